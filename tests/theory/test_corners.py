"""Limits at corners, and the powers of the distance that rule them, against 120 digits on generic data."""

import math
from itertools import combinations
from typing import Any

import mpmath
import numpy as np
import pytest

from gtb_cli.theory.corners import corner_limits
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long

MP = mpmath.mp.clone()
MP.dps = 120

BOUND = 0.02  # between a power and the slope of a maximum over finitely many ways, at finite distances


def corner_patch(kind: str, seed: int) -> Patch:
    """A patch at whose corner knot 0 four knots lead, 1 to 4, with generic control points in the plane z = 0.

    The knots at sums of two neighbours give it a quadratic form over each pair, which join with one slope ("joined") or
    do not ("kinked"). "low" has a further knot, below twice the polygon.
    """
    rng = np.random.default_rng(seed)
    (first, second), (low, left) = rng.uniform(0.52, 0.62, 2), rng.uniform(0.08, 0.2, 2)
    x = np.array([[1, 0], [first, low], [left, second], [0, 1]])
    turn = np.linspace(0, rng.uniform(1, 3), 4) + rng.uniform(-0.1, 0.1, 4)
    b = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(0.5, 1.5, (4, 1))
    w = np.exp(rng.uniform(-1, 1, 4))
    form = np.zeros((4, 4))  # of b_i and b_j, neighbours
    form[[0, 0, 1, 2, 3], [0, 1, 1, 3, 3]] = rng.normal(size=5)
    form[1, 2] = np.linalg.solve(b[[0, 1]], form[[0, 1], 1]) @ b[2]
    form[2, 2] = np.linalg.solve(b[[1, 3]], form[[1, 2], [2, 3]]) @ b[2]
    if kind == "kinked":
        form[1, 2] += 1
    knots, points, weights = [np.zeros(2), *x], [np.zeros(3), *np.pad(b, ((0, 0), (0, 1)))], [1, *w]
    for i, j in ((0, 0), (0, 1), (1, 1), (1, 2), (2, 2), (2, 3), (3, 3)):
        knots.append(x[i] + x[j])
        weights.append(np.exp(rng.uniform(-1, 1)))
        height = form[i, j] * w[i] * w[j] / weights[-1] / (2 if i == j else 1)
        points.append([*rng.normal(size=2), height])
    more = [[4, 0], [0, 4], [4, 4], [2.5, 2.2]]
    more += [[0.75, 0.6]] if kind == "low" else []
    shares = np.exp(rng.uniform(-1, 1, len(more)))
    return Patch([*knots, *more], [*points, *rng.normal(size=(len(more), 3))], [*weights, *shares])


