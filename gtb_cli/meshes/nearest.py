"""Distances of points from segments and triangles: pair by pair, and from the nearest of many."""

import sys
from functools import cached_property, reduce
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, bounds_of, column_dot, cross, row_blocks
from gtb_cli.values import frozen

BLOCK_POINTS = 8192  # points that are measured together: their arrays stay in the processor's cache
BRANCHES = 8  # boxes in each box of the tree
PAIR_BATCH = 1 << 18  # pairs of a point and a box examined together; longer lists are halved, which bounds the memory


@frozen
class NearestCells:
    """Segments (k, 2, 3) or triangles (k, 3, 3) of any size and shape, arranged for finding the nearest ones.

    Cells are sorted along a space-filling curve; eight consecutive boxes make a box of the next level. The search for a
    point starts from the cell with the nearest centre and visits all boxes nearer than the nearest cell so far. It
    takes about 3 s for 1 million points and triangles of similar meshes.
    """

    corners: FloatArray

    def start(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """(m,) distances of (m, 3) points from the cells with the nearest centres (upper bounds), and these cells."""
        cells = np.asarray(self._centres.query(points)[1], dtype=np.int64)
        return self.distances(points, cells), cells

    def distances(self, points: FloatArray, cells: IntArray) -> FloatArray:
        """(m,) distance of each point from its own cell."""
        return cell_distances(points, *np.moveaxis(self.corners[cells], 1, 0))

    def nearest(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """(m,) distances of (m, 3) points, up to rounding, and indices of the nearest cells."""
        return self.search(points, *self.start(points))

    def search(self, points: FloatArray, bounds: FloatArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
        """Return what `nearest` does, from a cell for each of (m, 3) points and its distance, as `start` finds them."""
        bounds, cells = bounds.copy(), cells.copy()
        top = len(self.boxes) - 1
        count = len(self.boxes[top][0])
        stack = [
            (top, np.repeat(np.arange(rows.start, rows.stop), count), np.tile(np.arange(count), rows.stop - rows.start))
            for rows in row_blocks(len(points), max(1, PAIR_BATCH // count))
        ][::-1]
        while stack:
            level, point, node = stack.pop()
            low, high = (box[node] for box in self.boxes[level])
            here = points[point]
            outside = np.maximum(np.maximum(low - here, here - high), 0.0)
            near = np.flatnonzero(np.einsum("ij,ij->i", outside, outside) < bounds[point] ** 2)
            point, node = point[near], node[near]
            if level:
                point, node = self.inside(level, point, node)
                stack += [(level - 1, point[rows], node[rows]) for rows in row_blocks(len(point), PAIR_BATCH)][::-1]
                continue
            cell = self.order[node]
            distance = self.distances(points[point], cell)
            order = np.lexsort((cell, distance, point))
            first = order[np.flatnonzero(np.diff(point[order], prepend=-1))]
            better = first[distance[first] < bounds[point[first]]]
            bounds[point[better]] = distance[better]
            cells[point[better]] = cell[better]
        return bounds, cells

    def inside(self, level: int, rows: IntArray, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Pair each row with the boxes of the level below in its own box, or with the cells of level 0."""
        rows, nodes = np.repeat(rows, BRANCHES), (nodes[:, None] * BRANCHES + np.arange(BRANCHES)).ravel()
        is_there = nodes < len(self.boxes[level - 1][0])  # the last box of a level may have fewer
        return rows[is_there], nodes[is_there]

    @cached_property
    def crowd(self) -> float:
        """Estimate in how many cells' boxes the middle of one lies, as a search visits all: 20 in a fan of 100."""
        some = self.corners[:: len(self.corners) // 1000 + 1]
        low, high = some.min(axis=1), some.max(axis=1)
        places = (low + high)[:: len(some) // 50 + 1, None] / 2
        within = ((low <= places) & (places <= high)).all(axis=2)
        return float(1 + len(self.corners) * (within.mean() - 1 / len(some)))  # each is in its own

    @cached_property
    def most_points(self) -> int:
        """How many points, or rays, may be searched for in about two seconds, if long cells crowd; else all."""
        usual, pairs = 100, 5_000_000  # of cells at a place, and of points with cells
        return sys.maxsize if self.crowd <= usual else int(pairs / self.crowd)

    @cached_property
    def order(self) -> IntArray:
        """(k,) the cells along the curve."""
        return spatial_order(np.asarray(self._centres.data))

    @cached_property
    def boxes(self) -> list[tuple[FloatArray, FloatArray]]:
        """Lowest and highest corners of the boxes of each level, those of the cells, in this order, first."""
        low, high = (reduce(bound, np.moveaxis(self.corners, 1, 0))[self.order] for bound in (np.minimum, np.maximum))
        levels = [(low, high)]
        while (count := len(levels[-1][0])) > BRANCHES:
            first = np.arange(0, count, BRANCHES)
            levels.append((np.minimum.reduceat(levels[-1][0], first), np.maximum.reduceat(levels[-1][1], first)))
        return levels

    @cached_property
    def _centres(self) -> Any:  # scipy.spatial.cKDTree
        from scipy.spatial import cKDTree

        return cKDTree(middles(self.corners), balanced_tree=False, compact_nodes=False)


def cell_distances(points: FloatArray, *corners: FloatArray) -> FloatArray:
    """(m,) distances of (m, 3) points, each from its own cell, which may be flat or a point, by (m, 3) corners."""
    result = np.empty(len(points))
    for rows in row_blocks(len(points), BLOCK_POINTS):
        p, origin, *others = (np.ascontiguousarray(each[rows].T) for each in (points, *corners))
        sides = [other - origin for other in others]
        result[rows] = _to_triangles(p - origin, *sides) if len(sides) == 2 else np.sqrt(_to_side(p - origin, *sides))
    return result


def middles(corners: FloatArray) -> FloatArray:
    """(m, 3) means of the corners (m, c, 3) of cells, several times faster than along an axis."""
    return np.asarray(reduce(np.add, np.moveaxis(corners, 1, 0)) / corners.shape[1])


def spatial_order(points: FloatArray) -> IntArray:
    """The order of (m, 3) points along Morton's space-filling curve, in which consecutive points are mostly near."""
    low, high = bounds_of(points)
    # Groups of bits are halved and moved apart, until two zeros follow each bit.
    apart = (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3)
    extent = float((high - low).max()) or 1.0
    key = np.zeros(len(points), dtype=np.int64)
    for axis in range(3):
        grid = ((points[:, axis] - low[axis]) * ((2**20 - 1) / extent)).astype(np.int64)  # 20 bits
        for shift, kept in (*apart, (2, 0x1249249249249249)):
            grid = (grid | grid << shift) & kept
        key |= grid << axis
    return np.argsort(key, kind="stable")


def _to_triangles(relative: FloatArray, ab: FloatArray, ac: FloatArray) -> FloatArray:
    """(m,) distances of (3, m) points from triangles with one corner at the origin, and these others."""
    normal = cross(ab, ac, 0)
    square = column_dot(normal, normal)
    safe = np.where(square > 0, square, 1.0)
    v = column_dot(relative, cross(ac, normal, 0)) / safe
    w = column_dot(relative, cross(normal, ab, 0)) / safe
    result = np.abs(column_dot(relative, normal)) / np.sqrt(safe)
    other = np.flatnonzero((square <= 0) | (v < 0) | (w < 0) | (v + w > 1))
    if len(other):
        relative, ab, ac = (each.take(other, axis=1) for each in (relative, ab, ac))  # faster than [:, other]
        sides = (_to_side(relative, ab), _to_side(relative, ac), _to_side(relative - ab, ac - ab))
        result[other] = np.sqrt(np.minimum(np.minimum(sides[0], sides[1]), sides[2]))
    return result


def _to_side(relative: FloatArray, direction: FloatArray) -> FloatArray:
    """(m,) squares of the distances of (3, m) points from the segments from the origin to `direction`."""
    square = column_dot(direction, direction)
    t = np.minimum(np.maximum(column_dot(relative, direction) / np.where(square > 0, square, 1.0), 0.0), 1.0)
    apart = relative - t * direction
    return column_dot(apart, apart)
