"""The moment map and its inverse, the linear parametrisation."""

import math

import numpy as np
import pytest

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.domain import domain
from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.moment import moment_map
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.solve import LogSum
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import LinearParametrization, RationalBasis
from tests.laws import RESIDUAL, heights, linear_points
from tests.marks import mostly_long
from tests.patches import NAMES, SHIFT, SURFACES, bumps, named, pentagon, regular

EPS = float(np.finfo(np.float64).eps)

SHARED_ERROR = 1e-12
"""Error of points of size 1 on an edge that two patches share: the residual twice, and the slope there."""

STEPS = 60  # evaluations of μ for a point, on the average of a few hundred: a tenth of it where weights are tame


def error(patch, p):
    """Largest |μ(μ⁻¹(p)) − p| as a fraction of the size, and of what rounding leaves far from the origin."""
    found = patch.rational_basis.blend(patch.knots, locations(patch, p), len(p))
    size = max(patch.domain.size, 16 * EPS / RESIDUAL * np.abs(patch.domain.vertices).max())
    return np.abs(found - p).max() / size


def locations(patch, p):
    return list(patch.rational_basis.locations(p, "linear"))


def inside(patch, p):
    """Those of some points that rounding has not put outside."""
    return p[~np.isnan(heights(patch, p)).any(axis=1)]


