"""Differences about a knot: coordinates in which dominant knots are exactly 0, so that no digits are lost."""

from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.values import frozen

# Sine of the angle, a few thousand roundings, below which two unit vectors do not define a normal
PARALLEL_SINE = 1e-12


@frozen
class Differences:
    """Coordinates of a surface's knots about knot k, along and across lines from it to others, up to positive factors.

    The columns of (n, m) coordinates are those for lines to (m,) other knots. Across, they are positive to the left,
    and exactly 0 for the knots on the line, in particular for those on an edge.
    """

    shape: Domain
    k: int

    @cached_property
    def steps(self) -> FloatArray:
        """(n, 2) differences."""
        return np.asarray(self.shape.knots - self.shape.knots[self.k])

    @cached_property
    def lengths(self) -> FloatArray:
        """(n,) distances, 0 at the same place, up to rounding."""
        lengths = np.hypot(self.steps[:, 0], self.steps[:, 1])
        return np.where(lengths > knot_tolerance(self.shape.knots), lengths, 0.0)

    def along(self, others: IntArray) -> FloatArray:
        """(n, m) coordinates along lines."""
        return np.where(self.lengths[:, None] > 0, self.steps @ self.steps[others].T, 0.0)

    def across(self, others: IntArray) -> FloatArray:
        """(n, m) coordinates across lines."""
        shape, ends = self.shape, self.steps[others]
        across = self.steps[:, 1:] * ends[:, 0] - self.steps[:, :1] * ends[:, 1]
        across[np.abs(across) <= knot_tolerance(shape.knots) * self.lengths[others]] = 0.0
        for edge in np.flatnonzero(shape.incidence[self.k]).tolist():
            here = shape.incidence[others, edge]
            across[:, here] = shape.heights[:, [edge]] * np.sign(ends[here] @ shape.direction(edge))
        return np.asarray(across)


def coordinate_rounding(points: FloatArray) -> float:
    """Distance within which points count as equal."""
    # Units in the last place of the largest coordinate by which control points meant to be equal may differ
    coincident_ulps = 8
    return coincident_ulps * EPS * float(np.abs(points).max())


def cleared(differences: FloatArray, rounding: FloatArray | float) -> FloatArray:
    """Differences of points, with exact zeros in place of possible rounding."""
    return np.where(np.abs(differences) <= rounding, 0.0, differences)
