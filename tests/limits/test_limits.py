"""Toric degeneration and knot limits, against the paper's numbers, exact rationals and mpmath."""

import dataclasses
import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gtb_cli.errors import DomainError
from gtb_cli.knots.hull import depth_in
from gtb_cli.limits.degeneration import degenerate, regular_control_surface
from gtb_cli.limits.knot_limit import knot_limit, merge_knots, move_knots
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.sequences.family import film_mesh
from gtb_cli.sequences.sequence import degeneration
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.laws import linear_points
from tests.marks import mostly_long
from tests.patches import bicubic, bumps, irrational_curve
from tests.specs import spec
from tests.tables import cases

EXACT = 4e-15  # error of numbers of size 1 after a few operations

ROUNDING = 1e-12  # error of points: exponents of a few hundred are rounded to 1e-13 of themselves

HUGE = 1e-10  # error of points at x = 1e300, whose exponents are in the thousands


def hexagon() -> Patch:
    """19 knots, with control points that follow no dome."""
    patch = spec("hexagon")
    return dataclasses.replace(patch, control_points=patch.control_points + bumps(patch.knots)[::-1] / 4)


# --- degeneration


def test_ordinary_weights_stay_floats():
    patch = irrational_curve()
    lifting = [2, 1, 5, 9 - 4 * math.sqrt(2), 1]
    found = degenerate(patch, 3.0, lifting)
    expected = [1 * 9, 10 * 3, 20 * 243, 6 * 3.0 ** (9 - 4 * math.sqrt(2)), 5 * 3]
    np.testing.assert_allclose(found.weights, expected, rtol=EXACT)
    for name in ("knots", "control_points", "coefficients"):
        assert (getattr(found, name) == getattr(patch, name)).all()


@pytest.mark.parametrize("x", mostly_long([0.02, 3.0, 37.0]))
def test_vertices_of_a_sequence_are_points_of_the_degenerated_patch(x):
    """The meshes evaluate each cell with a lifting of its own; the gaps of these are not 0 and 1 only."""
    patch = dataclasses.replace(spec("example-4.4"), lifting=spec("example-4.4").lifting * 1.7)
    mesh = degeneration(patch, [x], resolution=3).meshes[0]
    inside = (patch.domain.heights_of_columns(mesh.parameters) > 0).all(axis=0)
    assert inside.sum() > 5
    whole = degeneration(spec("bicubic"), [3], np.arange(16) % 3, 3, distances=False).meshes[0]
    assert (mesh.exact_normals, whole.exact_normals) == (False, True)
    expected = linear_points(degenerate(patch, x), mesh.parameters[inside])
    np.testing.assert_allclose(mesh.vertices[inside], expected, atol=ROUNDING * 100)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_degenerations_follow_each_other(x, y):
    patch = spec("example-4.4")
    assert degenerate(patch, 1.0) == patch
    twice, once = degenerate(degenerate(patch, x), y), degenerate(patch, x * y)
    np.testing.assert_allclose(twice.log_products, once.log_products, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *((lambda x=x: degenerate(spec("example-4.4"), x), "x: must be finite and positive")
          for x in (0.0, -1.0, math.inf, math.nan)),
        *((lambda step=step: move_knots(irrational_curve(), {1: 2}, step), "step: expected a number from 0 to 1")
          for step in (-0.1, 1.1, math.nan)),
        (lambda: degenerate(irrational_curve(), 2.0), "has no lifting: write one"),
        (lambda: degenerate(irrational_curve(), 2.0, [1, 2]), "lifting: expected 5, one for each knot, got 2"),
        (lambda: degenerate(irrational_curve(), 2.0, [1, 2, 3, math.nan, 4]), "lifting.3.: must be finite"),
        (lambda: degenerate(irrational_curve(), 1e300, [1e308, 0, 0, 0, 0]), "beyond the largest float"),
    ],
)  # fmt: skip
def test_what_is_no_number_of_a_limit(change, message):
    with pytest.raises(DomainError, match=message):
        change()


PLACES = {
    "example-4.4": [(0.5, 0.5), (1.1, 1.1), (0.01, 1.99), (1.2, 0.3), (1.999, 0.5), (1e-9, 1.0)],
    "example-3.4": [(1e-12,), (0.1,), (0.25,), (0.5,), (0.7,), (0.999,)],
}
DEGENERATE = [
    *(("example-4.4", x, 18 * ROUNDING) for x in (5, 600, 1e6, 1e30, 1e-30)),
    *(("example-4.4", 1e300, 18 * HUGE), *(("example-3.4", x, 4 * ROUNDING) for x in (1.3, 3, 1e30))),
]


