"""Steps of Newton's method for many problems with one or two unknowns at once, one problem per column."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray

MIN_CURVATURE = 1e-300
"""Smallest curvature used as a divisor."""


class State(NamedTuple):
    """Columns s, and the values, gradients and Hessians of the objective there."""

    s: FloatArray
    value: FloatArray
    gradient: FloatArray
    hessian: FloatArray

    def columns(self, chosen: IntArray | BoolArray) -> State:
        """The chosen columns."""
        return State(*(x[..., chosen] for x in self))

    def put(self, rows: IntArray, other: State) -> None:
        """Replace the columns in `rows`."""
        for mine, theirs in zip(self, other, strict=True):
            mine[..., rows] = theirs


def put(columns: FloatArray, where: IntArray, values: FloatArray) -> None:
    """Write (d, k) values to some of (d, m) columns, row by row, which is faster in numpy than all at once."""
    for row, new in zip(columns, values, strict=True):
        row[where] = new


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) scalar products of (d, m) columns, faster than a reduction by numpy for up to three rows."""
    return np.asarray(reduce(np.add, (x * y for x, y in zip(a, b, strict=True))))


def size(a: FloatArray) -> FloatArray:
    """(m,) largest absolute entry of (d, m) columns."""
    return np.asarray(np.abs(a[0]) if len(a) == 1 else np.maximum(np.abs(a[0]), np.abs(a[1])))


def plain_step(gradient: FloatArray, hessian: FloatArray) -> FloatArray:
    """Solve H step = −gradient for each column; NaN where rounding has made H indefinite."""
    first = _positive(hessian[0])
    if len(gradient) == 1:
        return np.asarray(-gradient / first)
    ratio = hessian[2] / first
    rest = hessian[1] - ratio * hessian[2]
    step = np.empty_like(gradient)
    step[1] = (ratio * gradient[0] - gradient[1]) / _positive(rest)
    step[0] = -gradient[0] / first - ratio * step[1]
    return step


def _positive(curvatures: FloatArray) -> FloatArray:
    """The curvatures, with NaN in place of those that are not positive."""
    return curvatures if curvatures.min(initial=1.0) > 0 else np.where(curvatures > 0, curvatures, np.nan)


def regularised_step(gradient: FloatArray, hessian: FloatArray, regular: FloatArray) -> FloatArray:
    """Solve (H + regular I) step = −gradient for each column."""
    if len(gradient) == 1:
        return np.asarray(-gradient / np.maximum(hessian + regular, MIN_CURVATURE))
    # Cholesky's method keeps all digits if the knots that count are nearly collinear; Cramer's rule does not.
    xx, yy, xy = hessian[0] + regular, hessian[1] + regular, hessian[2]
    ratio = xy / np.maximum(xx, MIN_CURVATURE)
    rest = yy - ratio * xy
    rest = np.maximum(np.where(rest > 0, rest, yy), MIN_CURVATURE)
    over = (ratio * gradient[0] - gradient[1]) / rest
    step = np.empty_like(gradient)
    step[0], step[1] = -(gradient[0] + xy * over) / np.maximum(xx, MIN_CURVATURE), over
    return step
