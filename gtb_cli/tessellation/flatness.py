"""Flat patches, inside which a parameter may slide out of its cell: what their meshes must hold instead."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.tessellation.complex import Sampler
from gtb_cli.tessellation.lattice import CENTROID, LATTICE, lattice
from gtb_cli.tessellation.subdivision import Subdivision
from gtb_cli.theory.patch import Patch

FOLD_AREA_FRACTION = 1e-9
"""Part of the largest triangle's area by which another one of a flat patch may be turned over, by rounding."""


def is_flat(patch: Patch, tolerance: float) -> bool:
    """Whether all control points, and so the surface, are within a tenth of the tolerance of a plane."""
    centred = patch.control_points - patch.control_points.mean(axis=0)
    return bool(np.abs(centred @ np.linalg.svd(centred, full_matrices=False)[2][-1]).max() <= tolerance / 10)


def turned_over(corners: FloatArray) -> BoolArray:
    """(k,) which of the (k, 3, 3) triangles of a plane look to the other side than the whole."""
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turn = area @ area.sum(axis=0)
    return np.asarray(turn < -FOLD_AREA_FRACTION * turn.max())


def left_out(points: FloatArray, own: IntArray, corners: FloatArray, tolerance: float) -> IntArray:
    """Which points are farther than the tolerance from all triangles; each has its own, which is tried first."""
    nearest = NearestCells(corners)
    distance = nearest.distances(points, own)
    far = np.flatnonzero(distance > tolerance)
    if not len(far):
        return far
    return far[nearest.search(points[far], distance[far], own[far])[0] > tolerance]


def folded_or_uncovered(
    mesh: Subdivision, rows: IntArray, steps_at: IntArray, sampler: Sampler, within: float, tolerance: float
) -> BoolArray:
    """Which cells of a flat patch, all given, are turned over, or have samples beyond the tolerance from all.

    Sampled on lattices of the given steps, at places that may be off by `within` as of `Sampler.points`.
    """
    corners = np.stack(mesh.corners(rows), axis=1)
    failing = turned_over(corners)
    if failing.any():
        return failing
    places, owners = [], []
    for steps in np.unique(steps_at).tolist():
        part = np.flatnonzero(steps_at == steps)
        weights = lattice(steps if steps > LATTICE else CENTROID)
        places.append(np.einsum("wc,kcd->kwd", weights, mesh.cells.corners[rows[part]]).reshape(-1, 2))
        owners.append(np.repeat(part, len(weights)))
    u, own = np.concatenate(places), np.concatenate(owners)
    sample = sampler.points(mesh.cells.patch[rows[own]], u, np.zeros(len(own), dtype=np.int64), within)
    failing[own[left_out(sample, own, corners, tolerance)]] = True
    return failing
