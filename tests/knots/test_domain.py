"""The hull of the knots, which knots lie on its edges, and the edge functions."""

import math
from fractions import Fraction
from itertools import permutations

import mpmath
import numpy as np
import pytest
from hypothesis import given

from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.hull import convex_hull
from gtb_cli.theory.patch import Patch
from tests.patches import NAMES, SHIFT, any_patch, named, regular
from tests.tables import cases

EPS = float(np.finfo(np.float64).eps)

HEIGHT_ERROR = 1e-12
"""Relative error of an edge function: 2^10 roundings where the exact difference takes over, and a few below."""

SCALES = [1e-9, 1e-3, 1.0, 1e3, 1e9]

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


def corners(knots, **options):
    return domain(knots, **options).vertices.tolist()


# The hull


def test_corners_run_counter_clockwise_from_the_lowest_then_leftmost():
    expected = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
    for order in permutations(SQUARE):
        assert corners(list(order)) == expected
    assert corners([[0, 1], [1, 0], [2, 3]]) == [[1, 0], [2, 3], [0, 1]]
    assert corners([[5, 1], [2, 0], [4, 0], [0, 3]])[:2] == [[2, 0], [4, 0]]


@pytest.mark.parametrize("scale", SCALES)
def test_nearly_level_corners_are_told_apart_beyond_rounding(scale):
    level = scale * np.array([[0, 1e-15], [1, 0], [0.5, 1]])
    tilted = scale * np.array([[0, 1e-9], [1, 0], [0.5, 1]])
    assert corners(level)[0] == level[0].tolist()
    assert corners(tilted)[0] == tilted[1].tolist()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shift", [0.0, 1.0, SHIFT])
def test_collinear_knots_stay_on_slanted_edges(scale, shift):
    hexagon = regular(6, 0.37)
    on_edges = [hexagon[j] * (1 - t) + hexagon[(j + 1) % 6] * t for j in range(6) for t in (1 / 3, 1 / math.pi, 0.999)]
    knots = scale * (np.vstack([on_edges, hexagon]) + np.array([shift, -shift]))
    shape = domain(knots)
    assert len(shape.vertices) == 6
    assert (shape.incidence[:18].sum(axis=1) == 1).all()
    assert (shape.incidence[18:].sum(axis=1) == 2).all()
    assert (shape.incidence.sum(axis=0) == 5).all()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("gap", "is_on_edge"), [(1e-11, False), (1e-14, True), (0.0, True), (-1e-14, True)])
def test_a_knot_is_on_an_edge_within_a_trillionth_of_the_size(scale, gap, is_on_edge):
    shape = domain(scale * np.array([*SQUARE, [1.3, 4 * gap], [4 - 4 * gap, 2.2]]))
    assert len(shape.vertices) == 4
    assert shape.incidence[4].tolist() == [is_on_edge, False, False, False]
    assert shape.incidence[5].tolist() == [False, is_on_edge, False, False]
    assert (shape.heights[4, 0] == 0) == is_on_edge


@pytest.mark.parametrize("scale", SCALES)
def test_a_knot_outside_an_edge_beyond_the_tolerance_is_a_corner(scale):
    assert len(domain(scale * np.array([*SQUARE, [2, -4e-11]])).vertices) == 5
    assert len(domain(scale * np.array([*SQUARE, [2, -4e-14]])).vertices) == 4


@pytest.mark.parametrize("scale", SCALES)
def test_flat_knots_are_refused(scale):
    direction = np.array([math.cos(1.1), math.sin(1.1)])
    knots = scale * np.outer([0, 1 / 3, 0.5, 1 / math.pi, 1], direction)
    with pytest.raises(DomainError, match="knots: all 5 lie on one line, their hull is flat"):
        domain(knots)
    with pytest.raises(DomainError, match="all 5 lie on one line"):
        domain(knots + np.array([SHIFT * scale, 0]))


@pytest.mark.parametrize("scale", SCALES)
def test_thin_hulls_are_hulls(scale):
    turn = np.array([[math.cos(0.7), math.sin(0.7)], [-math.sin(0.7), math.cos(0.7)]])
    shape = domain(scale * np.array([[0, 0], [1, 0], [0.5, 1e-9], [0.4, 0]]) @ turn)
    assert len(shape.vertices) == 3
    assert shape.incidence.sum(axis=1).tolist() == [2, 2, 2, 1]


def test_a_knot_near_a_sharp_corner_is_on_one_edge_only():
    # Within the tolerance of both edges, though a millionth of the size away from their corner.
    patch = Patch([[0, 0], [1, 0], [1, 1e-6], [1e-7, 0]], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [5, 5, 5]])
    assert patch.domain.incidence[3].tolist() == [True, False, False]
    assert (patch.domain.heights[3] > 0).tolist() == [False, True, True]
    assert patch.evaluate([[0, 0]]).tolist() == [[0, 0, 0]]


