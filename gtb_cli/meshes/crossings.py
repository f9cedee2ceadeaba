"""Crossings of a mesh with itself: pairs of triangles that cross and have no vertex in common."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, bounds_of, cross, dot
from gtb_cli.meshes.nearest import spatial_order

# pairs of triangles compared, in half a minute: a smooth mesh has about 20 per triangle; if all
# triangles overlapped, the comparison would never end
MAX_COMPARED_PAIRS = 50_000_000


def crossing_pairs(vertices: FloatArray, cells: IntArray) -> tuple[IntArray, bool]:
    """Find triangles of a mesh that pass through others.

    Parameters
    ----------
    vertices : (m, 3) float
    cells : (k, 3) int

    Returns
    -------
    pairs : (p, 2) int
        Pairs of cells without a common vertex, each pair once. Triangles that touch, or lie in one plane, do not cross.
    is_complete : bool
        Whether all pairs were compared: at most `MAX_COMPARED_PAIRS` are near each other.

    Notes
    -----
    Boxes around the triangles are compared in a tree, level by level: about k log k, unless most of them overlap. A
    million triangles take about ten seconds.
    """
    # Depth, relative to the largest extent, below which triangles only touch: the rounding of coplanar surfaces
    crossing_depth = 1e-9
    found = [np.empty((0, 2), dtype=np.int64)]
    depth = crossing_depth * float(np.ptp(bounds_of(vertices), axis=0).max())
    compared = 0
    for pairs in _near_pairs(vertices, cells) if len(cells) > 1 else ():
        compared += len(pairs)
        if compared > MAX_COMPARED_PAIRS:
            return np.concatenate(found), False
        one, other = cells[pairs].transpose(1, 0, 2)
        apart = ~(one[:, :, None] == other[:, None]).any(axis=(1, 2))
        pairs = pairs[apart]
        crossed = pairs[_cross(vertices[cells[pairs[:, 0]]], vertices[cells[pairs[:, 1]]], depth)]
        found.append(np.sort(crossed, axis=1))
    return np.concatenate(found), True


def _near_pairs(vertices: FloatArray, cells: IntArray) -> Iterator[IntArray]:
    """Blocks of (p, 2) pairs of cells whose boxes overlap."""
    pair_batch = 1 << 20  # pairs of boxes held at a time, in about 100 MB
    corners = vertices[cells]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = spatial_order((low + high) / 2)
    levels = [(low[order], high[order])]
    while len(levels[-1][0]) > 1:
        levels.append(_parents(*levels[-1]))
    stack = [(len(levels) - 1, np.zeros((1, 2), dtype=np.int64))]
    while stack:
        level, pairs = stack.pop()
        if level == 0:
            yield order[pairs]
            continue
        if len(pairs) > pair_batch // 4:
            half = len(pairs) // 2
            stack += [(level, pairs[half:]), (level, pairs[:half])]
            continue
        low, high = levels[level - 1]
        below = (2 * pairs[:, None] + [[0, 0], [0, 1], [1, 0], [1, 1]]).reshape(-1, 2)
        below = below[(below[:, 0] <= below[:, 1]) & (below[:, 1] < len(low))]
        if level == 1:
            below = below[below[:, 0] != below[:, 1]]
        a, b = below.T
        stack.append((level - 1, below[((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)]))


def _parents(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Boxes around pairs of boxes; a single last box stays as it is."""
    first = np.arange(0, len(low), 2)
    return np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)


def _cross(one: FloatArray, other: FloatArray, depth: float) -> BoolArray:
    """(p,) true where a side of one of two (p, 3, 3) triangles passes through the inside of the other."""
    (heights, plane), (back, back_plane) = _heights(one, other), _heights(other, one)
    # A triangle degenerated to a line has no plane, but may still pierce another.
    reaches = [
        ((rows.max(axis=1) > depth) & (rows.min(axis=1) < -depth)) | ~normal.any(axis=1)
        for rows, normal in ((heights, plane), (back, back_plane))
    ]
    result = np.zeros(len(one), dtype=bool)
    near = np.flatnonzero(reaches[0] & reaches[1])
    for triangle, sides, rows, normal in ((one, other, heights, plane), (other, one, back, back_plane)):
        result[near] |= _pierced(triangle[near], sides[near], rows[near], normal[near], depth)
    return result


def _heights(triangle: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(p, 3) heights of the other triangles' corners over (p,) planes, and unit normals of these; 0 without a plane."""
    a, b, c = triangle.transpose(1, 0, 2)
    normal = cross(b - a, c - a)
    length = np.sqrt(dot(normal, normal))
    longest = np.maximum(dot(b - a, b - a), dot(c - a, c - a))
    normal = normal / np.where(length > 0, length, 1.0)[:, None]
    normal[length <= 64 * EPS * longest] = 0.0
    return np.einsum("pij,pj->pi", other - a[:, None], normal), normal


def _pierced(
    triangle: FloatArray, sides: FloatArray, heights: FloatArray, normal: FloatArray, depth: float
) -> BoolArray:
    """(p,) true where a side of the other triangle, whose corners have these heights, meets the triangle's inside."""
    result = np.zeros(len(triangle), dtype=bool)
    for k in range(3):
        below, above = heights[:, k - 1], heights[:, k]
        through = (np.minimum(below, above) < -depth) & (np.maximum(below, above) > depth)
        share = np.where(through, below / np.where(through, below - above, 1.0), 0.0)
        place = sides[:, k - 1] + share[:, None] * (sides[:, k] - sides[:, k - 1])
        inside = through
        for i in range(3):
            edge = triangle[:, i] - triangle[:, i - 1]
            length = np.sqrt(dot(edge, edge))
            inside = inside & (dot(cross(edge, place - triangle[:, i - 1]), normal) > depth * length)
        result |= inside
    return result
