"""Curvature against 50-digit arithmetic, difference quotients and surfaces whose curvature is known."""

import math

import numpy as np
import pytest

from gtb_cli.theory.patch import Patch
from tests.exact import CONTEXT, Number, numbers, point
from tests.marks import mostly_long
from tests.specs import SPECS, load, spec
from tests.surfaces import inside, octant, plane, quartic_octant, rim, torus

# A few thousand roundings: what is left of 16 digits by sums of a dozen terms and an angle of some degrees
DIGITS = 1e-12


# --- known surfaces


SPHERES = [
    (octant(2.5), np.concatenate([inside(octant(), 200), [[1, 0], [0, 0], [2, 0], [0, 1.3], [2, 0.01]]]), 2.5, DIGITS),
    (quartic_octant(), np.concatenate([inside(quartic_octant(), 200), rim(quartic_octant())]), 1.0, DIGITS),
    (octant(1.0, (1e7, -1e7, 1e7)), inside(octant(), 50, depth=0.1), 1.0, 1e-7),  # of control points with 9 digits
]


@pytest.mark.parametrize(("patch", "u", "radius", "digits"), SPHERES, ids=["pole", "no pole", "far away"])
@pytest.mark.parametrize("parametrization", ["toric", "linear"])
def test_a_sphere_has_one_over_r_squared_and_one_over_r(patch, u, radius, digits, parametrization):
    """Inside and on the whole rim, but for the pole."""
    gaussian, mean = patch.curvature(u, parametrization)
    np.testing.assert_allclose(gaussian, 1 / radius**2, rtol=digits)
    np.testing.assert_allclose(mean, 1 / radius, rtol=digits)


@pytest.mark.parametrize("place", [(1.3, 2), (1.0, 0), (0, 0), (2, 0), (0, 2), (2, 0.7), (0, 0.7)])
def test_no_digits_are_lost_near_the_boundary(place):
    """Towards edges, corners, and the pole, at which all derivatives along the edge vanish."""
    target, middle = np.array(place, dtype=float), np.array([0.9, 0.8])
    u = target + 10.0 ** -np.arange(1.0, 15.0)[:, None] * (middle - target)
    gaussian, mean = octant().curvature(u)
    # Right at a corner of the pole, control points that are 1e-16 from the tangent plane are taken to lie in it.
    digits = 1e-8 if place == (0, 2) else DIGITS
    np.testing.assert_allclose(gaussian, 1, rtol=digits)
    np.testing.assert_allclose(mean, 1, rtol=digits)


def test_at_the_pole_there_is_no_formula():
    assert np.isnan(octant().curvature([[1, 2], [0, 2], [2, 2]])).all()


@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_a_plane_has_exactly_none(shift):
    """Even on the boundary, where other control points would have no limit, and with extreme weights."""
    for weight in (3.0, 1e30):
        patch = plane(weight)
        moved = Patch(patch.knots, patch.control_points + shift, patch.weights)
        gaussian, mean = moved.curvature(np.concatenate([inside(patch, 100), rim(patch)]))
        assert (gaussian == 0).all()
        assert (mean == 0).all()


def test_a_plane_whose_square_is_no_number_has_none():
    small = Patch([[0, 0], [1, 0], [0, 1]], [[0, 0, 0], [1e-300, 0, 0], [0, 1e-300, 0]])
    assert not np.any(small.curvature([[0.25, 0.25], [0.5, 0.0]]))


def test_a_torus():
    patch = torus(3.0, 1.0)
    u = np.concatenate([inside(patch, 100), rim(patch)])
    cosine = np.hypot(*patch.evaluate(u)[:, :2].T) - 3.0
    gaussian, mean = patch.curvature(u)
    np.testing.assert_allclose(gaussian, cosine / (3 + cosine), atol=DIGITS)
    np.testing.assert_allclose(mean, (3 + 2 * cosine) / (2 * (3 + cosine)), rtol=DIGITS)


# --- any surface


def forms(first, second):
    """(K, H) from the derivatives P_0, P_1 and P_00, P_01, P_11, in the numbers of mpmath."""
    (ax, ay, az), (bx, by, bz), dot = *first, CONTEXT.fdot
    normal = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    square = dot(normal, normal)
    e, f, g = dot(first[0], first[0]), dot(first[0], first[1]), dot(first[1], first[1])
    l, m, n = (dot(vector, normal) / CONTEXT.sqrt(square) for vector in second)  # noqa: E741
    return float((l * n - m * m) / square), float(-(e * n - 2 * f * m + g * l) / (2 * square))


@CONTEXT.workdps(250)  # so that digits of the least T remain
def by_quotients(patch: Patch, u) -> tuple[float, float]:
    """From difference quotients of the points."""
    step = Number(10) ** -40 * Number(patch.domain.size)
    center = numbers([float(x) for x in u])
    at = {(i, j): point(patch, [center[0] + i * step, center[1] + j * step]) for i in (-1, 0, 1) for j in (-1, 0, 1)}

    def total(*terms):
        return [sum(sign * at[place][k] for sign, place in terms) for k in range(3)]

    first = [total((1, (1, 0)), (-1, (-1, 0))), total((1, (0, 1)), (-1, (0, -1)))]
    second = [
        total((1, (1, 0)), (-2, (0, 0)), (1, (-1, 0))),
        [x / 4 for x in total((1, (1, 1)), (-1, (1, -1)), (-1, (-1, 1)), (1, (-1, -1)))],
        total((1, (0, 1)), (-2, (0, 0)), (1, (0, -1))),
    ]
    return forms([[x / (2 * step) for x in v] for v in first], [[x / step**2 for x in v] for v in second])


