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

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.basis import (
    NOTHING,
    SAFE_EXPONENT,
    UNDERFLOW,
    Location,
    block_length,
    face_knots,
    is_corner,
    weighted_sums,
)
from gtb_cli.domain import EPS, Domain, domain
from gtb_cli.errors import ToleranceError
from gtb_cli.lifting import regular_decomposition

RESIDUAL = 1e-12
"""Largest |μ(s) − p| that is accepted, as a fraction of the hull's size."""

ACCEPTED = RESIDUAL / 2
"""The same in the coordinates in which a point is solved, whose axes may be longer and turned."""

TARGET = 1e-14
"""Residual at which a point is done at once if all digits are asked for; where rounding keeps it above, `REFUSALS`
steps in a row end it."""

REFUSALS = 4
ITERATIONS = 300

EXTREME = 3.0
"""Range of log(c_i ω_i), affine part removed, from which the tropical limit is tried as a start too."""

CELL_FLOOR = 1e-3
"""How near the border of its cell, as a fraction of the next layer's distance, a tropical start may be: on the border
itself it is infinite."""

START_FLOOR = 1e-17
"""Distance from an edge, as a fraction of the next layer's, from which points nearer still are started."""

LAST_CORNER = 1e-6
"""How near the last corner of its edge, as a fraction of the hull's size, coordinates of a point start from there."""

HALVINGS = 60
"""Largest number of times a start that is far too far out is drawn in."""

NEAR = 1.0
"""Torus coordinates of unit knots from which a start is not drawn in further: it sees all knots."""

WEAKEST = 1e-8
"""Smallest regularisation, times the residual: less is lost in the rounding of the Hessian's determinant."""

CANCELLED = 1 - 8 * EPS
"""Of μ², what is taken from mean squares for the Hessian: what is left is as much as rounding makes of it."""

TINY = 1e-300
"""Smallest curvature that is divided by."""

PARTS = 64
"""The box around Δ is cut into this many parts each way; the first point solved in each is remembered, and what it
added to its start serves the others."""

FARTHEST = 1.0
"""Largest exponent by which the slope of what was added may move a start: beyond, it is no guide."""

POOR = 0.05
"""Residual of a start, as a fraction of the hull's size, from which the cells' limits are tried too."""


