"""Where the image of a mesh of Δ turns back on itself."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray


def folds(vertices: FloatArray, cells: IntArray) -> int:
    """Count the sides of triangles, consistently oriented, at which the surface turns by more than a right angle."""
    a, b, c = (vertices[cells[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    sides = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    ordered = sides[order]
    first = np.flatnonzero((ordered[1:] == ordered[:-1]).all(axis=1))
    one, other = normals[order[first] // 3], normals[order[first + 1] // 3]
    return int(((one * other).sum(axis=1) < 0).sum())
