"""B-spline curves as exact Bézier curves, span by span.

Knots are inserted until their multiplicity is the degree. This gives the Bézier points of a span [t_k, t_{k+1}]: the
values of its polar form at (t_k, …, t_k, t_{k+1}, …, t_{k+1}), which de Boor's algorithm finds by averages alone.
"""

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError


def span_matrices(degree: int, knots: FloatArray, count: int) -> list[tuple[int, FloatArray]]:
    """Return, for each span of a B-spline basis of `count` functions on as many knots, its first point and a matrix.

    The (degree + 1, degree + 1) matrix gives the span's Bézier points. Its rows are nonnegative and add up to 1: no
    accuracy is lost, and positive weights stay positive.
    """
    min_span = 1e-12  # spans shorter than this fraction of all are ignored: their knots were meant to be equal
    steps = np.diff(knots)
    if not (steps >= 0).all():
        k = int(np.argmin(steps >= 0))
        raise DomainError(f"knots: must ascend, got {knots[k]:g} before {knots[k + 1]:g}")
    found = degree + np.flatnonzero(steps[degree:count] > min_span * (knots[count] - knots[degree]))
    if not len(found):
        raise DomainError("knots: all spans are empty")
    return [(k - degree, _bezier_points(degree, knots, k)) for k in found.tolist()]


def _bezier_points(degree: int, knots: FloatArray, k: int) -> FloatArray:
    """Apply de Boor's algorithm to unit control points, with degree − j times the span's start and j times its end."""
    table, j = np.tile(np.eye(degree + 1), (degree + 1, 1, 1)), np.arange(degree + 1)[:, None, None]
    for step in range(1, degree + 1):
        low, high = knots[k - degree + step : k + 1, None], knots[k + 1 : k + 2 + degree - step, None]
        share = (np.where(step <= degree - j, knots[k], knots[k + 1]) - low) / (high - low)
        table = (1 - share) * table[:, :-1] + share * table[:, 1:]
    return table[:, 0]
