"""Where Newton's method starts that inverts a moment map: torus coordinates of points of a hull, nearly."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.domain import Domain

START_FLOOR = 1e-17
"""Distance from an edge, as a fraction of the next layer's, from which points nearer still are started."""

PARTS = 64
"""The box around Δ is cut into this many parts each way."""

FARTHEST = 1.0
"""Largest exponent by which the slope of a correction may move a start: beyond, it is no guide."""


class LayerStarts:
    """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)``: torus coordinates of p as if only the nearest layers of knots counted.

    Parameters
    ----------
    shape : Domain
        The hull; δ_j is the distance of the knots nearest to edge j, but not on it.
    """

    def __init__(self, shape: Domain) -> None:
        self.layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        self.normals = shape.normals
        self.offsets = np.einsum("jk,jk->j", shape.normals, shape.vertices)

    def __call__(self, p: FloatArray, floor: float = START_FLOOR) -> FloatArray:
        """(d, m) starts of (d, m) points."""
        heights = self.normals @ p - self.offsets[:, None]
        logs = np.log(np.maximum(heights / self.layer[:, None], floor))
        return np.asarray((self.normals / self.layer[:, None]).T @ logs)

    def slopes(self, p: FloatArray) -> FloatArray:
        """(d, d, m) derivatives of the starts of (d, m) points; inf or NaN on edges."""
        heights = self.normals @ p - self.offsets[:, None]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(np.einsum("jk,jl,jm->klm", self.normals, self.normals / self.layer[:, None], 1 / heights))


class Corrections:
    """What the solutions of points of a polygon differ by from their starts, to start others near them with.

    Of each part of the box around the polygon one point is remembered, and the slope there. Parts are narrow along
    the box's sides where a polygon has edges and corners: there, solutions go to infinity.

    Parameters
    ----------
    low, high : (2,) float
        Corners of the box. Its lower side is the edge that points are near to.
    """

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        self.low, self.high = low, high
        self.places = np.zeros((2, PARTS * PARTS))
        self.values = np.full((2, PARTS * PARTS), np.nan)
        self.slopes = np.zeros((2, 2, PARTS * PARTS))

    def part(self, p: FloatArray) -> IntArray:
        """(m,) numbers of the parts that (2, m) points lie in."""
        along, over = np.clip((p - self.low[:, None]) / (self.high - self.low)[:, None], 0, 1)
        column, row = (
            np.minimum(share * PARTS, PARTS - 1).astype(np.int64)
            for share in (np.arccos(1 - 2 * along) / np.pi, np.sqrt(over))
        )
        return np.asarray(column + PARTS * row)

    def unknown(self, part: IntArray, uses: int) -> IntArray:
        """The first points in parts of which nothing is known, and where so many points are at least."""
        first = np.full(PARTS * PARTS, -1)
        first[part[::-1]] = np.arange(len(part))[::-1]
        chosen = (np.bincount(part, minlength=PARTS * PARTS) >= uses) & np.isnan(self.values[0])
        return np.asarray(first[chosen])

    def learn(self, part: IntArray, p: FloatArray, values: FloatArray, slopes: FloatArray) -> None:
        """Remember, of (k,) parts, (2, k) points, their corrections and the (2, 2, k) slopes of these."""
        self.places[:, part], self.values[:, part] = p, values
        self.slopes[:, :, part] = np.where(np.isfinite(slopes), slopes, 0.0)

    def __call__(self, part: IntArray, p: FloatArray) -> FloatArray:
        """(2, m) corrections at (2, m) points; 0 in parts of which nothing is known."""
        move = p - self.places[:, part]
        slope = self.slopes[:, :, part]
        turn = slope[:, 0] * move[0] + slope[:, 1] * move[1]
        correction = self.values[:, part] + np.where(np.abs(turn) < FARTHEST, turn, 0.0)
        return np.asarray(np.where(np.isnan(correction), 0.0, correction))
