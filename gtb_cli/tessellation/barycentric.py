"""Barycentric lattices of a triangle, and the quadratic with given heights over the middles of its sides."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray

SIDE_STEPS = 4  # steps at which edges are sampled at least; all other numbers of steps are multiples of it
MIN_SAMPLES = 20_000  # points at which a coarse mesh is sampled, at least, by a finer lattice on each triangle


def inner_points(steps: int) -> FloatArray:
    """(k, 3) barycentric coordinates of the inner points of a triangle's lattice; of the coarsest, of the centroid."""
    steps = steps if steps > SIDE_STEPS else 3  # one point is enough where the surface is quadratic
    i, j = np.mgrid[1:steps, 1:steps]
    inner = i + j < steps
    return np.stack([i[inner], j[inner], steps - i[inner] - j[inner]], axis=1) / steps


def steps_for(width: FloatArray, samples: int) -> IntArray:
    """(k,) steps of the lattices of cells of given widths in Δ: many if cells are few or wide."""
    most = 32 / SIDE_STEPS
    few = np.clip(np.sqrt(2 * samples / len(width)) / SIDE_STEPS, 1, most)
    steps, parts = np.full(len(width), int(few)), width * most
    wide = np.flatnonzero(parts > 1)
    steps[wide] = np.maximum(steps[wide], np.exp2(np.ceil(np.log2(parts[wide]) - 1e-9)))
    return SIDE_STEPS * steps


def quadratic_heights(places: FloatArray) -> FloatArray:
    """(k, 3) factors by which heights over the middles of sides 0, 1 and 2 enter those at (k, 3) barycentric places."""
    a, b, c = places.T
    return np.asarray(4 * np.stack([a * b, b * c, c * a], axis=1))
