"""The points of a surface nearest to given points, found by Newton's method in torus coordinates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import reduce
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, column_dot
from gtb_cli.moment.torus import scaled_exponentials
from gtb_cli.sequences.continuation import Stratum, squares_of

LONGEST_SLIDE = 2.0
"""Longest step of a nearest point, in torus coordinates of unit knots."""

ROUNDING_DISTANCE = 1e-14
"""Distance, as a fraction of the control points' extent, below which all is rounding."""

MAX_FOOT_STEPS = 40
"""Steps to a nearest point. Four mostly suffice, but towards an edge, which is infinitely far, each step only divides
the remaining distance by e."""

MIN_CURVATURE_RATIO = 1e-3
"""Ratio of the curvature of half the squared distance to that from a plane, below which the latter is used."""

PAIRS = ((0, 0), (1, 1), (0, 1))
"""Pairs of coordinates by which second derivatives are taken, in order."""


class Chart(ABC):
    """Points of a surface in torus coordinates s, with their derivatives.

    What else tells where the points are stands in columns, one for each point: see `StratumChart`, `MovingChart`.
    """

    dimension: int

    @abstractmethod
    def points(self, s: FloatArray, columns: Any) -> FloatArray:
        """(3, m) points at (d, m) torus coordinates."""

    @abstractmethod
    def derivatives(self, s: FloatArray, columns: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(3, m) points, (d, 3, m) first and (1 or 3, 3, m) second derivatives with respect to s; see `PAIRS`."""

    def least_squares(
        self, points: FloatArray, start: FloatArray, columns: Any, accuracy: float, enough: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Find the points of the surface nearest to (3, m) points, by Newton's method from (d, m) starts.

        Returns their (m,) squared distances and (d, m) torus coordinates.

        Ends when a step would not shorten the squared distance by more than a fraction `accuracy`, or when this is at
        most `enough` (m,).
        """
        s, active = start, np.arange(start.shape[1])
        squares, enough = np.full(len(active), np.inf), np.maximum(enough, ROUNDING_DISTANCE**2)
        feet = s.copy()
        best, least, reach = s, squares, np.full(len(active), LONGEST_SLIDE / 2)
        for _ in range(MAX_FOOT_STEPS):
            place, first, second = self.derivatives(s, columns)
            apart = place - points
            square = column_dot(apart, apart)
            better = square < least
            gradient = np.stack([column_dot(each, apart) for each in first])
            reach = np.where(better, np.minimum(2 * reach, LONGEST_SLIDE), reach / 4)
            step = _descent(gradient, first, [column_dot(each, apart) for each in second], reach)
            # Three quarters of a step that led farther away are taken back.
            following = np.where(better, s + step, best + (s - best) / 4)
            best, least = np.where(better, s, best), np.where(better, square, least)
            squares[active], feet[:, active] = least, best
            near = better & (-(gradient * step).sum(axis=0) <= accuracy * square)
            going = np.flatnonzero(~near & (least > enough))
            if not len(going):
                break
            active, s, points, columns = active[going], following[:, going], points[:, going], columns[..., going]
            best, least, reach, enough = best[:, going], least[going], reach[going], enough[going]
        return squares, feet


class StratumChart(Chart):
    """Places of a stratum, as quotients of sums over its knots; columns are (n, m) logarithms of weights."""

    def __init__(self, stratum: Stratum, middle: FloatArray, unit: float) -> None:
        self.stratum, self.dimension = stratum, stratum.knots.shape[1]
        b = ((stratum.control_points - middle) / unit).T
        moments = np.concatenate([np.ones((1, b.shape[1])), stratum.knots.T, squares_of(stratum.knots)])
        self.count = len(moments)
        self.summed = np.concatenate([moments, (moments[:, None] * b).reshape(-1, b.shape[1])])

    def points(self, s: FloatArray, weights: FloatArray) -> FloatArray:
        """See `Chart`."""
        e = scaled_exponentials(self.stratum.knots @ s + weights)
        return np.asarray((self.summed[self.count : self.count + 3] @ e) / e.sum(axis=0))

    def derivatives(self, s: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Chart`."""
        sums = self.summed @ scaled_exponentials(self.stratum.knots @ s + weights)
        sums /= sums[0]
        d, a = self.dimension, sums[1 : self.count]
        mixed = sums[self.count :].reshape(self.count, 3, -1)
        points = mixed[0]
        mu, first, second = a[:d], mixed[1 : d + 1], mixed[d + 1 :]
        for k, (i, j) in enumerate(PAIRS[: len(second)]):
            second[k] += (2 * mu[i] * mu[j] - a[d + k]) * points - mu[i] * first[j] - mu[j] * first[i]
        first = first - mu[:, None] * points
        return points, first, second


class MovingChart(Chart):
    """Points of surfaces whose knots differ; columns are (m,) numbers of surfaces.

    Parameters
    ----------
    knots : (d, n, k) float
    log_weights : (n, k) float
    control_points : (3, n) float
    """

    def __init__(self, knots: FloatArray, log_weights: FloatArray, control_points: FloatArray) -> None:
        self.knots, self.log_weights, self.control_points = knots, log_weights, control_points
        self.dimension = len(knots)

    def points(self, s: FloatArray, surface: IntArray) -> FloatArray:
        """See `Chart`."""
        return np.asarray(self.control_points @ self._shares(s, self.knots[..., surface], surface))

    def derivatives(self, s: FloatArray, surface: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `Chart`."""
        knots, b = self.knots[..., surface], self.control_points
        shares = self._shares(s, knots, surface)
        points = b @ shares
        centred = [each - (shares * each).sum(axis=0) for each in knots]
        weighted = [shares * each for each in centred]
        products = [weighted[i] * centred[j] for i, j in PAIRS[: 2 * self.dimension - 1]]
        second = np.stack([b @ each - each.sum(axis=0) * points for each in products])
        return points, np.stack([b @ each for each in weighted]), second

    def _shares(self, s: FloatArray, knots: FloatArray, surface: IntArray) -> FloatArray:
        """(n, m) shares of the knots in the points."""
        e = scaled_exponentials(
            reduce(np.add, (a * x for a, x in zip(knots, s, strict=True))) + self.log_weights[:, surface]
        )
        return np.asarray(e / e.sum(axis=0))


def _descent(gradient: FloatArray, first: FloatArray, bends: list[FloatArray], reach: FloatArray) -> FloatArray:
    """(d, m) steps towards the least squared distance: along each principal axis of its Hessian, at most (m,) `reach`.

    Where the curvature along an axis is not positive, that of the distance from a plane is used.
    """
    xx = column_dot(first[0], first[0])
    if len(first) == 1:
        return _along(gradient[0], xx + bends[0], xx, reach)[None]
    yy, xy = column_dot(first[1], first[1]), column_dot(first[0], first[1])
    a, b, c = xx + bends[0], yy + bends[1], xy + bends[2]
    # Towards an edge, which is infinitely far, one curvature may vanish to rounding; steps along its axis must remain.
    turn = 0.5 * np.arctan2(2 * c, a - b)
    cos, sin = np.cos(turn), np.sin(turn)
    middle, radius = (a + b) / 2, np.hypot((a - b) / 2, c)
    across, mixed = cos * gradient[1] - sin * gradient[0], 2 * cos * sin * xy
    high = _along(cos * gradient[0] + sin * gradient[1], middle + radius, cos**2 * xx + sin**2 * yy + mixed, reach)
    low = _along(across, middle - radius, sin**2 * xx + cos**2 * yy - mixed, reach)
    return np.stack([cos * high - sin * low, sin * high + cos * low])


def _along(gradient: FloatArray, curvature: FloatArray, plane: FloatArray, reach: FloatArray) -> FloatArray:
    curvature = np.where(curvature > MIN_CURVATURE_RATIO * plane, curvature, np.maximum(plane, 0.0))
    return np.clip(-gradient / np.maximum(curvature, np.finfo(float).tiny), -reach, reach)