def jet(patch: Patch, s: Any, t: Any) -> tuple[float, Any, Any]:
    """Distance from the corner, sine of the normal's angle with z, and largest curvature, at torus coordinates."""
    tables = patch.knots.tolist(), patch.control_points.tolist()
    knots, points = ([[MP.mpf(v) for v in row] for row in table] for table in tables)
    e = [MP.exp(x * s + y * t + MP.mpf(float(w))) for (x, y), w in zip(knots, patch.log_products, strict=True)]
    total = sum(e)
    e = [value / total for value in e]
    mu = [sum(v * a[k] for v, a in zip(e, knots, strict=True)) for k in (0, 1)]
    d = [[a[k] - mu[k] for k in (0, 1)] for a in knots]
    p = MP.matrix([sum(v * b[k] for v, b in zip(e, points, strict=True)) for k in range(3)])

    def moment(*axes: int) -> Any:
        factors = [v * MP.fprod(row[axis] for axis in axes) for v, row in zip(e, d, strict=True)]
        return MP.matrix([sum(f * (b[k] - p[k]) for f, b in zip(factors, points, strict=True)) for k in range(3)])

    u, v, dot = moment(0), moment(1), MP.fdot
    n = MP.matrix([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
    n /= MP.sqrt(dot(n, n))
    ee, ff, gg, ll, mm, rr = dot(u, u), dot(u, v), dot(v, v), *(dot(moment(*k), n) for k in ((0, 0), (0, 1), (1, 1)))
    mean, gauss = (ee * rr - 2 * ff * mm + gg * ll) / (ee * gg - ff**2) / 2, (ll * rr - mm**2) / (ee * gg - ff**2)
    bend = abs(mean) + MP.sqrt(max(mean**2 - gauss, MP.mpf(0)))
    return float(MP.sqrt(dot(p, p))), MP.sqrt(n[0] ** 2 + n[1] ** 2), bend


def worst(patch: Patch, digits: float, offsets: np.ndarray) -> tuple[float, float]:
    """Largest sine and curvature at a distance of 10^-digits, on the ways where two of the leading knots are equal."""
    leading, found = patch.knots[1:5], []
    for a, b in combinations(leading, 2):
        way = (a - b)[::-1] * [-1, 1]
        way *= np.sign(way.sum())
        if way.min() <= 0 or a @ way > np.sort(leading @ way)[1] + 1e-9:
            continue
        length = digits * math.log(10) / (leading @ way).min()
        for offset in offsets:
            place = [MP.mpf(float(v)) for v in -way * length + offset * np.array([-way[1], way[0]]) / way.max()]
            found.append(jet(patch, *place))
    return tuple(max(float(MP.log(row[k])) for row in found) for k in (1, 2))


@pytest.mark.parametrize(
    ("kind", "seed"), mostly_long([(kind, seed) for seed in (1, 3, 4, 5) for kind in ("low", "kinked")], 2)
)
def test_powers_are_those_observed(kind, seed):
    patch = corner_patch(kind, seed)
    found = corner_limits(patch, 0)
    assert found.angle < 1e-9
    assert found.curvature == math.inf
    assert found.curvature_exponent < -0.1
    offsets = np.linspace(-4, 4, 3)
    near, far = (worst(patch, digits, offsets) for digits in (32, 22))
    slopes = [(a - b) / (-10 * math.log(10)) for a, b in zip(near, far, strict=True)]
    assert slopes == pytest.approx([found.normal_exponent, found.curvature_exponent], abs=BOUND)


@pytest.mark.parametrize("seed", mostly_long([2, 3, 5]))
def test_the_largest_limit_of_curvature_is_what_is_observed(seed):
    patch = corner_patch("joined", seed)
    found = corner_limits(patch, 0)
    assert found.curvature_exponent == 0
    assert -0.03 < worst(patch, 12, np.linspace(-4, 4, 25))[1] - math.log(found.curvature) < 1e-3


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
def test_units_of_knots_and_points_do_not_matter(scale, shift):
    found = []
    for patch in (corner_patch("low", 1), corner_patch("joined", 2)):
        moved = Patch(patch.knots * scale + shift, patch.control_points * scale + shift, log_weights=patch.log_weights)
        found.append(corner_limits(patch, 0))
        corner = int(np.linalg.norm(moved.domain.vertices - moved.knots[0], axis=1).argmin())
        found.append(corner_limits(moved, corner))
    low, moved_low, joined, moved_joined = found
    assert moved_low.curvature_exponent == pytest.approx(low.curvature_exponent, abs=1e-6)
    assert moved_joined.curvature * scale == pytest.approx(joined.curvature, rel=1e-6)


def test_a_knot_below_the_line_of_the_next_ones_makes_several_limits():
    """Near (0, 0) the knot (0.2, 0.2) counts beside each edge: normals are 79 degrees off the product of the edges."""
    patch = Patch([[0, 0], [1, 0], [0, 1], [0.2, 0.2]], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 1]])
    found = corner_limits(patch, 0)
    expected = np.array([[0, -1, 0.2], [-1, 0, 0.2]]) / math.sqrt(1.04)
    np.testing.assert_allclose(found.normals[[0, -1]], expected, atol=1e-12)
    assert np.isnan(patch.normals([0, 0])).all()
    assert np.isnan(patch.curvature([0, 0])).all()
    for height, several in ((2.5e-5, True), (1e-8, False)):  # of 1e-2 and 4e-6 degrees
        low = corner_limits(patch.replace(control_points=patch.control_points * [1, 1, height]), 0)
        assert np.isnan(low.normal).any() == several
    for slope, limit in zip((1e-6, 1e6), expected, strict=True):
        steps = np.array([1, slope]) / max(1, slope) * 1e-9
        np.testing.assert_allclose(patch.normals(steps), limit, atol=1e-3)


def test_two_knots_in_line_with_a_corner_to_rounding_are_no_turn():
    """Terms of both were at one place across a way into the corner (1, 2), and the limit ended in a division by 0."""
    patch = Patch([[0, -1e-8], [0, 0], [1, 2], [1, 0], [2, 0]], np.random.default_rng(0).normal(size=(5, 3)))
    assert np.isfinite(corner_limits(patch, 2).normals).all()
