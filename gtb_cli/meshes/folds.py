"""Where a surface turns back on itself, between triangles side by side."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray


def folded(vertices: FloatArray, cells: IntArray) -> IntArray:
    """(k,) triangles, consistently oriented, at a side of which the surface turns by more than a right angle."""
    a, b, c = (vertices[cells[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    sides = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    ordered = sides[order]
    first = np.flatnonzero((ordered[1:] == ordered[:-1]).all(axis=1))
    one, other = order[first] // 3, order[first + 1] // 3
    return np.asarray(one[(normals[one] * normals[other]).sum(axis=1) < 0])


def folds(vertices: FloatArray, cells: IntArray) -> int:
    """Count the sides at which the surface turns by more than a right angle."""
    return len(folded(vertices, cells))
