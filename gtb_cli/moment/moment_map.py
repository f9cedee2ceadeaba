"""The moment map μ and its inverse.

``μ(s) = Σ_i T_i(s) a_i`` maps the torus coordinates one-to-one onto the interior of the knots' hull (Birch's theorem).
The linear parametrisation needs the inverse: p ↦ P(μ⁻¹(p)).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.lattice import binomial_coefficients, lattice_of
from gtb_cli.moment.grid import Grid, grid_of
from gtb_cli.moment.hulls import CellStarts, Hull, cells_with_gradients, extents_of, hull_of, origin_of
from gtb_cli.moment.newton import State, dot, plain_step, put, regularised_step, size
from gtb_cli.moment.starts import Corrections
from gtb_cli.moment.torus import NO_ROWS, SAFE_EXPONENT, UNDERFLOW_EXPONENT, block_length, weighted_sums
from gtb_cli.values import frozen

RESIDUAL = 1e-12
"""Largest accepted |μ(s) − p|, as a fraction of the hull's size."""

ACCEPTED_RESIDUAL = RESIDUAL / 2
"""The same in the coordinates of the solver, whose axes may be longer and turned."""

TARGET_RESIDUAL = 1e-14
"""Residual at which a point is done if all digits are asked for; if rounding keeps it above, `MAX_REFUSALS` refused
steps in a row end the iteration."""

MAX_REFUSALS = 4
MAX_ITERATIONS = 300

TROPICAL_RANGE = 3.0
"""Range of log(c_i ω_i), without the affine part, from which the tropical limit is also tried as a start."""

KNOTS_PER_RANGE = 16
"""`TROPICAL_RANGE` is scaled by the number of knots over this, from 4 on: smooth weights have hundreds of cells."""

CELL_FLOOR = 1e-3
"""Smallest distance of a tropical start from the border of its cell, as a fraction of the next layer's distance: the
start is infinite on the border itself."""

MAX_HALVINGS = 60
"""Largest number of times a start that is much too far out is halved."""

SEEING_REACH = 1.0
"""Torus coordinates of unit knots within which a start is not halved further, since all knots count there."""

MIN_REGULARISATION = 1e-8
"""Smallest regularisation of two unknowns, as a multiple of the residual: rounding of the Hessian's determinant hides a
smaller one. One unknown has none: between knots 1e-11 of the hull apart, the curvature is 1e-22."""

FIRST_REGULARISATION = 1e-2
"""First regularisation, over the residual, also after a refused step; `MAX_REFUSALS` of these shorten steps."""

MAX_SUBTRACTED_SHARE = 1 - 8 * EPS
"""Share of μ² subtracted from mean squares for the Hessian: the rest is of the order of the rounding."""

MAX_STEP_EXPONENT = 8.0
"""Largest exponent by which a plain step of Newton's method may change the shares of knots."""

MAX_PLAIN_STEPS = 6
"""Largest number of plain steps; a point that needs more is left to the safe method."""

SCOUT_POINTS = 2
"""Fewest points in a part of the hull without a correction for which one of them is solved before the others …"""

MIN_SCOUT_PARTS = 50
"""… and the fewest such parts for which this is done: a few points are solved faster together than in turn."""

POOR_RESIDUAL = 0.05
"""Residual of a start, as a fraction of the hull's size, above which the cells' limits are also tried."""


