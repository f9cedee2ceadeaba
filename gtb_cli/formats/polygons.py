"""Polygons cut into triangles, and polylines into segments."""

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, as_indices, cross, dot, groups, planar_cross
from gtb_cli.meshes.frame import Frame


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


def unfolded(vertices: FloatArray, cells: IntArray, polygons: IntArray) -> tuple[IntArray | None, int]:
    """Cut polygons otherwise whose triangles around the first corner are not all on one side, as of concave ones.

    Returns the places in the flat `cells`, (k, 3), from which corners are taken, None if all stay; and the number of
    polygons whose triangles may overlap: they cross themselves, take too much effort, or have too many corners. What is
    not flat is seen along its mean normal.
    """
    most, block, effort = 5000, 1 << 14, 30_000_000  # corners, polygons at a time, and steps of `_ears`
    is_large = polygons[:, 1] > most
    left, polygons = int(is_large.sum()), polygons[~is_large]
    frame, places, flat_cells = Frame.around(vertices), None, cells.ravel()
    for count, which in groups(polygons[:, 1]):
        local = np.array([0, 1, *range(2, 3 * count - 6, 3)])  # of each corner, a place in the cells
        for begin in range(0, len(which), max(1, block // count)):
            first = polygons[which[begin : begin + max(1, block // count)], 0]
            corners = 3 * first[:, None] + local
            points = frame.inside(vertices[flat_cells[corners]].reshape(-1, 3)).reshape(len(first), count, 3)
            normals = _normals(points)
            means, squares = normals.sum(axis=1), np.einsum("pkx,pkx->p", normals, normals)
            along, size = np.einsum("pkx,px->pk", normals, means), dot(means, means)
            folded = np.flatnonzero(along.min(axis=1) < 1e-9 * (squares - size))
            if not len(folded):
                continue
            places = np.arange(cells.size).reshape(-1, 3) if places is None else places
            # Around the second corner, which does for all quadrilaterals that do not cross themselves
            along = np.einsum("pkx,px->pk", _normals(np.roll(points[folded], -1, axis=1)), means[folded])
            is_cut = (along >= 0).all(axis=1) & (size > 1e-18 * squares)[folded]
            fan = np.stack(
                [np.ones(count - 2, dtype=int), np.arange(2, count), np.arange(3, count + 1) % count], axis=1
            )
            cut = folded[is_cut]
            places[first[cut, None] + np.arange(count - 2)] = corners[cut][:, fan]
            for k in folded[~is_cut].tolist():
                axis = int(np.abs(means[k]).argmax())
                plan = points[k][:, [(axis + 1) % 3, (axis + 2) % 3]] * [np.sign(means[k, axis]), 1]
                found, effort = _ears(plan, effort) if size[k] > 1e-18 * squares[k] else ([], effort)
                left += not found
                if found:
                    places[first[k] + np.arange(count - 2)] = corners[k][np.array(found)]
    return places, left


def _normals(points: FloatArray) -> FloatArray:
    """Return the products of sides, (p, k - 2, 3), of triangles around the first corners of (p, k, 3) polygons."""
    sides = points[:, 1:] - points[:, :1]
    return cross(sides[:, :-1], sides[:, 1:])


def _ears(points: FloatArray, effort: int) -> tuple[list[list[int]], int]:
    """Cut ears, corners with no other one in their triangle, off a plane polygon; none if it has not enough.

    What is left of the effort is returned, too: a corner takes as many steps as there are others, and a constant.
    """
    rest, found, at, tried = [*range(len(points))], list[list[int]](), 0, 0
    while len(rest) > 2 and tried < len(rest) and effort > 0:
        effort -= 500 + len(rest)
        ear = [rest[at - 1], rest[at], rest[(at + 1) % len(rest)]]
        p, others = points[ear], points[rest]
        sides = np.stack([planar_cross(p[k] - p[k - 1], others - p[k - 1]) for k in range(3)])
        within = (sides >= 0).all(axis=0) & (others != p[:, None]).any(axis=2).all(axis=0)
        tried += 1
        if planar_cross(p[1] - p[0], p[2] - p[0]) >= 0 and not within.any():
            found.append(ear)
            del rest[at]
            at, tried = at - 1, 0
        at = (at + 1) % len(rest)
    return (found if len(rest) == 2 else []), effort
