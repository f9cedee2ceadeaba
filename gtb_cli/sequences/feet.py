"""The points of a surface nearest to given points, found by Newton's method in torus coordinates."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.newton import dot
from gtb_cli.sequences.continuation import Stratum, squares_of
from gtb_cli.theory.basis import scaled_exponentials

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


class Chart:
    """Points of a stratum and their derivatives with respect to s, as quotients of sums over its knots."""

    def __init__(self, stratum: Stratum, middle: FloatArray, unit: float) -> None:
        self.stratum, self.dimension = stratum, stratum.knots.shape[1]
        b = ((stratum.control_points - middle) / unit).T
        moments = np.concatenate([np.ones((1, b.shape[1])), stratum.knots.T, squares_of(stratum.knots)])
        self.count = len(moments)
        self.summed = np.concatenate([moments, (moments[:, None] * b).reshape(-1, b.shape[1])])

    def points(self, s: FloatArray, weights: FloatArray) -> FloatArray:
        """(3, m) points at (d, m) torus coordinates under (n, m) logarithms of weights."""
        e = scaled_exponentials(self.stratum.knots @ s + weights)
        return np.asarray((self.summed[self.count : self.count + 3] @ e) / e.sum(axis=0))

    def derivatives(self, s: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(3, m) points, (d, 3, m) first and (1 or 3, 3, m) second derivatives with respect to s; see `PAIRS`."""
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

    def least_squares(self, points: FloatArray, start: FloatArray, weights: FloatArray, accuracy: float) -> FloatArray:
        """(m,) squared distances of (3, m) points from the surface, found by Newton's method from (d, m) starts.

        Ends when a step would not shorten the squared distance by more than a fraction `accuracy`.
        """
        s, active = start, np.arange(start.shape[1])
        squares = np.full(len(active), np.inf)
        best, least, reach = s, squares, np.full(len(active), LONGEST_SLIDE / 2)
        for _ in range(MAX_FOOT_STEPS):
            place, first, second = self.derivatives(s, weights)
            apart = place - points
            square = dot(apart, apart)
            better = square < least
            gradient = np.stack([dot(each, apart) for each in first])
            reach = np.where(better, np.minimum(2 * reach, LONGEST_SLIDE), reach / 4)
            step = _descent(gradient, first, [dot(each, apart) for each in second], reach)
            # Three quarters of a step that led farther away are taken back.
            following = np.where(better, s + step, best + (s - best) / 4)
            best, least = np.where(better, s, best), np.where(better, square, least)
            squares[active] = least
            near = better & (-(gradient * step).sum(axis=0) <= accuracy * square)
            going = np.flatnonzero(~near & (least > ROUNDING_DISTANCE**2))
            if not len(going):
                break
            active, s, points, weights = active[going], following[:, going], points[:, going], weights[:, going]
            best, least, reach = best[:, going], least[going], reach[going]
        return squares


def _descent(gradient: FloatArray, first: FloatArray, bends: list[FloatArray], reach: FloatArray) -> FloatArray:
    """(d, m) steps towards the least squared distance: along each principal axis of its Hessian, at most (m,) `reach`.

    Where the curvature along an axis is not positive, that of the distance from a plane is used.
    """
    xx = dot(first[0], first[0])
    if len(first) == 1:
        return _along(gradient[0], xx + bends[0], xx, reach)[None]
    yy, xy = dot(first[1], first[1]), dot(first[0], first[1])
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