def test_repeated_corners_count_once_and_the_first_stands_for_all():
    knots = np.array([*SQUARE, *SQUARE, [4, 1e-15]])
    assert convex_hull(knots).tolist() == [0, 1, 2, 3]
    assert domain(knots).incidence[8].tolist() == [True, True, False, False]


@given(patch=any_patch(dimension=2))
def test_any_hull_is_convex_and_holds_its_knots(patch):
    shape = patch.domain
    v, r = shape.vertices, len(shape.vertices)
    edges = np.roll(v, -1, axis=0) - v
    following = np.roll(edges, -1, axis=0)
    assert (edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0).all()
    crosses = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    turn = np.arctan2(crosses, (edges * following).sum(axis=1)).sum()
    assert turn == pytest.approx(2 * math.pi)
    distances = ((patch.knots[:, None] - v) * shape.normals).sum(axis=2) / shape.normal_lengths
    assert distances.min() >= -1e-9 * shape.size
    assert distances[shape.incidence].max() <= 1e-9 * shape.size
    assert shape.incidence[(np.abs(distances) < 1e-13 * shape.size).any(axis=1)].any(axis=1).all()
    assert ((shape.heights == 0) == shape.incidence).all()
    assert v[0, 1] <= v[:, 1].min() + 1e-12 * shape.size + 8 * EPS * np.abs(v).max()
    for corner in range(r):
        here = (patch.knots == v[corner]).all(axis=1)
        assert here.any()
        assert (shape.incidence[here] == np.isin(np.arange(r), [corner, (corner - 1) % r])).all()
    assert (shape.incidence.sum(axis=0) >= 2).all()
    assert (shape.incidence.sum(axis=1) <= 2).all()


# Curves


def test_a_curve_takes_its_knots_in_the_order_given():
    shape = domain([3, 1, 2, 3])
    assert shape.dimension == 1
    assert shape.knots.tolist() == [[3], [1], [2], [3]]
    assert shape.vertices.tolist() == [[1], [3]]
    assert shape.incidence.tolist() == [[False, True], [True, False], [False, False], [False, True]]
    assert shape.heights.tolist() == [[2, 0], [0, 2], [1, 1], [2, 0]]
    assert shape.edge_knots(1).tolist() == [0, 3]


def test_a_curves_edge_functions_have_scales_of_their_own():
    shape = domain([0, 1, 4], edge_scale=[3, 0.5])
    assert shape.edge_functions([0, 1, 4]).tolist() == [[0, 2], [3, 1.5], [12, 0]]
    assert shape.edge_functions([[1]]).tolist() == [[3, 1.5]]


@pytest.mark.parametrize("edge_normals", ["auto", "unit", "primitive"])
def test_a_curve_has_one_convention_of_normals(edge_normals):
    assert domain([0.5, 2.25], edge_normals).normals.tolist() == [[1], [-1]]


# Normals and their scale


def test_lattice_polygons_have_the_papers_edge_functions():
    # Example 2.2: v, 2 − u, 3 − u − v, 2 − v, u.
    shape = named("pentagon").domain
    assert shape.vertices.tolist() == [[0, 0], [2, 0], [2, 1], [1, 2], [0, 2]]
    u, v = 0.3, 0.9
    assert shape.edge_functions([[u, v]])[0] == pytest.approx([v, 2 - u, 3 - u - v, 2 - v, u], rel=4 * EPS)


def test_primitive_normals_have_no_common_factor():
    shape = domain([[0, 0], [4, 0], [0, 6], [0.3, 0.4]])
    assert shape.normals.tolist() == [[0, 1], [-3, -2], [1, 0]]
    assert domain([[0, 0], [6, 3], [0, 9]], "primitive").normals.tolist() == [[-1, 2], [-1, -1], [1, 0]]


def test_normals_are_unit_if_asked_for_or_if_a_corner_is_not_an_integer_point():
    for shape in (domain([[0, 0], [4, 0], [0, 3.5]]), domain([[0, 0], [4, 0], [0, 3]], "unit")):
        assert shape.normal_lengths == pytest.approx(1, rel=2 * EPS)
    assert shape.normals[1] == pytest.approx([-0.6, -0.8], rel=2 * EPS)


def test_edge_scales_multiply():
    one = domain([[0, 0], [4, 0], [0, 3]], "unit")
    assert domain(one.knots, "unit", 2.5).normals == pytest.approx(2.5 * one.normals)
    each = domain(one.knots, "unit", [1, 2, 3])
    assert each.normals == pytest.approx(one.normals * [[1], [2], [3]])
    assert each.heights == pytest.approx(one.heights * [1, 2, 3])


