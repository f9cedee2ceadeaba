"""The moment map μ and its inverse: the linear parametrisation.

``μ(s) = Σ_i T_i(s) a_i`` maps the torus coordinates one-to-one onto the interior of Δ (Birch's theorem), and on each
face likewise for the knots on it. Sampling a patch at p ↦ P(μ⁻¹(p)) is the linear parametrisation: with the knots as
control points it is the identity; on an edge it depends on that edge's knots, weights and coefficients alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.basis import SAFE_EXPONENT, UNDERFLOW, Location, block_length, face_knots, is_corner, weighted_sums
from gtb_cli.domain import EPS, Domain, domain
from gtb_cli.errors import ToleranceError
from gtb_cli.lifting import regular_decomposition

RESIDUAL = 1e-12
"""Largest |μ(s) − p| that is accepted, as a fraction of the hull's size."""

TARGET = 1e-14
"""Residual at which a point is done at once; where rounding keeps it above, `REFUSALS` steps in a row end it."""

REFUSALS = 4
ITERATIONS = 300

EXTREME = 3.0
"""Range of log(c_i ω_i), affine part removed, from which the tropical limit is tried as a start too."""

CELL_FLOOR = 1e-3
"""How near the border of its cell, as a fraction of the next layer's distance, a tropical start may be: on the border
itself it is infinite."""

PARTS = 64
"""The box around Δ is cut into this many parts each way; one point of each is solved first and its correction to the
first start serves the others of its part."""

PARTS_FROM = 4096
"""Number of points from which that pays."""


def linear_locations(shape: Domain, log_weights: FloatArray, p: FloatArray) -> Iterator[Location]:
    """Locate parameters in the linear parametrisation: solve μ(s) = p.

    Parameters
    ----------
    shape : Domain
    log_weights : (n,) float
        log(c_i ω_i).
    p : (m, d) float
        Points of Δ.

    Yields
    ------
    Location
        With s such that |μ(s) − p| ≤ `RESIDUAL` times the hull's size.

    Raises
    ------
    DomainError
        A point is not finite or outside Δ.
    ToleranceError
        The residual was not reached.

    Notes
    -----
    On an edge only that edge's knots and weights are used. Inside, each point is solved in coordinates along and
    over its nearest edge, in which the knots on that edge have an exact 0, so that digits are kept up to the edge.
    """
    heights = shape.heights_of_columns(p)
    r = len(shape.vertices)
    # Points inside are handled by nearest edge, numbered from −r.
    group = shape.nearest_edge(heights) - r
    boundary = np.flatnonzero((heights == 0).any(axis=0))
    group[boundary] = shape.face_of(heights[:, boundary])
    for index in (np.flatnonzero(np.bincount(group + r)) - r).tolist():
        rows = np.flatnonzero(group == index)
        here = heights[:, rows]
        if is_corner(shape, index):
            yield Location(rows, index, face_knots(shape, index), np.zeros((0, len(rows))), here)
        elif index > 0:
            knots = face_knots(shape, index)
            s = MomentMap(knots, log_weights[shape.faces[index]]).inverse(shape.along(index - 1, p[rows])[:, None])
            yield Location(rows, index, knots, s, here)
        else:
            edge = index + r
            knots, points = shape.knots - shape.center, p[rows] - shape.center
            if shape.dimension == 2:
                over = shape.normal_lengths[edge]
                knots = np.column_stack([shape.along(edge, shape.knots), shape.heights[:, edge] / over])
                points = np.column_stack([shape.along(edge, p[rows]), here[edge] / over])
            yield Location(rows, 0, knots, MomentMap(knots, log_weights).inverse(points), here)


