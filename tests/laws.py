"""What the paper proves of every patch, as one checker; and its consequences in mathematics.md sections 1, 2 and 4.

`LAWS` are functions of a patch that raise `AssertionError`; `test_patch.py` runs them on every named patch of
`patches` and on generated ones.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache

import numpy as np

from gtb_cli.errors import DomainError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.theory.basis import Location, torus_coordinates
from gtb_cli.theory.patch import Patch

EPS = float(np.finfo(np.float64).eps)

UNITY = 1e-14  # error of the partition of unity: sixty roundings

RESIDUAL = 1e-12  # what mathematics.md and the issue ask of the inverse moment map, as a fraction of the hull's size


NEAR = (1e-12, 1e-6, 1e-2)  # distances from edges, in units of the hull's size, at which laws are tested too


def size(patch: Patch) -> float:
    """Extent of the control points, at least what rounding leaves of it."""
    points = patch.control_points
    return max(float(np.ptp(points, axis=0).max()), 1e-6 * float(np.abs(points).max()), 1e-300)


def error_of_points(patch: Patch) -> float:
    """Bound for the rounding error of points: that of T, and of a sum of control points."""
    return rounding(patch) * size(patch) + UNITY * float(np.abs(patch.control_points).max())


def error_of_linear_points(patch: Patch) -> float:
    """Bound for the error of points in the linear parametrisation: the residual of p, times the steepest rise."""
    sliver = 100.0  # how much steeper than between two knots a surface may be over a triangle of knots
    gaps = np.abs(patch.knots[:, None] - patch.knots).max(axis=2)
    far = EPS * np.abs(patch.knots).max()
    steepness = sliver * size(patch) / gaps[gaps > RESIDUAL * patch.domain.size + 16 * far].min()
    return float(steepness * (RESIDUAL * patch.domain.size + 4 * far) + 4 * error_of_points(patch))


def rounding(patch: Patch) -> float:
    """Bound for the error of T: a few roundings of each term of the exponents, distances down to 1e-12 of the size."""
    logs = np.abs(np.log(patch.domain.size * patch.domain.normal_lengths)) - np.log(min(NEAR))
    return 8 * EPS * float((patch.domain.heights @ logs).max() + np.ptp(patch.log_products) + 8)


@lru_cache(maxsize=1)
def inner_parameters(patch: Patch, seed: int = 0) -> np.ndarray:
    """(m, d) parameters inside Δ, from its middle to 1e-12 of its size from each edge."""
    v = patch.domain.vertices
    rng = np.random.default_rng(seed)
    middle = v.mean(axis=0)
    u = [middle[None], rng.dirichlet(np.ones(len(v)), 12) @ v]
    for distance in NEAR:
        edges = edge_parameters(patch, [0.3])[0] if patch.dimension == 2 else v
        inward = patch.domain.normals / patch.domain.normal_lengths[:, None]
        u.append(edges + inward * distance * patch.domain.size)
    u = np.concatenate(u)
    return u[(heights(patch, u) > 0).all(axis=1)]


def heights(patch: Patch, u: np.ndarray) -> np.ndarray:
    """(m, r) edge functions, NaN for parameters that rounding has put outside."""
    with suppress(DomainError):
        return patch.domain.edge_functions(u)
    result = np.full((len(u), len(patch.domain.vertices)), np.nan)
    for row, parameter in zip(result, u, strict=True):
        try:
            row[:] = patch.domain.edge_functions(parameter[None])[0]
        except DomainError:
            continue
    return result


def edge_parameters(patch: Patch, fractions: list[float]) -> list[np.ndarray]:
    """For each fraction the (r, 2) parameters there on all edges of a surface."""
    v = patch.domain.vertices
    return [v + t * (np.roll(v, -1, axis=0) - v) for t in fractions]


@lru_cache(maxsize=1)
def parameters(patch: Patch) -> np.ndarray:
    """(m, d) parameters inside, on edges and at corners."""
    edges = edge_parameters(patch, [1e-9, 0.25, 0.7]) if patch.dimension == 2 else []
    return np.concatenate([inner_parameters(patch), *edges, patch.domain.vertices])


def linear_points(patch: Patch, p: np.ndarray) -> np.ndarray:
    """(m, 3) points in the linear parametrisation."""
    return patch.evaluate(p, "linear")


@lru_cache(maxsize=1)
def linear_points_at_parameters(patch: Patch) -> np.ndarray:
    return linear_points(patch, parameters(patch))


def close(actual: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Fail where two arrays differ by more than an absolute tolerance."""
    assert actual.shape == expected.shape
    error = float(np.abs(actual - expected).max())
    assert error <= tolerance, f"error {error:.3g} is more than {tolerance:.3g}"