GENERAL = ("pentagon", "hexagon", "nonagon", "bicubic", "bezier-triangle", "trapezoid", "repeated-knot", "example-4.4")


def assert_same(found, expected, digits=DIGITS):
    """K and H relative to the larger of K and H², as one of them may vanish."""
    (gaussian, mean), (k, h) = found, expected
    assert abs(gaussian[0] - k) <= digits * max(abs(k), h * h)
    assert abs(mean[0] - h) <= digits * max(abs(h), abs(k) ** 0.5)


@pytest.mark.parametrize("name", mostly_long(GENERAL, 2))
def test_curvature_is_that_of_difference_quotients(name):
    patch = load(SPECS / f"{name}.toml")
    for u in inside(patch, 3, seed=1, depth=0.1):
        assert_same(patch.curvature(u[None]), by_quotients(patch, u))


@pytest.mark.parametrize("name", mostly_long(GENERAL, 0))
def test_curvature_keeps_its_digits_near_the_boundary(name):
    """Where it has no limit there, too. Only edges along an axis: elsewhere floats cannot say how near they are."""
    patch = load(SPECS / f"{name}.toml")
    corners = patch.domain.vertices
    for edge in np.flatnonzero((patch.domain.normals == 0).any(axis=1)).tolist():
        start, end = corners[edge], corners[(edge + 1) % len(corners)]
        for t, depth in ((0.3, 1e-3), (0.8, 1e-7), (1e-6, 1e-9), (0.5, 1e-13)):
            u = (1 - depth) * ((1 - t) * start + t * end) + depth * corners.mean(axis=0)
            assert_same(patch.curvature(u[None]), by_quotients(patch, u))


@pytest.mark.parametrize("power", [0, 5, 40])
def test_extreme_weights(power):
    """Weights x^λ: nearly all of the surface is where three knots have nearly all of T, none of them at a corner."""
    patch = load(SPECS / "example-4.4.toml")
    logs = np.log(patch.weights) + power * np.log(10) * patch.lifting
    heavy = Patch(patch.knots, patch.control_points, log_weights=logs)
    for u in inside(patch, 5, seed=2, depth=0.2):
        # Exponents of up to 276 have that many times the rounding of 1, and T with them.
        assert_same(heavy.curvature(u[None]), by_quotients(heavy, u), (1 + 7 * power) * DIGITS)


def test_knots_close_to_a_slanted_edge():
    """Their distances are exact, however small they are."""
    knots = [[0, 0], [3, 1], [2, 4], [-1, 2], [1.5 - 1e-8, 0.5 + 3e-8], [1, 2], [2.6, 2.2]]
    random = np.random.default_rng(3)
    patch = Patch(knots, random.uniform(-1, 1, (7, 3)), [1e3, 1e3, 1, 1, 1, 1, 1])
    assert 0 < patch.domain.heights[4, 0] < 1e-6
    for u in inside(patch, 12, seed=4, depth=0.01):
        assert_same(patch.curvature(u[None]), by_quotients(patch, u))


def test_knots_typed_with_twelve_digits_are_on_their_edge():
    """Even where the line through the two heaviest misses the third, twice as far, by more than the tolerance."""
    exactly = np.array([[0, 0], [3, 1], [2, 4], [-1, 2], [1.5, 0.5], [1, 2], [2.6, 2.2]])
    typed = exactly.copy()
    typed[4] += [-1e-12, 3e-12]
    points = np.random.default_rng(3).uniform(-1, 1, (7, 3))
    weights = [100, 1, 1, 1, 50, 1, 1]
    one, other = (Patch(knots, points, weights) for knots in (exactly, typed))
    assert other.domain.incidence[4, 0]
    u = exactly[4] + np.array([[-0.2, 0.9], [-0.4, 0.3]]) * np.array([[1e-5], [1e-6]])
    for there, here in zip(other.curvature(u), one.curvature(u), strict=True):
        np.testing.assert_allclose(there, here, rtol=1e-8)


def test_collinear_knots_inside_are_collinear_to_rounding():
    """Beside a heavy line nearly all of T is on it; an irrational map of the knots changes nothing."""
    knots = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [1, 2], [1.7, 2], [3, 2]])
    points = np.column_stack([knots, np.sin(3 * np.arange(7))])
    logs = np.array([0, 0, 0, 0, 60.0, 60, 60])
    turn = np.array([[math.cos(1), math.sin(1)], [-math.sin(1), math.cos(1)]]) / 7
    plain = Patch(knots, points, log_weights=logs, edge_normals="unit")
    turned = Patch(knots @ turn, points, log_weights=logs, edge_normals="unit", edge_scale=7)
    u = inside(plain, 20, seed=5, depth=0.2)
    basis_values = np.sort(plain.basis(u), axis=1)
    assert (basis_values[:, -4] < 1e-15).any()
    for there, here in zip(turned.curvature(u @ turn), plain.curvature(u), strict=True):
        # Exponents of up to 60 have that many times the rounding of 1.
        np.testing.assert_allclose(there, here, rtol=60 * DIGITS)


