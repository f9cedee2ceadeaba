"""Pieces of the cells of one mesh, cut until each lies over one cell of another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross
from gtb_cli.meshes.nearest import NearestCells, middles

CUT_DEPTH = 1e-9
"""A plane cuts a piece only if corners on both sides are farther from it than this fraction of the piece's size."""

HEIGHT_ROUNDING = 1e-15
"""Height over a plane, for coordinates up to 1, that may be rounding: a plane that cuts off no more would cut a tiny
piece thousands of times without changing it."""


class Pieces(NamedTuple):
    """Segments or triangles, and how far their points can be from another mesh.

    Attributes
    ----------
    corners : (m, 2, 3) or (m, 3, 3) float
    bounds : (m,) float
        No point of the piece is farther than this from the other mesh.
    likely : (m,) int
        A nearby cell of the other mesh.
    worst : (m,) int
        The corner at which the bound may be attained.
    samples : (m,) float
        Distance of one point of the piece, or an upper bound of it.
    """

    corners: FloatArray
    bounds: FloatArray
    likely: IntArray
    worst: IntArray
    samples: FloatArray

    @staticmethod
    def of(corners: FloatArray, distances: FloatArray, nearest: IntArray, tree: NearestCells) -> Pieces:
        """Whole cells, (m, c, 3), whose corners are no farther from the cells (m, c) `nearest` than `distances`."""
        number = corners.shape[1]
        bounds = distances.max(axis=1) + _radii(corners)
        points = np.repeat(middles(corners), number, axis=0)
        samples = tree.distances(points, nearest.ravel()).reshape(-1, number)
        rows, best = np.arange(len(corners)), samples.argmin(axis=1)
        return Pieces(corners, bounds, nearest[rows, best], distances.argmax(axis=1), samples[rows, best])

    @property
    def middles(self) -> FloatArray:
        """(m, 3) means of the corners."""
        return middles(self.corners)

    def bounded(self, tree: NearestCells, likely: IntArray, samples: FloatArray) -> Pieces:
        """Bound each piece by its corners' distances from one cell, which becomes the cell below it."""
        number = self.corners.shape[1]
        away = tree.distances(self.corners.reshape(-1, 3), np.repeat(likely, number)).reshape(-1, number)
        worst = away.argmax(axis=1)
        bounds = away[np.arange(len(worst)), worst]
        better = bounds < self.bounds
        lower, corner = np.where(better, bounds, self.bounds), np.where(better, worst, self.worst)
        return Pieces(self.corners, lower, likely, corner, samples)

    def cut(self, tree: NearestCells) -> Pieces:
        """Cut each piece in two or three.

        The cell below a piece has a part nearest to the piece's middle: its face, an edge or a corner. The piece is cut
        where it leaves the region over this part. If it does not leave it, the part nearest to the worst corner is
        used; failing that, the cut runs across the longest side.
        """
        number = self.corners.shape[1]
        rows = np.arange(len(self.bounds))
        square = _squares(self.corners)
        size = np.sqrt(square.max(axis=1, initial=0.0))
        start = square.argmax(axis=1)
        side = np.zeros((len(rows), number))
        side[rows, start], side[rows, (start + 1) % number] = -1.0, 1.0
        heights = _heights(self.corners, self.middles, tree.corners[self.likely])
        proper = _is_proper(heights, size)
        side[proper] = heights[proper]
        other = np.flatnonzero(~proper)
        if len(other):
            corners, worst = self.corners[other], self.corners[other, self.worst[other]]
            _, cells = tree.nearby(worst, *tree.start(worst))
            heights = _heights(corners, worst, tree.corners[cells])
            proper = _is_proper(heights, size[other])
            side[other[proper]] = heights[proper]
        outside = side > 0
        lone = np.where(outside.sum(axis=1) == 1, outside.argmax(axis=1), (~outside).argmax(axis=1))
        turned = (lone[:, None] + np.arange(number)) % number
        corners = np.take_along_axis(self.corners, turned[:, :, None], axis=1)
        side = np.take_along_axis(side, turned, axis=1)
        t = side[:, :1] / (side[:, :1] - side[:, 1:])
        points = corners[:, :1] + t[:, :, None] * (corners[:, 1:] - corners[:, :1])
        every = np.concatenate([corners, points], axis=1)
        parts = np.array([[0, 2], [2, 1]] if number == 2 else [[0, 3, 4], [3, 1, 2], [3, 2, 4]])
        kept = np.ones((len(size), len(parts)), dtype=bool)
        if number == 3:  # a cut through a corner makes two parts
            kept[:, 1] = t[:, 0] < 1
            kept[:, 2] = t[:, 1] < 1
        rows = np.flatnonzero(kept)
        return Pieces(
            every[:, parts].reshape(-1, number, 3)[rows],
            np.repeat(self.bounds, len(parts))[rows],
            np.repeat(self.likely, len(parts))[rows],
            np.zeros(len(rows), dtype=np.int64),
            np.repeat(self.samples, len(parts))[rows],
        )