@frozen
class MomentMap:
    """``μ(s) = Σ_i T_i(s) a_i`` for one set of knots, and its inverse.

    Parameters
    ----------
    knots : (n, d) float
    log_weights : (n,) float
        log(c_i ω_i).

    Notes
    -----
    The inverse minimises the convex function log Σ c_i ω_i exp<a_i, s> − <p, s> by Newton's method, with plain steps if
    these are short, otherwise with a regularisation that scales with the gradient. It starts from the torus coordinates
    of p for the nearest layers of knots alone, corrected by nearby solutions. If weights are extreme and the function
    is lower there, it starts from the limit in a cell of the decomposition that log(c_i ω_i) induces.
    """

    knots: FloatArray
    log_weights: FloatArray

    def __call__(self, s: FloatArray) -> FloatArray:
        """(m, d) points μ(s) at (d, m) torus coordinates."""
        sums = weighted_sums(self._unit_knots, self.log_weights, self._unit_knots, s * self._extents[:, None])
        return np.asarray((sums[1:] / sums[0]).T * self._extents + self._origin)

    def inverse(self, p: FloatArray, within: float = 0.0) -> FloatArray:
        """(d, m) torus coordinates s with μ(s) = p, for (m, d) points inside the hull.

        A residual of `within` times the hull's size suffices if `within` exceeds `TARGET_RESIDUAL`.

        Raises
        ------
        ToleranceError
            |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        target = max(TARGET_RESIDUAL, within)
        unit = self._unit(np.ascontiguousarray(p.T))
        safe = self._hull.starts(unit)
        if self.bezier_shift is not None:
            return np.asarray((safe + self.bezier_shift) / self._extents[:, None])
        s = safe.copy()
        if len(unit) == 2:
            part = self._corrections.part(unit)
            often = self._corrections.unknown(part, SCOUT_POINTS)
            if len(often) >= MIN_SCOUT_PARTS:
                start = safe[:, often]
                found = self._solve(unit[:, often], start, start, TARGET_RESIDUAL)
                self._learn(part[often], unit[:, often], start, found)
            seldom = self._corrections.unknown(part, 1)
            s += self._corrections(part, unit)
        length = block_length(len(self.knots))
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            s[:, block] = self._solve(unit[:, block], s[:, block], safe[:, block], target)
        if len(unit) == 2 and len(seldom):
            self._learn(part[seldom], unit[:, seldom], safe[:, seldom], s[:, seldom])
        return np.asarray(s / self._extents[:, None])

    def nearly(self, p: FloatArray, corrections: FloatArray, within: float = 0.0) -> tuple[FloatArray, IntArray]:
        """(d, m) torus coordinates of (d, m) points from their approximate `corrections`.

        Also the indices of the points not found in this way, whose places are starts.
        """
        unit = self._unit(p)
        start = self._hull.starts(unit)
        start += corrections
        far = np.flatnonzero(~(self._reach[:-1] @ np.abs(start) + self._reach[-1] <= SAFE_EXPONENT))
        there, start[:, far] = start[:, far], np.nan
        found, left = self._short_steps(unit, start, max(TARGET_RESIDUAL, within))
        put(found, far, there)
        return found / self._extents[:, None], left

    def inverse_near(self, p: FloatArray, start: FloatArray, within: float = 0.0) -> FloatArray:
        """(d, m) torus coordinates of (d, m) points from nearby ones; unlike `inverse`, this learns nothing."""
        unit, start = self._unit(p), start * self._extents[:, None]
        return np.asarray(self._solve(unit, start, start, max(TARGET_RESIDUAL, within)) / self._extents[:, None])

    def corrections(self, p: FloatArray, s: FloatArray) -> FloatArray:
        """(d, m) differences between torus coordinates of (d, m) points and those from the nearest layers alone."""
        return np.asarray(s * self._extents[:, None] - self._hull.starts(self._unit(p)))

    def _unit(self, p: FloatArray) -> FloatArray:
        """(d, m) points in the coordinates of the solver."""
        unit = p - self._origin[:, None]
        unit /= self._extents[:, None]
        if len(unit) == 1:  # far from the origin, rounding may move points out of the hull
            np.clip(unit, self._unit_knots.min(), self._unit_knots.max(), out=unit)
        return np.asarray(unit)

    @cached_property
    def bezier_shift(self) -> FloatArray | None:
        """(d, 1) common error of all starts for Bézier weights times affine factors; None for other weights.

        For these, p has the parameters of Bernstein polynomials, and logarithms alone give its torus coordinates.
        """
        shape = self._hull.shape
        if lattice_of(shape) is None:
            return None
        try:
            rest = self.log_weights - np.log(binomial_coefficients(shape))
        except DomainError:  # beyond the range of floats
            return None
        affine = np.column_stack([self._unit_knots, np.ones(len(rest))])
        shift = np.asarray(-np.linalg.lstsq(affine, rest)[0][:-1, None], dtype=np.float64)
        # Any points inside show whether this is exact: here, the knots moved to the middle.
        p = (0.7 * self._unit_knots + 0.3 * self._unit_knots.mean(axis=0)).T
        mu, *_ = self._evaluate(self._hull.starts(p) + shift)
        return shift if np.abs(mu - p).max() <= 10 * TARGET_RESIDUAL else None

    def _learn(self, part: IntArray, unit: FloatArray, start: FloatArray, solution: FloatArray) -> None:
        """Remember the corrections of the starts of solved points."""
        _, (xx, yy, xy), *_ = self._evaluate(solution)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            slopes = np.array([[yy, -xy], [-xy, xx]]) / (xx * yy - xy * xy) - self._hull.starts.slopes(unit)
        self._corrections.learn(part, unit, solution - start, slopes)

    @cached_property
    def _hull(self) -> Hull:
        return hull_of(self._unit_knots)

    @cached_property
    def _corrections(self) -> Corrections:
        return Corrections(self._unit_knots.min(axis=0), self._unit_knots.max(axis=0))

    @cached_property
    def _extents(self) -> FloatArray:
        """(d,) unit of each coordinate, so that thin hulls are solved like others."""
        return extents_of(self.knots)

    @cached_property
    def _origin(self) -> FloatArray:
        """(d,) 0 in coordinates whose zeros are exact, as over an edge; otherwise the middle of the hull."""
        return origin_of(self.knots)

    @cached_property
    def _unit_knots(self) -> FloatArray:
        return np.asarray((self.knots - self._origin) / self._extents)

    @cached_property
    def _exponents(self) -> FloatArray:
        """(n, d + 1) unit knots, and log weights relative to the knot nearest 0, where Σ c ω e^<a, s> is about 1."""
        nearest = np.lexsort((-self.log_weights, np.abs(self._unit_knots).max(axis=1)))[0]
        return np.column_stack([self._unit_knots, self.log_weights - self.log_weights[nearest]])

    @cached_property
    def _reach(self) -> FloatArray:
        return np.asarray(np.abs(self._exponents).max(axis=0))

    @cached_property
    def _summed(self) -> FloatArray:
        """The functions averaged under T: 1, the knots' coordinates, their squares and, for d = 2, their product."""
        a = self._unit_knots.T
        return np.concatenate([np.ones((1, a.shape[1])), a, a**2, a[:1] * a[1:]])

    @cached_property
    def _on_grid(self) -> tuple[Grid, FloatArray] | None:
        """The grid of the knots, if they form one, and the values summed under its exponentials."""
        grid = grid_of(self._unit_knots)
        if grid is None or not grid.is_worth_it:
            return None
        return grid, (self._summed * np.exp(self._exponents[:, -1]))[:, grid.order]

    @cached_property
    def _cells(self) -> tuple[tuple[CellStarts, FloatArray], ...]:
        """The cells of the regular decomposition that log(c_i ω_i) induces, with gradients; empty for tame weights."""
        w, affine = self.log_weights, np.column_stack([self._unit_knots, np.ones(len(self.knots))])
        extreme = TROPICAL_RANGE * (len(w) / KNOTS_PER_RANGE if len(w) > 4 * KNOTS_PER_RANGE else 1)
        if np.ptp(w - affine @ np.linalg.lstsq(affine, w)[0]) < extreme:
            return ()
        return cells_with_gradients(self._hull, self._unit_knots, w)

    def _evaluate(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | float]:
        """The gradient μ (d, m) of log Σ c ω e^<a, s>, its Hessian (1, m), or xx, yy, xy as (3, m), and the sum.

        The sum is a factor times the exponential of the last result.
        """
        d, count = s.shape
        columns = np.empty((d + 1, count))
        columns[:d], columns[d] = s, 1.0
        shift: FloatArray | float = 0.0
        is_safe = bool(self._reach @ np.abs(columns).max(axis=1, initial=0.0) <= SAFE_EXPONENT)
        if is_safe and self._on_grid is not None:
            grid, summed = self._on_grid
            sums, shift = summed @ grid.exponentials(s), grid.first @ s
        else:
            e = self._exponents @ columns
            if not is_safe:
                shift = e.max(axis=0)
                e -= shift
                np.maximum(e, UNDERFLOW_EXPONENT, out=e)
            np.exp(e, out=e)
            sums = self._summed @ e
        moments = sums[1:] / sums[0]
        mu, hessian = moments[:d], moments[d:]
        hessian[:d] -= MAX_SUBTRACTED_SHARE * mu**2
        hessian[d:] -= mu[:1] * mu[1:]
        return mu, hessian, sums[0], shift

    def _solve(self, unit: FloatArray, start: FloatArray, safe: FloatArray, target: float) -> FloatArray:
        """Solve by short steps from `start`; if these fail, by `_newton` from `safe`, from `start` and from 0."""
        solution, left = self._short_steps(unit, start, target)
        if len(left):
            p = unit[:, left]
            found, residual = np.empty_like(p), np.full(len(left), np.inf)
            # Far from the origin, knots are off their edge by rounding: a layer that is much too thin to start from.
            for begin in (safe[:, left], start[:, left], np.zeros_like(p)):
                failed = np.flatnonzero(residual > max(ACCEPTED_RESIDUAL, target))
                if len(failed):
                    found[:, failed], residual[failed] = self._newton(p[:, failed], begin[:, failed], target)
            if (residual > max(ACCEPTED_RESIDUAL, target)).any():
                raise ToleranceError(
                    f"linear parametrisation: residual {residual.max():.1e} of the hull's size after "
                    f"{MAX_ITERATIONS} steps, {RESIDUAL:g} is required"
                )
            solution[:, left], _ = self._short_steps(p, found, target)
        return solution

    def _short_steps(self, unit: FloatArray, start: FloatArray, target: float) -> tuple[FloatArray, IntArray]:
        """Take Newton's plain steps while they are short; columns for which this does not suffice are not changed.

        Third derivatives of log Σ c ω e^<a, s> are at most its second ones times the extent of the knots, 1. This
        bounds the residual before a step is taken; a point is done after the step if the bound is small enough.
        """
        s, p, solution, active, left = start, unit, start, np.arange(start.shape[1]), [NO_ROWS]
        for turn in range(MAX_PLAIN_STEPS):
            mu, hessian, *_ = self._evaluate(s)
            mu -= p
            step = plain_step(mu, hessian)
            length = np.abs(step[0]) if len(step) == 1 else np.abs(step[0]) + np.abs(step[1])
            bound = -0.5 * dot(mu, step)
            step += s
            done = bound * np.exp(min(length.max(initial=0.0), MAX_STEP_EXPONENT)) <= target
            if np.count_nonzero(done) < np.count_nonzero(bound <= target):
                done = bound * np.exp(np.minimum(length, MAX_STEP_EXPONENT)) <= target
            short = length <= MAX_STEP_EXPONENT
            done &= short
            found = np.flatnonzero(done)
            if turn == 0:
                solution = step
            else:
                put(solution, active.take(found), step.take(found, axis=1))
            left.append(active[~short])
            keep = np.flatnonzero(short & ~done)
            if not len(keep):
                break
            active, s, p = active.take(keep), step.take(keep, axis=1), p.take(keep, axis=1)
        else:
            left.append(active)
        rows = np.concatenate(left)
        put(solution, rows, start.take(rows, axis=1))
        return solution, rows

    def _newton(self, p: FloatArray, start: FloatArray, target: float) -> tuple[FloatArray, FloatArray]:
        """Minimise log Σ c ω e^<a, s> − <p, s> by regularised steps.

        Returns the columns, and (m,) residuals of those that did not converge, 0 for the others.
        """
        at = self._drawn_in(p, self._better_start(p, self._state(p, start.copy())))
        solution, active = at.s.copy(), np.arange(len(at.value))
        sigma = np.full(len(active), FIRST_REGULARISATION)
        refusals = np.zeros(len(active), dtype=np.int64)
        lowest = MIN_REGULARISATION if len(p) == 2 else 0.0
        for _ in range(MAX_ITERATIONS):
            residual = size(at.gradient)
            going = (residual > target) & ((refusals < MAX_REFUSALS) | (residual > ACCEPTED_RESIDUAL))
            count = int(going.sum())
            if not count:
                break
            if count < 0.5 * len(going):
                solution[:, active] = at.s
                at, p = at.columns(going), p[:, going]
                active, refusals = active[going], refusals[going]
                sigma, residual = sigma[going], residual[going]
            step = regularised_step(at.gradient, at.hessian, sigma * residual)
            trial = self._state(p, at.s + step)
            slope = dot(at.gradient, step)
            # Below the rounding of the objective, only the gradient can identify a better point.
            rounding = -slope < 64 * EPS * (1 + np.abs(at.value) + dot(np.abs(p), np.abs(trial.s)))
            lower = np.where(rounding, size(trial.gradient) < residual, trial.value <= at.value + 1e-4 * slope)
            pairs = zip(trial, at, strict=True)
            at = trial if lower.all() else State(*(np.where(lower, new, old) for new, old in pairs))
            sigma = np.where(lower, np.maximum(sigma / 16, lowest), np.clip(sigma * 8, FIRST_REGULARISATION, 1e9))
            refusals = np.where(lower, 0, refusals + 1)
        solution[:, active] = at.s
        residuals = np.zeros(solution.shape[1])
        residuals[active] = size(at.gradient)
        return solution, residuals

    def _state(self, p: FloatArray, s: FloatArray) -> State:
        mu, hessian, total, shift = self._evaluate(s)
        return State(s, np.log(total) + shift - dot(p, s), mu - p, hessian)

    def _better_start(self, p: FloatArray, at: State) -> State:
        """Replace a start by a cell's limit if the objective is lower there."""
        poor = np.flatnonzero(size(at.gradient) > POOR_RESIDUAL) if self._cells else NO_ROWS
        for cell, gradient in self._cells if len(poor) else ():
            other = self._state(p[:, poor], cell(p[:, poor], CELL_FLOOR) - gradient[:, None])
            better = np.flatnonzero(other.value < at.value[poor])
            at.put(poor[better], other.columns(better))
        return at

    def _drawn_in(self, p: FloatArray, at: State) -> State:
        """Draw in starts far beyond their solutions, where the curvature vanishes.

        A start is halved while, to second order, the minimum along its ray is on the other side of 0.
        """
        for _ in range(MAX_HALVINGS):
            s, hessian = at.s, at.hessian
            curvature = dot(hessian[: len(s)], s**2)
            if len(s) == 2:
                curvature += 2 * hessian[2] * s[0] * s[1]
            rows = np.flatnonzero((dot(at.gradient, s) > curvature) & (size(s) > SEEING_REACH))
            if not len(rows):
                break
            at.put(rows, self._state(p[:, rows], s[:, rows] / 2))
        return at
