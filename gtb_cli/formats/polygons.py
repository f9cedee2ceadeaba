"""Polygons cut into triangles, and polylines into segments."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, as_indices, cross, dot, groups, planar_cross, row_blocks
from gtb_cli.formats.file_arrays import FileArrays
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Values


def triangles(corners: NDArray[np.generic], counts: IntArray) -> IntArray:
    """Cut polygons into triangles around their first corners.

    The corners of all polygons stand one after another, `counts` of them, at least 3, for each. Indices have 32 bits,
    as no file that is read has more vertices, unless a wrong one needs more.
    """
    if (counts == 3).all():
        return as_indices(corners.reshape(-1, 3), np.int32)
    ends = np.cumsum(counts)
    starts = ends - counts
    inner = np.ones(len(corners), dtype=bool)
    inner[starts] = inner[ends - 1] = False
    first = np.repeat(corners[starts], (counts - 2).astype(np.intp))
    return as_indices(np.stack([first, corners[inner], corners[1:][inner[:-1]]], axis=1), np.int32)


def segments(corners: NDArray[np.generic], counts: IntArray) -> IntArray:
    """Cut polylines, given like the polygons of `triangles`, into segments."""
    inner = np.ones(len(corners), dtype=bool)
    inner[np.cumsum(counts) - 1] = False
    return as_indices(np.stack([corners[inner], corners[1:][inner[:-1]]], axis=1), np.int32)


def polygons_of(counts: IntArray, first: int = 0) -> IntArray:
    """Return the first of the triangles of `triangles` of polygons with more than three corners, and these; (p, 2)."""
    many = np.flatnonzero(counts > 3)
    ends = np.cumsum(counts.astype(np.int64) - 2) if len(many) else counts
    return np.column_stack([first + ends[many] - counts[many] + 2, counts[many]]).astype(np.intp)


def unfolded(content: FileArrays) -> tuple[FileArrays, int]:
    """Cut polygons otherwise whose triangles around the first corner are not all on one side, as of concave ones.

    Also returns the number of polygons whose triangles may overlap: they cross themselves, take too much effort, or
    have too many corners. What is not flat is seen along its mean normal.
    """
    most, block, effort, left = 50_000, 1 << 14, 30_000_000, 0  # corners, all at a time, and steps of `_ears`
    cells, frame, places = content.cells.ravel(), Frame.around(content.vertices), np.arange(content.cells.size)
    for count, which in groups(content.polygons[:, 1]):
        left += len(which) * (count > most)
        for some in row_blocks(len(which), block // count + 1) if count <= most else ():
            first = content.polygons[which[some], 0]
            corners = 3 * first[:, None] + np.array([0, 1, *range(2, 3 * count - 6, 3)])  # places in the cells
            points = frame.inside(content.vertices[cells[corners]])
            folded, means = _folded(points)
            for corner in range(1, 2 if count == 4 else min(count, 9)):  # of four, others make the same triangles
                fan, rest = np.roll(np.arange(count), -corner), np.flatnonzero(folded)
                turned = rest[~_folded(points[rest][:, fan])[0]]
                around = np.stack([np.full(count - 2, corner), fan[1:-1], fan[2:]], axis=1).ravel()
                places[3 * first[turned, None] + np.arange(len(around))] = corners[turned][:, around]
                folded[turned] = False
            if count == 4:
                left += int(folded.sum())
                continue
            for k in np.flatnonzero(folded).tolist():
                axis = int(np.abs(means[k]).argmax())
                plan = points[k][:, [(axis + 1) % 3, (axis + 2) % 3]] * [np.sign(means[k, axis]), 1]
                found, effort = _ears(plan, effort) if means[k].any() else ([], effort)
                left += not found
                places[3 * first[k] :][: 3 * len(found)] = corners[k][np.array(found, dtype=int)].ravel()
    if (places[1:] > places[:-1]).all():
        return content, left

    def values() -> Values:
        return {name: (rows, of.ravel()[places].reshape(-1, 3)) for name, (rows, of) in content.values().items()}

    return replace(content, cells=cells[places].reshape(-1, 3), values=values), left


def _folded(points: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Tell whether triangles around the first corners of (p, n, 3) polygons look to both sides of the mean normals.

    Returns (p,) answers and the normals, (p, 3), which are 0 where rounding leaves none.
    """
    sides = points[:, 1:] - points[:, :1]
    normals = cross(sides[:, :-1], sides[:, 1:])
    means, squares = normals.sum(axis=1), np.einsum("pkx,pkx->p", normals, normals)
    size = dot(means, means)
    along = np.einsum("pkx,px->pk", normals, means).min(axis=1)
    return along < 1e-7 * (squares - 2 * size), np.where(size > 1e-18 * squares, 1, 0)[:, None] * means


def _ears(points: FloatArray, effort: int) -> tuple[list[list[int]], int]:
    """Cut ears, corners with no other one in their triangle, off a plane polygon; none if it has not enough.

    What is left of the effort is returned, too: convex corners take as many steps as there are others, and a constant.
    """
    rest, found, at, tried = np.arange(len(points)), list[list[int]](), 0, 0
    rounding = 1e-9 * float(np.ptp(points, axis=0).max()) ** 2  # of areas: last digits make no other ears
    while len(rest) > 2 and tried < 2 * len(rest) and effort > 0:
        ear = rest[[at - 1, at, (at + 1) % len(rest)]].tolist()
        p = points[ear]
        least = rounding if tried < len(rest) else -rounding  # first those with an area, away from other corners
        tried += 1
        if planar_cross(p[1] - p[0], p[2] - p[0]) < least:
            effort, at = effort - 100, (at + 1) % len(rest)
            continue
        effort -= 500 + len(rest)
        others = points[rest]
        sides = np.stack([planar_cross(p[k] - p[k - 1], others - p[k - 1]) for k in range(3)])
        within = (sides >= -least).all(axis=0) & (others != p[:, None]).any(axis=2).all(axis=0)
        if not within.any():
            found.append(ear)
            rest, at, tried = np.delete(rest, at), at - 1, 0
        at = (at + 1) % len(rest)
    return (found if len(rest) == 2 else []), effort