@pytest.mark.parametrize(("name", "x", "tolerance"), DEGENERATE)
def test_points_of_a_degenerating_patch(name, x, tolerance):
    patch = degenerate(spec(name), x)
    expected = [[float(x) for x in exact.point(patch, place)] for place in PLACES[name]]  # of 50 digits
    np.testing.assert_allclose(patch.evaluate(PLACES[name]), expected, rtol=0, atol=tolerance)


# --- the limit of degeneration


def test_cells_of_example_44_are_patches_of_their_own():
    patch = spec("example-4.4")
    model = regular_control_surface(patch)
    cells = [(0, 1, 2, 3), (1, 3, 4), (2, 3, 6), (2, 5, 6), (3, 4, 6, 7)]
    assert [len(part.domain.vertices) for part in model.patches] == [4, 3, 3, 3, 4]
    for part, cell in zip(model.patches, cells, strict=True):
        for name in ("knots", "weights", "coefficients", "control_points", "lifting"):
            assert (getattr(part, name) == getattr(patch, name)[list(cell)]).all()
    assert model.name == "example-4.4"
    assert model.patches[2].name == "example-4.4-cell2"


@pytest.mark.parametrize(
    ("lifting", "knots"),
    [
        ([2, 1, 5, 9 - 4 * math.sqrt(2), 1], [[0, 2], [2, 3, 4]]),
        ([0, 2.5, 3, 2.5, 0], [[0, 1], [1, 2], [2, 3], [3, 4]]),
        ([1, 3, 1, 0, 1], [[0, 1], [1, 4]]),
        ([0, 0, 0, 1, 0], [[0, 3], [3, 4]]),
    ],
)
def test_limits_of_example_34(lifting, knots):
    """Also property (g): one weight alone gives the polyline b_0 b_i b_n."""
    patch = irrational_curve()
    model = regular_control_surface(patch, lifting)
    expected = [patch.control_points[cell].tolist() for cell in knots]
    assert [part.control_points.tolist() for part in model.patches] == expected


def test_the_limit_for_small_x_is_that_of_the_opposite_lifting():
    patch = spec("example-4.4")
    p = np.array([[0.3, 1.7], [1.0, 0.4], [1.8, 0.2]])
    points = linear_points(degenerate(patch, 1e-200), p)
    model = regular_control_surface(patch, -patch.lifting)
    cells = [next(k for k, part in enumerate(model) if depth_in(part.domain.vertices, q[None])[0] >= 0) for q in p]
    limit = [linear_points(model.patches[k], q[None])[0] for k, q in zip(cells, p, strict=True)]
    np.testing.assert_allclose(points, limit, atol=HUGE)


def test_logarithmic_weights_stay_so_in_the_limit():
    patch = degenerate(spec("example-4.4"), 1e300)
    model = regular_control_surface(patch)
    assert (model.patches[1].log_weights == patch.log_weights[[1, 3, 4]]).all()


# --- merging


@pytest.mark.parametrize(
    ("patch", "moves", "knots", "weights", "points"),
    [
        (irrational_curve(), {1: 2}, [0, 2, 3, 4], [1, 30, 6, 5], {1: ["44/30", "53/30", 0]}),
        (irrational_curve(), {1: 2, 3: 2}, [0, 2, 4], [1, 36, 5], {1: ["66.2/36", "62/36", 0], 2: [4, 0, 0]}),
        (irrational_curve(), {1: 3, 3: 2}, [0, 2, 4], [1, 36, 5], {1: ["66.2/36", "62/36", 0], 0: [0, 0, 0]}),
        (spec("example-4.2"), {3: 1}, [0, 1, 2, 4, 5, 6, 7], [2, 9, 5, 2, 3, 5, 2], {1: ["10/9", "12/9", "43/9"]}),
    ],
)
def test_merged_patches_of_the_paper(patch, moves, knots, weights, points):
    """Examples 3.2, 3.3 (chains end at the last knot) and 4.2."""
    found = merge_knots(patch, moves)
    assert (found.knots == patch.knots[knots]).all()
    assert found.weights.tolist() == weights
    for index, point in points.items():
        expected = [float(Fraction(x.split("/")[0]) / Fraction(x.split("/")[1])) if "/" in str(x) else x for x in point]
        np.testing.assert_allclose(found.control_points[index], expected, rtol=EXACT)


