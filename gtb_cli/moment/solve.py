"""The solver of μ(s) = p, for many points at once, one in each column; starts, second tries, errors: `moment_map`.

μ is the gradient of the convex function ``log Σ c_i ω_i e^<a_i, s>``. Plain steps of Newton's method are taken while
they are short; columns for which these do not suffice minimise ``log Σ c_i ω_i e^<a_i, s> − <p, s>`` by steps that are
regularised and refused if they do not lead lower.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, column_dot
from gtb_cli.moment.torus import scaled_exponentials
from gtb_cli.values import frozen

RESIDUAL = 1e-12  # largest accepted |μ(s) − p|, as a fraction of the hull's size
ACCEPTED_RESIDUAL = RESIDUAL / 2  # in the coordinates of the solver, whose axes may be longer and turned
TARGET_RESIDUAL = 1e-14  # residual at which a point is done if all digits are asked for
MAX_STEPS = 300  # regularised steps after which a point is missing


@frozen
class LogSum:
    """``log Σ_i c_i ω_i e^<a_i, s>`` for each column s."""

    knots: FloatArray  # (n, d) in units of their extents
    log_weights: FloatArray  # (n,) log(c_i ω_i) for all columns, or (n, m), one for each

    def columns(self, rows: IntArray) -> LogSum:
        """Return the function for some columns."""
        return self if self.log_weights.ndim == 1 else LogSum(self.knots, self.log_weights[:, rows])

    def moments(self, s: FloatArray) -> tuple[FloatArray, ...]:
        """Return means μ, (d, m), variances, (1, m), or variances and covariance, (3, m), and sums with their shift."""
        d, e = len(s), self.knots @ s
        e += self.log_weights if self.log_weights.ndim == 2 else self.log_weights[:, None]
        shift = e.max(axis=0)
        sums = self._summed @ scaled_exponentials(e)
        moments = sums[1:] / sums[0]
        mean, spread = moments[:d], moments[d:]
        # The spread of a column near a knot is of the order of the rounding, but positive.
        spread[:d] -= (1 - 8 * EPS) * mean**2
        spread[d:] -= mean[:1] * mean[1:]
        return mean, spread, sums[0], shift

    @cached_property
    def _summed(self) -> FloatArray:
        """The functions averaged: 1, the knots' coordinates, their squares and, for d = 2, their product."""
        a = self.knots.T
        return np.concatenate([np.ones((1, a.shape[1])), a, a**2, a[:1] * a[1:]])


class State(NamedTuple):
    """Columns s, and the values, gradients and second derivatives of the objective there."""

    s: FloatArray
    value: FloatArray
    gradient: FloatArray
    hessian: FloatArray

    @staticmethod
    def at(total: LogSum, p: FloatArray, s: FloatArray) -> State:
        """Evaluate ``log Σ c_i ω_i e^<a_i, s> − <p, s>``."""
        mean, spread, sums, shift = total.moments(s)
        return State(s, np.log(sums) + shift - column_dot(p, s), mean - p, spread)


def solve(total: LogSum, p: FloatArray, start: FloatArray, target: float) -> tuple[FloatArray, IntArray]:
    """Return (d, m) columns s with μ(s) = p from (d, m) starts, and the columns whose residual is too large.

    Points are in the coordinates of the knots, inside their hull. A residual |μ(s) − p| of `target` suffices; if
    rounding keeps it above, `ACCEPTED_RESIDUAL` does.
    """
    s, left = short_steps(total, p, start, target)
    if not len(left):
        return s, left
    some, there = total.columns(left), p.take(left, axis=1)
    found, residual = _minimised(some, there, start.take(left, axis=1), target)
    s[:, left] = short_steps(some, there, found, target)[0]
    return s, left[~(residual <= max(ACCEPTED_RESIDUAL, target))]


