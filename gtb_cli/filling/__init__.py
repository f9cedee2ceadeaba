"""Holes with any number of sides, filled with patches that touch their neighbours; certified angles, curvature."""
