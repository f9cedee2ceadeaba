"""Coordinates about a knot, in which the knots that dominate are exactly 0, so that no digits are lost."""

from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.values import frozen

PARALLEL_SINE = 1e-12  # of the angle, a few thousand roundings, below which two vectors do not define a normal


@frozen
class Differences:
    """Coordinates of a surface's knots about knot k: along lines from it to other knots, and across them.

    Each is (n, m) for lines to (m,) other knots, up to positive factors. Across, coordinates are positive to the left,
    and exactly 0 for the knots on the line, so also for all knots on an edge.
    """

    shape: Domain
    k: int

    @cached_property
    def steps(self) -> FloatArray:
        """Return the differences of all knots from knot k, (n, 2)."""
        return np.asarray(self.shape.knots - self.shape.knots[self.k])

    @cached_property
    def lengths(self) -> FloatArray:
        """Return the distances of all knots from knot k, (n,): 0 at the same place, up to rounding."""
        lengths = np.hypot(self.steps[:, 0], self.steps[:, 1])
        return np.where(lengths > knot_tolerance(self.shape.knots), lengths, 0.0)

    def along(self, others: IntArray) -> FloatArray:
        """Return the coordinates along the lines to (m,) other knots: (n, m)."""
        return np.where(self.lengths[:, None] > 0, self.steps @ self.steps[others].T, 0.0)

    def across(self, others: IntArray) -> FloatArray:
        """Return the coordinates across the lines to (m,) other knots: (n, m)."""
        shape, ends = self.shape, self.steps[others]
        across = self.steps[:, 1:] * ends[:, 0] - self.steps[:, :1] * ends[:, 1]
        across[np.abs(across) <= knot_tolerance(shape.knots) * self.lengths[others]] = 0.0
        for edge in np.flatnonzero(shape.incidence[self.k]).tolist():
            here = shape.incidence[others, edge]
            across[:, here] = shape.heights[:, [edge]] * np.sign(ends[here] @ shape.direction(edge))
        return np.asarray(across)


def coordinate_rounding(points: FloatArray) -> float:
    """Return the distance within which points count as equal."""
    coincident_ulps = 8  # of the largest coordinate: control points meant to be equal may differ by as much
    return coincident_ulps * EPS * float(np.abs(points).max())


def offsets_from(points: FloatArray, k: int) -> FloatArray:
    """Return the differences of (n, 3) points from point k, exactly 0 where the points count as equal."""
    return cleared(points - points[k], coordinate_rounding(points))


def cleared(differences: FloatArray, rounding: FloatArray | float) -> FloatArray:
    """Return differences of points, with exact zeros in place of what may be rounding."""
    return np.where(np.abs(differences) <= rounding, 0.0, differences)
