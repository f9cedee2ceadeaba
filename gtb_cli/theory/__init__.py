"""The paper, in its order: basis, moment map, parametrisations, patch, limits. Knows no mesh."""