@pytest.mark.parametrize("name", NAMES)
def test_normals_point_inwards_and_heights_are_edge_functions(name):
    shape = named(name).domain
    middle = shape.vertices.mean(axis=0)
    assert (((middle - shape.vertices) * shape.normals).sum(axis=1) > 0).all()
    found = shape.edge_functions(shape.knots[shape.incidence.sum(axis=1) < 2])
    expected = shape.heights[shape.incidence.sum(axis=1) < 2]
    tolerance = 16 * EPS * np.abs(shape.knots).max() * shape.normal_lengths.max()
    assert np.abs(found - expected).max(initial=0) <= tolerance


@pytest.mark.parametrize(("arguments", "message"), cases("knots/refused", "domain"))
def test_what_is_not_a_domain_is_refused(arguments, message):
    with pytest.raises(DomainError, match=f"^{message}"):
        domain(*arguments)


# Edge functions


def exact_height(shape, edge, u):
    """Distance from the line through two corners, in exact rationals up to the root."""
    a, b = ([Fraction(x) for x in shape.vertices[(edge + k) % len(shape.vertices)].tolist()] for k in (0, 1))
    p = [Fraction(x) for x in u.tolist()]
    cross = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    square = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    with mpmath.workdps(40):
        root = mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
        return mpmath.mpf(cross.numerator) / cross.denominator / root * float(shape.normal_lengths[edge])


@pytest.mark.parametrize("distance", [1e-12, 1e-9, 1e-6, 9e-4, 1.1e-3, 0.01, 0.1])
def test_edge_functions_have_a_small_relative_error_however_near_the_edge(distance):
    rng = np.random.default_rng(7)
    for case in range(24):
        knots = rng.normal(size=(5, 2)) * 10.0 ** rng.integers(-9, 10)
        shape = domain(knots, "unit", rng.uniform(0.1, 10))
        edge = int(rng.integers(len(shape.vertices)))
        end = shape.vertices[(edge + 1) % len(shape.vertices)]
        t = rng.uniform(0.3, 0.7)
        inward = shape.normals[edge] / shape.normal_lengths[edge]
        u = shape.vertices[edge] * (1 - t) + end * t + distance * shape.size * inward
        if (exact := exact_height(shape, edge, u)) <= 0:
            continue
        found = shape.edge_functions(u[None])[0, edge]
        assert abs(found / exact - 1) < HEIGHT_ERROR, case


def test_edge_functions_far_from_the_origin_lose_no_digits_of_what_is_given():
    shape = named("far_pentagon").domain
    rng = np.random.default_rng(8)
    for u in rng.dirichlet(np.ones(5), 30) @ shape.vertices:
        found = shape.edge_functions(u[None])[0]
        for edge in range(5):
            exact = exact_height(shape, edge, u)
            assert found[edge] == 0 or abs(found[edge] / exact - 1) < HEIGHT_ERROR


@pytest.mark.parametrize("scale", SCALES)
def test_parameters_on_an_edge_have_an_exact_zero(scale):
    shape = domain(scale * regular(7, 0.3))
    v = shape.vertices
    for t in (0.1, 1 / 3, 0.5, 0.999):
        on_edges = v * (1 - t) + np.roll(v, -1, axis=0) * t
        assert ((shape.edge_functions(on_edges) == 0) == np.eye(7, dtype=bool)).all()
    corner = np.eye(7, dtype=bool) | np.roll(np.eye(7, dtype=bool), -1, axis=1)
    assert ((shape.edge_functions(v) == 0) == corner).all()


@pytest.mark.parametrize("scale", SCALES)
def test_parameters_are_snapped_within_four_ulp_only(scale):
    shape = domain(scale * np.array(SQUARE, dtype=float), "unit")
    step = EPS * shape.size
    for gap in (-3, 3):
        assert shape.edge_functions([[2 * scale, gap * step]])[0, 0] == 0
        assert shape.edge_functions([[4 * scale + gap * step, scale]])[0, 1] == 0
    inside = shape.edge_functions([[2 * scale, 1e-12 * shape.size]])[0, 0]
    assert inside == pytest.approx(1e-12 * shape.size, rel=4 * EPS)
    assert shape.edge_functions([[2 * scale, 6 * step]])[0, 0] == pytest.approx(6 * step)
    with pytest.raises(DomainError, match=r"parameters\[0\]: .* is outside the domain, by up to"):
        shape.edge_functions([[2 * scale, -6 * step]])


def test_slanted_edges_are_snapped_within_four_ulp_only():
    shape = domain([[0, 0], [3, 1], [1, 4]], "unit")
    on_edge, inward = np.array([1.5, 0.5]), shape.normals[0]
    assert shape.edge_functions([on_edge - 2 * EPS * inward])[0, 0] == 0
    assert shape.edge_functions([on_edge + 1e-12 * inward])[0, 0] == pytest.approx(1e-12, rel=1e-3)
    with pytest.raises(DomainError, match="outside the domain, by up to 1e-12"):
        shape.edge_functions([on_edge - 1e-12 * inward])


