"""Barycentric lattices of a triangle, and the quadratic that is known by its heights over the sides' middles."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray

LATTICE = 4
"""Edges are verified at this many steps; all numbers of steps are multiples of it."""

CENTROID = 3
"""Steps of the lattice that has one inner point: enough for a triangle on which all samples are a quadratic's."""

POINTS_IN_ALL = 20_000
"""A coarse mesh is verified on a finer lattice: at about this many points in all, or more."""

MAX_LATTICE_STEPS = 32


def lattice(steps: int) -> FloatArray:
    """(k, 3) barycentric coordinates of the inner points of a triangle's lattice."""
    i, j = np.mgrid[1:steps, 1:steps]
    inner = i + j < steps
    return np.stack([i[inner], j[inner], steps - i[inner] - j[inner]], axis=1) / steps


def steps_for(width: FloatArray, points: int = POINTS_IN_ALL) -> IntArray:
    """(k,) steps of the lattices of cells of given widths in Δ: many for few, and for wide ones among any number."""
    few = np.clip(np.sqrt(2 * points / len(width)) / LATTICE, 1, MAX_LATTICE_STEPS / LATTICE)
    wide = np.exp2(np.ceil(np.log2(np.maximum(width * MAX_LATTICE_STEPS / LATTICE, 1)) - 1e-9))
    return np.asarray(LATTICE * np.maximum(few.astype(np.int64), wide.astype(np.int64)))


def quadratic_heights(places: FloatArray) -> FloatArray:
    """(k, 3) factors of the heights over the middles of sides 0, 1 and 2 in those over (k, 3) barycentric places."""
    a, b, c = places.T
    return np.asarray(4 * np.stack([a * b, b * c, c * a], axis=1))


BULGES = quadratic_heights(
    np.array([[2, 2, 0], [0, 2, 2], [2, 0, 2], [4 / 3, 4 / 3, 4 / 3], [2, 1, 1], [1, 2, 1], [1, 1, 2]]) / 4
)
"""(7, 3): at the middles of the sides, of the triangle, and between these."""
