"""Grids of knots, on which exponentials are products of a few."""

from functools import lru_cache

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, distinct
from gtb_cli.values import frozen


@frozen
class Grid:
    """Knots that are all points of a grid along the axes, each once.

    Attributes
    ----------
    order : (n,) int
        The knots row by row, beginning with the lowest second coordinate.
    first : (2,) float
        The knot with the lowest coordinates.
    steps : pair of (p,) float
        Coordinates of the columns and of the rows, relative to `first`.
    are_equal : pair of bool
        Whether all steps are equal, to rounding.
    is_worth_it : bool
        Whether products take at most half as many exponentials as there are knots.
    """

    order: IntArray
    first: FloatArray
    steps: tuple[FloatArray, ...]
    are_equal: tuple[bool, ...]
    is_worth_it: bool

    def exponentials(self, s: FloatArray) -> FloatArray:
        """(n, m) numbers e^<a − first, s> at (2, m) torus coordinates, with the knots in `order`.

        Notes
        -----
        Equal steps need only two exponentials for each point: each power is the product of two powers about half as
        high, so that rounding grows with the logarithm of the degree.
        """
        columns, rows = map(_exponentials, self.steps, self.are_equal, s)
        return np.asarray((rows[:, None] * columns).reshape(-1, s.shape[1]))


def grid_of(knots: FloatArray) -> Grid | None:
    """Return the grid that (n, 2) knots form, or None."""
    return _grid(np.ascontiguousarray(knots).tobytes()) if knots.shape[1] == 2 else None


@lru_cache(1024)  # the patches of a model mostly share their knots
def _grid(content: bytes) -> Grid | None:
    knots = np.frombuffer(content).reshape(-1, 2)
    order = np.lexsort(knots.T)
    steps = tuple(distinct(column) - column.min() for column in knots.T)
    places = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2) if len(steps[0]) * len(steps[1]) == len(knots) else 0
    if not np.array_equal(knots[order] - knots[order[0]], places):
        return None
    are_equal = tuple(bool(np.abs(x - np.linspace(0, x[-1], len(x))).max() <= EPS * x[-1]) for x in steps)
    exponentials = sum(1 if equal else len(x) for x, equal in zip(steps, are_equal, strict=True))
    return Grid(order, knots[order[0]], steps, are_equal, exponentials <= len(knots) / 2)


def _exponentials(steps: FloatArray, are_equal: bool, t: FloatArray) -> FloatArray:
    """(p, m) exponentials of ascending steps, beginning with 0, times (m,) numbers."""
    if not are_equal:
        return np.asarray(np.exp(np.multiply.outer(steps, t)))
    powers = np.empty((len(steps), len(t)))
    powers[0] = 1.0
    np.exp(steps[-1] / (len(steps) - 1) * t, out=powers[1])
    for k in range(2, len(steps)):
        np.multiply(powers[k // 2], powers[k - k // 2], out=powers[k])
    return powers
