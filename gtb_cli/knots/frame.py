"""Differences about a knot: coordinates in which dominant knots are exactly 0, so that no digits are lost."""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.hull import knot_tolerance

# Sine of the angle, a few thousand roundings, below which two unit vectors do not define a normal
PARALLEL_SINE = 1e-12


class Frame(NamedTuple):
    """Coordinates of the knots about a knot k.

    `along` and `across`, (n, n), are those of knot i along and across the line from knot k to knot j, up to positive
    factors for each j; positive to the left, and exactly 0 across for the knots on that line, in particular for those
    on an edge. `lengths`, (n,), are distances from knot k, and `away` has the knots at other places, up to rounding.
    """

    along: FloatArray
    across: FloatArray
    lengths: FloatArray
    away: IntArray


def frame(shape: Domain, k: int) -> Frame:
    """Coordinates of a surface's knots about knot k."""
    steps = shape.knots - shape.knots[k]
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    tolerance = knot_tolerance(shape.knots)
    along = steps @ steps.T
    across = steps[:, 1:] * steps[:, 0] - steps[:, :1] * steps[:, 1]
    across[np.abs(across) <= tolerance * lengths] = 0.0
    for edge in np.flatnonzero(shape.incidence[k]).tolist():
        on_edge = np.flatnonzero(shape.incidence[:, edge])
        across[:, on_edge] = shape.heights[:, [edge]] * np.sign(steps[on_edge] @ shape.direction(edge))
    along[lengths <= tolerance] = 0.0
    return Frame(along, across, lengths, np.flatnonzero(lengths > tolerance))


def coordinate_rounding(points: FloatArray) -> float:
    """Distance within which points count as equal."""
    # Units in the last place of the largest coordinate by which control points meant to be equal may differ
    coincident_ulps = 8
    return coincident_ulps * EPS * float(np.abs(points).max())


def cleared(differences: FloatArray, rounding: FloatArray | float) -> FloatArray:
    """Differences of points, with exact zeros in place of possible rounding."""
    return np.where(np.abs(differences) <= rounding, 0.0, differences)
