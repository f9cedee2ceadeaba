"""Data that the moment maps of one set of knots share for all weights: the hull, and the last cells.

The patches of a family, and their parts, differ only in their weights and mostly have the same regular decomposition.
Finding it anew for each took half the time of a sequence of coarse meshes.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from gtb_cli.knots.decomposition import RegularDecomposition

START_FLOOR = 1e-17
"""Smallest distance from an edge used for a start, as a fraction of the next layer's: nearer points start there."""

MAX_KEPT_HULLS = 1024
"""Number of sets of knots whose hull and last cells are kept: the patches of a family differ only in their weights."""

MAX_COMPARED_PAIRS = 1_000_000
"""Largest number of pairs of a cell and a knot for which the last cells are tested with other weights."""

PLANE_TOLERANCE = 1e-13
"""Distance from a cell's plane, as a fraction of its values, within which a lifted knot clearly belongs to the cell."""

CLEAR_GAP = 1e-9
"""Depth below the plane beyond which rounding cannot make a knot the cell's: earlier results must not change any
digit."""


class LayerStarts:
    """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)``: torus coordinates of p if only the nearest layers of knots counted.

    Parameters
    ----------
    shape : Domain
        The hull; δ_j is the distance from edge j to the nearest knots not on it.
    """

    def __init__(self, shape: Domain) -> None:
        self.layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        self.normals = shape.normals
        self.offsets = np.einsum("jk,jk->j", shape.normals, shape.vertices)

    def __call__(self, p: FloatArray, floor: float = START_FLOOR) -> FloatArray:
        """(d, m) starts of (d, m) points."""
        heights = self.normals @ p
        heights -= self.offsets[:, None]
        heights /= self.layer[:, None]
        np.maximum(heights, floor, out=heights)
        np.log(heights, out=heights)
        return np.asarray((self.normals / self.layer[:, None]).T @ heights)

    def slopes(self, p: FloatArray) -> FloatArray:
        """(d, d, m) derivatives of the starts of (d, m) points; inf or NaN on edges."""
        heights = self.normals @ p - self.offsets[:, None]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(np.einsum("jk,jl,jm->klm", self.normals, self.normals / self.layer[:, None], 1 / heights))


class Hull:
    """The hull of unit knots, and the cells of the weights used last."""

    def __init__(self, shape: Domain) -> None:
        self.shape, self.starts = shape, LayerStarts(shape)
        self.cells: _Cells | None = None


class CellStarts:
    """The starts of `LayerStarts` for a cell with (n, d) knots, in their coordinates."""

    def __init__(self, knots: FloatArray) -> None:
        self.knots, self.extents, self.origin = knots, extents_of(knots), origin_of(knots)

    @cached_property
    def _starts(self) -> LayerStarts:
        return hull_of((self.knots - self.origin) / self.extents).starts

    def __call__(self, p: FloatArray, floor: float) -> FloatArray:
        """(d, m) starts of (d, m) points."""
        unit = ((p.T - self.origin) / self.extents).T
        return np.asarray(self._starts(unit, floor) / self.extents[:, None])


def hull_of(knots: FloatArray) -> Hull:
    """The hull of (n, d) unit knots."""
    return _hull(np.ascontiguousarray(knots).tobytes(), knots.shape[1])


@lru_cache(MAX_KEPT_HULLS)
def _hull(knots: bytes, dimension: int) -> Hull:
    return Hull(domain(np.frombuffer(knots).reshape(-1, dimension), "unit"))


def extents_of(knots: FloatArray) -> FloatArray:
    """(d,) extents of (n, d) knots."""
    return np.asarray(np.ptp(knots, axis=0))


def origin_of(knots: FloatArray) -> FloatArray:
    """(d,) 0 if zeros in the coordinates of (n, d) knots are exact, as over an edge; else the middle of the hull."""
    low, high = knots.min(axis=0), knots.max(axis=0)
    far = np.maximum(np.abs(low), np.abs(high)) > 4 * extents_of(knots)
    return np.where(far, (low + high) / 2, 0.0)


def cells_with_gradients(hull: Hull, knots: FloatArray, w: FloatArray) -> tuple[tuple[CellStarts, FloatArray], ...]:
    """The cells of the regular decomposition that (n,) values induce on unit knots, with their gradients."""
    cells = hull.cells  # other threads may change it
    planes = None if cells is None else cells.gradients(w)
    if cells is None or planes is None:
        from gtb_cli.knots.decomposition import regular_decomposition  # for extreme weights only

        parts = regular_decomposition(knots, w)
        hull.cells = cells = _Cells.of(knots, parts)
        planes = cells.gradients(w)
        if planes is None:
            planes = parts.gradients[cells.order]
    return tuple(zip(cells.starts, planes, strict=True))


@frozen
class _Cells:
    """The cells of a regular decomposition, in the order of their knots."""

    knots: FloatArray
    cells: list[tuple[int, ...]]
    corners: IntArray  # (c, d + 1) knots that span each cell
    order: list[int]
    starts: list[CellStarts]

    @staticmethod
    def of(knots: FloatArray, parts: RegularDecomposition) -> _Cells:
        order = sorted(range(len(parts.cells)), key=lambda k: sorted(parts.cells[k]))
        cells = [parts.cells[k] for k in order]
        corners = np.array([_spanning(parts.polygons[k]) for k in order])
        return _Cells(knots, cells, corners, order, [CellStarts(knots[list(cell)]) for cell in cells])

    def gradients(self, w: FloatArray) -> FloatArray | None:
        """(c, d) gradients of the lifted cells, if (n,) values clearly have the same cells; otherwise None."""
        if len(self.cells) * len(w) > MAX_COMPARED_PAIRS:
            return None
        affine = np.column_stack([self.knots, np.ones(len(w))])
        try:
            planes = np.linalg.solve(affine[self.corners], w[self.corners][..., None])[..., 0]
        except np.linalg.LinAlgError:
            return None
        below = planes @ affine.T - w
        scale = float(np.abs(planes).max() + np.abs(w).max())
        for row, cell in zip(below, self.cells, strict=True):
            own = list(cell)
            if np.abs(row[own]).max() > PLANE_TOLERANCE * scale:
                return None
            row[own] = np.inf
        return np.asarray(planes[:, :-1]) if below.min() > CLEAR_GAP * scale else None


def _spanning(polygon: tuple[int, ...]) -> tuple[int, ...]:
    """Corners of a cell that are not collinear: both ends of a segment, three distant corners of a polygon."""
    return polygon if len(polygon) == 2 else (polygon[0], polygon[len(polygon) // 3], polygon[2 * len(polygon) // 3])
