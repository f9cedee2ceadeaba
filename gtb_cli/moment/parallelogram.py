"""Smooth values at the vertices of a parallelogram's mesh, by polynomials through values at Chebyshev points.

The error falls by a constant factor with each further point in a direction if the values are analytic, edges included
(L. N. Trefethen, Approximation Theory and Approximation Practice, ch. 8). It is measured, since not all values are, and
parts in which it is too large are quartered.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import repeat
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import as_strided

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.domain import Domain

POINTS = 20
"""Chebyshev points of a part in each direction."""

MEASURED_EXTREMA = np.array([0.25, 2, 5, 8, 12, 15, 18, POINTS - 0.25])
"""Numbers of some extrema of the Chebyshev polynomial of this degree, the outer ones just inside: at all pairs of them
the error of a part is measured, as well as at the knots. Elsewhere it was at most 4 times as large on 126 patches."""

PART_VALUES = POINTS**2 + len(MEASURED_EXTREMA) ** 2
"""Values that are computed in a part."""

INTERPOLATION_ERROR = 5e-14
"""Largest error of an interpolated value, as a fraction of the values' range …"""

ROUNDING_ULPS = 8
"""… and in units in the last place of the largest value."""

MAX_OFFSET = 64
"""Largest value, as a multiple of the range, that is interpolated: its rounding would be multiplied for nothing."""

MIN_VERTICES_PER_VALUE = 6
"""Fewest vertices in a part for each value computed there: computing all their values takes about twice as long …"""

MIN_VERTICES_PER_DOUBT = 24
"""… and the fewest if, by the error of the whole, the error of a quarter will probably be too large."""

MAX_LEFT_SHARE = 0.35
"""Largest share of vertices left to others: if more are left, all of them are found sooner together."""

VERTEX_ULPS = 16
"""Units in the last place within which vertices are those of `triangulation`."""

BLOCK_VALUES = 1 << 18
"""Values that are made at once: two megabytes, which fit in the cache."""

QUARTERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
"""Corners of the quarters of a part, in halves of it."""

Function: TypeAlias = Callable[[FloatArray, FloatArray | None], FloatArray]
"""(m, 2 + k) values at (m, 2) places: first two of which approximate ones, if there are any, help with the others."""