def test_the_limit_of_example_42_is_the_spec_of_its_name():
    found, limit = merge_knots(spec("example-4.2"), {3: 1}), spec("example-4.2-limit")
    assert (found.knots == limit.knots).all()
    np.testing.assert_allclose(found.control_points, limit.control_points, rtol=EXACT)


def test_general_coefficients_against_rationals():
    """c̃ = c_q, ω̃ = (c_k ω_k + c_q ω_q)/c_q, in exact arithmetic."""
    c, w, b = [2, 3, 5, 7], [11, 13, 17, 19], [[1, 2, 3], [4, 5, 6], [7, 8, 10], [0, 1, -1]]
    found = merge_knots(Patch([0, 1, 2, 3], b, w, c, lifting=[4, 3, 2, 1], name="p"), {1: 2})
    total = Fraction(3 * 13 + 5 * 17)
    assert found.coefficients.tolist() == [2, 5, 7]
    assert found.weights.tolist() == [11, float(total / 5), 19]
    sums = [3 * 13 * one + 5 * 17 * two for one, two in zip(b[1], b[2], strict=True)]
    np.testing.assert_allclose(found.control_points[1], [float(Fraction(x) / total) for x in sums], rtol=EXACT)
    assert found.lifting.tolist() == [4, 2, 1]
    assert found.name == "p"


@given(st.permutations(range(1, 15)), st.integers(1, 6), st.integers(0, 10**6))
def test_a_merged_patch_is_the_patch_with_repeated_knots(order, count, seed):
    """Whatever coefficients, edge functions and chains: at every parameter, the boundary too."""
    rng = np.random.default_rng(seed)
    patch = bicubic()
    inner = [k for k in order if k not in (0, 3, 12, 15)]
    moves = {inner[i]: inner[rng.integers(i + 1, len(inner))] for i in range(count)}
    weights, coefficients = rng.uniform(0.5, 2, (2, 16))
    patch = patch.replace(weights=weights, coefficients=coefficients, edge_scale=[1, 2, 0.5, 1])
    u = np.concatenate([rng.uniform(0, 3, (20, 2)), [[0, 0], [3, 1.5], [1, 0], [0, 2.5], [3, 3]]])
    points = move_knots(patch, moves, 1).evaluate(u)
    np.testing.assert_allclose(merge_knots(patch, moves).evaluate(u), points, atol=1e-13)


@pytest.mark.parametrize("shift", [800.0, -800.0])
def test_merging_in_logarithms(shift):
    plain = irrational_curve()
    patch = plain.replace(log_weights=np.log(plain.weights) + shift)
    found, expected = merge_knots(patch, {1: 2}), merge_knots(plain, {1: 2})
    np.testing.assert_allclose(found.log_weights - shift, np.log(expected.weights), atol=1e-12)
    np.testing.assert_allclose(found.control_points, expected.control_points, rtol=1e-12)


def test_weights_whose_products_overflow_merge():
    patch = Patch([0, 1, 2, 3], np.eye(4, 3), [1, 1e200, 3e200, 1], [1, 1e200, 1e200, 1])
    found = merge_knots(patch, {1: 2})
    np.testing.assert_allclose(found.control_points[1], [0, 0.25, 0.75], rtol=1e-12)
    np.testing.assert_allclose(found.weights, [1, 4e200, 1], rtol=1e-12)


@pytest.mark.parametrize(("moves", "message"), cases("limits/refused", "moves"))
def test_bad_moves(moves, message):
    for refused in (merge_knots, knot_limit, lambda patch, moves: move_knots(patch, moves, 0.5)):
        with pytest.raises(DomainError, match=message):
            refused(spec("example-4.2"), dict(moves))


def test_an_end_with_two_knots_spares_one():
    with pytest.raises(DomainError, match=r"knot 0 -> 1 changes the hull: no other knot stays at its end \(0\)"):
        merge_knots(irrational_curve(), {0: 1})
    patch = Patch([0, 0, 1, 2], [[0, 0], [0, 1], [1, 1], [2, 0]])
    found = merge_knots(patch, {0: 2})
    assert found.knots[:, 0].tolist() == [0, 1, 2]
    assert found.control_points[:2, :2].tolist() == [[0, 1], [0.5, 0.5]]
    with pytest.raises(DomainError, match="changes the hull"):
        merge_knots(patch, {0: 2, 1: 2})