def test_a_pole_of_points_that_are_equal_within_rounding():
    patch = octant()
    points = patch.control_points.copy()
    points[6:, 2] = [1 - 2**-53, 1.0, 1 + 2**-52]
    rounded = Patch(patch.knots, points, patch.weights, patch.coefficients)
    gaussian, mean = rounded.curvature(np.column_stack([np.full(13, 1.2), 2 - 10.0 ** -np.arange(1.0, 14.0)]))
    np.testing.assert_allclose(gaussian, 1, rtol=1e-7)
    np.testing.assert_allclose(mean, 1, rtol=1e-7)


# --- limits on the boundary


def layered(second: float) -> Patch:
    """A square whose knots have distances 1 and `second` from its lowest edge."""
    heights, columns = (0.0, 1.0, second, 4.0), (0.0, 1.0, 2.0)
    knots = [[x, y] for y in heights for x in columns]
    points = [[x, y, 0.3 * (x - 1) ** 2 + 0.2 * (y - 2) ** 2 + 0.1 * x * y] for x, y in knots]
    return Patch(knots, points)


LIMITS = [
    *((spec(name), rim(spec(name)), 1e-9, 1e-7)  # where curvatures change by tens per unit
      for name in ("bicubic", "bezier-triangle", "trapezoid", "repeated-knot", "example-4.1-integer")),
    *((layered(second), np.array([[1.0, 0.0], [0.4, 0.0]]), 2.5e-11, 1e-3) for second in (2.0, 2.5, 3.0)),  # of h^(1/2)
]  # fmt: skip


@pytest.mark.parametrize(("patch", "u", "share", "error"), LIMITS)
def test_values_on_the_boundary_are_limits(patch, u, share, error):
    """Also at an edge whose second layer of knots is twice as far as the first, or farther."""
    near = u + share * (patch.domain.vertices.mean(axis=0) - u)
    for there, here in zip(patch.curvature(u, "linear"), patch.curvature(near, "linear"), strict=True):
        np.testing.assert_allclose(there, here, rtol=error, atol=min(error, 1e-7))


def test_an_edge_whose_second_layer_is_too_near_has_no_curvature():
    """There it grows like h^(δ'/δ − 2) with the distance h, by a fitted rate."""
    for second in (1.2, 1.5, 1.8):
        patch = layered(second)
        assert np.isnan(patch.curvature([[1.0, 0.0], [0.4, 0.0], [0.0, 0.0]])).all()
        h = 10.0 ** -np.arange(8, 12)
        mean = patch.curvature(np.column_stack([np.full(4, 1.1), h]), "linear").mean
        rate = np.polyfit(np.log(h), np.log(np.abs(mean)), 1)[0]
        # 0.2: next to the limit of 2 the terms that stay finite are not small yet.
        assert rate == pytest.approx(second - 2, abs=0.02 if second < 1.7 else 0.2)


# --- what does not change it


def test_the_parametrisation_does_not_count():
    patch = load(SPECS / "bicubic.toml")
    u = np.concatenate([inside(patch, 50), rim(patch)])
    other = Patch(
        1e9 * patch.knots[:, ::-1] + 3e9,  # mirrored: the normal turns over
        patch.control_points,
        np.exp(patch.log_products + patch.knots @ [0.5, -1.0]),
        edge_scale=[1.0, 2.0, 0.5, 3.0],
    )
    linear = patch.curvature(u, "linear")
    # The affine factor e^<a, θ> moves points in the linear parametrisation, not on corners.
    corners = other.curvature(1e9 * u[50:54, ::-1] + 3e9)
    np.testing.assert_allclose(corners.gaussian, linear.gaussian[50:54], rtol=DIGITS)
    np.testing.assert_allclose(corners.mean, -linear.mean[50:54], rtol=DIGITS)
    mirrored = Patch(1e-9 * patch.knots[:, ::-1], patch.control_points, patch.weights, patch.coefficients)
    turned = mirrored.curvature(1e-9 * u[:, ::-1], "linear")
    np.testing.assert_allclose(turned.gaussian, linear.gaussian, rtol=1e-9)
    np.testing.assert_allclose(turned.mean, -linear.mean, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_units(scale):
    patch = load(SPECS / "pentagon.toml")
    u = inside(patch, 50)
    large = Patch(patch.knots, scale * patch.control_points, patch.weights)
    gaussian, mean = patch.curvature(u)
    np.testing.assert_allclose(large.curvature(u).gaussian * scale**2, gaussian, rtol=DIGITS)
    np.testing.assert_allclose(large.curvature(u).mean * scale, mean, rtol=DIGITS)
