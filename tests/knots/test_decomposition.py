"""Regular decompositions against the paper, exact brute force in `fractions`, and scipy's hull."""

from fractions import Fraction
from itertools import combinations, pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import control_net, lifting_of_knot, regular_decomposition
from tests.marks import mostly_long
from tests.tables import cases

# Knots Ã of Examples 4.1 and 4.4, and the lifting of mathematics.md section 7.
PENTAGON = np.array([[0, 2], [1, 2], [0, 6 / 5], [8 / 7, 8 / 7], [2, 1], [0, 0], [6 / 5, 0], [2, 0]])
PENTAGON_LIFTING = np.array([1.0, 0, 3, 2, 0, 1, 3, 1])
PENTAGON_CELLS = ((0, 1, 2, 3), (1, 3, 4), (2, 3, 6), (2, 5, 6), (3, 4, 6, 7))

CURVE = np.array([0, sqrt(2) / 4, 1 / 2, sqrt(2) / 2, 1])  # Example 3.4

GRID = np.array([[x, y] for x in range(3) for y in range(3)], dtype=float)
GRID_CENTRE = 4

CASES = 100  # random cases per brute-force test
ROUNDING = 1e-12  # of the largest term: a dozen roundings and some cancellation between knots of similar size
GAP = 1e-9  # of the lifting's range: to be told apart
NOISE = 1e-15  # of the lifting's range: a few units in the last place, not to be told apart


def brute_force(knots, lifting):
    """Cells and absent knots by trying every line or plane through d + 1 knots, in exact rationals."""
    n, d = len(knots), len(knots[0])
    cells = set()
    for chosen in combinations(range(n), d + 1):
        a, *others = chosen
        rows = [[q - p for p, q in zip(knots[a], knots[b], strict=True)] for b in others]
        rises = [lifting[b] - lifting[a] for b in others]
        determinant = rows[0][0] if d == 1 else rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
        if determinant == 0:
            continue
        if d == 1:
            gradient = [Fraction(rises[0]) / determinant]
        else:
            minors = rises[0] * rows[1][1] - rises[1] * rows[0][1], rises[1] * rows[0][0] - rises[0] * rows[1][0]
            gradient = [Fraction(minor) / determinant for minor in minors]
        gaps = [
            lifting[a] + sum(g * (q - p) for g, p, q in zip(gradient, knots[a], knot, strict=True)) - value
            for knot, value in zip(knots, lifting, strict=True)
        ]
        if min(gaps) >= 0:
            cells.add(tuple(i for i in range(n) if gaps[i] == 0))
    present = {i for cell in cells for i in cell}
    return tuple(sorted(cells)), tuple(i for i in range(n) if i not in present)


def random_case(rng, d):
    """Small rationals, with several knots on most faces, repeated knots, and knots below the hull."""
    n = int(rng.integers(d + 1, 11))
    places = rng.integers(0, (5, 9)[d == 1], (n, d))
    squares = (places**2).sum(axis=1)
    folds = sum(np.minimum(0, places @ rng.integers(-2, 3, d) - rng.integers(-2, 4)) for _ in range(2))
    lifting = (rng.integers(0, 4, n), -squares, folds, folds + rng.integers(-1, 1, n), squares)[rng.integers(5)]
    divisor, lifting_divisor = (int(rng.choice([1, 1, 3, 7])) for _ in range(2))
    exact_knots = [tuple(Fraction(int(x), divisor) for x in place) for place in places]
    exact_lifting = [Fraction(int(x), lifting_divisor) for x in lifting]
    return exact_knots, exact_lifting


def random_cases(seed, d, count):
    rng = np.random.default_rng(seed)
    found = 0
    while found < count:
        knots, lifting = random_case(rng, d)
        centered = np.array(knots, dtype=float) - np.array(knots[0], dtype=float)
        if np.linalg.matrix_rank(centered) == d:
            found += 1
            yield knots, lifting, rng


