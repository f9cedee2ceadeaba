"""Bounding boxes of curves and surfaces, inside the boxes of their control points."""

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, bounds_of
from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.theory.patch import Patch


def bounds(patches: Sequence[Patch]) -> FloatArray:
    """Return the lowest and the highest coordinates of patches together, (2, 3), to eight digits of the size.

    Smaller and smaller copies of Δ are sampled about the best samples. An extremum narrower than a 48th of an edge, and
    far from all knots, may be missed.
    """
    corners = np.concatenate([patch.evaluate(patch.domain.vertices) for patch in patches])
    boxes = np.array([bounds_of(patch.control_points) for patch in patches])
    found = bounds_of(corners)
    rounding = 1e-12 * float(np.ptp(boxes.reshape(-1, 3), axis=0).max())

    def excess() -> FloatArray:
        return np.concatenate([found[0] - boxes[:, 0], boxes[:, 1] - found[1]], axis=1)

    for number in np.argsort(-excess().max(axis=1), kind="stable").tolist():
        ways = np.flatnonzero(excess()[number] > rounding)
        if len(ways):  # else it lies within what others reach
            found = bounds_of(np.concatenate([found, _extremes(patches[number], ways)]))
    return found


def _extremes(patch: Patch, ways: IntArray) -> FloatArray:
    """Return the points of a patch farthest along k of six ways, down along the axes, then up: (k, 3)."""
    rounds, shrinkage = 20, 0.5  # copies of Δ shrink to 5e-7, and extrema are flat, or at the ends of an edge
    starts, apart = 4, 0.1  # best samples for each way, and their distances as fractions of the size of Δ
    signs = np.repeat(np.concatenate([-np.eye(3), np.eye(3)])[ways], starts, axis=0)
    samples = triangulation(patch.domain, 48).parameters
    points = np.concatenate([_points(patch, samples, 1e-3), patch.evaluate(patch.knots, "linear")])
    samples = np.concatenate([samples, patch.knots])  # each T_i peaks at its knot, in however narrow a layer
    heights = signs @ points.T
    for k in range(len(signs) - 1):
        if (k + 1) % starts:
            near = np.abs(samples - samples[heights[k].argmax()]).max(axis=1) < apart * patch.domain.size
            heights[k + 1, near | np.isneginf(heights[k])] = -np.inf
    best = heights.argmax(axis=1)
    at, extremes = samples[best], points[best]
    samples = triangulation(patch.domain, 4).parameters
    size = 0.5
    for _ in range(rounds):
        tried = at[:, None] + size * (samples - at[:, None])
        points = _points(patch, tried.reshape(-1, patch.dimension), 1e-2 * size).reshape(*tried.shape[:2], 3)
        heights = (points * signs[:, None]).sum(axis=2)
        for k in np.flatnonzero(heights.max(axis=1) > (extremes * signs).sum(axis=1)).tolist():
            j = int(heights[k].argmax())
            at[k], extremes[k] = tried[k, j], points[k, j]
        size *= shrinkage
    return np.asarray(extremes)


def _points(patch: Patch, u: FloatArray, within: float) -> FloatArray:
    """Return points of the patch at parameters, to `within` of the size of Δ: (m, d) → (m, 3)."""
    return patch.points_at(patch.rational_basis.linear.locations(u, within=within), len(u))
