"""Points of many members of a degeneration at once, found from solutions for nearby weights.

Members differ only in their weights. So the places in all cells are solved together, with a column for each place on
each member. Solutions change slowly with log x: they are followed along a ladder of values whose rungs depend only on
the lifting, so that no member depends on the others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups, rows_of
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import Face
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.solve import ACCEPTED_RESIDUAL, LogSum, solve
from gtb_cli.moment.starts import extents_of
from gtb_cli.moment.torus import scaled_exponentials
from gtb_cli.theory.basis import face_knots
from gtb_cli.theory.patch import Patch

FIRST_RUNG = 0.5
"""Logarithm at the first rung above 0, times the largest gap. Each further rung is twice as high."""

MAX_RUNGS = 40
"""Largest number of rungs; liftings whose gaps differ by so many powers of ten that they need more are not followed."""

MAX_STEPS = 12
"""Steps of Newton's method after which a place is given up; from a good start it takes two or three."""

LONGEST_STEP = 4.0
"""Longest step, in torus coordinates of unit knots: the Hessian says little about a longer one."""

MIN_BOUNDARY_DISTANCE = 1e-5
"""Distance from the boundary of Δ, as a fraction of its size, below which this method would lose digits."""

MAX_GAP_EXPONENT = 1e6
"""Largest exponent by which a knot is put below its cell; its share is 0 long before that."""


class Places(NamedTuple):
    """Places in Δ at which all members have points.

    Attributes
    ----------
    cell : (m,) int
        Cells of the decomposition that hold them.
    parameters : (m, d) float
    face : (m,) int
        Numbers of the faces of Δ in whose interior they lie.
    """

    cell: IntArray
    parameters: FloatArray
    face: IntArray


class Continuation:
    """Solutions s at fixed places for the patches with weights e^{−l g} ω, l ≥ 0, where each cell has gaps g.

    Parameters
    ----------
    patch : Patch
    gaps : (n, c) float
        How far the lifting of each knot lies below the plane of each of the c cells, at least 0.
    places : Places
    last : float
        The largest l to come.

    Attributes
    ----------
    strata : list of Stratum
        Places by the face of Δ in which they lie, corners left out.
    fixed : (f,) int
        Places at corners with one knot, whose control point is the point of all members.
    points : (f, 3) float
        These points.
    left : (r,) int
        Places that are not solved here: those near the boundary of Δ, and those for which Newton's method is slow.
    """

    def __init__(self, patch: Patch, gaps: FloatArray, places: Places, last: float) -> None:
        shape, self.count, self.strata = patch.domain, len(places.cell), []
        ladder = _ladder(float(gaps.max(initial=0.0)), last)
        left = np.ones(self.count, dtype=bool)
        points = np.zeros((self.count, 3))
        for number, rows in groups(places.face):
            face = shape.faces[number]
            if face.is_corner:
                if face.knots.sum() == 1:
                    points[rows] = patch.control_points[face.knots]
                    left[rows] = False
                continue
            if face.is_interior:
                heights = shape.heights_of_columns(places.parameters[rows]) / shape.normal_lengths[:, None]
                rows = rows[heights.min(axis=0) > MIN_BOUNDARY_DISTANCE * shape.size]
            if len(rows) and len(ladder) <= MAX_RUNGS:
                stratum = Stratum(patch, face, gaps, rows_of(places, rows), rows, ladder)
                self.strata.append(stratum)
                left[stratum.rows] = False
        self.left = np.flatnonzero(left)
        solved = np.zeros(self.count, dtype=bool)
        for stratum in self.strata:
            solved[stratum.rows] = True
        self.fixed = np.flatnonzero(~left & ~solved)
        self.points = points[self.fixed]

    def at(self, logarithms: FloatArray, target: float) -> tuple[FloatArray, BoolArray]:
        """(k, m, 3) points for (k,) values of l, and (k, m) whether they are known."""
        points = np.zeros((len(logarithms), self.count, 3))
        known = np.zeros((len(logarithms), self.count), dtype=bool)
        points[:, self.fixed], known[:, self.fixed] = self.points, True
        for stratum in self.strata:
            _, points[:, stratum.rows], found = stratum.solutions(logarithms, target)
            known[:, stratum.rows] = found.reshape(len(logarithms), -1)
        return points, known


def _ladder(gap: float, last: float) -> FloatArray:
    """Ascending values of l, the first 0, the last one at least `last`."""
    rungs = [0.0, FIRST_RUNG / gap if gap * last > FIRST_RUNG else max(last, 1.0)]
    while rungs[-1] < last and len(rungs) <= MAX_RUNGS:
        rungs.append(2 * rungs[-1])
    return np.array(rungs)