def area(points):
    x, y = (points - points[0]).T
    return (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def assert_tiles(decomposition):
    """Polygons are counter-clockwise, fill the hull, and meet edge to edge."""
    from scipy.spatial import ConvexHull

    knots = decomposition.knots
    areas = [area(knots[list(polygon)]) for polygon in decomposition.polygons]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(ConvexHull(knots - knots[0]).volume, rel=1e-7)  # knots at 1e7 are 2e-9 apart
    borders = [pair for polygon in decomposition.polygons for pair in pairwise([*polygon, polygon[0]])]
    assert len(set(borders)) == len(borders)
    outer = {(a, b) for a, b in borders if (b, a) not in set(borders)}
    assert sorted(a for a, _ in outer) == sorted(b for _, b in outer)
    length = sum(np.hypot(*(knots[b] - knots[a])) for a, b in outer)
    assert length == pytest.approx(ConvexHull(knots - knots[0]).area, rel=1e-7)
    for cell, polygon in zip(decomposition.cells, decomposition.polygons, strict=True):
        assert set(polygon) <= set(cell)


def assert_planes(decomposition):
    """λ = <g_F, a> + o_F on each cell, less elsewhere."""
    knots, lifting = decomposition.knots, decomposition.lifting
    for k, cell in enumerate(decomposition.cells):
        g, o = decomposition.gradients[k], decomposition.offsets[k]
        size = np.abs(knots).max(axis=0) @ np.abs(g) + abs(o) + np.abs(lifting).max()
        plane = knots @ g + o
        gaps = plane - lifting
        assert np.abs(gaps[list(cell)]).max() <= ROUNDING * size
        assert gaps.min() >= -ROUNDING * size
        np.testing.assert_allclose(decomposition.gaps(k), gaps, rtol=0, atol=ROUNDING * size)
        assert (decomposition.gaps(k)[list(cell)] == 0).all()


ANGLES = 2 * pi * np.arange(5) / 5
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
SIDES = [tuple(sorted((k, (k + 1) % 5, k + 5, (k + 1) % 5 + 5))) for k in range(5)]
TRIANGLE = [[0, 0], [1, 0], [0.5, 1]]
ROUNDED = 0.1 + 0.2  # 0.30000000000000004
WHOLE = tuple(range(9))

# Knots and lifting, then cells; knots in none are absent.
EXAMPLES = {
    "example 3.4": (CURVE, [2, 1, 5, 9 - 4 * sqrt(2), 1], ((0, 2), (2, 3, 4))),
    "concave curve": (CURVE, [0, 2.5, 3, 2.5, 0], ((0, 1), (1, 2), (2, 3), (3, 4))),
    "two low knots": (CURVE, [1, 3, 1, 0, 1], ((0, 1), (1, 4))),
    "affine on a curve": (CURVE, 0.3 * CURVE - 0.1, ((0, 1, 2, 3, 4),)),
    "example 4.4": (PENTAGON, PENTAGON_LIFTING, PENTAGON_CELLS),
    "constant": (GRID, np.zeros(9), (WHOLE,)),
    "constant that is rounded": (GRID, np.full(9, 0.1), (WHOLE,)),
    "affine": (GRID, GRID @ [1, 2], (WHOLE,)),
    "affine to rounding": (GRID, GRID @ [0.1, 0.7] + 1 / 3, (WHOLE,)),
    "steep": (GRID, GRID @ [1e6, -1e5], (WHOLE,)),
    "roof": (GRID, -0.1 * np.abs(GRID[:, 0] - 1), ((0, 1, 2, 3, 4, 5), (3, 4, 5, 6, 7, 8))),
    "pyramid": (GRID, -0.7 * np.abs(GRID - 1).max(axis=1), ((0, 1, 2, 4), (0, 3, 4, 6), (2, 4, 5, 8), (4, 6, 7, 8))),
    "quadrilaterals": (GRID, -0.3 * (GRID**2).sum(axis=1), ((0, 1, 3, 4), (1, 2, 4, 5), (3, 4, 6, 7), (4, 5, 7, 8))),
    "pentagonal face with a knot inside": (
        np.concatenate([RING, 2 * RING, [[0.1, 0.05], [0.2, -0.1]]]),
        np.concatenate([np.full(5, 0.7), np.zeros(5), [0.7, 0.6]]), tuple(sorted([(0, 1, 2, 3, 4, 10), *SIDES])),
    ),
    "repeated knots count where they are highest": (
        [[0, 0], [1, 0], [0, 1], [1, 0], [0, 1], [1, 0], [1, 1]], [0.1, 0.2, 0.3, 0.2, 0.1, 0.1, 0],
        ((0, 1, 2, 3), (1, 2, 3, 6)),
    ),
    "repeated knots of a curve": ([0, 0.5, 0.5, 0.5, 1, 0], [0, 1, 0.9, 1, 0, -1], ((0, 1, 3), (1, 3, 4))),
    "copies of a corner apart by rounding": (
        [[0, 0], [0.3, 0], [ROUNDED, 0], [0, 1], [ROUNDED, 1], [0.3, 1]], [0, 1, 0, 0, 1, 1], ((0, 1, 3, 4, 5),),
    ),
    "low knots beside the hull by rounding": (
        [*TRIANGLE, [0.3, 1e-17], [0.6, -1e-17], [0.25, 0.5]], [0.1, 0.1, 0.1, -3, -5, -1], ((0, 1, 2),),
    ),
    **{
        f"high knot {offset} beside the hull": (
            [*TRIANGLE, [0.3, offset]], [0.1, 0.1, 0.1, 3], ((0, 2, 3), (1, 2, 3)),
        )
        for offset in (1e-17, 0.0, -1e-17)
    },
    # Integers are taken at their word: one is a billionth too low, the other 2^-30.
    "integers": ([[0, 0], [10**9, 0], [0, 10**9], [1, 1]], [0, 0, 0, -1], ((0, 1, 2),)),
    "integers of a curve": ([0, 1, 2**30], [0, 1, 2**30 + 1], ((0, 2),)),
    # Property (g): the polyline, or the fan, over one knot.
    **{f"knot {k} of a curve to infinity": (CURVE, lifting_of_knot(5, k), ((0, k), (k, 4))) for k in (1, 2, 3)},
    "knot 3 to infinity": (
        PENTAGON, lifting_of_knot(8, 3), ((0, 1, 3), (0, 2, 3, 5), (1, 3, 4), (3, 4, 7), (3, 5, 6, 7)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples(name):
    knots, lifting, cells = EXAMPLES[name]
    decomposition = regular_decomposition(knots, lifting)
    assert decomposition.cells == cells
    assert set(decomposition.absent) == set(range(len(lifting))) - {i for cell in cells for i in cell}
    assert_planes(decomposition)
    if decomposition.dimension == 2:
        assert_tiles(decomposition)


POLYGONS = {
    "example 4.4": ((3, 1, 0, 2), (4, 1, 3), (6, 3, 2), (5, 6, 2), (6, 7, 4, 3)),
    "affine": ((0, 6, 8, 2),),
    "repeated knots count where they are highest": ((0, 1, 2), (1, 6, 2)),
}
NETS = {
    "example 4.4": [
        (0, 1), (0, 2), (1, 3), (1, 4), (2, 3), (2, 5), (2, 6), (3, 4), (3, 6), (4, 7), (5, 6), (6, 7),
    ],
    "affine": [(0, 1), (0, 3), (1, 2), (2, 5), (3, 6), (5, 8), (6, 7), (7, 8)],  # the border, at each of its knots
    "affine on a curve": [(0, 1), (1, 2), (2, 3), (3, 4)],
    "repeated knots count where they are highest": [(0, 1), (0, 2), (1, 2), (1, 6), (2, 6)],
    "repeated knots of a curve": [(0, 1), (1, 4)],
}  # fmt: skip


@pytest.mark.parametrize("name", NETS)
def test_polygons_and_control_nets(name):
    decomposition = regular_decomposition(*EXAMPLES[name][:2])
    assert control_net(decomposition) == NETS[name]
    assert name not in POLYGONS or decomposition.polygons == POLYGONS[name]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("height", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("affine", [0.0, 1.0, 1e3])
def test_gaps_of_1e_9_are_told_apart_and_rounding_is_not(scale, height, affine):
    lifting = -np.abs(GRID[:, 0] - 1) * 0.5 + affine * (GRID @ [0.3, 0.9])  # range 0.5, the centre on the fold
    knots = GRID * scale
    bump = np.arange(9) == GRID_CENTRE

    def cells(gap):
        found = regular_decomposition(knots, (lifting + gap * 0.5 * bump) * height)
        return found.cells, found.absent

    roof = ((0, 1, 2, 3, 4, 5), (3, 4, 5, 6, 7, 8)), ()
    assert cells(0) == cells(NOISE) == cells(-NOISE) == roof
    assert cells(-GAP) == (((0, 1, 2, 3, 5), (3, 5, 6, 7, 8)), (4,))
    raised, absent = cells(GAP)
    assert raised == ((0, 1, 2, 4), (0, 3, 4), (2, 4, 5), (3, 4, 6), (4, 5, 8), (4, 6, 7, 8))
    assert absent == ()


@pytest.mark.parametrize("d", [1, 2])
@pytest.mark.parametrize("count", mostly_long([CASES // 5, CASES]))
@pytest.mark.parametrize("rounds", [False, True])
def test_brute_force_in_fractions(count, d, rounds):
    """Scaled, rotated, shifted knots and tilted liftings are coplanar up to rounding only."""
    for knots, lifting, rng in random_cases(20 + 20 * rounds + d, d, count):
        points, heights = np.array(knots, dtype=float), np.array(lifting, dtype=float)
        if rounds:
            angle = rng.uniform(0, 2 * pi)
            rotation = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])[:d, :d] if d == 2 else np.eye(1)
            tilt = rng.choice([0, 1, 1e3, 1e5]) * (points @ rng.standard_normal(d) + rng.standard_normal())
            scale, height, shift = 10.0 ** rng.integers(-6, 7), 10.0 ** rng.integers(-6, 7), rng.choice([0, 0, 1e3])
            points, heights = (points @ rotation + shift) * scale, (pi * heights + tilt) * height
        found = regular_decomposition(points, heights)
        assert (found.cells, found.absent) == brute_force(knots, lifting)
        assert_planes(found)
        if d == 2:
            assert_tiles(found)


@pytest.mark.parametrize("n", mostly_long([60, 300]))
@pytest.mark.parametrize("concave", [True, False])
def test_scipy_hull_of_generic_liftings(n, concave):
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(n)
    knots = rng.random((n, 2))
    lifting = -(knots**2).sum(axis=1) if concave else rng.random(n)
    hull = ConvexHull(np.column_stack([knots, lifting]))
    upper = hull.simplices[hull.equations[:, 2] > 0]
    decomposition = regular_decomposition(knots, lifting)
    assert decomposition.cells == tuple(sorted(tuple(sorted(cell)) for cell in upper.tolist()))
    assert_tiles(decomposition)


@pytest.mark.parametrize("k", [-1, 8])
def test_lifting_of_a_knot_that_is_not_there(k):
    with pytest.raises(DomainError, match=r"expected an index from 0 to 7, got"):
        lifting_of_knot(8, k)


@pytest.mark.parametrize(("arguments", "message"), cases("knots/refused", "decomposition"))
def test_refused_input(arguments, message):
    with pytest.raises(DomainError, match=message):
        regular_decomposition(*arguments)


def test_neighbours_of_a_border_agree_on_its_corners():
    """Gaps of a few 1e-13 on the fold x = 1/2: joined on its left, where knot 5 is inside a side, not on its right."""
    knots = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [0.5, 0.5], [0.5, 1], [1.5, 0], [0, 1], [0.5, 1.5]])
    steps = np.array([-2, -2, -1, 2, -2, 1, 2, -3, -2])
    decomposition = regular_decomposition(knots, -np.abs(knots[:, 0] - 1) + 1e-13 * steps)
    assert decomposition.cells[0] == (0, 3, 4, 5, 7, 8)
    assert set(decomposition.polygons[0]) == {0, 3, 4, 5, 8}
    assert_tiles(decomposition)


def test_neighbours_of_a_border_agree_on_its_knots():
    """Knot 7 is knot 1 again, lower by a gap that one of the two cells there would forgive."""
    knots = np.array([[0, 0], [2, 0], [2, 2], [0, 2], [2, 2], [2, 1], [0, 1.5], [2, 0], [0.5, 1]])
    steps = np.array([-1, 0, 0, -1, 2, 3, -1, -3, 0])
    decomposition = regular_decomposition(knots, -np.abs(knots[:, 0] - 1) + 1e-13 * steps)
    assert decomposition.cells == ((0, 1, 7, 8), (0, 3, 6, 8), (1, 2, 4, 5, 7, 8), (2, 3, 4, 8))


@given(st.integers(0, 2**32 - 1), st.floats(-17, -6), st.sampled_from([0.0, 1e-16, 1e-15]))
def test_cells_tile_whatever_the_noise(seed, exponent, shake):
    """Gaps between rounding and 1e-9 may go either way, but never break the tiling."""
    rng = np.random.default_rng(seed)
    knots = np.concatenate([GRID, rng.integers(0, 5, (12, 2)) / 2])
    lifting = (-np.abs(knots[:, 0] - 1), knots @ [1.0, 2.0], -(knots**2).sum(axis=1))[seed % 3]
    knots = knots + shake * rng.standard_normal(knots.shape)
    assert_tiles(regular_decomposition(knots, lifting + 10.0**exponent * rng.standard_normal(len(knots))))