@dataclass(frozen=True, eq=False)
class LinearParametrization:
    """The linear parametrisation of a patch: where p in Δ lies, found by solving μ(s) = p.

    Parameters
    ----------
    shape : Domain
    log_weights : (n,) float
        log(c_i ω_i).

    Notes
    -----
    On an edge only that edge's knots and weights are used. Inside, each point is solved in coordinates along and
    over its nearest edge, in which the knots on that edge have an exact 0, so that digits are kept up to the edge.
    """

    shape: Domain
    log_weights: FloatArray

    def locations(self, p: FloatArray, faces: IntArray | None = None, within: float = 0.0) -> Iterator[Location]:
        """Locate (m, d) points of Δ.

        `faces`, rows of `Domain.faces`, says where they are known to lie, whatever rounding has made of them.

        Yields
        ------
        Location
            With s such that |μ(s) − p| ≤ `RESIDUAL`, or `within` if that is more, times the hull's size.

        Raises
        ------
        DomainError
            A point is not finite or outside Δ.
        ToleranceError
            The residual was not reached.
        """
        shape = self.shape
        heights = shape.heights_of_columns(p, 0, faces)
        r = len(shape.vertices)
        # Points inside are handled by nearest edge, numbered from −r; those near its last corner from −2r.
        group = shape.nearest_edge(heights) - r
        if shape.dimension == 2:
            following = (group + 1) % r
            gap = heights[following, np.arange(len(p))] / shape.normal_lengths[following]
            group[gap < LAST_CORNER * shape.size] -= r
        boundary = np.flatnonzero((heights == 0).any(axis=0))
        group[boundary] = shape.face_of(heights[:, boundary])
        for index in (np.flatnonzero(np.bincount(group + 2 * r)) - 2 * r).tolist():
            rows = np.flatnonzero(group == index)
            here = heights[:, rows]
            if is_corner(shape, index):
                yield Location(rows, index, face_knots(shape, index), np.zeros((0, len(rows))), here)
                continue
            moments = self._moments(index)
            if index > 0:
                points = shape.along(index - 1, p[rows])[:, None]
            elif shape.dimension == 1:
                points = p[rows] - shape.vertices[index]
            else:
                points = self._along_and_over(index, p[rows], here[index % r])
            yield Location(rows, max(index, 0), moments.knots, moments.inverse(points, within), here)

    @cached_property
    def _made(self) -> dict[int, MomentMap]:
        return {}

    def _moments(self, index: int) -> MomentMap:
        """The moment map of an edge (1 … r), or of Δ in coordinates of an edge (−2r … −1), or from an end (−2, −1)."""
        shape = self.shape
        if index not in self._made:
            if index > 0:
                knots, weights = face_knots(shape, index), self.log_weights[shape.faces[index]]
            elif shape.dimension == 1:
                knots, weights = shape.knots - shape.vertices[index], self.log_weights
            else:
                heights = shape.heights[:, index % len(shape.vertices)]
                knots, weights = self._along_and_over(index, shape.knots, heights), self.log_weights
            self._made[index] = MomentMap(knots, weights)
        return self._made[index]

    def _along_and_over(self, index: int, points: FloatArray, heights: FloatArray) -> FloatArray:
        """(m, 2) coordinates along edge index mod r and over it, from its first corner, or its last if index < −r."""
        shape = self.shape
        r = len(shape.vertices)
        edge = index % r
        corner = edge if index >= -r else (edge + 1) % r
        along = (points - shape.vertices[corner]) @ shape.direction(edge)
        return np.column_stack([along, heights / shape.normal_lengths[edge]])