class Stratum:
    """Places inside one face of Δ: Δ itself, or an edge.

    Attributes
    ----------
    knots : (n, d) float
        Those of the face, in units of their extents and relative to the middle of these.
    control_points : (n, 3) float
    rows, cell : (m,) int
        Numbers of these places among all, and their cells.
    """

    def __init__(
        self, patch: Patch, face: Face, gaps: FloatArray, places: Places, rows: IntArray, ladder: FloatArray
    ) -> None:
        shape = patch.domain
        inner = face.is_interior
        knots = shape.knots if inner else face_knots(shape, face)
        p = places.parameters if inner else shape.along(face.index, places.parameters)[:, None]
        extents = extents_of(knots)
        origin = knots.min(axis=0) + extents / 2
        self.knots, self.p = (knots - origin) / extents, np.ascontiguousarray(((p - origin) / extents).T)
        self.control_points, self.log_weights = patch.control_points[face.knots], patch.log_products[face.knots]
        self.gaps, self.cell, self.rows = gaps[face.knots], places.cell, rows
        self.summed = np.concatenate([np.ones((1, len(knots))), self.knots.T, squares_of(self.knots)])
        self.ladder, self.solved = ladder, self._climb(ladder)

    def _climb(self, ladder: FloatArray) -> FloatArray:
        """(rungs, d, m) solutions; places for which this fails are dropped."""
        try:
            solved = MomentMap(self.knots, self.log_weights).inverse(self.p.T)[None]
        except ToleranceError:
            solved = np.empty((1, len(self.p), 0))
            self._keep(np.empty(0, dtype=np.int64))
        steps = np.diff(ladder)
        for rung in range(1, len(ladder)):
            start = solved[-1]
            if rung > 1:  # for large l, s is linear in l
                start = start + (solved[-1] - solved[-2]) * (steps[rung - 1] / steps[rung - 2])
            s, found = self._solve(self.exponents(ladder[rung], self.cell), self.p, start, ACCEPTED_RESIDUAL)
            rows = np.flatnonzero(found)
            solved = np.concatenate([solved, s[None]])[:, :, rows]
            self._keep(rows)
        return solved

    def _keep(self, rows: IntArray) -> None:
        self.rows, self.p, self.cell = self.rows[rows], self.p[:, rows], self.cell[rows]

    def solutions(self, logarithms: FloatArray, target: float) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Solve all places for (k,) values of l.

        Returns
        -------
        s : (d, k m) float
        points : (k, m, 3) float
        found : (k m,) bool
            False if Newton's method was too slow.
        """
        count = len(logarithms)
        rung = np.clip(np.searchsorted(self.ladder, logarithms) - 1, 0, len(self.ladder) - 2)
        share = (logarithms - self.ladder[rung]) / (self.ladder[rung + 1] - self.ladder[rung])
        start = self.solved[rung] + share[:, None, None] * (self.solved[rung + 1] - self.solved[rung])
        start = np.ascontiguousarray(np.moveaxis(start, 1, 0)).reshape(len(self.p), -1)
        weights = self.exponents(np.repeat(logarithms, len(self.cell)), np.tile(self.cell, count))
        s, found = self._solve(weights, np.tile(self.p, count), start, target)
        e = scaled_exponentials(self.knots @ s + weights)
        points = (self.control_points.T @ e) / e.sum(axis=0)
        return s, points.T.reshape(count, -1, 3), found

    def exponents(self, logarithms: FloatArray, cell: IntArray) -> FloatArray:
        """(n, m) logarithms of the weights of the knots for (m,) values of l, or one value, and (m,) cells."""
        with np.errstate(over="ignore"):
            gaps = np.minimum(self.gaps[:, cell] * logarithms, MAX_GAP_EXPONENT)
        return np.asarray(self.log_weights[:, None] - gaps)

    def _solve(
        self, weights: FloatArray, p: FloatArray, start: FloatArray, target: float
    ) -> tuple[FloatArray, BoolArray]:
        """(d, m) torus coordinates of (d, m) places p under (n, m) logarithms of weights, and (m,) which are found."""
        found = np.ones(start.shape[1], dtype=bool)
        s, missing = solve(LogSum(self.knots, weights), p, start, target)
        found[missing] = False
        return s, found


def squares_of(knots: FloatArray) -> FloatArray:
    """(1 or 3, n) squares of the coordinates of (n, d) knots, for d = 2 followed by their product."""
    a = knots.T
    return np.concatenate([a**2, a[:1] * a[1:]])
