"""The paper, in its order: weights, basis, points in both parametrisations, patch, edges; normals, curvature."""
