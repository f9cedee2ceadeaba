"""Crossings of a mesh with itself: pairs of triangles that pass through each other or lie upon each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, bounds_of, cross, dot, unit
from gtb_cli.meshes.nearest import spatial_order
from gtb_cli.meshes.topology import are_proper
from gtb_cli.meshes.welding import weld

# pairs of triangles compared, in half a minute: a smooth mesh has about 20 per triangle; if all
# triangles overlapped, the comparison would never end
MAX_COMPARED_PAIRS = 50_000_000


def crossing_pairs(vertices: FloatArray, cells: IntArray) -> tuple[IntArray, bool]:
    """Find triangles of a mesh that pass through others, or lie in one plane with others and overlap them.

    Parameters
    ----------
    vertices : (m, 3) float
        Those at exactly the same place are one.
    cells : (k, 3) int
        Triangles with two corners at one place are left out.

    Returns
    -------
    pairs : (p, 2) int
        Pairs of cells, each pair once. Triangles that only touch do not cross, and neighbours do not cross in what they
        share.
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
    first, places = weld(vertices)
    vertices, cells = vertices[first], places[cells]
    proper = np.flatnonzero(are_proper(cells))
    cells = cells[proper]
    depth = crossing_depth * float(np.ptp(bounds_of(vertices), axis=0).max()) if len(cells) else 0.0
    compared = 0
    is_complete = True
    for pairs in _near_pairs(vertices, cells) if len(cells) > 1 else ():
        compared += len(pairs)
        if compared > MAX_COMPARED_PAIRS:
            is_complete = False
            break
        one, other = cells[pairs].transpose(1, 0, 2)
        # Neighbours along an edge cross only if they lie upon each other: most pairs, told apart sooner.
        common = (one[:, :, None] == other[:, None]).any(axis=2).sum(axis=1)
        apart, beside = pairs[common < 2], pairs[common == 2]
        found += [
            apart[_cross(vertices[cells[apart[:, 0]]], vertices[cells[apart[:, 1]]], depth)],
            beside[_folded(vertices, cells[beside], depth)],
            pairs[common == 3],
        ]
    return proper[np.sort(np.concatenate(found), axis=1)], is_complete


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
    """(p,) true where two (p, 3, 3) triangles, with at most one corner in common, pass through each other or overlap.

    Triangles that reach through each other's planes meet these in two segments of one line. They cross if the segments
    have a length in common.
    """
    (heights, plane), (back, back_plane) = _heights(one, other), _heights(other, one)
    has_plane = plane.any(axis=1) & back_plane.any(axis=1)
    reach = [(rows.max(axis=1) > depth) & (rows.min(axis=1) < -depth) for rows in (heights, back)]
    result = np.zeros(len(one), dtype=bool)
    near = np.flatnonzero(has_plane & reach[0] & reach[1])
    segments = [_section(other[near], heights[near]), _section(one[near], back[near])]
    along = np.stack([segment[:, 1] - segment[:, 0] for segment in segments])
    squares = np.stack([dot(direction, direction) for direction in along])
    longer = squares.argmax(axis=0)
    direction = unit(along[longer, np.arange(len(near))])
    origin = segments[0][:, :1]
    low, high = (
        np.stack([bound(np.einsum("pij,pj->pi", segment - origin, direction), axis=1) for segment in segments])
        for bound in (np.min, np.max)
    )
    result[near] = high.min(axis=0) - low.max(axis=0) > depth
    flat = has_plane & (np.abs(heights) <= depth).all(axis=1) & (np.abs(back) <= depth).all(axis=1)
    result[flat] = _overlap(one[flat], other[flat], plane[flat], depth)
    return result


def _section(triangle: FloatArray, heights: FloatArray) -> FloatArray:
    """(p, 2, 3) ends of the segments in which (p, 3, 3) triangles meet the plane over which their corners are."""
    rows = np.arange(len(triangle))
    below = heights < 0
    # The corner that is alone on its side of the plane, and the sides from there
    top = np.where(below.sum(axis=1) == 1, below.argmax(axis=1), below.argmin(axis=1))
    height = heights[rows, top]
    ends = []
    for k in (1, 2):
        next = (top + k) % 3
        share = height / (height - heights[rows, next])
        ends.append(triangle[rows, top] + share[:, None] * (triangle[rows, next] - triangle[rows, top]))
    return np.stack(ends, axis=1)


def _overlap(one: FloatArray, other: FloatArray, normal: FloatArray, depth: float) -> BoolArray:
    """(p,) true where triangles in one plane have an area in common: no line along a side of one separates them."""
    result = np.ones(len(one), dtype=bool)
    for ours, theirs in ((one, other), (other, one)):
        for i in range(3):
            edge = ours[:, i] - ours[:, i - 1]
            inwards = cross(normal, edge) / np.sqrt(dot(edge, edge))[:, None]
            reach, others = (np.einsum("pij,pj->pi", x - ours[:, [i]], inwards) for x in (ours, theirs))
            result &= np.minimum(reach.max(axis=1), others.max(axis=1)) > depth + np.maximum(
                reach.min(axis=1), others.min(axis=1)
            )
    return result


def _folded(vertices: FloatArray, cells: IntArray, depth: float) -> BoolArray:
    """(p,) true where the two triangles of (p, 2, 3) cells with an edge in common lie upon each other."""
    one, other = cells.transpose(1, 0, 2)
    in_other = (one[:, :, None] == other[:, None]).any(axis=2)
    alone = in_other.argmin(axis=1)
    rows = np.arange(len(one))
    start, end, top = (vertices[one[rows, (alone + k) % 3]] for k in (1, 2, 0))
    back = vertices[other[rows, (one[:, :, None] == other[:, None]).any(axis=1).argmin(axis=1)]]
    edge = end - start
    edge = edge / np.sqrt(dot(edge, edge))[:, None]
    # Heights over the edge; a triangle that is a line lies upon nothing.
    ours, theirs = ((x - start) - dot(x - start, edge)[:, None] * edge for x in (top, back))
    high, low = np.sqrt(dot(ours, ours)), np.sqrt(dot(theirs, theirs))
    turned = (dot(ours, theirs) > 0) & (np.minimum(high, low) > depth)
    across = cross(ours, theirs)
    flat_angle = 1e-6  # at which a triangle hardly wider than the depth is no longer flat
    return turned & (np.sqrt(dot(across, across)) <= np.minimum(depth * np.maximum(high, low), flat_angle * high * low))


def _heights(triangle: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(p, 3) heights of the other triangles' corners over (p,) planes, and unit normals of these; 0 without a plane."""
    a, b, c = triangle.transpose(1, 0, 2)
    normal = cross(b - a, c - a)
    length = np.sqrt(dot(normal, normal))
    longest = np.maximum(dot(b - a, b - a), dot(c - a, c - a))
    normal = normal / np.where(length > 0, length, 1.0)[:, None]
    normal[length <= 64 * EPS * longest] = 0.0
    return np.einsum("pij,pj->pi", other - a[:, None], normal), normal