def test_a_knot_may_merge_with_its_copy():
    patch = Patch([0, 0, 1], [[0, 0], [2, 4], [1, 1]], [1, 3, 1])
    found = merge_knots(patch, {1: 0})
    assert found.control_points[0].tolist() == [1.5, 3, 0]
    assert not knot_limit(patch, {1: 0}).films


# --- moving


@pytest.mark.parametrize(("step", "knot"), [(0.4, ("38/35", "52/35")), (0.8, ("36/35", "64/35"))])
def test_steps_of_example_42(step, knot):
    found = move_knots(spec("example-4.2"), {3: 1}, step)
    np.testing.assert_allclose(found.knots[3], [float(Fraction(x)) for x in knot], rtol=EXACT)
    assert (found.domain.vertices == spec("example-4.2").domain.vertices).all()


def test_all_knots_of_a_chain_move_to_its_end():
    curve_knots = [0, math.sqrt(2) / 4, 0.5, math.sqrt(2) / 2, 1]
    patch = irrational_curve()
    found = move_knots(patch, {1: 3, 3: 2}, 0.5).knots[:, 0]
    expected = [0, (curve_knots[1] + 0.5) / 2, 0.5, (curve_knots[3] + 0.5) / 2, 1]
    np.testing.assert_allclose(found, expected, rtol=EXACT)
    assert (move_knots(patch, {1: 3, 3: 2}, 0).knots == patch.knots).all()
    assert move_knots(patch, {1: 3, 3: 2}, 1).knots[:, 0].tolist() == [0, 0.5, 0.5, 0.5, 1]


@pytest.mark.parametrize(("patch", "moves"), [(irrational_curve(), {1: 2, 3: 2}), (spec("example-4.2"), {3: 1})])
def test_inside_points_converge_linearly(patch, moves):
    """Where the target is a corner, too: there the convergence is pointwise."""
    merged = merge_knots(patch, moves)
    p = patch.domain.center + 0.4 * (patch.domain.vertices[:3] - patch.domain.center)
    errors = [
        np.abs(linear_points(move_knots(patch, moves, 1 - e), p) - linear_points(merged, p)).max()
        for e in (1e-3, 1e-4, 1e-5)
    ]
    for one, two in pairwise(errors):
        assert 9.5 < one / two < 10.5


# --- films

FILMS = [
    (irrational_curve(), {1: 0}),
    (irrational_curve(), {1: 0, 3: 4, 2: 4}),
    (spec("example-4.2"), {3: 1}),
    (hexagon(), {18: 6}),  # to a knot on an edge
    (hexagon(), {12: 0, 17: 0}),  # to a corner, on two lines
    (hexagon(), {6: 0, 12: 0}),  # one of them along an edge
]


@pytest.mark.parametrize(
    ("patch", "moves", "faces"),
    [
        (irrational_curve(), {1: 2, 3: 2}, {}),
        (irrational_curve(), {1: 0}, {1: 1}),
        (spec("example-4.2"), {3: 1}, {3: 1 + 5 + 3}),
        (spec("example-4.2"), {2: 0}, {2: 1 + 5 + 4}),
        (hexagon(), {12: 18}, {}),
        (hexagon(), {18: 6}, {18: 3}),
        (bicubic(), {1: 2}, {}),  # along an edge to a knot inside it
        (bicubic(), {1: 2, 5: 2}, {5: 1}),
    ],
)
def test_where_knots_arrive(patch, moves, faces):
    limit = knot_limit(patch, moves)
    assert limit.arrivals == faces
    assert bool(limit.films) == bool(faces)


@pytest.mark.parametrize(("off", "count"), [(0.0, 0), (1e-7, 1)])
def test_knots_that_arrive_along_one_line_make_no_film_of_a_corner(off, count):
    knots = [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1], [2, 2 + off]]
    assert sum(film.face.is_corner for film in knot_limit(Patch(knots, np.eye(6, 3)), {4: 0, 5: 0}).films) == count


