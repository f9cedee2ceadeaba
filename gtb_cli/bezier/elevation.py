"""Degree elevation: the same curve or surface with more knots and control points."""

from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import domain, has_integer_corners
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.knots.lattice import lattice_of
from gtb_cli.language.spec_paths import of_patch
from gtb_cli.theory.corner_powers import alike, summed
from gtb_cli.theory.patch import Patch

MAX_ELEVATED_KNOTS = 10_000
MAX_PLAIN_WEIGHT = 1e150  # and inverse of the smallest; other weights are handled as logarithms


@of_patch
def elevate(patch: Patch, by: int = 1) -> Patch:
    """Elevate the degree of a patch: more knots, weights and control points for the same image.

    Knots of `multiplier` are added to the patch's knots, `by` times; see `product`. For Bézier curves, triangles and
    tensor product patches this is the classical degree elevation by `by`, in both directions of the latter; for others
    the paper's Section 5 names it as future work.

    The result has all coefficients 1, and no lifting. Its image is exactly the same. A curve with k_0 = k_1 keeps its
    points at the same fractions of its interval, and a Bézier patch at the same fractions of its domain; other surfaces
    are reparametrised. `DomainError` is raised unless `by` is a whole number from 0, and where the result would have
    more than `MAX_ELEVATED_KNOTS` knots.
    """
    if isinstance(by, bool) or not isinstance(by, int | np.integer) or by < 0:
        raise DomainError(f"by: expected a whole number, at least 0, got {by!r}")
    knots = multiplier(patch)
    for _ in range(by):
        patch = product(patch, knots)
    return patch


def multiplier(patch: Patch) -> FloatArray:
    """Return the (m, d) knots by which one elevation multiplies a patch.

    For the lattices of Bézier curves, triangles and tensor product patches, these are one step in each direction. For
    other curves, they are 0 and the largest gap between knots. For other surfaces, they are the corners of Δ relative
    to the first: only these are sure not to add edges. They are a k-th of that if all edges of Δ have k equal steps, so
    that edges shared with Bézier patches stay shared.
    """
    shape = patch.domain
    if (lattice := lattice_of(shape)) is not None:
        steps = np.concatenate([direction.steps for direction in lattice])
        return np.array([np.zeros(shape.dimension), *steps, *[steps.sum(axis=0)] * (len(lattice) == 2)])
    if shape.dimension == 2:
        edges = range(len(shape.vertices))
        found = [lattice_of(domain(shape.along(edge, shape.knots[shape.edge_knots(edge)]))) for edge in edges]
        counts = {on_edge[0].degree if on_edge else 1 for on_edge in found}
        return np.asarray((shape.vertices - shape.vertices[0]) / (counts.pop() if len(counts) == 1 else 1))
    return np.array([[0.0], [np.diff(np.sort(shape.knots[:, 0])).max()]])


def product(patch: Patch, knots: FloatArray) -> Patch:
    """Multiply numerator and denominator of a patch by ``Σ_k e^{<d_k, s>}``, for (m, d) knots d_k: the same image.

    The knots become all distinct sums e = a_i + d_k, ascending by rows from below, with ``W_e = Σ c_i ω_i`` and control
    points ``Σ c_i ω_i b_i / W_e``, summed over a_i + d_k = e; the coefficients become 1. If an edge of the hull of d_k
    is not parallel to any edge of Δ, it becomes a collapsed edge of the result.
    """
    max_sums = 2_000_000  # before equal ones are merged: their arrays need 100 MB
    if len(patch.knots) * len(knots) > max_sums:
        raise DomainError(f"knots: {len(patch.knots)} times {len(knots)} sums, at most {max_sums} are allowed")
    sums = (patch.knots[:, None] + knots).reshape(-1, patch.dimension)
    group = alike(sums.T[::-1], [knot_tolerance(sums)] * patch.dimension)
    _, first, counts = np.unique(group, return_index=True, return_counts=True)
    if len(first) > MAX_ELEVATED_KNOTS:
        found = f"the elevated patch would have {len(first)}"
        raise DomainError(f"knots: {found}, at most {MAX_ELEVATED_KNOTS} are allowed")
    points = np.repeat(patch.control_points, len(knots), axis=0)
    logs, factors = np.repeat(patch.log_products, len(knots)), np.column_stack([np.ones(len(points)), points])
    with np.errstate(over="ignore", under="ignore"):
        plain = np.repeat(patch.coefficients * patch.weights, len(knots))
    ordinary = bool(plain.min() > 1 / MAX_PLAIN_WEIGHT and plain.max() < MAX_PLAIN_WEIGHT)
    if ordinary:  # so that whole numbers stay whole
        logs, factors = np.zeros(len(points)), plain[:, None] * factors
    top, sums_of_terms = summed(group, logs, factors)
    totals = sums_of_terms[:, 0]
    control_points = np.where(counts[:, None] == 1, points[first], sums_of_terms[:, 1:] / totals[:, None])
    given: dict[str, Any] = {"weights": totals} if ordinary else {"log_weights": top + np.log(totals)}
    result = Patch(sums[first], control_points, name=patch.name, **given)
    # With as many edges as the patch, which are then the same, the result keeps its edge functions.
    corners, normals = result.domain.vertices, patch.edge_normals
    if normals == "primitive" and not has_integer_corners(corners):
        normals = "unit"
    is_same = np.ndim(patch.edge_scale) == 0 or len(corners) == len(patch.domain.vertices)
    return result.replace(edge_normals=normals, edge_scale=patch.edge_scale if is_same else 1.0)
