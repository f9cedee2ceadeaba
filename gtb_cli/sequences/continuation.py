"""Points of many members of a degeneration at once, each found from what is known at weights nearby.

Members differ in their weights alone. So places in all cells are solved together, a column for each place on each
member. Solutions change slowly with log x: they are followed along a ladder of values that depends on the lifting
alone, so that no member depends on which others there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import Face
from gtb_cli.knots.hulls import extents_of
from gtb_cli.newton import dot, regularised_step, size
from gtb_cli.theory.basis import UNDERFLOW_EXPONENT, face_knots
from gtb_cli.theory.moment import ACCEPTED_RESIDUAL, MIN_REGULARISATION, MomentMap
from gtb_cli.theory.patch import Patch

FIRST_RUNG = 0.5
"""First logarithm of the ladder above 0, times the largest gap. Each further one is twice as large."""

MAX_RUNGS = 40
"""Largest number of rungs: gaps that differ by more than 1e9 are not followed."""

STEPS = 12
"""Steps of Newton's method after which a place is given up: from a good start it takes two or three."""

LONGEST_STEP = 4.0
"""Longest step, as an exponent of unit knots: a longer one sees too little of the curvature."""

NEAR_BOUNDARY = 1e-5
"""Distance from the boundary of Δ, as a fraction of its size, below which digits would be lost here."""

FARTHEST_GAP = 1e6
"""Largest exponent by which a knot is put below its cell. Its share is 0 long before."""


class Places(NamedTuple):
    """Where points are on all members.

    Attributes
    ----------
    cell : (m,) int
        Cell of the decomposition.
    parameters : (m, d) float
        Point of Δ.
    face : (m,) int
        Number of the face of Δ in which it lies.
    """

    cell: IntArray
    parameters: FloatArray
    face: IntArray

    def at(self, rows: IntArray) -> Places:
        """Some of the places."""
        return Places(self.cell[rows], self.parameters[rows], self.face[rows])

    def followed_by(self, other: Places) -> Places:
        """These and others."""
        return Places(
            np.append(self.cell, other.cell),
            np.concatenate([self.parameters, other.parameters]),
            np.append(self.face, other.face),
        )