def basis_is_nonnegative(patch: Patch) -> None:
    """Thm 2.1 (a), Thm 2.3 (a)."""
    assert (patch.basis(parameters(patch)) >= 0).all()


def basis_is_a_partition_of_unity(patch: Patch) -> None:
    """Thm 2.1 (b), Thm 2.3 (b)."""
    sums = patch.basis(parameters(patch)).sum(axis=1)
    close(sums, np.ones_like(sums), UNITY)


def corners_belong_to_their_knots(patch: Patch) -> None:
    """Thm 2.1 (d), Thm 2.3 (d); knots repeated there share T in proportion c ω."""
    v = patch.domain.vertices
    t = patch.basis(v)
    points = patch.evaluate(v)
    for corner, row, point in zip(v, t, points, strict=True):
        gap = np.abs(patch.knots - corner).max(axis=1)
        there = gap <= 1e-12 * patch.domain.size + 8 * EPS * np.abs(v).max()
        assert (row[~there] == 0).all()
        logs = patch.log_products[there]
        share = np.exp(logs - logs.max())
        close(row[there], share / share.sum(), UNITY)
        if there.sum() == 1:
            assert row[there] == 1
            assert (point == patch.control_points[there][0]).all()


def edges_belong_to_their_knots(patch: Patch) -> None:
    """Thm 2.3 (c): exact zeros off the edge, none on it, but where T is too small for a float."""
    if patch.dimension == 1:
        return
    for u in edge_parameters(patch, [0.25, 0.7]):
        t = patch.basis(u)
        on_edge = patch.domain.incidence.T
        assert (t[~on_edge] == 0).all()
        spread = np.ptp(patch.log_products) + patch.domain.heights.sum(axis=1).max() * 4
        if spread < 600:
            assert (t[on_edge] > 0).all()


def edges_are_curves(patch: Patch) -> None:
    """Thm 4.0: the patch on an edge is the curve of the knots on it, once both are measured by μ."""
    if patch.dimension == 1:
        return
    for edge in range(len(patch.domain.vertices)):
        curve = patch.boundary(edge)
        u = np.concatenate(edge_parameters(patch, [0.0, 1e-6, 0.25, 0.5, 0.9, 1.0]))[edge :: len(patch.domain.vertices)]
        along = patch.domain.along(edge, patch.knots)
        mu = patch.basis(u) @ along
        low, high = curve.domain.vertices[:, 0]
        close(linear_points(curve, np.clip(mu, low, high)[:, None]), patch.evaluate(u), error_of_linear_points(patch))
        position = np.clip(patch.domain.along(edge, u), low, high)
        close(linear_points(curve, position[:, None]), linear_points(patch, u), error_of_linear_points(patch))


def points_are_in_the_convex_hull(patch: Patch) -> None:
    """Property (a): no point sticks out of the control points in any of many directions."""
    directions = np.random.default_rng(1).normal(size=(200, 3))
    points = patch.evaluate(parameters(patch)) @ directions.T
    bound = (patch.control_points @ directions.T).max(axis=0)
    scale = np.abs(patch.control_points).max() * np.abs(directions).sum(axis=1)
    assert (points <= bound + UNITY * scale).all()


def points_are_combinations_of_control_points(patch: Patch) -> None:
    """Eq. (301), eq. (401)."""
    u = parameters(patch)
    close(patch.evaluate(u), patch.basis(u) @ patch.control_points, error_of_points(patch))