def everywhere(patch, rng, count=60):
    """Points in the middle, from 1e-12 to 0.1 of the size from edges, at corners, and on edges."""
    v = patch.domain.vertices
    r = len(v)
    middle = [rng.dirichlet(np.full(r, concentration), count // 3) @ v for concentration in (0.1, 1, 5)]
    j = rng.integers(0, r, count)
    t = rng.random((count, 1))
    inward = patch.domain.normals[j] / patch.domain.normal_lengths[j][:, None]
    on_edges = v[j] if patch.dimension == 1 else v[j] * (1 - t) + v[(j + 1) % r] * t
    near = on_edges + inward * patch.domain.size * 10.0 ** rng.uniform(-12, -1, (count, 1))
    near_corners = v[j] + (v.mean(axis=0) - v[j]) * 10.0 ** rng.uniform(-12, -1, (count, 1))
    return inside(patch, np.concatenate([*middle, on_edges, near, near_corners, v]))


@pytest.mark.parametrize("name", mostly_long(reversed(NAMES), 12))
def test_the_inverse_is_inverse_on_named_patches(name):
    patch = named(name)
    assert error(patch, everywhere(patch, np.random.default_rng(0))) <= RESIDUAL


@pytest.mark.parametrize("sides", mostly_long([20, 60]))
def test_blunt_corners_are_solved_up_to_a_trillionth(sides):
    # Corners of nearly 180 degrees, whose torus coordinates go to tens of thousands.
    patch = Patch(regular(sides, 0.1), bumps(regular(sides, 0.1)))
    v = patch.domain.vertices
    inward = (np.roll(v, -1, axis=0) - v) * 0.3 + (np.roll(v, 1, axis=0) - v) * 0.4
    p = np.concatenate([v + gap * inward for gap in (1e-1, 1e-3, 1e-6, 1e-9, 1e-11, 1e-12)])
    assert error(patch, inside(patch, p)) <= RESIDUAL


@pytest.mark.parametrize("thickness", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_thin_hulls_are_solved(thickness, angle):
    rng = np.random.default_rng(1)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    knots = (rng.normal(size=(9, 2)) * [1, thickness]) @ turn
    patch = Patch(knots, bumps(knots), rng.uniform(0.1, 10, 9))
    p = rng.dirichlet(np.full(len(patch.domain.vertices), 1.0), 100) @ patch.domain.vertices
    assert error(patch, p) <= RESIDUAL
    # Across the strip too the error is a small part of its width.
    across = np.array([-math.sin(angle), math.cos(angle)]) @ turn.T @ turn
    found = patch.rational_basis.blend(patch.knots, locations(patch, p), len(p))
    assert np.abs((found - p) @ across).max() <= max(1e-11 * thickness, 64 * EPS) * patch.domain.size


def test_edges_that_rounding_bends_are_solved():
    # Knots on the slanted edges are off them by 1e-9, and the starts for such a layer are at 1e12.
    rng = np.random.default_rng(149)
    steps = np.concatenate([[0], np.sort(rng.random(4)), [1]])
    square = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    knots = square @ [[1, 0], [62, 1]] + [-1.28e7, 3.06e6]
    patch = Patch(knots, bumps(square), np.exp(rng.normal(size=36)))
    p = rng.dirichlet(np.full(4, 0.3), 40) @ patch.domain.vertices
    assert error(patch, p) <= RESIDUAL


@pytest.mark.parametrize("name", mostly_long(["bicubic", "pentagon", "irrational_hexagon", "plain_triangle"]))
def test_points_a_few_ulp_from_an_edge_are_finite(name):
    # Neither snapped to the edge nor far enough from it for its distance to survive a turn of coordinates.
    patch = named(name)
    v = patch.domain.vertices
    edges = np.roll(v, -1, axis=0) - v
    inward = patch.domain.normals / patch.domain.normal_lengths[:, None]
    for t in (0.25, 0.5, 1e-6, 1 - 1e-6):
        for ulps in range(4, 12):
            p = inside(patch, v + t * edges + inward * ulps * EPS * patch.domain.size)
            where = locations(patch, p)
            assert all(np.isfinite(location.s).all() for location in where)
            assert error(patch, p) <= RESIDUAL


# Edges


@pytest.mark.parametrize("edge", range(5))
def test_an_edge_depends_on_its_own_data_alone(edge):
    patch = pentagon()
    v = patch.domain.vertices
    on_edge = patch.domain.incidence[:, edge]
    other = Patch(
        patch.knots,
        np.where(on_edge[:, None], patch.control_points, patch.control_points[::-1] + 7),
        np.where(on_edge, patch.weights, 1e6 * patch.weights[::-1]),
        edge_scale=2,
    )
    t = np.linspace(0, 1, 33)[:, None]
    p = v[edge] * (1 - t) + v[(edge + 1) % 5] * t
    assert linear_points(other, p).tobytes() == linear_points(patch, p).tobytes()


def test_patches_that_share_an_edge_agree_on_it_to_rounding():
    # The edge from (0, 0) to (2, 0) of one, turned, stretched and run through backwards in the other.
    one = pentagon()
    members = one.domain.edge_knots(0)
    angle = 0.6
    turn = 1.7 * np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    knots = np.concatenate([[[2.0, 0.0]] - one.knots[members], [[1.0, 3.0], [0.3, 1.1]]]) @ turn + [5, -3]
    points = np.concatenate([one.control_points[members], [[0, 0, 9], [5, 5, 5]]])
    weights = np.concatenate([one.weights[members] * 3, [1, 2]])
    two = Patch(knots, points, weights)
    t = np.linspace(0, 1, 41)[:, None]
    first = linear_points(one, t * [2.0, 0.0])
    start, end = knots[0], knots[len(members) - 1]
    second = linear_points(two, start * (1 - t) + end * t)
    assert np.abs(first - second).max() < SHARED_ERROR


def test_known_faces_overrule_rounding():
    # A point meant to be on an edge, a little off it.
    patch = named("irrational_hexagon")
    v = patch.domain.vertices
    on_edge = (v[1] + v[2]) / 2
    off = on_edge + patch.domain.normals[1] * 1e-10
    where = patch.rational_basis.linear
    found = patch.points_at(where.locations(off[None], np.array([2])), 1)
    assert np.abs(found - linear_points(patch, on_edge[None])).max() < 1e-8
    assert np.abs(found - linear_points(patch, off[None])).max() > 0


@pytest.mark.parametrize("name", SURFACES)
def test_corners_are_exactly_the_corners(name):
    patch = named(name)
    v = patch.domain.vertices
    assert linear_points(patch, v).tolist() == patch.evaluate(v).tolist()


# Even meshes

RESOLUTION = 70  # segments of an edge at which a mesh is found from a coarser one; with fewer it is not


def hostile(name):
    """Surfaces on which interpolation is poor, or whose rounding is."""
    knots = np.array([[0, 0], [1, 0], [1.2, 0.9], [0.3, 1.4], [-0.4, 0.8], [0.5, 1e-6], [0.4, 0.5]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 1e-4], [1e-3, 0.5], [0.5, 0.5]])
    bent = np.random.default_rng(7).uniform(-30, 30, len(pentagon().knots))
    if "+" in name:
        scale, shift = map(float, name.split("+"))
        return Patch(pentagon().knots * scale + shift, pentagon().control_points, pentagon().weights)
    return {
        "near an edge": Patch(knots, bumps(knots)),
        "near two edges": Patch(square, bumps(square), [1, 2, 3, 4, 5, 6, 7]),
        "weights of e^30": pentagon().replace(log_weights=bent),
        "triangle": Patch(knots[[0, 1, 3, 6]], bumps(knots[[0, 1, 3, 6]]), [1, 2, 3, 40]),
    }[name]


def even_locations(patch, resolution=RESOLUTION):
    """Vertices of a triangulation, and where they lie when they are known to be its."""
    part = triangulation(patch.domain, resolution)
    face = np.zeros(len(part.parameters), dtype=np.int64)
    face[part.boundary] = patch.domain.faces.edges[:, None]
    face[part.boundary[:, 0]] = patch.domain.faces.corners
    return part.parameters, list(patch.rational_basis.linear.locations(part.parameters, face, 0.0, resolution))


HOSTILE = ["near an edge", "near two edges", "weights of e^30", "triangle", "1e-9+0", "1e9+0", "1+1e7"]


@pytest.mark.parametrize("name", mostly_long(HOSTILE, 3))
def test_even_meshes_are_found_from_coarser_ones(name):
    patch = hostile(name)
    p, where = even_locations(patch)
    found = patch.rational_basis.blend(patch.knots - patch.domain.center, where, len(p))
    size = max(patch.domain.size, 16 * EPS / RESIDUAL * np.abs(patch.domain.vertices).max())
    assert np.abs(found - (p - patch.domain.center)).max() <= RESIDUAL * size
    # Most are not left to the safe method, whose rows are numbers.
    assert sum(location.s.shape[1] for location in where if isinstance(location.rows, slice)) > 0.9 * len(p)
    points = patch.points_at(where, len(p))
    assert np.abs(points - linear_points(patch, p)).max() < 1e-11 * np.abs(patch.control_points).max() * max(
        1, 16 * EPS / RESIDUAL * np.abs(patch.domain.vertices).max() / patch.domain.size
    )


def test_an_even_mesh_takes_little_more_than_one_evaluation(monkeypatch):
    assert evaluations(lambda: even_locations(pentagon(), 320)[0], monkeypatch) < 1.6


# Extreme weights


@pytest.mark.parametrize("x", mostly_long([5, 1e300, 1e6, 100, 600, 1e30, 1e-30], 2))
@pytest.mark.parametrize("name", ["pentagon", "irrational_hexagon", "bicubic", "irrational_curve"])
def test_toric_degenerations_converge(name, x):
    patch = named(name)
    rng = np.random.default_rng(3)
    lifting = rng.integers(0, 4, len(patch.knots)).astype(float)
    steep = patch.replace(log_weights=patch.log_products + lifting * math.log(x), coefficients=None)
    p = everywhere(patch, rng)
    # Knots, and places between two of them: corners and borders of the limit's cells.
    i, j = rng.integers(0, len(patch.knots), (2, 40))
    t = rng.random((40, 1))
    p = np.concatenate([p, patch.knots, inside(patch, patch.knots[i] * t + patch.knots[j] * (1 - t))])
    assert error(steep, p) <= RESIDUAL


def test_the_limit_of_steep_weights_is_the_cells_own_patch():
    # λ = (1, 0, 3, 2, 0, 1, 3, 1): the triangle of the knots 1, 3, 4 is a cell (mathematics.md, section 7).
    patch = pentagon()
    steep = patch.replace(log_weights=patch.log_products + np.array([1, 0, 3, 2, 0, 1, 3, 1]) * math.log(1e30))
    cell = [1, 3, 4]
    alone = Patch(patch.knots[cell], patch.control_points[cell], patch.weights[cell])
    p = np.array([[0.4, 0.35, 0.25], [0.1, 0.8, 0.1], [0.3, 0.1, 0.6]]) @ patch.knots[cell]
    assert np.abs(linear_points(steep, p) - linear_points(alone, p)).max() < 1e-10


# Cost


def evaluations(locate, monkeypatch):
    """Evaluations of μ for each of the points that a function locates and returns."""
    counted = []
    moments = LogSum.moments
    with monkeypatch.context() as patched:
        patched.setattr(LogSum, "moments", lambda self, s: (counted.append(s.shape[1]), moments(self, s))[1])
        count = len(locate())
    return sum(counted) / count


@pytest.mark.parametrize(
    ("name", "most"),
    [("pentagon", 6), *mostly_long([("extreme_weights", STEPS), ("beyond_floats", STEPS), ("sixty_knots", STEPS)], 2)],
)
def test_points_take_a_bounded_number_of_steps(name, most, monkeypatch):
    patch = named(name)
    tame = np.random.default_rng(4).dirichlet(np.ones(5), 20000) @ named("pentagon").domain.vertices
    p = tame if name == "pentagon" else everywhere(patch, np.random.default_rng(5))
    assert evaluations(lambda: locations(patch, p) and p, monkeypatch) < most


ALMOST_FLAT = {
    # Log weights span 106: points between two knots, where what is across the line between them is lost in rounding.
    "span of 106": (
        [[0.2822, 1.0442], [1.8645, 0.0650], [2.6239, 2.5621], [0.1329, 2.4073], [0.5544, 2.0869], [0.4650, 2.0749],
         [2.8759, 2.9550], [1.9899, 0.4907], [1.1847, 0.8340]],
        [19.71, 49.23, 34.05, -8.06, -3.08, 21.72, -17.23, -56.02, -30.84],
    ),
    # Cramer's rule gave steps of 1e-14 there, each a little better than the last.
    "knots on a diagonal": ([[1, 2], [0, 0], [5, 0], [2, 4], [7, 4]], [15.88, 69.24, -47.73, 19.12, 62.38]),
}  # fmt: skip


@pytest.mark.parametrize("name", ALMOST_FLAT)
def test_points_that_look_as_if_on_a_line_are_found(name):
    knots, log_weights = map(np.array, ALMOST_FLAT[name])
    shape = domain(knots)
    rng = np.random.default_rng(0)
    s = rng.normal(size=(2, 4000)) * rng.choice([1, 10, 100], 4000)
    p = MomentMap(knots, log_weights)(s)
    p = p[(shape.heights_of_columns(p, 0, None) > 1e-9).all(axis=0)]
    basis = RationalBasis(shape, log_weights)
    found = basis.blend(knots, basis.locations(p, "linear"), len(p))
    assert np.abs(found - p).max() <= RESIDUAL * shape.size


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(
    ("knots", "weights"),
    [
        ([0, 5.6e-11, 1], [0.18, 6.9e7, 1.3e11]),
        ([0, 0.004, 1 - 1.8e-10, 1 - 1.1e-11, 1], [7.4e-11, 6.8e-4, 2.3e-10, 1.4e11, 2.1e10]),
        (
            [0, 2.6e-6, 0.12, 0.27, 0.2700001, 0.8, 0.9, 1 - 2.3e-12, 1],
            [7.5e-3, 4e-2, 4e10, 11, 3e9, 1e11, 0.02, 0.015, 2e-12],
        ),
    ],
)
def test_points_between_knots_that_nearly_coincide_are_found(knots, weights, mirrored):
    # Regularised steps were a millionth of what they should be: refused at residuals up to 1e-9.
    knots = (1 - np.array(knots) if mirrored else np.array(knots))[:, None]
    patch = Patch(knots, np.column_stack([knots, 0 * knots]), weights)
    gaps = 10.0 ** np.random.default_rng(8).uniform(-12, -1, 200)
    assert error(patch, np.concatenate([gaps, 1 - gaps])[:, None]) <= RESIDUAL


# The map itself


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize("shift", [0.0, SHIFT])
def test_the_moment_map_is_the_mean_of_the_knots(dimension, shift):
    rng = np.random.default_rng(6)
    knots = rng.normal(size=(7, dimension)) + shift
    log_weights = rng.normal(size=7) * 3
    s = rng.normal(size=(dimension, 20))
    weights = np.exp((knots - shift) @ s + log_weights[:, None])
    mean = (knots - shift).T @ weights / weights.sum(axis=0)
    moments = MomentMap(knots, log_weights)
    assert np.abs(moments(s) - shift - mean.T).max() < 1e-13 + 4 * EPS * shift
    assert np.abs(moments(moments.inverse(moments(s))) - moments(s)).max() < 1e-12 + 16 * EPS * shift


def test_points_outside_are_refused_and_no_points_have_no_locations():
    shape = domain([[0, 0], [1, 0], [0, 1]])
    with pytest.raises(DomainError, match=r"parameters\[1\].* outside the domain"):
        list(LinearParametrization(shape, np.zeros(3)).locations(np.array([[0.1, 0.1], [1.0, 1.0]])))
    with pytest.raises(DomainError, match=r"parameters\[0\]: must be finite"):
        list(LinearParametrization(shape, np.zeros(3)).locations(np.array([[math.nan, 0.1]])))
    assert list(LinearParametrization(shape, np.zeros(3)).locations(np.empty((0, 2)))) == []


@pytest.mark.parametrize("p", [[3.0, 1.0], [1.0, -1e-3]])
def test_what_cannot_be_reached_is_an_error(p):
    moments = MomentMap(pentagon().knots, pentagon().log_products)
    with pytest.raises(ToleranceError, match=r"linear parametrisation: residual .* after 300 steps, 1e-12 is"):
        moments.inverse(np.array([[1.0, 1.0], p]))


def test_the_latest_questions_are_remembered_each_for_itself(monkeypatch):
    """Maps are made anew wherever they are needed, so the contents of their arrays decide."""
    asked, starts = [], moment_map.tame_starts
    monkeypatch.setattr(moment_map, "tame_starts", lambda *question: asked.append(1) or starts(*question))
    knots, logs = pentagon().knots, pentagon().log_products
    p = knots.mean(axis=0) + 0.1 * np.random.default_rng(0).random((5, 2))

    def answer(logs=logs, p=p, **options):
        return MomentMap(knots.copy(), logs.copy()).inverse(p.copy(), **options)

    def count(*answers):
        before = len(asked)
        for options in answers:
            answer(**options)
        return len(asked) - before

    rough = {"within": 1e-3}
    assert count({}, rough, {}, rough) == 2
    exact, loose = (np.abs(MomentMap(knots, logs)(answer(**options)) - p).max() for options in ({}, rough))
    assert exact < RESIDUAL < loose
    assert count({"logs": logs + knots[:, 0]}, {"p": p[::-1]}, {"start": answer()}) == 3
    with pytest.raises(ValueError, match="read-only"):
        answer()[:] = 0.0
    assert count(*({"p": p + k * 1e-3} for k in range(1, 100)), {}) == 100
    assert len(moment_map._latest) <= 64
