"""Bounds of the difference of two rational curves, or surfaces, whose torus coordinates correspond by an affine map."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.theory.corner_powers import alike, summed


class Rational(NamedTuple):
    """``P(s) = Σ_i w_i e^{<a_i, s>} p_i / Σ_i w_i e^{<a_i, s>}``."""

    knots: FloatArray  # (n, d)
    logs: FloatArray  # (n,) logarithms of weights
    points: FloatArray  # (n, c)
    heights: FloatArray  # (n, r) distances from the ends or edges of the hull of the knots, 0 on them


class CornerTerms(NamedTuple):
    """The terms that a curve or a surface begins with at a corner: the first other control points along its edges."""

    point: FloatArray  # (c,)
    steps: FloatArray  # (d, d) from the knots at the corner
    logs: FloatArray  # (d,) logarithms of weights times distances, relative to the corner's weight

    def carried(self, other: "CornerTerms", order: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return Mᵀ and β with which the terms are those of another one, whose edges are taken in an order."""
        steps, logs = other.steps[[*order]], self.logs - other.logs[[*order]]
        return np.asarray(np.linalg.solve(steps, self.steps)), np.asarray(np.linalg.solve(steps, logs))


def corners_of(shape: Rational, least: float) -> list[CornerTerms]:
    """Return the corners, in order, along whose edges control points differ by more than a distance."""
    dimension = shape.knots.shape[1]
    place = alike(shape.knots.T, [knot_tolerance(shape.knots)] * dimension)  # copies act as one
    tops, sums = summed(place, shape.logs, np.column_stack([np.ones(len(place)), shape.points]))
    first = np.unique(place, return_index=True)[1]
    knots, logs, points = shape.knots[first], tops + np.log(sums[:, 0]), sums[:, 1:] / sums[:, :1]
    on = shape.heights[first].T == 0
    found = []
    for index in range(len(on)):
        edges = np.array([on[index], on[index - 1]]) if dimension == 2 else np.ones((1, len(knots)), dtype=bool)
        corner = int((on[index] & edges[-1]).argmax())
        steps, apart = knots - knots[corner], np.linalg.norm(points - points[corner], axis=1)
        lengths = np.where(edges & (apart > least), np.linalg.norm(steps, axis=1), np.inf)
        rows = lengths.argmin(axis=1)
        if np.isfinite(lengths.min(axis=1)).all():
            found.append(CornerTerms(points[corner], steps[rows], logs[rows] - logs[corner] + np.log(apart[rows])))
    return found


def difference(one: Rational, other: Rational, turn: FloatArray, shift: FloatArray) -> tuple[float, FloatArray]:
    """Bound ``P(s) − Q(M s + β)``, with M = `turn` transposed, (d, d), and β = `shift`, (d,); and a step for β.

    It is itself rational: its knots are a_i + Mᵀ b_j, its weights w_i v_j e^{<β, b_j>}, its control points p_i − q_j,
    and those of equal knots act as one (Thm 4.1). Exponentials are linearly independent, so that it is 0 if, and only
    if, these control points all are; and it is nowhere longer than the longest of them. The bound is infinite if there
    are too many terms; the step is to be subtracted from β.
    """
    most = 1_000_000  # terms, which need some 100 MB
    if len(one.knots) * len(other.knots) > most:
        return np.inf, 0 * shift
    dimension, count = one.knots.shape[1], len(one.knots)
    knots = (one.knots[:, None] + other.knots @ turn).reshape(-1, dimension)
    logs = (one.logs[:, None] + other.logs + other.knots @ shift).ravel()
    apart = (one.points[:, None] - other.points).reshape(len(knots), -1)
    rates = np.tile(other.knots, (count, 1))
    products = (apart[:, :, None] * rates[:, None]).reshape(len(knots), -1)
    number = alike(knots.T, [knot_tolerance(knots)] * dimension)
    sums = summed(number, logs, np.column_stack([np.ones(len(knots)), rates, apart, products]))[1]
    rate, mean, slopes = np.split(sums[:, 1:] / sums[:, :1], [dimension, dimension + apart.shape[1]], axis=1)
    slopes = slopes - (mean[:, :, None] * rate[:, None]).reshape(len(slopes), -1)
    step = np.linalg.lstsq(slopes.reshape(-1, dimension), mean.ravel(), rcond=None)[0]
    # Knots that were merged over a gap: a share grows by e^{|s| gap}, which does not count where all shares but those
    # on an edge are below a rounding.
    gap = np.abs(knots - knots[np.unique(number, return_index=True)[1]][number]).max()
    layers = max(float((h.max(0) / np.where(h > 0, h, np.inf).min(0)).max()) for h in (one.heights, other.heights))
    reach = layers * (np.ptp(logs) - np.log(EPS)) / one.heights.max(axis=0).min()
    growth = np.expm1(min(gap * reach, 1.0)) * np.linalg.norm(apart, axis=1).max()
    return float(np.linalg.norm(mean, axis=1).max() + growth), np.asarray(step)


def least_difference(
    one: Rational, other: Rational, turn: FloatArray, shift: FloatArray, enough: float
) -> tuple[float, FloatArray]:
    """Return a bound of the difference and β, by Newton's method until it is enough, or no longer falls by half."""
    bound, step = difference(one, other, turn, shift)
    while bound > enough:
        nearer, next_step = difference(one, other, turn, shift - step)
        if not nearer < bound / 2:
            break
        bound, shift, step = nearer, shift - step, next_step
    return bound, shift
