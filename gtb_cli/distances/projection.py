"""The points of a surface nearest to given points, found by Newton's method in torus coordinates."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, column_dot, row_blocks
from gtb_cli.distances.strata import Strata

ROUNDING = 1e-14  # distance, as a fraction of the size of the surfaces, below which all is rounding


def projected(
    strata: Strata, points: FloatArray, stratum: IntArray, s: FloatArray, accuracy: float, enough: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Move along strata, from (m, 2) coordinates in (m,) strata, to the places nearest to (m, 3) points.

    Return (m,) distances, never too short, with a relative error of `accuracy` or at most `enough`, and coordinates.
    """
    distances, found = np.empty(len(points)), np.empty_like(s)
    for rows in row_blocks(len(points), 1 + 100_000 // len(strata.log_weights)):
        there, least = strata.chosen(stratum[rows]), enough[rows] ** 2
        squares, found[rows] = _least_squares(there, points[rows].T, s[rows].T, 0.2 * accuracy, least)
        distances[rows] = np.sqrt(squares)
    return distances, found


def _least_squares(
    strata: Strata, points: FloatArray, start: FloatArray, accuracy: float, enough: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return least squared distances of (3, m) points from a stratum each, (m,), and the nearest places, (m, 2).

    Ends when a step would not shorten the square by more than a fraction `accuracy`, or when it is at most `enough`.
    """
    longest_step = 32.0  # towards an edge, steps are as long as one over its distance from the next knots
    s, active = np.ascontiguousarray(start), np.arange(start.shape[1])
    squares, enough, places = np.full(len(active), np.inf), np.maximum(enough, ROUNDING**2), s.copy()
    best, least, reach = s, squares, np.full(len(active), longest_step / 2)
    for _ in range(80):  # mostly four; an edge is infinitely far, and each step divides the remaining distance by e
        place, first, second = strata.derivatives(s)
        apart = place - points
        square = column_dot(apart, apart)
        better = square < least
        reach = np.where(better, np.minimum(2 * reach, longest_step), reach / 4)
        step, gain = _descent(apart, first, np.einsum("pxm,xm->pm", second, apart), reach)
        # Three quarters of a step that led farther away are taken back.
        following = np.where(better, s + step, best + (s - best) / 4)
        best, least = np.where(better, s, best), np.where(better, square, least)
        squares[active], places[:, active] = least, best
        going = np.flatnonzero(~(better & (gain <= accuracy * square)) & (least > enough))
        if not len(going):
            break
        if len(going) < len(active):
            strata, active, points, enough = strata.chosen(going), active[going], points[:, going], enough[going]
        s, best, least, reach = following[:, going], best[:, going], least[going], reach[going]
    return squares, places.T


def _descent(
    apart: FloatArray, first: FloatArray, bends: FloatArray, reach: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return steps towards the least squared distance, (2, m), and by how much gradients say that it falls, (m,).

    Along each principal axis of the Hessian a step is at most `reach`, (m,).
    """
    x, y = first
    a, b, c = column_dot(x, x) + bends[0], column_dot(y, y) + bends[1], column_dot(x, y) + bends[2]
    turn = 0.5 * np.arctan2(2 * c, a - b)
    cos, sin = np.cos(turn), np.sin(turn)
    # Towards an edge the derivative across it vanishes: as a difference of squares it would drown in rounding.
    along, across = cos * x + sin * y, cos * y - sin * x
    mixed, x_bend, y_bend = 2 * cos * sin * bends[2], bends[0], bends[1]
    high, gain = _along(apart, along, cos**2 * x_bend + sin**2 * y_bend + mixed, reach)
    low, more = _along(apart, across, sin**2 * x_bend + cos**2 * y_bend - mixed, reach)
    return np.array([cos * high - sin * low, sin * high + cos * low]), gain + more


def _along(apart: FloatArray, first: FloatArray, bend: FloatArray, reach: FloatArray) -> tuple[FloatArray, FloatArray]:
    least_ratio = 1e-3  # of the curvature to a plane's, which takes its place below it
    gradient, plane = column_dot(first, apart), column_dot(first, first)
    curvature = np.where(plane + bend > least_ratio * plane, plane + bend, plane)
    step = np.clip(-gradient / np.maximum(curvature, np.finfo(float).tiny), -reach, reach)
    return step, -gradient * step
