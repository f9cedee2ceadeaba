"""Cells of one mesh, cut until each part lies over one cell of another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, rows_of
from gtb_cli.meshes.nearest import NearestCells, middles


class CellParts(NamedTuple):
    """Segments or triangles, and how far their points can be from another mesh."""

    corners: FloatArray  # (m, 2, 3) or (m, 3, 3)
    bounds: FloatArray  # (m,) no point of the part is farther than this from the other mesh
    likely: IntArray  # (m,) a nearby cell of the other mesh
    worst: IntArray  # (m,) the corner at which the bound may be attained
    samples: FloatArray  # (m,) distance of one point of the part, or an upper bound of it

    @staticmethod
    def of(corners: FloatArray, distances: FloatArray, nearest: IntArray, tree: NearestCells) -> CellParts:
        """Whole cells, (m, c, 3), whose corners are no farther from the cells (m, c) `nearest` than `distances`."""
        number = corners.shape[1]
        # Each point has a corner within 1/√3 of a triangle's longest side, and within half of a segment.
        longest = np.sqrt(_squares(corners).max(axis=1, initial=0.0))
        bounds = distances.max(axis=1) + longest / (2.0 if number == 2 else np.sqrt(3.0))
        samples = tree.distances(np.repeat(middles(corners), number, axis=0), nearest.ravel()).reshape(-1, number)
        rows, best = np.arange(len(corners)), samples.argmin(axis=1)
        return CellParts(corners, bounds, nearest[rows, best], distances.argmax(axis=1), samples[rows, best])

    def bounded(self, tree: NearestCells, likely: IntArray, samples: FloatArray) -> CellParts:
        """Bound each part by its corners' distances from one cell, which becomes the cell below it."""
        number = self.corners.shape[1]
        away = tree.distances(self.corners.reshape(-1, 3), np.repeat(likely, number)).reshape(-1, number)
        bounds, worst = away.max(axis=1), away.argmax(axis=1)
        better = bounds < self.bounds
        lower, corner = np.where(better, bounds, self.bounds), np.where(better, worst, self.worst)
        return CellParts(self.corners, lower, likely, corner, samples)

    def cut(self, tree: NearestCells) -> CellParts:
        """Cut each part in two or three by a plane.

        The cell below a part has one feature nearest to the part's middle: its face, an edge or a corner. The part is
        cut where it leaves the region over this feature. If it does not leave it, the feature nearest to the worst
        corner is used; failing that, the plane bisects the longest side.
        """
        square = _squares(self.corners)
        rows, longest = np.arange(len(square)), square.argmax(axis=1)
        number = self.corners.shape[1]
        heights = np.zeros((len(rows), number))
        heights[rows, longest], heights[rows, (longest + 1) % number] = -1.0, 1.0
        # A plane must pass between corners, farther from both than 1e-9 of the part's size. A height of 1e-15, for
        # coordinates up to 1, may be rounding: such planes would cut a tiny part thousands of times in vain.
        depth = np.maximum(1e-9 * np.sqrt(square.max(axis=1, initial=0.0)), 1e-15)
        over_middle = _heights(self.corners, middles(self.corners), tree.corners[self.likely])
        is_cut = (over_middle.max(axis=1) > depth) & (over_middle.min(axis=1) < -depth)
        heights[is_cut] = over_middle[is_cut]
        return self._divided(heights)

    def _divided(self, heights: FloatArray) -> CellParts:
        """Cut each part by the plane over which its corners have these (m, c) heights, of both signs."""
        number = heights.shape[1]
        above = heights > 0
        lone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
        turned = (lone[:, None] + np.arange(number)) % number  # the corner alone on its side first
        corners = np.take_along_axis(self.corners, turned[:, :, None], axis=1)
        heights = np.take_along_axis(heights, turned, axis=1)
        share = heights[:, :1] / (heights[:, :1] - heights[:, 1:])
        ends = corners[:, :1] + share[:, :, None] * (corners[:, 1:] - corners[:, :1])
        parts = np.array([[0, 2], [2, 1]] if number == 2 else [[0, 3, 4], [3, 1, 2], [3, 2, 4]])
        kept = np.ones((len(heights), len(parts)), dtype=bool)
        kept[:, 1:] = share < 1  # a cut through the corner of a triangle makes two parts
        made = rows_of(self, np.nonzero(kept)[0])
        return made._replace(corners=np.concatenate([corners, ends], axis=1)[:, parts][kept], worst=0 * made.worst)


