"""The paper, in its order: basis, moment map, parametrisations, patch, limits. Does not import meshes."""
