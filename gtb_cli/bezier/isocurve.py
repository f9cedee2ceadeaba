"""Isoparametric curves of surfaces, where they are GT-Bézier curves."""

import numpy as np

from gtb_cli.bezier.elevation import product
from gtb_cli.errors import DomainError
from gtb_cli.language.spec_paths import of_patch
from gtb_cli.theory.basis import torus_coordinates
from gtb_cli.theory.patch import Patch


@of_patch
def isocurve(patch: Patch, axis: int, value: float) -> Patch:
    """Return the curve of a surface on which one parameter, u (axis 0) or v (axis 1), keeps its value.

    On a rectangle along the axes, ``P(u*, v)`` is the GT-Bézier curve of the knots' other coordinates, with equal
    knots merged and the weights ``c_i ω_i exp(u_i θ(u*))`` (Section 4, property (d), which holds only there). It has
    the same points at the same v; on an edge it is the boundary curve. Raises `DomainError` for a curve, another
    domain, or a value beyond it.
    """
    if patch.dimension == 1:
        raise DomainError("is a curve, and has no isoparametric curves")
    shape = patch.domain
    if len(shape.vertices) != 4 or ((shape.normals != 0).sum(axis=1) != 1).any():
        fault = "the domain is not a rectangle along the axes"
        raise DomainError(f"{fault}: isoparametric curves are not GT-Bézier curves there")
    low, high = shape.vertices[[0, 2], axis].tolist()
    if not low <= value <= high:
        raise DomainError(f"{'uv'[axis]}: expected {low:g} to {high:g}, got {value:g}")
    name = f"{patch.name or 'patch'}-{'uv'[axis]}{value:g}"
    # Edges 0 … 3 are bottom, right, top, left.
    beside = [3, 1] if axis == 0 else [0, 2]
    heights = shape.heights_of_columns(np.where(np.arange(2) == axis, value, shape.vertices.mean(axis=0))[None])
    on = [edge for edge in beside if heights[edge, 0] == 0]
    members = np.flatnonzero(shape.incidence[:, on[0]]) if on else np.arange(len(patch.knots))
    logs = patch.log_products[members]
    if not on:
        # Knots are measured from the middle, so that the logarithms stay small.
        theta = float(torus_coordinates(shape, heights)[axis, 0])
        logs = logs + (patch.knots[members, axis] - shape.center[axis]) * theta
    ends = shape.normal_lengths[[0, 2] if axis == 0 else [3, 1]]
    scale = ends if ends[0] != ends[1] else float(ends[0])
    knots, points = patch.knots[members, 1 - axis], patch.control_points[members]
    curve = Patch(knots, points, log_weights=logs, edge_scale=scale, name=name)
    merged = product(curve, np.zeros((1, 1)))
    return merged if len(merged.knots) < len(curve.knots) else curve