def fill(
    result: FloatArray, function: Function, shape: Domain, p: FloatArray, inner: IntArray, resolution: int
) -> IntArray | None:
    """Fill rows of an (m, k) result by interpolation where that is as good as `function` to rounding.

    Parameters
    ----------
    result : (m, k) float
    function : callable
        Values at points inside Δ; the first two serve only to start from.
    shape : Domain
    p : (m, 2) float
        Points, which may be the vertices of `triangulation`, or some of them.
    inner : (i,) int
        The rows to be filled, of points inside Δ.
    resolution : int
        Cells of `triangulation` along each edge.

    Returns
    -------
    (l,) int or None
        The rows that are left to do; None if nothing is filled, as unless Δ is a parallelogram.
    """
    v, line = shape.vertices, np.arange(1, resolution) / resolution
    if len(v) != 4 or len(inner) != len(line) ** 2 or len(inner) < MIN_VERTICES_PER_DOUBT * PART_VALUES:
        return None
    rows, sides = inner.reshape(len(line), -1), np.array([v[1] - v[0], v[3] - v[0]])
    border = np.ones(rows.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    expected = v[0] + (np.argwhere(border)[:, ::-1] + 1) @ sides / resolution
    step = rows[-1, 0] - rows[-2, 0]
    if (
        np.abs(p[rows[border]] - expected).max() > VERTEX_ULPS * EPS * np.abs(v).max()
        or (np.diff(rows[:, 0]) != step).any()
    ):
        return None
    # Values change quickly around knots, if anywhere.
    knots = (shape.knots[~shape.incidence.any(axis=1)] - v[0]) @ np.linalg.inv(sides)
    parts = _parts(lambda places, start: function(v[0] + places @ sides, start), knots, len(inner))
    if parts is None:
        return None
    row, number = result.strides
    table = as_strided(result[inner[0] :], (*rows.shape, result.shape[1]), (step * row, row, number))
    left = np.ones(rows.shape, dtype=bool)
    for part in parts:
        (columns, along), (lines, across) = (part.cardinals(axis, line) for axis in (0, 1))
        left[lines, columns] = False
        sums = (along @ part.values).reshape(POINTS, -1)
        length = max(1, BLOCK_VALUES // sums.shape[1])
        for begin in range(0, len(across), length):
            block = across[begin : begin + length] @ sums
            some = slice(lines.start + begin, lines.start + begin + len(block))
            table[some, columns] = block.reshape(len(block), len(along), -1)
    return rows[left]


class _Part(NamedTuple):
    """A square part of the unit square, and (POINTS, POINTS, k) values at its Chebyshev points, row by row."""

    corner: FloatArray
    size: float
    values: FloatArray

    def cardinals(self, axis: int, line: FloatArray) -> tuple[slice, FloatArray]:
        """Which of ascending coordinates in a direction lie in this part, and the polynomials there."""
        begin, end = np.searchsorted(line, [self.corner[axis], self.corner[axis] + self.size]).tolist()
        return slice(begin, end), _cardinals((line[begin:end] - self.corner[axis]) / self.size)


def _parts(function: Function, knots: FloatArray, vertices: int) -> list[_Part] | None:
    """Parts of the unit square in which polynomials are as good as a function; None if too many are missing."""
    places, polynomials, quarters = _places()
    values = function(np.concatenate([places, knots]), None)
    starts, values, at_knots = values[:PART_VALUES, :2], values[:PART_VALUES, 2:], values[PART_VALUES:, 2:]
    span, largest = float(np.ptp(values, axis=0).max()), float(np.abs(values).max())
    if not largest <= MAX_OFFSET * span:  # also NaN
        return None
    target = INTERPOLATION_ERROR * span + ROUNDING_ULPS * EPS * largest
    corners, size, parts, left = np.zeros((1, 2)), 1.0, list[_Part](), 0.0
    while True:
        chosen, right = np.split(values.reshape(len(corners), PART_VALUES, -1), [POINTS**2], axis=1)
        error = np.abs(np.tensordot(polynomials, chosen, (1, 1)) - right.swapaxes(0, 1)).max(axis=(0, 2))
        good = error <= target
        for part in np.flatnonzero(good).tolist():
            steps = (knots - corners[part]) / size
            inside = ((steps >= 0) & (steps < 1)).all(axis=1)
            off = _polynomials(steps[inside]) @ chosen[part] - at_knots[inside]
            good[part] = np.abs(off).max(initial=0.0) <= target
        shape = (-1, POINTS, POINTS, chosen.shape[2])
        parts += [_Part(*one) for one in zip(corners[good], repeat(size), chosen[good].reshape(shape))]
        # Half as large, a part has the square of the error: there are twice as many points for each length.
        is_hopeful = error <= np.sqrt(target) * np.sqrt(span)
        room = np.where(is_hopeful, MIN_VERTICES_PER_VALUE, MIN_VERTICES_PER_DOUBT) * PART_VALUES
        split = ~good & (vertices * size**2 / 4 >= room)
        left += float((~good & ~split).sum()) * size**2
        if left > MAX_LEFT_SHARE or not split.any():
            return parts if left <= MAX_LEFT_SHARE else None
        size /= 2
        corners = (corners[split][:, None] + size * QUARTERS).reshape(-1, 2)
        starts = np.tensordot(quarters, starts.reshape(len(split), -1, 2)[split, : POINTS**2], (1, 1)).swapaxes(0, 1)
        values = function((corners[:, None] + size * places).reshape(-1, 2), starts.reshape(-1, 2))
        starts, values = values[:, :2], values[:, 2:]


@cache
def _places() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Chebyshev points of the unit square, row by row, and places between; values of the points' polynomials there.

    The third is the same for all places in its quarters.
    """
    lines = np.sin(_angles()) ** 2, np.sin(MEASURED_EXTREMA * (np.pi / (2 * POINTS))) ** 2
    points, between = (np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2) for line in lines)
    places = np.concatenate([points, between])
    return places, _polynomials(between), _polynomials(((places + QUARTERS[:, None]) / 2).reshape(-1, 2))


def _polynomials(places: FloatArray) -> FloatArray:
    """(m, POINTS²) values at (m, 2) places."""
    x, y = (_cardinals(column) for column in places.T)
    return np.asarray((y[:, :, None] * x[:, None]).reshape(-1, POINTS**2))


def _angles() -> FloatArray:
    return np.asarray((np.arange(POINTS) + 0.5) * (np.pi / (2 * POINTS)))


def _cardinals(x: FloatArray) -> FloatArray:
    """(m, POINTS) polynomials at (m,) places, each 1 at one Chebyshev point and 0 at the others.

    They are ``w_j/(x − x_j)`` but for a common factor, where the weights w_j are sines of alternating sign (J.-P.
    Berrut, L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004), sect. 5).
    """
    distance = x[:, None] - np.sin(_angles()) ** 2
    hit = distance == 0
    distance[hit] = 1.0
    shares = np.sin(2 * _angles()) * (-1.0) ** np.arange(POINTS) / distance
    shares /= shares.sum(axis=1, keepdims=True)
    at_point = hit.any(axis=1)
    shares[at_point] = hit[at_point]
    return np.asarray(shares)