def affine_maps_commute(patch: Patch) -> None:
    """Property (a), affine invariance."""
    matrix, shift = np.array([[2, 1, 0], [0, -1, 3], [1, 0, 0.5]]), size(patch) * np.array([1, -2, 3])
    moved = patch.replace(control_points=patch.control_points @ matrix.T + shift)
    u = parameters(patch)
    close(moved.evaluate(u), patch.evaluate(u) @ matrix.T + shift, error_of_points(moved))


def weights_and_coefficients_act_as_a_product(patch: Patch) -> None:
    """Mathematics, section 1, consequence (1); a common factor does nothing."""
    factor = 2.0 ** np.arange(len(patch.knots)) / 8
    log_weights = patch.log_products - np.log(factor) + 5
    other = patch.replace(coefficients=factor, log_weights=log_weights)
    u = parameters(patch)
    # Logarithms that are rounded differently: each as often as its size says.
    tolerance = error_of_points(patch) + 8 * EPS * np.abs(log_weights).max() * size(patch)
    close(other.evaluate(u), patch.evaluate(u), tolerance)


def edge_scale_changes_no_image(patch: Patch) -> None:
    """Consequence (2): another scale of the edge functions reparametrises and does nothing more."""
    scale = 1 + np.arange(len(patch.domain.vertices)) / 4
    other = patch.replace(edge_normals="unit", edge_scale=scale)
    u = inner_parameters(patch)
    where = [Location(slice(0, len(u)), patch.domain.faces[INTERIOR], centred(patch), same_torus_coordinates(patch, u))]
    assert (other.points_at(where, len(u)) == patch.points_at(where, len(u))).all()
    p = clipped(patch, other.basis(u) @ patch.knots)
    close(linear_points(patch, p), other.evaluate(u), error_of_linear_points(patch))


def affine_liftings_translate(patch: Patch) -> None:
    """Consequence (3): x^λ on the weights, λ affine, is a translation of s and leaves the image as it was."""
    slope = np.array([1.5, -0.5])[: patch.dimension] / patch.domain.size
    lifted = patch.replace(log_weights=patch.log_products + centred(patch) @ slope + 2, coefficients=None)
    u = inner_parameters(patch)
    s = same_torus_coordinates(patch, u)
    rows = slice(0, len(u))
    here = Location(rows, patch.domain.faces[INTERIOR], centred(patch), s)
    there = Location(rows, patch.domain.faces[INTERIOR], centred(patch), s - slope[:, None])
    close(lifted.points_at([there], len(u)), patch.points_at([here], len(u)), error_of_points(patch))
    found = linear_points(lifted, parameters(patch))
    close(found, linear_points_at_parameters(patch), error_of_linear_points(patch))


def linear_parametrization_is_linear(patch: Patch) -> None:
    """Mathematics, section 2: with the knots as control points it is the identity."""
    control_points = np.zeros((len(patch.knots), 3))
    control_points[:, : patch.dimension] = patch.knots
    p = parameters(patch)
    v = patch.domain.vertices
    tolerance = RESIDUAL * patch.domain.size + 16 * EPS * np.abs(v).max()
    close(linear_points(patch.replace(control_points=control_points), p)[:, : patch.dimension], p, tolerance)


def linear_parametrization_is_affine_in_the_domain(patch: Patch) -> None:
    """An affine image of the knots, with parameters carried along, gives the same points."""
    matrix = np.array([[2.0, 1.0], [-0.5, 1.0]])[: patch.dimension, : patch.dimension]
    moved = patch.replace(knots=centred(patch) @ matrix.T, edge_normals="auto", edge_scale=1.0)
    u = parameters(patch)
    p = clipped(moved, (u - patch.domain.center) @ matrix.T)
    close(linear_points(moved, p), linear_points_at_parameters(patch), error_of_linear_points(patch))


