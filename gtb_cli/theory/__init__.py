"""The paper, in its order: weights, basis, parametrisations, patch, edges; then normals, curvature, quadrature."""
