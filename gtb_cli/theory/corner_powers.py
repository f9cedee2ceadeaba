"""Knots near a corner of Δ as exponents, sums of powers with such exponents, and which of their terms lead.

See `gtb_cli.theory.corners`. A way into a corner is a pair λ > 0 of rates at which both torus coordinates fall; a term
with exponents E has the order ⟨E, λ⟩ on it.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, planar_cross, rows_of
from gtb_cli.knots.about_a_knot import cleared, coordinate_rounding
from gtb_cli.knots.domain import LAYER_TOLERANCE, Domain

AXIS = 1e-9  # λ along an edge
PLACES = 1601  # across each way on which limits turn into others


class CornerKnots(NamedTuple):
    """The n knots that are not at a corner, as seen from it."""

    x: FloatArray  # (n, 2) exponents
    logs: FloatArray  # (n,) logarithms of weights
    points: FloatArray  # (n, 3) differences of control points from the corner's
    gaps: FloatArray  # (2,) up to which exponents are equal
    rounding: float  # up to which points are equal


class Powers(NamedTuple):
    """A sum of k powers, whose factors are ``factors · exp(logs)``."""

    x: FloatArray  # (k, 2) exponents, all different
    logs: FloatArray  # (k,)
    factors: FloatArray  # (k, c)

    def of_order(self, order: float, ray: FloatArray, gaps: FloatArray) -> "Powers":
        """Return the terms of an order or a lower one on a way."""
        return rows_of(self, self.x @ ray <= order + gaps @ ray)

    def logarithms(self, places: FloatArray) -> FloatArray:
        """Return (k, p) logarithms of the terms, but for their factors, at (p, 2) torus coordinates."""
        return np.asarray(self.x @ places.T + self.logs[:, None])

    def at(self, places: FloatArray, shift: FloatArray) -> FloatArray:
        """Return (p, c) sums at (p, 2) torus coordinates, times exp(−shift)."""
        return np.asarray(np.exp(self.logarithms(places) - shift).T @ self.factors)


def corner_knots(domain: Domain, log_weights: FloatArray, points: FloatArray, corner: int) -> tuple[CornerKnots, float]:
    """Return the knots, merged where places are equal, with points in units of their extent; and the extent."""
    exponents, gaps, own = exponents_at(domain, corner)
    place = alike(exponents.T, gaps)
    tops, sums = summed(place, log_weights, np.column_stack([np.ones(len(place)), exponents, points - points[own]]))
    means, logs, here = sums[:, 1:] / sums[:, :1], tops + np.log(sums[:, 0]), place[own]
    means, logs = np.delete(means - means[here], here, axis=0), np.delete(logs - logs[here], here)
    rounding = coordinate_rounding(points)
    b = cleared(means[:, 2:], rounding)
    extent = float(np.abs(b).max()) or 1.0  # no product of points of this size is beyond floats
    return CornerKnots(means[:, :2], logs, b / extent, gaps, rounding / extent), extent


def exponents_at(domain: Domain, corner: int) -> tuple[FloatArray, FloatArray, int]:
    """Return the (n, 2) exponents of all knots at a corner of Δ, up to which they are equal, and a knot at it."""
    edges = [(corner - 1) % len(domain.vertices), corner]
    heights, incidence = domain.heights[:, edges], domain.incidence[:, edges]
    steps = [np.where(incidence[:, 1 - k] & (h > 0), h, np.inf).min() for k, h in enumerate(heights.T)]
    return heights / steps, LAYER_TOLERANCE * heights.max(axis=0) / steps, int(incidence.all(axis=1).argmax())


def alike(columns: FloatArray, gaps: Iterable[float]) -> IntArray:
    """Number groups of points that are equal up to gaps, (n,), ascending by the first of (d, n) coordinates first."""
    group = np.zeros(columns.shape[1], dtype=np.int64)
    for values, gap in zip(columns, gaps, strict=True):
        # A gap splits each group found so far.
        order = np.lexsort((values, group))
        group[order] = np.concatenate([[0], np.cumsum((np.diff(values[order]) > gap) | (np.diff(group[order]) > 0))])
    return group


def summed(number: IntArray, logs: FloatArray, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest logarithm of each group of terms, (k,), and the sums of terms over it, (k, c)."""
    count = int(number.max(initial=-1)) + 1
    tops = np.full(count, -np.inf)
    np.maximum.at(tops, number, logs)
    weights = np.exp(logs - tops[number])
    return tops, np.stack([np.bincount(number, weights * column, count) for column in factors.T], axis=1)


def newton_polygon(x: FloatArray, gaps: FloatArray) -> IntArray:
    """Return the corners of the Newton polygon of exponents, from the lowest y, then x, to the lowest x."""
    found: list[int] = []
    for k in np.lexsort((x[:, 0], alike(x.T[1:], gaps[1:]))).tolist():
        if found and x[k, 0] >= x[found[-1], 0] - gaps[0]:
            continue
        while len(found) > 1:
            step, whole = x[found[-1]] - x[found[-2]], x[k] - x[found[-2]]
            if planar_cross(step, whole) < -gaps @ np.abs(whole[::-1]):
                break
            found.pop()
        found.append(k)
    return np.array(found, dtype=np.int64)


def orders_on(exponents: FloatArray, ray: FloatArray, gaps: FloatArray) -> FloatArray:
    """Return the orders of (k, 2) exponents on a way, exactly 0 where they are 0 to rounding."""
    orders = cleared(exponents, 4 * gaps) @ ray
    return np.asarray(orders if ray.min() <= AXIS else cleared(orders, 4 * gaps @ ray))


@lru_cache(maxsize=64)
def subsets(count: int, size: int) -> IntArray:
    """Return all sets of a size of the numbers below a count, a row each."""
    return np.array(list(combinations(range(count), size)), dtype=np.int64).reshape(-1, size)


def determinants(a: FloatArray, b: FloatArray, gaps: FloatArray) -> FloatArray:
    """Return det(a, b) of (…, 2) exponents, exactly 0 where they are in line with 0."""
    return np.asarray(cleared(planar_cross(a, b), (np.abs(a) + np.abs(b))[..., ::-1] @ gaps))


def turning_places(ray: FloatArray, sums: Sequence[Powers]) -> FloatArray:
    """Return (p, 2) torus coordinates across a way, at which terms of sums, of one order each, lead in turn."""
    across = np.array([-ray[1], ray[0]])
    turns, slowest = [], math.inf
    for each in sums:
        place = each.x @ across
        order = np.argsort(place, kind="stable")
        steps, rises = np.diff(place[order]), np.diff(each.logs[order])
        apart = steps > 0  # otherwise two exponents are equal to rounding
        turns += (-rises[apart] / steps[apart]).tolist()
        slowest = min([slowest, *steps[apart].tolist()])
    if not turns:
        return np.zeros((1, 2))
    far = 16 / slowest  # where all but one term of each sum are below a millionth
    return np.asarray(np.linspace(min(turns) - far, max(turns) + far, PLACES)[:, None] * across)
