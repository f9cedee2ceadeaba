"""Unit normals inside, near edges, on edges and at corners, against sums over triples of knots in many digits."""

from dataclasses import replace

import numpy as np
import pytest

from gtb_cli.theory.patch import Patch
from tests import exact
from tests.laws import inner_parameters, rounding
from tests.marks import mostly_long
from tests.patches import SURFACES, bicubic, collapsed_edge, named, pentagon
from tests.specs import memory_below

NORMAL_ERROR = 1e-11  # error of a unit normal: a hundred times that of T, for the angle between the two derivatives

# Error of a normal 10^-DIGITS of the hull's size from an edge, where layers of knots are at least 0.01 apart
LIMIT_ERROR = 1e-9

FEW_KNOTS = [name for name in SURFACES if len(named(name).knots) <= 16]


@pytest.mark.parametrize("name", mostly_long(FEW_KNOTS, 3))
def test_normals_keep_their_digits_everywhere_inside(name):
    # From the middle to 1e-12 of the size from each edge, also where one knot holds all but 1e-300 of T.
    patch = named(name)
    u = inner_parameters(patch)[::3]
    found = patch.normals(u)
    tolerance = NORMAL_ERROR + 100 * rounding(patch) * (name in ("large_knots", "beyond_floats"))
    for parameter, normal in zip(u, found, strict=True):
        assert np.abs(normal - exact.normal(patch, parameter.tolist())).max() < tolerance


@pytest.mark.parametrize("weight", mostly_long([1e12, 2e6, 1e300, 1e3, 1e100], 2))
def test_a_heavy_knot_inside_spoils_no_digits(weight):
    patch = bicubic()
    weights = patch.weights.copy()
    weights[5] = weight
    heavy = patch.replace(weights=weights)
    for u in ([1.5, 1.4], [0.3, 2.7], [1e-9, 1e-5]):
        assert np.abs(heavy.normals([u])[0] - exact.normal(heavy, u)).max() < NORMAL_ERROR / 10


def test_normals_follow_the_orientation_of_the_domain():
    # A graph over the domain: the third coordinate is positive, and negative once u and v change places.
    patch = pentagon()
    u = np.concatenate([inner_parameters(patch), [[0, 1], [1.5, 1.5]], patch.domain.vertices])
    flat = patch.replace(control_points=np.column_stack([patch.knots, np.full(8, 3.0)]))
    assert flat.normals(u) == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(u), 1)), abs=1e-12)
    mirrored = replace(flat, control_points=flat.control_points[:, [1, 0, 2]])
    assert mirrored.normals(u) == pytest.approx(np.tile([0.0, 0.0, -1.0], (len(u), 1)), abs=1e-12)


# Limits


def approached(patch, place, inward):
    """Normal at `place` + 10^-digits `inward`, where `place` is exactly a combination of two corners."""
    digits = 1000
    with exact.CONTEXT.workdps(digits + 100):
        (first, second), t = place
        a, b = exact.numbers(first.tolist()), exact.numbers(second.tolist())
        step = exact.Number(10) ** -digits
        u = [x * (1 - t) + y * t + step * exact.Number(float(n)) for x, y, n in zip(a, b, inward, strict=True)]
        return exact.normal(patch, u)


KINDS = ["pentagon", "trapezoid", "repeated_knots", "bezier_triangle", "irrational_hexagon", "plain_triangle"]


@pytest.mark.parametrize("name", mostly_long(KINDS, 3))
def test_normals_on_edges_are_limits(name):
    patch = named(name)
    v = patch.domain.vertices
    ends = np.roll(v, -1, axis=0)
    for edge in range(0, len(v), 2):
        t = 0.3125
        found = patch.normals([v[edge] * (1 - t) + ends[edge] * t])[0]
        inward = patch.domain.normals[edge] * patch.domain.size
        expected = approached(patch, ((v[edge], ends[edge]), t), inward)
        assert np.abs(found - expected).max() < LIMIT_ERROR


def assert_limit(patch, corner):
    """The normal at a corner is its limit on all ways, from those along one edge to those along the other; else NaN."""
    rates = 10 ** np.linspace(0, 4, 7)
    ways = [*([-1e5, -1e5 * rate] for rate in rates), *([-1e5 * rate, -1e5] for rate in rates)]
    normals = np.array([next_to(patch, [corner - 1, corner], way) for way in ways])
    found = patch.normals(patch.domain.vertices[corner])
    assert np.isnan(found).all() == (np.abs(normals - normals[0]).max() > 1e-3)
    assert np.isnan(found).all() or np.abs(normals - found).max() < LIMIT_ERROR


@pytest.mark.parametrize("name", mostly_long(["bezier_triangle", "pentagon", "bicubic", "integer_pentagon"], 2))
def test_normals_at_corners_are_limits(name):
    patch = named(name)
    for corner in range(len(patch.domain.vertices)):
        assert_limit(patch, corner)


def test_normals_on_an_edge_keep_their_digits_up_to_both_corners():
    # Near the second corner too, where all but 1e-36 of T is the corner's.
    patch = bicubic()
    expected_first, expected_last = patch.normals([[0, 0], [3, 0]])
    for gap in (1e-3, 1e-6, 1e-12):
        first, last = patch.normals([[3 * gap, 0], [3 - 3 * gap, 0]])
        assert np.abs(first - expected_first).max() < 10 * gap
        assert np.abs(last - expected_last).max() < 10 * gap + 1e-15 / gap * 1e-3


# Where there is none