def test_the_film_of_one_knot_at_an_end_is_a_segment():
    patch = irrational_curve()
    limit = knot_limit(patch, {1: 0})
    (film,) = limit.films
    ends = film.points([[1.0], [0.0]])
    np.testing.assert_allclose(ends[0], limit.merged.control_points[0], rtol=EXACT)
    assert (ends[1] == patch.control_points[0]).all()
    for point in film.points([[0.25], [0.5], [0.9]]):
        assert np.linalg.norm(np.cross(point - ends[0], ends[1] - ends[0])) < EXACT


def test_the_membrane_of_example_42_is_two_triangles():
    """From the edges that stay, (0,2,0) (1,2,4) and (1,2,4) (2,1,2), to the merged corner."""
    limit = knot_limit(spec("example-4.2"), {3: 1})
    corner = limit.merged.control_points[1]
    points = limit.patch.control_points
    for film, ends in zip(limit.films, (points[[4, 1]], points[[1, 0]]), strict=True):
        for z in (0.0, 0.5, 1.0):
            found = tessellate(film.section(z), 4).vertices
            basis = np.stack([*ends, corner], axis=1)
            shares = np.linalg.solve(basis, found.T)
            assert (shares > -1e-12).all()
            np.testing.assert_allclose(shares.sum(axis=0), 1, atol=1e-12)
    reached = np.concatenate([film.section(0).control_points for film in limit.films])
    assert {tuple(point) for point in reached} == {tuple(point) for point in points[[0, 1, 4]]}


@pytest.mark.parametrize(("patch", "moves"), FILMS[2:])
def test_films_span_from_the_boundary_that_stays_to_the_merged_one(patch, moves):
    limit = knot_limit(patch, moves)
    for film in limit.films:
        if film.along is None:
            continue
        # Knots that move along the edge are merged at both ends of the film.
        along = any(patch.domain.incidence[k, film.face.index] for k in moves)
        for z, owner in ((1.0, limit.merged), (0.0, patch)):
            section, edge = film.section(z), owner.boundary(film.face.index)
            t = np.linspace(0, 1, 9)
            points = [linear_points(curve, t[:, None] * curve.domain.vertices[1]) for curve in (section, edge)]
            if z == 1.0 or not along:
                np.testing.assert_allclose(*points, atol=1e-11)


def torus_points(patch: Patch, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points of a patch at torus coordinates of all magnitudes and directions, straight from the definition."""
    d = patch.dimension
    direction = rng.standard_normal((d, count))
    s = direction / np.linalg.norm(direction, axis=0) * 10 ** rng.uniform(-1, 6, count) / patch.domain.size
    e = (patch.knots - patch.domain.center) @ s + patch.log_products[:, None]
    e = np.exp(np.maximum(e - e.max(axis=0), -700))
    return (e.T @ patch.control_points) / e.sum(axis=0)[:, None]


@pytest.mark.parametrize(("patch", "moves"), mostly_long(FILMS, 3))
def test_the_limit_as_a_set_is_the_merged_patch_with_its_films(patch, moves):
    """Scattered points of patches near the end are near it, the nearer the nearer to the end, and not near less."""
    limit = knot_limit(patch, moves)
    merged = tessellate(limit.merged, 2000 if patch.dimension == 1 else 80, parametrization="linear")
    film = film_mesh(limit)
    plain = NearestCells(merged.vertices[merged.cells])
    whole = NearestCells(np.concatenate([merged.vertices[merged.cells], film.vertices[film.cells]]))
    size = float(np.ptp(patch.control_points, axis=0).max())
    farthest = []
    for tree, ends in ((whole, (1e-1, 1e-2, 1e-4)), (plain, (1e-4,))):
        for end in ends:
            points = torus_points(move_knots(patch, moves, 1 - end), 3000, np.random.default_rng(7))
            farthest.append(float(tree.nearest(points)[0].max()) / size)
    assert farthest[0] > 2 * farthest[1]
    assert farthest[2] < 3e-3  # chords of the meshes
    assert farthest[3] > 5 * farthest[2]


@pytest.mark.parametrize("name", ["example-4.4", "example-3.4", "pentagon"])
def test_the_limit_of_a_sequence_is_the_mesh_of_the_control_surface(name):
    """The one joins cells by the decomposition, the other by their edges' curves: the same vertices and cells."""
    patch = spec(name)
    limit = degeneration(patch, [], resolution=3, normals=False, distances=False).meshes[-1]
    model = tessellate(regular_control_surface(patch), 3, normals=False)
    np.testing.assert_array_equal(model.cells, limit.cells)
    np.testing.assert_array_equal(model.vertices, limit.vertices)