class Continuation:
    """Solutions s at fixed places, for the patches with weights e^{−l g} ω: any l from 0 on, and gaps g of each cell.

    Parameters
    ----------
    patch : Patch
    gaps : (n, c) float
        For each of c cells how far the lifting of each knot is below the cell's plane, at least 0.
    places : Places
    last : float
        The largest l to come.

    Attributes
    ----------
    strata : list of Stratum
        Places by the face of Δ in which they lie, but for its corners.
    fixed : (f,) int
        Places on corners with one knot, which is the point of all members.
    points : (f, 3) float
        These points.
    left : (r,) int
        Places that are not solved here: near the boundary of Δ, and where Newton's method is slow.
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
                rows = rows[heights.min(axis=0) > NEAR_BOUNDARY * shape.size]
            if len(rows) and len(ladder) <= MAX_RUNGS:
                stratum = Stratum(patch, face, gaps, places.at(rows), rows, ladder)
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
    """Values of l from 0 on; the last one is not below `last`."""
    rungs = [0.0, FIRST_RUNG / gap if gap * last > FIRST_RUNG else max(last, 1.0)]
    while rungs[-1] < last and len(rungs) <= MAX_RUNGS:
        rungs.append(2 * rungs[-1])
    return np.array(rungs)


class Stratum:
    """Places inside one face of Δ: Δ itself, or an edge.

    Attributes
    ----------
    knots : (n, d) float
        Those of the face, in units of their extent, about the middle.
    control_points : (n, 3) float
    rows, cell : (m,) int
        Which places these are, and their cells.
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
        """(rungs, d, m) solutions at all places but those for which this fails, which are left out."""
        try:
            solved = MomentMap(self.knots, self.log_weights).inverse(self.p.T)[None]
        except ToleranceError:
            solved = np.empty((1, len(self.p), 0))
            self._keep(np.empty(0, dtype=np.int64))
        steps = np.diff(ladder)
        for rung in range(1, len(ladder)):
            start = solved[-1]
            if rung > 1:  # for large l, s is linear in it
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
            False where Newton's method was too slow.
        """
        count = len(logarithms)
        rung = np.clip(np.searchsorted(self.ladder, logarithms) - 1, 0, len(self.ladder) - 2)
        share = (logarithms - self.ladder[rung]) / (self.ladder[rung + 1] - self.ladder[rung])
        start = self.solved[rung] + share[:, None, None] * (self.solved[rung + 1] - self.solved[rung])
        start = np.ascontiguousarray(np.moveaxis(start, 1, 0)).reshape(len(self.p), -1)
        weights = self.exponents(np.repeat(logarithms, len(self.cell)), np.tile(self.cell, count))
        s, found = self._solve(weights, np.tile(self.p, count), start, target)
        e = exponentials(self.knots @ s + weights)
        points = (self.control_points.T @ e) / e.sum(axis=0)
        return s, points.T.reshape(count, -1, 3), found

    def exponents(self, logarithms: FloatArray, cell: IntArray) -> FloatArray:
        """(n, m) logarithms of the weights of each knot, for (m,) values of l, or one, and (m,) cells."""
        with np.errstate(over="ignore"):
            gaps = np.minimum(self.gaps[:, cell] * logarithms, FARTHEST_GAP)
        return np.asarray(self.log_weights[:, None] - gaps)

    def _solve(
        self, weights: FloatArray, p: FloatArray, start: FloatArray, target: float
    ) -> tuple[FloatArray, BoolArray]:
        """(d, m) torus coordinates of (d, m) places under (n, m) logarithms of weights, and (m,) which are found."""
        s, solution, d = start, start.copy(), len(start)
        active = np.arange(start.shape[1])
        found = np.zeros(len(active), dtype=bool)
        for _ in range(STEPS):
            sums = self.summed @ exponentials(self.knots @ s + weights)
            moments = sums[1:] / sums[0]
            gradient, hessian = moments[:d] - p, moments[d:]
            hessian[:d] -= moments[:d] ** 2
            hessian[d:] -= moments[:1] * moments[1:d]
            residual = size(gradient)
            # On the border of cells far below their neighbours the Hessian is singular to rounding.
            with np.errstate(over="ignore", invalid="ignore"):  # NaN is not near, and is given up
                step = regularised_step(gradient, hessian, MIN_REGULARISATION * residual)
                length = np.abs(step).sum(axis=0)
                step *= LONGEST_STEP / np.maximum(length, LONGEST_STEP)
            # As for `MomentMap`: how near a step comes is known before it is taken, if it is short.
            after = -0.5 * np.exp(np.minimum(length, LONGEST_STEP)) * dot(gradient, step)
            near = residual <= target
            done = near | ((after <= target) & (length <= LONGEST_STEP))
            s = np.where(near, s, s + step)
            rows, going = np.flatnonzero(done), np.flatnonzero(~done)
            solution[:, active[rows]], found[active[rows]] = s[:, rows], True
            if not len(going):
                break
            active, s, p, weights = active[going], s[:, going], p[:, going], weights[:, going]
        return solution, found


def squares_of(knots: FloatArray) -> FloatArray:
    """(1 or 3, n) squares of the coordinates of (n, d) knots, and for d = 2 their product."""
    a = knots.T
    return np.concatenate([a**2, a[:1] * a[1:]])


def exponentials(e: FloatArray) -> FloatArray:
    """Turn (n, m) exponents into exponentials, in place, up to a factor for each column."""
    e -= e.max(axis=0)
    np.maximum(e, UNDERFLOW_EXPONENT, out=e)
    return np.exp(e, out=e)