@pytest.mark.parametrize(
    ("points", "count"),
    [(np.tile([1 / 3, 2.0, 1e7], (8, 1)), None), (np.outer(np.arange(8), [1.0, 2.0, -1.0]) + 5, 13)],
)
def test_control_points_in_one_place_or_on_a_line_have_no_normal(points, count):
    patch = pentagon().replace(control_points=points)
    u = np.concatenate([inner_parameters(patch)[:count], [[0, 1]], patch.domain.vertices])
    assert np.isnan(patch.normals(u)).all()


def test_edges_at_a_tiny_angle_span_a_plane():
    thin = Patch([[0, 0], [1, 0], [0, 1]], [[0, 0, 0], [1, 0, 0], [1, 1e-10, 0]])
    np.testing.assert_allclose(thin.normals([[0, 0], [0.3, 0.3]]), [[0, 0, 1]] * 2, atol=1e-9)


def test_an_edge_that_is_a_point_has_the_limits_of_its_surroundings():
    patch = collapsed_edge()
    u = np.array([[1, 0], [0, 0], [3, 0], [2.2, 0]])
    assert np.abs(patch.normals(u, "linear") - patch.normals(u + np.array([0, 1e-13]), "linear")).max() < 1e-6
    u = [[1, 1e-12], [2.5, 1e-6], [0.5, 0.1], [1e-9, 1e-9]]
    for parameter, normal in zip(u, patch.normals(u), strict=True):
        assert np.abs(normal - exact.normal(patch, parameter)).max() < NORMAL_ERROR


def collapsed(kind, mode, seed):
    """A patch whose knots 0 to 3 are on one edge and have one control point, and the number of that edge.

    Mode 1: the next knots' control points are on a line with it; mode 2: two of them are that point too.
    """
    rng = np.random.default_rng(seed)
    if kind == "real":
        inner = rng.random((5, 2)) * 3 + [0, 0.05]
        knots = np.concatenate([[[0, 0], [0.8 + rng.random(), 0], [2.1 + rng.random(), 0], [3.3, 0]], inner])
    else:
        knots = np.array([(i, j) for j in range(3) for i in range(4 - j * (kind == "triangle"))], dtype=float)
    points = rng.integers(-9, 10, size=(len(knots), 3)).astype(float)
    points[:4] = points[0]
    following = np.argsort(knots[:, 1], kind="stable")[4:6]
    if mode == 1:
        points[following] = points[0] + np.outer([1, 3], rng.integers(1, 5, size=3))
    if mode == 2:
        points[following] = points[0]
    patch = Patch(knots, points, np.exp(rng.normal(size=len(knots))))
    return patch, int(patch.domain.incidence[:4].all(axis=0).argmax())


def next_to(patch, edges, slopes):
    """Normal where log h_j of `edges` is as in `slopes`: nearer than floats come."""
    domain, mp = patch.domain, exact.CONTEXT
    s = [sum(mp.mpf(float(domain.normals[e, axis])) * y for e, y in zip(edges, slopes, strict=True)) for axis in (0, 1)]
    knots = [exact.numbers(a) for a in patch.knots.tolist()]
    logs = [mp.mpf(float(w)) + a[0] * s[0] + a[1] * s[1] for a, w in zip(knots, patch.log_products, strict=True)]
    return exact.normal_of(patch, [mp.exp(e) for e in logs])


@pytest.mark.parametrize("seed", mostly_long(range(2)))
@pytest.mark.parametrize("mode", mostly_long(range(3)))
@pytest.mark.parametrize("kind", mostly_long(["triangle", "real", "lattice"], 2))
def test_an_edge_that_is_a_point_has_the_limits_of_sums_in_many_digits(kind, mode, seed):
    patch, edge = collapsed(kind, mode, seed)
    domain = patch.domain
    corner = (edge + 1) % len(domain.vertices)
    u = domain.vertices[edge] * 0.4 + domain.vertices[corner] * 0.6
    others = [j for j in range(len(domain.vertices)) if j != edge]
    logs = [exact.CONTEXT.log(exact.height(domain, j, u.tolist())) for j in others]
    expected = next_to(patch, [edge, *others], [exact.Number(-100_000), *logs])
    assert np.abs(patch.normals(u[None])[0] - expected).max() < LIMIT_ERROR
    for k in (edge, corner):
        assert_limit(patch, k)


def test_a_second_layer_of_knots_serves_where_the_first_is_parallel():
    # The rows v = 0 and v = 1 have the same control points: tangent planes come from the row v = 2.
    patch = bicubic()
    points = patch.control_points.copy()
    points[4:8] = points[:4]
    folded = patch.replace(control_points=points, weights=np.ones(16))
    found = folded.normals([[1.3, 0]])[0]
    expected = approached(folded, ((np.array([0.0, 0.0]), np.array([3.0, 0.0])), 1.3 / 3), [0, 1])
    assert np.abs(found - expected).max() < LIMIT_ERROR


def test_memory_for_an_edge_that_is_a_point_grows_with_pairs_of_knots_not_with_triples():
    """300 knots, 30 of them on it: 300 MB were taken for all triples; ten million numbers are 80 MB."""
    rng = np.random.default_rng(1)
    edge = np.column_stack([[0, 1, *rng.random(28)], np.zeros(30)])
    knots = np.concatenate([edge, 0.02 + 0.96 * rng.random((268, 2)), [[0, 1], [1, 1]]])
    points = np.column_stack([knots, 0.1 * rng.normal(size=300)])
    points[:30] = points[0]
    patch = Patch(knots, points, np.exp(rng.normal(size=300)))
    with memory_below(80e6):
        normals = patch.normals(np.column_stack([np.linspace(0.1, 0.9, 50), np.zeros(50)]))
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-12
