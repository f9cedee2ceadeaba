"""All regular decompositions: known numbers, laws of the secondary fan, and brute force."""

from fractions import Fraction
from itertools import combinations, islice
from math import cos, pi, sin

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.knots.all_decompositions import regular_decompositions
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.knots.polyhedral_cones import extreme_rays
from tests.knots.test_decomposition import GRID, brute_force
from tests.marks import long, mostly_long

CUBIC = 1e-9 * np.array([[x, y] for x in range(4) for y in range(4 - x)])
TURN = 1e9 * np.array([[cos(0.3), sin(0.3)], [-sin(0.3), cos(0.3)]])
CATALAN = [(3, 1, 1), (4, 2, 3), (5, 5, 11), (6, 14, 45)]


def polygon(n, radius=1.0, turn=0.0):
    angles = 2 * pi * np.arange(n) / n + turn
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def test_the_rays_of_a_cone_are_where_its_planes_meet():
    """Over a cube with one side twice, a cut through three of its corners, and a cut across the edge between two."""
    cube = [[s * (i == k) for i in range(3)] + [1] for k in range(3) for s in (1, -1)]
    rows = [*cube, cube[1], [-1, -1, -1, 1], [0, -1, 1, 1]]
    corners = set()
    for planes in map(np.array, combinations(rows, 3)):
        if abs(np.linalg.det(planes[:, :3])) > 0.5:
            place = np.linalg.solve(planes[:, :3], -planes[:, 3])
            if (np.array(rows) @ [*place, 1] > -1e-9).all():
                corners.add(tuple(np.round(place, 6) + 0.0))
    rays = np.array(extreme_rays(rows, 4, 0.0))
    assert sorted(map(tuple, rays[:, :3] / rays[:, 3:] + 0.0)) == sorted(corners)


def numbers(knots):
    """How many triangulations and decompositions there are; each is checked with its lifting."""
    found = list(regular_decompositions(knots))
    n, d = len(knots), np.asarray(knots).ndim
    for cone in found:
        decomposition = regular_decomposition(knots, cone.lifting)
        assert (decomposition.cells, decomposition.absent) == (cone.cells, cone.absent)
        assert cone.used == n - len(cone.absent)
        assert bool(cone.flips) == (cone.dimension == n > d + 1)
    by_cells = {cone.cells: cone for cone in found}
    assert len(by_cells) == len(found)
    finest = {cone.cells for cone in found if cone.dimension == n}
    assert {cone.cells for cone in regular_decompositions(knots, triangulations=True)} == finest
    for cells in finest:
        assert all(cells in by_cells[other].flips for other in by_cells[cells].flips)
    # The cones are the faces of a polytope turned over, the secondary polytope, for which Euler's relation holds.
    assert sum((-1) ** (n - cone.dimension) for cone in found) == 1
    assert min(cone.dimension for cone in found) == d + 1
    return len(finest), len(found)


@pytest.mark.parametrize(
    ("scale", "n", "count", "all_count"),
    mostly_long([*((scale, *each) for scale in (1, 1e-9, 1e9) for each in CATALAN), (1, 7, 42, 197)], len(CATALAN)),
)
def test_convex_polygons_have_catalan_and_schroeder_numbers(scale, n, count, all_count):
    assert numbers(scale * polygon(n)) == (count, all_count)


@pytest.mark.parametrize("n", mostly_long([2, 3, 5, 7], 3))
def test_a_curve_bends_at_each_inner_knot_or_is_straight_there_or_leaves_it_out(n):
    assert numbers(np.sqrt(np.arange(n))[::-1]) == (2 ** (n - 2), 3 ** (n - 2))
    assert numbers(np.arange(n) * 3) == (2 ** (n - 2), 3 ** (n - 2))


@pytest.mark.parametrize(
    ("knots", "count"),
    [
        ([[0, 0], [1, 0], [0, 1], [1, 0]], (2, 3)),  # one copy, the other, or both
        ([0, 0, 0, 1], (3, 7)),  # the faces of a triangle
        ([[0, 0], [1, 0], [2, 0], [0, 1]], (2, 3)),  # the knot inside an edge: bent, flat, left out
        ([[0, 0], [0.1, 0.3], [0.2, 0.6], [0.3, 0.9], [0, 1]], (4, 9)),  # collinear to rounding
        pytest.param([*polygon(6), [0, 0]], (32, 155), marks=long),
    ],
)
def test_repeated_and_collinear_knots(knots, count):
    assert numbers(knots) == count


@pytest.mark.parametrize("small", [[[2, 1, 1], [1, 2, 1], [1, 1, 2]]])
def test_two_concentric_triangles_have_two_triangulations_that_are_not_regular(small):
    """Both turn around the middle; in rounded coordinates one of them is regular by 1e-16."""
    whole = np.array([[4, 0, 0], [0, 4, 0], [0, 0, 4], *small])[:, :2]
    assert numbers(whole) == numbers(np.concatenate([polygon(3, 1, 0.1), polygon(3, 0.25, 0.1)])) == (16, 51)


@pytest.mark.parametrize(
    ("knots", "count"),
    mostly_long([(GRID + 1e4, 387), (GRID @ TURN, 387), (GRID @ [[1, 0.3], [0, 1 / 3]] + 1e4, 387), (CUBIC, 1166)]),
)
def test_lattices_scaled_turned_and_shifted(knots, count):
    assert sum(1 for _ in islice(regular_decompositions(knots, triangulations=True), 1200)) == count


def test_drops_at_all_facets_are_equal_if_the_cone_is_simplicial():
    for cone in regular_decompositions(polygon(6), triangulations=True):
        gaps = [regular_decomposition(polygon(6), cone.lifting).gaps(k) for k in range(4)]
        drops = []
        for k, j in combinations(range(4), 2):
            there, here = ({*cone.cells[a]} - {*cone.cells[b]} for a, b in ((k, j), (j, k)))
            if len(here) == 1:
                drops.append(min(gaps[k][here.pop()], gaps[j][there.pop()]))
        assert len(drops) == 3
        assert max(drops) <= min(drops) * (1 + 1e-9)


@pytest.mark.parametrize(("n", "seed"), mostly_long([(5, 0), (6, 1), (6, 4)]))
@pytest.mark.parametrize("whole", [False, True])
def test_brute_force(n, seed, whole):
    """By brute force; liftings of few different heights leave knots level, and most of many heights make triangles."""
    rng = np.random.default_rng(seed)
    places = rng.permutation(16)[:n]
    knots = np.column_stack([places // 4, places % 4]).astype(float) if whole else rng.random((n, 2))
    numbers(knots)
    cells = {cone.cells for cone in regular_decompositions(knots)}
    exact = [tuple(map(Fraction, knot)) for knot in knots.tolist()]
    for most in [4, 1000] * 40:
        lifting = [Fraction(int(x)) for x in rng.integers(0, most, n)]
        assert brute_force(exact, lifting)[0] in cells


def test_a_walk_can_be_left_at_any_time():
    knots = [[x, y] for x in range(4) for y in range(4)]
    assert len(list(islice(regular_decompositions(knots), 20))) == 20


def test_flat_knots_are_refused():
    with pytest.raises(DomainError, match="one line"):
        next(regular_decompositions([[0, 0], [1, 1], [2, 2], [3, 3]]))
