"""Triangles that pass through others, against exact arithmetic for all pairs."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest

from gtb_cli.solids.crossings import crossing_pairs
from tests.marks import mostly_long


def minus(p, q):
    return [x - y for x, y in zip(p, q, strict=True)]


def dot(u, v):
    return sum(x * y for x, y in zip(u, v, strict=True))


def cross(u, v):
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def at(p, q, share):
    return [x + share * (y - x) for x, y in zip(p, q, strict=True)]


def clipped(polygon, heights):
    """The part of a convex polygon with heights ≥ 0."""
    result = []
    for k in range(len(polygon)):
        if heights[k - 1] * heights[k] < 0:
            result.append(at(polygon[k - 1], polygon[k], heights[k - 1] / (heights[k - 1] - heights[k])))
        if heights[k] >= 0:
            result.append(polygon[k])
    return result


def crosses(one, other):
    """Whether triangles with areas have inner points in common: along a segment, or an area in one plane; exact."""
    ours, theirs = (cross(minus(t[1], t[0]), minus(t[2], t[0])) for t in (one, other))
    if not any(ours) or not any(theirs):
        return False
    over, back = [dot(minus(p, one[0]), ours) for p in other], [dot(minus(p, other[0]), theirs) for p in one]
    if not any(over):
        common = one
        for k in range(3):
            inwards = cross(theirs, minus(other[k], other[k - 1]))
            common = clipped(common, [dot(minus(p, other[k]), inwards) for p in common])
        return any(any(cross(minus(p, common[0]), minus(q, common[0]))) for p, q in combinations(common, 2))
    if not (min(over) < 0 < max(over) and min(back) < 0 < max(back)):
        return False
    line = cross(ours, theirs)
    first, second = (
        [dot(p, line) for p in clipped(clipped(t, h), [-x for x in clipped_heights(h)])]
        for t, h in ((other, over), (one, back))
    )
    return min(max(first), max(second)) > max(min(first), min(second))


def clipped_heights(heights):
    """The heights of the corners of `clipped`."""
    return [row[0] for row in clipped([[height] for height in heights], heights)]


def passes(one, other, beside_one, beside_other):
    """Whether triangles that touch along a segment belong to surfaces that pass through each other there; exact.

    `beside` gives the third corners of neighbours, by the corner opposite to the common edge.
    """
    normal = cross(minus(one[1], one[0]), minus(one[2], one[0]))
    heights = [dot(minus(p, one[0]), normal) for p in other]
    if heights.count(0) != 2:
        return False
    (apex,) = (k for k in range(3) if heights[k])
    start, end = common = [other[apex - 2], other[apex - 1]]
    along = minus(end, start)
    for k in range(3):
        inwards = cross(normal, minus(one[k], one[k - 1]))
        common = clipped(common, [dot(minus(p, one[k]), inwards) for p in common])
    if not common or min(common) == max(common) or apex not in beside_other:
        return False
    middle = at(min(common), max(common), Fraction(1, 2))
    ours = [cross(normal, along), cross(along, normal)]
    for k in range(3):
        if not any(cross(minus(middle, one[k]), minus(one[k - 1], one[k]))):
            if (k + 1) % 3 not in beside_one:
                return False
            ours = [minus(one[(k + 1) % 3], start), minus(beside_one[(k + 1) % 3], start)]
    frame = [cross(along, normal), cross(along, cross(along, normal))]
    theirs = [minus(other[apex], start), minus(beside_other[apex], start)]
    (a, b), (c, d) = ([[dot(v, axis) for axis in frame] for v in vectors] for vectors in (ours, theirs))
    return (is_between(c, a, b) and is_between(d, b, a)) or (is_between(d, a, b) and is_between(c, b, a))


def is_between(v, a, b):
    """Whether a vector of the plane is inside the sector from a to b, counter-clockwise."""
    det = a[0] * b[1] - a[1] * b[0]
    after, before = a[0] * v[1] - a[1] * v[0], v[0] * b[1] - v[1] * b[0]
    return (after > 0 or before > 0) if det < 0 else (after > 0 and (before > 0 or not det))


def neighbours(cells):
    """The opposite corner of the only neighbour across the edge opposite to each corner of each triangle."""
    edges = {}
    for i, cell in enumerate(cells):
        for k in range(3):
            if len(set(cell)) == 3:
                edges.setdefault(frozenset((cell[k - 2], cell[k - 1])), []).append((i, k))
    result = [{} for _ in cells]
    for (i, k), (j, m) in (pair for pair in edges.values() if len(pair) == 2):
        result[i][k], result[j][m] = (j, m), (i, k)
    return result


def exact_pairs(vertices, cells):
    """Every pair, one after the other."""
    points = [[Fraction(x) for x in row] for row in vertices.tolist()]
    triangles = [[points[k] for k in cell] for cell in cells.tolist()]
    beside = [
        {k: triangles[j][m] for k, (j, m) in {**ours, **theirs}.items()}
        for ours, theirs in zip(
            neighbours(cells.tolist()), neighbours([[tuple(p) for p in t] for t in triangles]), strict=True
        )
    ]
    return [
        [i, j]
        for i, j in combinations(range(len(cells)), 2)
        if crosses(triangles[i], triangles[j])
        or passes(triangles[i], triangles[j], beside[i], beside[j])
        or passes(triangles[j], triangles[i], beside[j], beside[i])
    ]


@pytest.mark.parametrize(("seed", "scale", "shift"), [(0, 1, 0), (1, 1e-9, 0), (2, 1e9, 0), (3, 1, 1e7)])
def test_random_triangles_cross_as_exact_arithmetic_says(seed, scale, shift):
    rng = np.random.default_rng(seed)
    middles = 0.7 * rng.random((20, 1, 3))
    vertices = ((middles + 0.4 * rng.normal(size=(20, 3, 3))).reshape(-1, 3)) * scale + shift
    cells = np.arange(60).reshape(20, 3)
    cells[1:4, 0] = cells[0, 0]  # some of them share a vertex
    pairs, is_complete = crossing_pairs(vertices, cells)
    assert is_complete
    assert sorted(pairs.tolist()) == exact_pairs(vertices, cells)
    assert len(pairs) > 10


@pytest.mark.parametrize("seed", mostly_long(range(12), 2))
def test_triangles_of_a_small_lattice_cross_as_exact_arithmetic_says(seed):
    """Most of them touch: in corners, in sides, in parts of sides, in one plane, or are equal; some are lines."""
    rng = np.random.default_rng(seed)
    vertices = rng.integers(0, 4, (40, 3)).astype(float)
    cells = np.array([rng.choice(40, 3, replace=False) for _ in range(30)])
    pairs = crossing_pairs(vertices, cells)[0]
    assert sorted(pairs.tolist()) == exact_pairs(vertices, cells)
    assert len(pairs) > 10
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]  # rounds the coordinates
    turned = (vertices[:, :, None] * turn).sum(axis=1)
    assert sorted(crossing_pairs(1e-9 * turned, cells)[0].tolist()) == sorted(pairs.tolist())


def test_triangles_that_touch_do_not_cross():
    base = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    others = {
        "upon it": [[0.2, 0.2, 0], [0.5, 0.2, 0], [0.2, 0.5, 0]],
        "standing on it": [[0.2, 0.2, 0], [0.4, 0.3, 0], [0.3, 0.3, 1]],
        "beside it": [[0.5, -0.1, -1], [0.5, -0.1, 1], [0.5, -1, 0]],
        "beside it in its plane": [[0, 1, 0], [1, 0, 0], [1, 1, 0]],
        "folded upon it": [[1, 0, 0], [0, 0, 0], [0.3, 0.2, 0]],
        "through its corner": [[0, 0, -1], [0, 0, 1], [-1, -1, 0]],
        "through it from its corner": [[0, 0, 0], [0.3, 0.3, 1], [0.3, 0.3, -1]],
        "a line through it, with sides that are its neighbours'": [[0.2, 0.2, -1], [0.2, 0.2, 0], [0.2, 0.2, 1]],
    }
    cells = np.arange(6).reshape(2, 3)
    crossing = [name for name, rows in others.items() if len(crossing_pairs(np.array(base + rows, float), cells)[0])]
    assert crossing == ["upon it", "folded upon it", "through it from its corner"]


def test_too_many_near_pairs_are_not_compared(monkeypatch):
    monkeypatch.setattr("gtb_cli.solids.crossings.MAX_COMPARED_PAIRS", 100)
    vertices = np.random.default_rng(5).random((60, 3))
    assert not crossing_pairs(vertices, np.arange(60).reshape(20, 3))[1]
    assert crossing_pairs(vertices[:3], np.array([[0, 1, 2]]))[1]