def _sides(corners: FloatArray) -> FloatArray:
    """(m, sides, 3) sides of segments or triangles, the first from the first corner to the second."""
    sides = np.roll(corners, -1, axis=1) - corners
    return sides[:, :1] if corners.shape[1] == 2 else sides


def _squares(corners: FloatArray) -> FloatArray:
    """(m, sides) squares of the lengths of sides."""
    sides = _sides(corners)
    return np.asarray(np.einsum("ijk,ijk->ij", sides, sides))


def _heights(corners: FloatArray, inside: FloatArray, cells: FloatArray) -> FloatArray:
    """(m, c) heights of corners over the plane exceeded most around the region of a cell's feature nearest `inside`."""
    origins, normals = (_around_segment if cells.shape[1] == 2 else _around_triangle)(inside, cells)
    heights = np.einsum("ijk,ipk->ipj", corners, normals) - np.einsum("ipk,ipk->ip", origins, normals)[:, :, None]
    return np.asarray(heights[np.arange(len(cells)), heights.max(axis=2).argmax(axis=1)])


def _around_segment(inside: FloatArray, cells: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m, 2, 3) points and outward normals of the planes around the regions; beyond an end, one plane twice."""
    along, lengths = _directions(cells)
    t = ((inside - cells[:, 0]) * along[:, 0]).sum(axis=1)
    ends = np.stack([np.where(t > lengths[:, 0], 1, 0), np.where(t < 0, 0, 1)], axis=1)
    signs = np.stack([np.where(t < 0, 1.0, -1.0), np.where(t > lengths[:, 0], -1.0, 1.0)], axis=1)
    return np.take_along_axis(cells, ends[:, :, None], axis=1), signs[:, :, None] * along


def _around_triangle(inside: FloatArray, cells: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m, 3, 3) points and outward normals of the planes around the regions of the face, of an edge or of a corner."""
    along, lengths = _directions(cells)
    normal = cross(along[:, 0], along[:, 1])
    outwards = np.stack([cross(along[:, k], normal) for k in range(3)], axis=1)
    relative = inside[:, None] - cells
    t = np.einsum("ijk,ijk->ij", relative, along)
    beyond = np.einsum("ijk,ijk->ij", relative, outwards)
    beside = (beyond > 0) & (t >= 0) & (t <= lengths)
    off_face = (beyond > 0).any(axis=1)
    origins, normals = cells.copy(), outwards.copy()
    rows = np.flatnonzero(off_face & beside.any(axis=1))
    edge = np.where(beside, beyond, -1.0).argmax(axis=1)[rows]
    first, second = cells[rows, edge], cells[rows, (edge + 1) % 3]
    origins[rows] = np.stack([first, first, second], axis=1)
    normals[rows] = np.stack([-outwards[rows, edge], -along[rows, edge], along[rows, edge]], axis=1)
    rows = np.flatnonzero(off_face & ~beside.any(axis=1))
    corner = np.einsum("ijk,ijk->ij", relative, relative).argmin(axis=1)[rows]
    origins[rows] = cells[rows, corner][:, None]
    normals[rows] = np.stack([along[rows, corner], -along[rows, corner - 1], along[rows, corner]], axis=1)
    return origins, normals


def _directions(cells: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m, sides, 3) unit vectors along sides, 0 where both ends coincide, and (m, sides) lengths."""
    sides, lengths = _sides(cells), np.sqrt(_squares(cells))
    return sides / np.where(lengths > 0, lengths, 1.0)[:, :, None], lengths