def _radii(corners: FloatArray) -> FloatArray:
    """(m,) distance within which each point has a corner: 1/√3 of a triangle's longest side, half of a segment."""
    longest = np.sqrt(_squares(corners).max(axis=1, initial=0.0))
    return np.asarray(longest / (2.0 if corners.shape[1] == 2 else np.sqrt(3.0)))


def _squares(corners: FloatArray) -> FloatArray:
    """(m, sides) squares of the lengths of sides, the first from the first corner to the second."""
    sides = np.roll(corners, -1, axis=1) - corners
    if corners.shape[1] == 2:
        sides = sides[:, :1]
    return np.asarray(np.einsum("ijk,ijk->ij", sides, sides))


def _is_proper(heights: FloatArray, size: FloatArray) -> BoolArray:
    depth = np.maximum(CUT_DEPTH * size, HEIGHT_ROUNDING)
    return np.asarray((heights.max(axis=1) > depth) & (heights.min(axis=1) < -depth))


def _heights(corners: FloatArray, inside: FloatArray, cells: FloatArray) -> FloatArray:
    """(m, c) heights of corners over one plane around the region of (m, 3) points `inside`: the plane exceeded most.

    The region is that of all points to which the same part of a cell is nearest.
    """
    number = cells.shape[1]
    along = np.roll(cells, -1, axis=1) - cells
    if number == 2:
        along = along[:, :1]
    lengths = np.sqrt(np.einsum("ijk,ijk->ij", along, along))
    along = along / np.where(lengths > 0, lengths, 1.0)[:, :, None]
    relative = inside[:, None] - cells[:, : along.shape[1]]
    t = np.einsum("ijk,ijk->ij", relative, along)
    rows = np.arange(len(cells))
    if number == 2:
        before, after = t[:, 0] < 0, t[:, 0] > lengths[:, 0]
        # Two planes, the same one twice at an end.
        origins = np.stack(
            [np.where(after[:, None], cells[:, 1], cells[:, 0]), np.where(before[:, None], cells[:, 0], cells[:, 1])],
            axis=1,
        )
        signs = np.stack([np.where(before, 1.0, -1.0), np.where(after, -1.0, 1.0)], axis=1)
        normals = signs[:, :, None] * along
    else:
        normal = cross(along[:, 0], along[:, 1])
        outwards = np.stack([cross(along[:, k], normal) for k in range(3)], axis=1)
        height = np.einsum("ijk,ijk->ij", relative, outwards)
        beside = (height > 0) & (t >= 0) & (t <= lengths)
        edge = np.where(beside, height, -1.0).argmax(axis=1)
        corner = np.einsum("ijk,ijk->ij", relative, relative).argmin(axis=1)
        on_face, on_edge = ~(height > 0).any(axis=1), beside.any(axis=1)
        origins, normals = cells.copy(), outwards
        e, n = rows[on_edge & ~on_face], edge[on_edge & ~on_face]
        first, second = cells[e, n], cells[e, (n + 1) % 3]
        origins[e] = np.stack([first, first, second], axis=1)
        normals[e] = np.stack([-outwards[e, n], -along[e, n], along[e, n]], axis=1)
        e, n = rows[~on_edge & ~on_face], corner[~on_edge & ~on_face]
        origins[e] = cells[e, n][:, None]
        normals[e] = np.stack([along[e, n], -along[e, n - 1], along[e, n]], axis=1)
    heights = np.einsum("ijk,ipk->ipj", corners, normals) - np.einsum("ipk,ipk->ip", origins, normals)[:, :, None]
    return np.asarray(heights[rows, heights.max(axis=2).argmax(axis=1)])