def order_of_knots_is_free(patch: Patch) -> None:
    """A permutation of the knots permutes the basis; points differ by rounding."""
    order = np.random.default_rng(2).permutation(len(patch.knots))
    other = patch.replace(
        knots=patch.knots[order],
        control_points=patch.control_points[order],
        coefficients=np.ones(len(order)),
        log_weights=patch.log_products[order],
    )
    u = parameters(patch)
    close(other.basis(u), patch.basis(u)[:, order], UNITY + rounding(patch))
    close(other.evaluate(u), patch.evaluate(u), error_of_points(patch))


def coincident_knots_merge(patch: Patch) -> None:
    """Thm 3.1, Thm 4.1: a knot split in two, with its c ω shared out, gives the same patch."""
    copies = np.r_[np.arange(len(patch.knots)), 0, len(patch.knots) - 1]
    share = np.zeros(len(copies))
    share[[0, -2]] = np.log([0.25, 0.75])
    share[[len(patch.knots) - 1, -1]] = np.log([0.6, 0.4])
    step = np.zeros((len(copies), 3))
    step[0], step[-2] = [3, 0, 0], [-1, 0, 0]
    split = patch.replace(
        knots=patch.knots[copies],
        control_points=patch.control_points[copies] + step * size(patch),
        coefficients=np.ones(len(copies)),
        log_weights=patch.log_products[copies] + share,
        lifting=None,
    )
    u = parameters(patch)
    close(split.evaluate(u), patch.evaluate(u), 2 * error_of_points(split))


def normals_are_unit_and_perpendicular(patch: Patch) -> None:
    """Inside, the normal is the direction of ∂P/∂u_0 × ∂P/∂u_1."""
    if patch.dimension == 1:
        return
    u = inner_parameters(patch)
    normals = patch.normals(u)
    found = ~np.isnan(normals[:, 0])
    lengths = np.where(found, np.linalg.norm(normals, axis=1), 1)
    close(lengths, np.ones_like(lengths), UNITY)
    if rounding(patch) > 1e-10:
        return
    derivatives = patch.derivatives(u)
    cross = np.cross(derivatives[:, :, 0], derivatives[:, :, 1])
    lengths = np.linalg.norm(derivatives, axis=1)
    # Where a derivative is small, or T nearly one knot's, it keeps few digits; the normal keeps all (test_normals.py).
    well = np.linalg.norm(cross, axis=1) > 1e-3 * lengths.prod(axis=1)
    well &= (lengths > 1e-4 * size(patch) / patch.domain.size).all(axis=1) & (patch.basis(u).max(axis=1) < 0.99)
    assert found[well].all()
    unit = cross[well] / np.linalg.norm(cross[well], axis=1, keepdims=True)
    assert (np.abs(unit - normals[well]) < 1e-9).all()


def centred(patch: Patch) -> np.ndarray:
    return patch.knots - patch.domain.center


def same_torus_coordinates(patch: Patch, u: np.ndarray) -> np.ndarray:
    return torus_coordinates(patch.domain, patch.domain.heights_of_columns(u))


def clipped(patch: Patch, p: np.ndarray) -> np.ndarray:
    """Points of Δ that rounding may have put outside, put on its boundary."""
    if patch.dimension == 1:
        return np.clip(p, *patch.domain.vertices)
    for edge in range(len(patch.domain.vertices)):
        inward = patch.domain.normals[edge] / patch.domain.normal_lengths[edge]
        distance = (p - patch.domain.vertices[edge]) @ inward
        p = p - np.minimum(distance, 0)[:, None] * inward
    return p


LAWS: tuple[Callable[[Patch], None], ...] = (
    basis_is_nonnegative, basis_is_a_partition_of_unity, corners_belong_to_their_knots, edges_belong_to_their_knots,
    edges_are_curves, points_are_in_the_convex_hull, points_are_combinations_of_control_points, affine_maps_commute,
    weights_and_coefficients_act_as_a_product, edge_scale_changes_no_image, affine_liftings_translate,
    linear_parametrization_is_linear, linear_parametrization_is_affine_in_the_domain, order_of_knots_is_free,
    coincident_knots_merge, normals_are_unit_and_perpendicular,
)  # fmt: skip
