"""Flat patches: points may slide out of their cells, but all cells together must cover them, and not fold."""

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.tessellation.barycentric import inner_points
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision
from gtb_cli.theory.patch import Patch


def is_flat(patch: Patch, tolerance: float) -> bool:
    """Tell whether all control points, and so the surface, are within a tenth of the tolerance of a plane."""
    centred = patch.control_points - patch.control_points.mean(axis=0)
    return bool(np.abs(centred @ np.linalg.svd(centred, full_matrices=False)[2][-1]).max() <= tolerance / 10)


def turned_over(corners: FloatArray) -> BoolArray:
    """Mark the (k, 3, 3) triangles in a plane that face away from most of the area."""
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rounding = 1e-9  # part of the largest area: by it a triangle may be turned over
    turn = area @ area.sum(axis=0)
    return np.asarray(turn < -rounding * turn.max())


def folded_or_uncovered(
    mesh: Subdivision, rows: IntArray, steps_at: IntArray, sampler: Sampler, within: float, tolerance: float
) -> BoolArray:
    """Mark cells of a flat patch that are turned over, or have samples farther than the tolerance from all cells.

    All k cells of the patch are given, and sampled on lattices of the given steps; `within` is that of
    `Sampler.points`.
    """
    corners = np.stack(mesh.corners(rows), axis=1)
    failing = turned_over(corners)
    if failing.any():
        return failing
    places, owners = [], []
    for steps in np.unique(steps_at).tolist():
        part = np.flatnonzero(steps_at == steps)
        weights = inner_points(steps)
        places.append(np.einsum("wc,kcd->kwd", weights, mesh.cells.corners[rows[part]]).reshape(-1, 2))
        owners.append(np.repeat(part, len(weights)))
    u, own = np.concatenate(places), np.concatenate(owners)
    sample = sampler.points(mesh.cells.patch[rows[own]], u, np.zeros(len(own), dtype=np.int64), within)
    nearest = NearestCells(corners)
    distance = nearest.distances(sample, own)
    far = np.flatnonzero(distance > tolerance)  # from their own triangles
    if len(far):
        failing[own[far[nearest.search(sample[far], distance[far], own[far])[0] > tolerance]]] = True
    return failing