@dataclass(frozen=True, eq=False)
class MomentMap:
    """``μ(s) = Σ_i T_i(s) a_i`` for one set of knots, and its inverse.

    Parameters
    ----------
    knots : (n, d) float
    log_weights : (n,) float
        log(c_i ω_i).

    Notes
    -----
    The inverse minimises the convex function log Σ c_i ω_i exp<a_i, s> − <p, s> by Newton's method with a
    regularisation that follows the gradient. It starts from the torus coordinates of p as if only the nearest layers
    of knots counted, or, where weights are extreme and the function is lower there, from the limit in a cell of
    the regular decomposition that log(c_i ω_i) induces.
    """

    knots: FloatArray
    log_weights: FloatArray

    def __call__(self, s: FloatArray) -> FloatArray:
        """(m, d) points μ(s) of (d, m) torus coordinates."""
        sums = weighted_sums(self._unit_knots, self.log_weights, self._unit_knots, s * self._shape.size)
        return np.asarray((sums[1:] / sums[0]).T * self._shape.size + self._origin)

    def inverse(self, p: FloatArray) -> FloatArray:
        """(d, m) torus coordinates s with μ(s) = p, for (m, d) points inside the hull.

        Raises
        ------
        ToleranceError
            |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        unit = (p - self._origin) / self._shape.size
        start = self._start(p)
        if len(p) >= PARTS_FROM and p.shape[1] == 2:
            low, high = unit.min(axis=0), unit.max(axis=0)
            part = np.minimum((unit - low) / (high - low) * PARTS, PARTS - 1).astype(np.int64) @ np.array([1, PARTS])
            first = np.full(PARTS * PARTS, -1)
            first[part] = np.arange(len(p))
            first = first[first >= 0]
            correction = np.zeros((2, PARTS * PARTS))
            correction[:, part[first]] = self._newton(unit[first].T, start[:, first]) - start[:, first]
            start += correction[:, part]
        length = block_length(len(self.knots))
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            start[:, block] = self._newton(unit[block].T, start[:, block])
        return np.asarray(start / self._shape.size)

    @cached_property
    def _origin(self) -> FloatArray:
        """(d,): 0 in coordinates where zeros are exact, as over an edge; else the middle of the hull."""
        far = np.abs(self._shape.vertices).max(axis=0) > 4 * self._shape.size
        return np.where(far, self._shape.center, 0.0)

    @cached_property
    def _shape(self) -> Domain:
        return domain(self.knots, "unit")

    @cached_property
    def _unit_knots(self) -> FloatArray:
        return np.asarray((self.knots - self._origin) / self._shape.size)

    @cached_property
    def _exponents(self) -> FloatArray:
        return np.column_stack([self._unit_knots, self.log_weights])

    @cached_property
    def _reach(self) -> FloatArray:
        return np.asarray(np.abs(self._exponents).max(axis=0))

    @cached_property
    def _summed(self) -> FloatArray:
        """What is summed under T: 1, the knots, their squares and, for d = 2, their product."""
        a = self._unit_knots.T
        return np.concatenate([np.ones((1, a.shape[1])), a, a**2, a[:1] * a[1:]])

    @cached_property
    def _cells(self) -> tuple[tuple[MomentMap, FloatArray], ...]:
        """Each cell of the regular decomposition that log(c_i ω_i) induces, with its gradient; none where tame."""
        w = self.log_weights
        affine = np.column_stack([self._unit_knots, np.ones(len(w))])
        if np.ptp(w - affine @ np.linalg.lstsq(affine, w)[0]) < EXTREME:
            return ()
        parts = regular_decomposition(self._unit_knots, w)
        return tuple(
            (MomentMap(self._unit_knots[list(cell)], w[list(cell)]), gradient)
            for cell, gradient in zip(parts.cells, parts.gradients, strict=True)
        )

    def _start(self, p: FloatArray, floor: float = 0.0) -> FloatArray:
        """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)``, δ_j the distance of edge j's nearest layer of knots, in unit coordinates."""
        shape = self._shape
        layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        if floor:
            heights = shape.normals @ (p - shape.center).T
            heights -= np.einsum("jk,jk->j", shape.normals, shape.vertices - shape.center)[:, None]
        else:
            heights = shape.heights_of_columns(p)
        logs = np.log(np.maximum(heights / layer[:, None], floor))
        return np.asarray((shape.normals / layer[:, None]).T @ logs) * shape.size

    def _evaluate(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """log Σ c ω e^<a, s>, its gradient μ (d, m) and its Hessian's entries: (1, m), or xx, yy, xy as (3, m)."""
        e = self._exponents @ np.concatenate([s, np.ones((1, s.shape[1]))])
        shift = np.zeros(s.shape[1])
        bound = self._reach @ np.append(np.abs(s).max(axis=1, initial=0.0), 1.0)
        if not bound <= SAFE_EXPONENT:
            shift = e.max(axis=0)
            e -= shift
            np.maximum(e, UNDERFLOW, out=e)
        np.exp(e, out=e)
        sums = self._summed @ e
        d = len(s)
        moments = sums[1:] / sums[0]
        mu = moments[:d]
        hessian = moments[d:]
        hessian[:d] -= mu**2
        hessian[d:] -= mu[:1] * mu[1:]
        return np.log(sums[0]) + shift, mu, hessian

    def _newton(self, unit: FloatArray, start: FloatArray) -> FloatArray:
        """Minimise log Σ c ω e^<a, s> − <unit, s> from `start`, or from a cell's limit where that is lower."""
        s = start
        value, mu, hessian = self._evaluate(s)
        value -= _dot(unit, s)
        for cell, gradient in self._cells:
            other = cell._start(unit.T, CELL_FLOOR) / cell._shape.size - gradient[:, None]
            their_value, their_mu, their_hessian = self._evaluate(other)
            their_value -= _dot(unit, other)
            better = their_value < value
            value = np.where(better, their_value, value)
            s, mu, hessian = (
                np.where(better, theirs, mine)
                for theirs, mine in ((other, s), (their_mu, mu), (their_hessian, hessian))
            )
        gradient = mu - unit
        solution = s.copy()
        active = np.arange(s.shape[1])
        sigma = np.full(s.shape[1], 1e-2)
        refusals = np.zeros(s.shape[1], dtype=np.int64)
        for _ in range(ITERATIONS):
            residual = _size(gradient)
            going = (residual > TARGET) & ((refusals < REFUSALS) | (residual > RESIDUAL))
            count = int(going.sum())
            if not count:
                break
            if count < 0.5 * len(going):
                solution[:, active] = s
                active, refusals = active[going], refusals[going]
                value, sigma, residual = value[going], sigma[going], residual[going]
                s, gradient, hessian, unit = s[:, going], gradient[:, going], hessian[:, going], unit[:, going]
            step = _regularised_step(gradient, hessian, sigma * residual)
            trial = s + step
            new_value, mu, new_hessian = self._evaluate(trial)
            new_value -= _dot(unit, trial)
            new_gradient = mu - unit
            slope = _dot(gradient, step)
            # Below the rounding of the objective only the gradient can tell a better point.
            rounding = -slope < 64 * EPS * (1 + np.abs(value) + _size(trial))
            lower = np.where(rounding, _size(new_gradient) < residual, new_value <= value + 1e-4 * slope)
            if lower.all():
                s, value, gradient, hessian = trial, new_value, new_gradient, new_hessian
            else:
                s, value, gradient, hessian = (
                    np.where(lower, new, old)
                    for new, old in ((trial, s), (new_value, value), (new_gradient, gradient), (new_hessian, hessian))
                )
            sigma = np.where(lower, sigma / 16, np.minimum(sigma * 8, 1e9))
            refusals = np.where(lower, 0, refusals + 1)
        else:
            raise ToleranceError(
                f"linear parametrisation: residual {residual.max():.1e} of the hull's size after {ITERATIONS} steps, "
                f"{RESIDUAL:g} is required"
            )
        solution[:, active] = s
        return solution


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) scalar products of (d, m) columns; for one or two rows faster than a reduction."""
    return np.asarray(a[0] * b[0] if len(a) == 1 else a[0] * b[0] + a[1] * b[1])


def _size(a: FloatArray) -> FloatArray:
    """(m,) largest absolute entry of (d, m) columns."""
    return np.asarray(np.abs(a[0]) if len(a) == 1 else np.maximum(np.abs(a[0]), np.abs(a[1])))


def _regularised_step(gradient: FloatArray, hessian: FloatArray, regular: FloatArray) -> FloatArray:
    """Solve (H + regular I) step = −gradient for each column."""
    if len(gradient) == 1:
        return np.asarray(-gradient / (hessian + regular))
    xx, yy, xy = hessian[0] + regular, hessian[1] + regular, hessian[2]
    determinant = xx * yy - xy * xy
    determinant = np.where(determinant > 0, determinant, xx * yy)
    return np.asarray(
        np.stack([xy * gradient[1] - yy * gradient[0], xy * gradient[0] - xx * gradient[1]]) / determinant
    )