def short_steps(total: LogSum, p: FloatArray, start: FloatArray, target: float) -> tuple[FloatArray, IntArray]:
    """Take Newton's steps, long ones in part; columns for which a few do not suffice are not changed.

    Returns the columns, and which are left. Third derivatives of the sum's logarithm are at most its second ones times
    the extent of the knots, 1. This bounds the residual before a step is taken: a point is done after the step if the
    bound is small enough. It also says that log(1 + l) of a step of length l leads lower (T. Sun, Q. Tran-Dinh,
    Generalized self-concordant functions, Math. Programming 178 (2019), Thm 2).
    """
    longest, patience = 8.0, 5  # of the steps that are taken in full; after as many longer ones, few get near
    s, solution, active, left = start, start.copy(), np.arange(start.shape[1]), list[IntArray]()
    for number in range(16):  # most points need five; one that needs more is left
        mean, spread, *_ = total.moments(s)
        mean -= p
        step = _step(mean, spread, 0.0, np.nan)
        length = np.abs(step).sum(axis=0)
        bound = -0.5 * np.einsum("ij,ij->j", mean, step)
        short = length <= longest
        done = short & (bound * np.exp(np.minimum(length, longest)) <= target)
        if not short.all():
            long = np.flatnonzero(~short)
            step[:, long] *= np.log1p(length[long]) / length[long]
        step += s
        s = step
        far = ~short & (number >= patience)
        if (done | far).any():
            solution[:, active[done]] = step[:, done]
            left.append(active[far])
            keep = np.flatnonzero(~(done | far))
            active = active[keep]
            if not len(keep):
                break
            s, p, total = step.take(keep, axis=1), p.take(keep, axis=1), total.columns(keep)
    return solution, np.concatenate([*left, active])


def _minimised(total: LogSum, p: FloatArray, start: FloatArray, target: float) -> tuple[FloatArray, FloatArray]:
    """Minimise the objective by regularised steps; return the columns and their (m,) residuals.

    The regularisation is a multiple of the residual, less after each step that leads lower and more after each that
    does not, which is refused.
    """
    first, most = 1e-2, 1e9
    # Rounding of a determinant hides less; one unknown has none: between knots 1e-11 apart, the curvature is 1e-22.
    least = 1e-8 if len(p) == 2 else 0.0
    at = _drawn_in(total, p, State.at(total, p, start.copy()))
    solution, residuals, active = at.s.copy(), abs(at.gradient).max(axis=0), np.arange(p.shape[1])
    factor, refusals = np.full(len(active), first), np.zeros(len(active), dtype=np.int64)
    for _ in range(MAX_STEPS):
        residual = abs(at.gradient).max(axis=0)
        solution[:, active], residuals[active] = at.s, residual
        # Rounding may keep a residual above the target: then every step is refused.
        going = np.flatnonzero((residual > target) & (refusals < 4))
        if not len(going):
            break
        if len(going) < len(active):
            at = State(*(x[..., going] for x in at))
            p, total, active = p[:, going], total.columns(going), active[going]
            factor, refusals, residual = factor[going], refusals[going], residual[going]
        step = _step(at.gradient, at.hessian, factor * residual, 1e-300)
        trial = State.at(total, p, at.s + step)
        slope = column_dot(at.gradient, step)
        # Below the rounding of the objective, only the gradient can identify a better point.
        rounding = -slope < 64 * EPS * (1 + np.abs(at.value) + column_dot(np.abs(p), np.abs(trial.s)))
        lower = np.where(rounding, abs(trial.gradient).max(axis=0) < residual, trial.value <= at.value + 1e-4 * slope)
        at = State(*(np.where(lower, new, old) for new, old in zip(trial, at, strict=True)))
        factor = np.where(lower, np.maximum(factor / 16, least), np.clip(factor * 8, first, most))
        refusals = np.where(lower, 0, refusals + 1)
    return solution, residuals


def _drawn_in(total: LogSum, p: FloatArray, at: State) -> State:
    """Draw in starts far beyond their solutions, where the curvature vanishes.

    A start is halved while, to second order, the minimum along its ray is on the other side of 0; but not within 1,
    where all knots count.
    """
    for _ in range(60):  # more would be beyond the range of exponents
        s, hessian = at.s, at.hessian
        curvature = column_dot(hessian[: len(s)], s**2)
        if len(s) == 2:
            curvature += 2 * hessian[2] * s[0] * s[1]
        rows = np.flatnonzero((column_dot(at.gradient, s) > curvature) & (abs(s).max(axis=0) > 1.0))
        if not len(rows):
            break
        for old, new in zip(at, State.at(total.columns(rows), p[:, rows], s[:, rows] / 2), strict=True):
            old[..., rows] = new
    return at


def _step(gradient: FloatArray, hessian: FloatArray, regular: FloatArray | float, least: float) -> FloatArray:
    """Solve (H + regular I) step = −gradient for each column; `least` replaces curvatures that are not positive."""
    xx = hessian[0] + regular
    xx = np.where(xx > 0, xx, least)
    if len(gradient) == 1:
        return np.asarray(-gradient / xx)
    # Cholesky's method keeps all digits if the knots that count are nearly collinear; Cramer's rule does not.
    yy, xy = hessian[1] + regular, hessian[2]
    ratio = xy / xx
    rest = yy - ratio * xy
    y = (ratio * gradient[0] - gradient[1]) / np.where(rest > 0, rest, np.maximum(yy, least))
    return np.array([-gradient[0] / xx - ratio * y, y])
