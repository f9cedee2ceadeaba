"""Smooth values at the vertices of a parallelogram's mesh, by polynomials through values at Chebyshev points.

The error falls by a constant factor with each further point in a direction if the values are analytic, edges included
(L. N. Trefethen, Approximation Theory and Approximation Practice, ch. 8). It is measured, since not all values are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.domain import Domain

FIRST_POINTS = 24
"""Chebyshev points in each direction from whose error the necessary number is estimated."""

SURPLUS = 1.25
"""Factor by which that estimate is raised."""

PLACES_PER_POINT = 16
"""Fewest wanted values for each value that is computed."""

MEASURED_PLACES = 256
"""Places all over the parallelogram at which the error is measured; it is also measured at the knots."""

INTERPOLATION_ERROR = 5e-14
"""Largest error of an interpolated value, as a fraction of the values' range …"""

ROUNDING_ULPS = 16
"""… and in units in the last place of the largest value: values far from 0 are rounded more coarsely."""

VERTEX_ULPS = 16
"""Units in the last place within which vertices are those of `triangulation`."""

BLOCK_VALUES = 1 << 18
"""Values that are made at once: two megabytes, which fit in the cache."""

Function: TypeAlias = Callable[[FloatArray], FloatArray]
"""(m, k) values at (m, 2) places."""


def fill(
    result: FloatArray, function: Function, shape: Domain, p: FloatArray, inner: IntArray, resolution: int
) -> bool:
    """Fill rows of an (m, k) result by interpolation if that is as good as `function`, and say whether it is.

    Parameters
    ----------
    result : (m, k) float
    function : callable
        Values at points inside Δ.
    shape : Domain
    p : (m, 2) float
        Points, which may be the vertices of `triangulation`, or some of them.
    inner : (i,) int
        The rows to be filled, of points inside Δ.
    resolution : int
        Cells of `triangulation` along each edge.

    Notes
    -----
    False unless Δ is a parallelogram. Values change quickly around knots, if anywhere, and are compared there, too.
    """
    v, line = shape.vertices, np.arange(1, resolution) / resolution
    if len(v) != 4 or len(inner) != len(line) ** 2:
        return False
    rows, sides = inner.reshape(len(line), -1), np.array([v[1] - v[0], v[3] - v[0]])
    border = np.ones(rows.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    expected = v[0] + (np.argwhere(border)[:, ::-1] + 1) @ sides / resolution
    if np.abs(p[rows[border]] - expected).max() > VERTEX_ULPS * EPS * np.abs(v).max():
        return False
    knots = (shape.knots[~shape.incidence.any(axis=1)] - v[0]) @ np.linalg.inv(sides)
    values = _resolved(lambda places: function(v[0] + places @ sides), len(inner), knots)
    if values is None:
        return False
    cardinals = _cardinals(len(values), line)
    columns = (cardinals @ values).reshape(len(values), -1)
    length = max(1, BLOCK_VALUES // columns.shape[1])
    for begin in range(0, len(line), length):
        block = cardinals[begin : begin + length] @ columns
        for first, row in zip(rows[begin : begin + length, 0].tolist(), block, strict=True):
            result[first : first + len(line)] = row.reshape(len(line), -1)
    return True


def _resolved(function: Function, wanted: int, knots: FloatArray) -> FloatArray | None:
    """(c, c, k) values at Chebyshev points of the unit square, row by row, if they say all; otherwise None."""
    places = np.concatenate([_all_over(MEASURED_PLACES), knots])
    count, right = FIRST_POINTS, None
    while count * count * PLACES_PER_POINT <= wanted:
        points = _points(count)
        values = function(np.stack(np.meshgrid(points, points), axis=-1).reshape(-1, 2))
        if right is None:
            right = function(places)
            span = float(np.ptp(right, axis=0).max())
            target = INTERPOLATION_ERROR * span + ROUNDING_ULPS * EPS * float(np.abs(right).max())
        x, y = (_cardinals(count, column) for column in places.T)
        lines = (y @ values.reshape(count, -1)).reshape(len(places), count, -1)
        error = float(np.abs((x[:, None] @ lines)[:, 0] - right).max())
        if error <= target:
            return values.reshape(count, count, -1)
        if not error < span:
            return None
        count = math.ceil(SURPLUS * count * math.log(target / span) / math.log(error / span))
    return None


def _points(count: int) -> FloatArray:
    """(count,) Chebyshev points of the first kind in the unit interval."""
    return np.asarray(np.sin(_angles(count)) ** 2)


def _angles(count: int) -> FloatArray:
    return np.asarray((np.arange(count) + 0.5) * (np.pi / (2 * count)))


def _cardinals(count: int, x: FloatArray) -> FloatArray:
    """(m, count) polynomials at (m,) places, each 1 at one Chebyshev point and 0 at the others.

    They are ``w_j/(x − x_j)`` but for a common factor, where the weights w_j are sines of alternating sign (J.-P.
    Berrut, L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004), sect. 5).
    """
    distance = x[:, None] - _points(count)
    hit = distance == 0
    distance[hit] = 1.0
    shares = np.sin(2 * _angles(count)) * (-1.0) ** np.arange(count) / distance
    shares /= shares.sum(axis=1, keepdims=True)
    at_point = hit.any(axis=1)
    shares[at_point] = hit[at_point]
    return np.asarray(shares)


def _all_over(count: int) -> FloatArray:
    """(count, 2) places spread evenly over the unit square: multiples of powers of the plastic number, modulo 1."""
    plastic = 1.32471795724474602596
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] / [plastic, plastic**2]) % 1.0)