@pytest.mark.parametrize(("u", "message"), cases("knots/refused", "parameters"))
@pytest.mark.parametrize("knots", [SQUARE, [[0, 0], [3, -1], [4, 3], [-1, 4]]])
def test_parameters_outside_are_refused(knots, u, message):
    with pytest.raises(DomainError, match=message):
        domain(knots).edge_functions(u)


def test_a_curves_parameters_are_checked_alike():
    shape = domain([0, 1, 3])
    assert shape.edge_functions([3 * (1 + 3 * EPS)])[0, 1] == 0
    assert shape.edge_functions([1e-12 * 3])[0, 0] == 3e-12
    for u, message in (([0, -1e-9], r"\[1\]: \(-1e-09\) is outside"), ([math.nan], r"\[0\]: must be finite")):
        with pytest.raises(DomainError, match=message):
            shape.edge_functions(u)


def test_parameters_of_a_curve_are_a_grid_of_numbers_and_those_of_a_surface_one_of_pairs():
    grids = [domain([0, 1, 3]).grid(u)[1] for u in (1, [1, 2], [[1], [2]], [[1, 2]], [[[1], [2]]])]
    assert grids == [(), (2,), (2,), (1, 2), (1, 2)]
    assert [domain(SQUARE).grid(u)[1] for u in ([1, 1], [[1, 1]], np.ones((3, 4, 2)))] == [(), (1,), (3, 4)]


def test_no_parameters_give_no_values():
    assert domain(SQUARE).edge_functions(np.empty((0, 2))).shape == (0, 4)
    assert domain([0, 1]).edge_functions([]).shape == (0, 2)


# Faces


HOUSE = domain([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [0.5, 0.5]])
SEGMENT = domain([0, 1, 3])


def test_a_surface_has_its_interior_edges_and_corners():
    kinds = [(face.dimension, face.index) for face in HOUSE.faces]
    assert kinds == [(2, 0), *((1, j) for j in range(4)), *((0, k) for k in range(4))]
    assert [face.number for face in HOUSE.faces] == list(range(9))
    assert len(HOUSE.faces) == 9
    assert HOUSE.faces[INTERIOR].is_interior
    assert HOUSE.faces[INTERIOR].knots.all()
    assert HOUSE.faces.edge(0).knots.tolist() == [True, True, False, False, True, False]
    assert HOUSE.faces.corner(1).knots.tolist() == [False, True, False, False, False, False]
    assert HOUSE.faces.corner(0).facets.tolist() == [0, 3]


def test_the_ends_of_a_curve_are_corners():
    assert [(face.dimension, face.index) for face in SEGMENT.faces] == [(1, 0), (0, 0), (0, 1)]
    assert SEGMENT.faces.edge(1) is SEGMENT.faces.corner(1)
    assert SEGMENT.faces.corner(1).is_corner


def test_the_smallest_face_holds_all_of_some_knots():
    faces = HOUSE.faces
    assert faces.smallest([0, 4]) is faces.edge(0)
    assert faces.smallest(4) is faces.edge(0)
    assert faces.smallest(1) is faces.corner(1)
    assert faces.smallest([0, 2]).is_interior
    assert faces.smallest(np.array([5])).is_interior


@pytest.mark.parametrize("name", NAMES)
def test_each_parameter_lies_on_one_face_and_knots_on_those_where_edge_functions_vanish(name):
    shape = named(name).domain
    v, middle = shape.vertices, shape.vertices.mean(axis=0)
    edges = (v + np.roll(v, -1, axis=0)) / 2 if shape.dimension == 2 else v[:0]
    numbers = shape.faces.at(shape.heights_of_columns(np.vstack([middle, edges, v])))
    assert numbers.tolist() == [face.number for face in shape.faces] == list(range(len(shape.faces)))
    assert (shape.heights_of_columns(v).T == 0).tolist() == shape.faces.vanishing[numbers[-len(v) :]].tolist()
    for face, vanishing in zip(shape.faces, shape.faces.vanishing, strict=True):
        assert face.facets.tolist() == np.flatnonzero(vanishing).tolist()
        assert face.knots.tolist() == (shape.heights[:, vanishing] == 0).all(axis=1).tolist()


def test_knots_are_measured_along_an_edge():
    shape = domain([[0, 0], [3, 4], [-4, 3], [1.5, 2], [0.6, 0.8]])
    assert shape.edge_knots(0).tolist() == [0, 4, 3, 1]
    assert shape.along(0, shape.knots[[0, 4, 3, 1]]) == pytest.approx([0, 1, 2.5, 5])
    assert shape.direction(0) == pytest.approx([0.6, 0.8])
    assert shape.size == 7
    assert shape.center.tolist() == [-0.5, 2]
