"""Points of a surface that are looked for beside points already found."""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.newton import put
from gtb_cli.moment.torus import NO_ROWS
from gtb_cli.theory.basis import Location
from gtb_cli.theory.linear import START_RESIDUAL, LinearParametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

CROWDED_SHARE = 0.1
"""Distance from an edge to the next knot, in units of 1/√n of the widest, below which knots crowd there. In lattices it
is 1; it was 0.4 or more in all of specs/, and 0.001 among 1,000 random knots."""


@frozen
class Neighbours:
    """Points inside one patch, found in the chart of its longest edge from guesses.

    What is guessed are corrections: differences between torus coordinates and those from the nearest layers of knots,
    or from 0 if knots crowd. They change slowly, so that nearby points' serve. Nothing is learnt: threads may share it.
    """

    patch: Patch
    linear: LinearParametrization

    def near(self, u: FloatArray, guesses: FloatArray, within: float, found: FloatArray | None = None) -> FloatArray:
        """(m, 3) points at (m, 2) linear parameters, NaN where they are not found.

        Guesses are NaN where there are none. Parameters may be off by `within`, a fraction of the domain's size. Right
        corrections are written to the (m, 2) `found`, if it is given.
        """
        points = np.full((len(u), 3), np.nan)
        chart, rows = self.linear.longest, np.flatnonzero(~np.isnan(guesses[:, 0]))
        if not len(rows):
            return points
        if len(rows) < len(u):
            u, guesses = u.take(rows, axis=0), guesses.take(rows, axis=0)
        places, moments = chart.columns(u), chart.moments
        if moments.bezier_shift is not None:
            s, left = moments.inverse(places.T), NO_ROWS
        else:
            starts = np.ascontiguousarray(guesses.T)
            if self.is_crowded:
                starts += moments.corrections(places, np.zeros_like(places))
            s, left = moments.nearly(places, starts, within)
        if len(left):
            some = left[~np.isnan(s[0, left])]
            with suppress(ToleranceError):
                put(s, some, moments.inverse_near(places.take(some, axis=1), s.take(some, axis=1), within))
                left = left[np.isnan(s[0, left])]
            rows, s, places = np.delete(rows, left), np.delete(s, left, axis=1), np.delete(places, left, axis=1)
        where = slice(None) if len(rows) == len(points) else rows
        location = Location(slice(None), self.patch.domain.faces[INTERIOR], moments.knots, s, None)
        points[where] = self.patch.points_at([location], len(rows))
        if found is not None:
            found[where] = self._corrections(places, s)
        return points

    def corrections(self, u: FloatArray) -> FloatArray:
        """(m, 2) corrections at (m, 2) linear parameters, NaN if they are not found."""
        places = self.linear.longest.columns(u)
        try:
            return self._corrections(places, self.linear.longest.moments.inverse(places.T, START_RESIDUAL))
        except ToleranceError:
            return np.full_like(u, np.nan)

    def _corrections(self, places: FloatArray, s: FloatArray) -> FloatArray:
        moments = self.linear.longest.moments
        if moments.bezier_shift is not None:  # starts are known
            return np.zeros(places.shape[::-1])
        found = moments.corrections(places, s)
        return np.asarray(found - moments.corrections(places, np.zeros_like(s)) if self.is_crowded else found).T

    @cached_property
    def is_crowded(self) -> bool:
        """Whether knots are so near an edge that starts from these alone say nothing of points farther inside."""
        heights = self.linear.shape.heights
        least = np.where(heights > 0, heights, np.inf).min(axis=0) / heights.max(axis=0)
        return bool(least.min() * len(heights) ** 0.5 < CROWDED_SHARE)