def linear_locations(shape: Domain, log_weights: FloatArray, p: FloatArray) -> Iterator[Location]:
    """Locate (m, d) points once; see `LinearParametrization.locations`."""
    return LinearParametrization(shape, log_weights).locations(p)


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
        sums = weighted_sums(self._unit_knots, self.log_weights, self._unit_knots, s * self._extents[:, None])
        return np.asarray((sums[1:] / sums[0]).T * self._extents + self._origin)

    def inverse(self, p: FloatArray, within: float = 0.0) -> FloatArray:
        """(d, m) torus coordinates s with μ(s) = p, for (m, d) points inside the hull.

        Where `within`, a fraction of the hull's size, is more than `TARGET`, that is near enough.

        Raises
        ------
        ToleranceError
            |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        target = max(TARGET, within)
        unit = (p - self._origin) / self._extents
        if len(self._extents) == 1:  # far from the origin, rounding may be more than the hull's
            unit = np.clip(unit, self._unit_knots.min(), self._unit_knots.max())
        start = self._start(unit)
        if p.shape[1] == 2:
            low, high = self._unit_knots.min(axis=0), self._unit_knots.max(axis=0)
            part = np.clip((unit - low) / (high - low) * PARTS, 0, PARTS - 1).astype(np.int64) @ np.array([1, PARTS])
            first = np.full(PARTS * PARTS, -1)
            first[part] = np.arange(len(p))
            first = first[(first >= 0) & np.isnan(self._corrections[0])]
            self._remember(part[first], unit[first].T, start[:, first])
            move = unit.T - self._places[:, part]
            slope = self._slopes[:, :, part]
            turn = slope[:, 0] * move[0] + slope[:, 1] * move[1]
            start += self._corrections[:, part] + np.where(np.abs(turn) < FARTHEST, turn, 0.0)
        length = block_length(len(self.knots))
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            start[:, block] = self._newton(unit[block].T, start[:, block], target)
        return np.asarray(start / self._extents[:, None])

    @cached_property
    def _corrections(self) -> FloatArray:
        """(2, PARTS²): what the first point solved in each part of the hull's box added to its start; NaN: none yet."""
        return np.full((2, PARTS * PARTS), np.nan)

    @cached_property
    def _places(self) -> FloatArray:
        """(2, PARTS²): where that point is."""
        return np.zeros((2, PARTS * PARTS))

    @cached_property
    def _slopes(self) -> FloatArray:
        """(2, 2, PARTS²): derivative there of what is added: Cov⁻¹ less that of `_start`."""
        return np.zeros((2, 2, PARTS * PARTS))

    def _remember(self, part: IntArray, unit: FloatArray, start: FloatArray) -> None:
        """Solve one point in each of some parts."""
        if not len(part):
            return
        solution = self._newton(unit, start, TARGET)
        self._places[:, part] = unit
        self._corrections[:, part] = solution - start
        _, _, (xx, yy, xy) = self._evaluate(solution)
        shape = self._shape
        layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        heights = shape.normals @ unit - np.einsum("jk,jk->j", shape.normals, shape.vertices)[:, None]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            own = np.einsum("jk,jl,jm->klm", shape.normals, shape.normals / layer[:, None], 1 / heights)
            slope = np.array([[yy, -xy], [-xy, xx]]) / (xx * yy - xy * xy) - own
        self._slopes[:, :, part] = np.where(np.isfinite(slope), slope, 0.0)

    @cached_property
    def _extents(self) -> FloatArray:
        """(d,): the unit of each coordinate, so that thin hulls are solved like others."""
        return np.asarray(np.ptp(self.knots, axis=0))

    @cached_property
    def _origin(self) -> FloatArray:
        """(d,): 0 in coordinates where zeros are exact, as over an edge; else the middle of the hull."""
        low, high = self.knots.min(axis=0), self.knots.max(axis=0)
        far = np.maximum(np.abs(low), np.abs(high)) > 4 * self._extents
        return np.where(far, (low + high) / 2, 0.0)

    @cached_property
    def _unit_knots(self) -> FloatArray:
        return np.asarray((self.knots - self._origin) / self._extents)

    @cached_property
    def _shape(self) -> Domain:
        """The hull of the unit knots."""
        return domain(self._unit_knots, "unit")

    @cached_property
    def _exponents(self) -> FloatArray:
        """(n, d + 1): unit knots, and log weights less that of the knot nearest 0, where Σ c ω e^<a, s> is about 1."""
        nearest = np.lexsort((-self.log_weights, np.abs(self._unit_knots).max(axis=1)))[0]
        return np.column_stack([self._unit_knots, self.log_weights - self.log_weights[nearest]])

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

    def _start(self, unit: FloatArray, floor: float = START_FLOOR) -> FloatArray:
        """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)`` of (m, d) unit p, δ_j the distance of edge j's nearest layer of knots."""
        shape = self._shape
        layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        heights = shape.normals @ unit.T - np.einsum("jk,jk->j", shape.normals, shape.vertices)[:, None]
        logs = np.log(np.maximum(heights / layer[:, None], floor))
        return np.asarray((shape.normals / layer[:, None]).T @ logs)

    def _evaluate(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """log Σ c ω e^<a, s>, its gradient μ (d, m) and its Hessian's entries: (1, m), or xx, yy, xy as (3, m)."""
        d, count = s.shape
        columns = np.empty((d + 1, count))
        columns[:d], columns[d] = s, 1.0
        e = self._exponents @ columns
        shift: FloatArray | float = 0.0
        if not self._reach @ np.abs(columns).max(axis=1, initial=0.0) <= SAFE_EXPONENT:
            shift = e.max(axis=0)
            e -= shift
            np.maximum(e, UNDERFLOW, out=e)
        np.exp(e, out=e)
        sums = self._summed @ e
        moments = sums[1:] / sums[0]
        mu = moments[:d]
        hessian = moments[d:]
        hessian[:d] -= CANCELLED * mu**2
        hessian[d:] -= mu[:1] * mu[1:]
        return np.log(sums[0]) + shift, mu, hessian

    def _newton(self, unit: FloatArray, start: FloatArray, target: float) -> FloatArray:
        """Minimise log Σ c ω e^<a, s> − <unit, s> from `start`, or from a cell's limit where that is lower."""
        s = start
        value, mu, hessian = self._evaluate(s)
        value -= _dot(unit, s)
        poor = np.flatnonzero(_size(mu - unit) > POOR) if self._cells else NOTHING
        for cell, gradient in self._cells if len(poor) else ():
            limit = cell._start((unit[:, poor].T - cell._origin) / cell._extents, CELL_FLOOR)
            other = limit / cell._extents[:, None] - gradient[:, None]
            their_value, their_mu, their_hessian = self._evaluate(other)
            their_value -= _dot(unit[:, poor], other)
            better = their_value < value[poor]
            rows = poor[better]
            s = s.copy()
            s[:, rows], value[rows] = other[:, better], their_value[better]
            mu[:, rows], hessian[:, rows] = their_mu[:, better], their_hessian[:, better]
        gradient = mu - unit
        # Far beyond its solution a start sees no curvature: it is drawn in while, to second order, the minimum along
        # its ray is on the other side of 0.
        for _ in range(HALVINGS):
            curvature = _dot(hessian[: len(s)], s**2)
            if len(s) == 2:
                curvature += 2 * hessian[2] * s[0] * s[1]
            rows = np.flatnonzero((_dot(gradient, s) > curvature) & (_size(s) > NEAR))
            if not len(rows):
                break
            s = s.copy()
            s[:, rows] /= 2
            value[rows], mu, hessian[:, rows] = self._evaluate(s[:, rows])
            value[rows] -= _dot(unit[:, rows], s[:, rows])
            gradient[:, rows] = mu - unit[:, rows]
        solution = s.copy()
        active = np.arange(s.shape[1])
        sigma = np.full(s.shape[1], 1e-2)
        refusals = np.zeros(s.shape[1], dtype=np.int64)
        for _ in range(ITERATIONS):
            residual = _size(gradient)
            going = (residual > target) & ((refusals < REFUSALS) | (residual > ACCEPTED))
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
            rounding = -slope < 64 * EPS * (1 + np.abs(value) + _dot(np.abs(unit), np.abs(trial)))
            lower = np.where(rounding, _size(new_gradient) < residual, new_value <= value + 1e-4 * slope)
            if lower.all():
                s, value, gradient, hessian = trial, new_value, new_gradient, new_hessian
            else:
                s, value, gradient, hessian = (
                    np.where(lower, new, old)
                    for new, old in ((trial, s), (new_value, value), (new_gradient, gradient), (new_hessian, hessian))
                )
            sigma = np.where(lower, np.maximum(sigma / 16, WEAKEST), np.minimum(sigma * 8, 1e9))
            refusals = np.where(lower, 0, refusals + 1)
        residual = _size(gradient)
        if (residual > max(ACCEPTED, target)).any():
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
        return np.asarray(-gradient / np.maximum(hessian + regular, TINY))
    # By Cholesky's way, which loses nothing where knots that count are nearly on a line; Cramer's rule does.
    xx, yy, xy = hessian[0] + regular, hessian[1] + regular, hessian[2]
    ratio = xy / np.maximum(xx, TINY)
    rest = yy - ratio * xy
    rest = np.maximum(np.where(rest > 0, rest, yy), TINY)
    over = (ratio * gradient[0] - gradient[1]) / rest
    step = np.empty_like(gradient)
    step[0], step[1] = -(gradient[0] + xy * over) / np.maximum(xx, TINY), over
    return step
