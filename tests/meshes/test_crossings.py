"""Triangles that pass through others, against exact arithmetic for all pairs."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest

from gtb_cli.meshes.crossings import crossing_pairs


def volume(a, b, c, d):
    """Six times the signed volume of a tetrahedron, exact."""
    u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d))
    return u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])


def pierces(p, q, triangle):
    """Whether the segment p q crosses the inside of a triangle."""
    if not volume(*triangle, p) * volume(*triangle, q) < 0:
        return False
    around = [volume(p, q, triangle[k], triangle[k - 1]) for k in range(3)]
    return min(around) > 0 or max(around) < 0


def exact_pairs(vertices, cells):
    """Every pair without a common vertex, one after the other."""
    points = [[Fraction(x) for x in row] for row in vertices.tolist()]
    found = []
    for i, j in combinations(range(len(cells)), 2):
        if set(cells[i]) & set(cells[j]):
            continue
        one, other = ([points[k] for k in cells[row]] for row in (i, j))
        if any(pierces(b[k], b[k - 1], a) for a, b in ((one, other), (other, one)) for k in range(3)):
            found.append([i, j])
    return found


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


def test_triangles_that_touch_or_lie_in_one_plane_do_not_cross():
    base = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    others = {
        "upon it": [[0.2, 0.2, 0], [0.5, 0.2, 0], [0.2, 0.5, 0]],
        "standing on it": [[0.2, 0.2, 0], [0.4, 0.3, 0], [0.3, 0.3, 1]],
        "beside it": [[0.5, -0.1, -1], [0.5, -0.1, 1], [0.5, -1, 0]],
        "through its corner": [[0, 0, -1], [0, 0, 1], [-1, -1, 0]],
        "a line through it": [[0.2, 0.2, -1], [0.2, 0.2, 0], [0.2, 0.2, 1]],
    }
    cells = np.arange(6).reshape(2, 3)
    crossing = {
        name: len(crossing_pairs(np.array(base + rows, dtype=float), cells)[0]) for name, rows in others.items()
    }
    assert crossing.pop("a line through it") == 1
    assert set(crossing.values()) == {0}


def test_too_many_near_pairs_are_not_compared(monkeypatch):
    monkeypatch.setattr("gtb_cli.meshes.crossings.MAX_COMPARED_PAIRS", 100)
    vertices = np.random.default_rng(5).random((60, 3))
    assert not crossing_pairs(vertices, np.arange(60).reshape(20, 3))[1]
    assert crossing_pairs(vertices[:3], np.array([[0, 1, 2]]))[1]
