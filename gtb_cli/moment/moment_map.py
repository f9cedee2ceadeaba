"""The moment map μ and its inverse.

``μ(s) = Σ_i T_i(s) a_i`` maps the torus coordinates one-to-one onto the interior of the knots' hull (Birch's theorem).
The linear parametrisation needs the inverse: p ↦ P(μ⁻¹(p)).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, put_columns
from gtb_cli.errors import ToleranceError
from gtb_cli.moment import solve as solver
from gtb_cli.moment.solve import RESIDUAL, TARGET_RESIDUAL, LogSum, short_steps, solve
from gtb_cli.moment.starts import LayerStarts, extents_of, layer_starts, origin_of, tame_starts
from gtb_cli.moment.torus import SAFE_EXPONENT, block_length, weighted_sums
from gtb_cli.values import frozen


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
    The inverse starts from the torus coordinates of p for the nearest layers of knots alone; where this fails,
    from solutions for tamer weights, and at last from 0. See `gtb_cli.moment.solve`.
    """

    knots: FloatArray
    log_weights: FloatArray

    def __call__(self, s: FloatArray) -> FloatArray:
        """(m, d) points μ(s) at (d, m) torus coordinates."""
        knots = self._sum.knots
        sums = weighted_sums(knots, self.log_weights, knots, s * self._extents[:, None])
        return np.asarray((sums[1:] / sums[0]).T * self._extents + self._origin)

    def inverse(self, p: FloatArray, within: float = 0.0, start: FloatArray | None = None) -> FloatArray:
        """(d, m) torus coordinates s with μ(s) = p, for (m, d) points inside the hull.

        A residual of `within` times the hull's size suffices if `within` exceeds `TARGET_RESIDUAL`. From a good `start`
        they are found sooner.

        Raises
        ------
        ToleranceError
            |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        unit, length = self._unit(np.ascontiguousarray(p.T)), block_length(len(self.knots))
        s, target = (
            self._starts(unit) if start is None else start * self._extents[:, None],
            max(TARGET_RESIDUAL, within),
        )
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            s[:, block] = self._solved(unit[:, block], s[:, block], target)
        return np.asarray(s / self._extents[:, None])

    def _solved(self, unit: FloatArray, start: FloatArray, target: float) -> FloatArray:
        s, missing = short_steps(self._sum, unit, start, target)
        if not len(missing):
            return s
        # Far from the origin, knots are off their edge by rounding: a layer that is much too thin to start from.
        for starts in (tame_starts, lambda total, p, start: np.zeros_like(start)):
            if len(missing):
                p, begin = unit[:, missing], start[:, missing]
                s[:, missing], rest = solve(self._sum, p, starts(self._sum, p, begin), target)
                missing = missing[rest]
        if len(missing):
            residual = np.abs(self._sum.moments(s[:, missing]).mean - unit[:, missing]).max()
            raise ToleranceError(
                f"linear parametrisation: residual {residual:.1e} of the hull's size after {solver.MAX_STEPS} steps, "
                f"{RESIDUAL:g} is required"
            )
        return s

    def starts(self, p: FloatArray) -> FloatArray:
        """(d, m) torus coordinates of (d, m) points if only the nearest layers of knots counted."""
        return np.asarray(self._starts(self._unit(p)) / self._extents[:, None])

    def near(self, p: FloatArray, start: FloatArray, within: float = 0.0) -> tuple[FloatArray, IntArray]:
        """(d, m) torus coordinates of (d, m) points from nearby ones, and the columns that are not found."""
        s, missing = solve(self._sum, self._unit(p), start * self._extents[:, None], max(TARGET_RESIDUAL, within))
        return s / self._extents[:, None], missing

    def very_near(self, p: FloatArray, start: FloatArray, within: float = 0.0) -> tuple[FloatArray, IntArray]:
        """Return what `near` does after short steps alone; what is not found so, or not to all digits, is missing."""
        start, reach = start * self._extents[:, None], self._sum.reach
        far = np.flatnonzero(~(reach[:-1] @ np.abs(start) + reach[-1] <= SAFE_EXPONENT))
        there, start[:, far] = start[:, far], np.nan
        s, missing = short_steps(self._sum, self._unit(p), start, max(TARGET_RESIDUAL, within))
        put_columns(s, far, there)
        return s / self._extents[:, None], missing

    def _unit(self, p: FloatArray) -> FloatArray:
        """(d, m) points in the coordinates of the solver."""
        unit = np.subtract(p, self._origin[:, None], order="C")
        unit /= self._extents[:, None]
        if len(unit) == 1:  # far from the origin, rounding may move points out of the hull
            np.clip(unit, self._sum.knots.min(), self._sum.knots.max(), out=unit)
        return np.asarray(unit)

    @cached_property
    def _starts(self) -> LayerStarts:
        return layer_starts(self._sum.knots)

    @cached_property
    def _extents(self) -> FloatArray:
        """(d,) unit of each coordinate, so that thin hulls are solved like others."""
        return extents_of(self.knots)

    @cached_property
    def _origin(self) -> FloatArray:
        """(d,) 0 in coordinates whose zeros are exact, as over an edge; otherwise the middle of the hull."""
        return origin_of(self.knots)

    @cached_property
    def _sum(self) -> LogSum:
        return LogSum(np.asarray((self.knots - self._origin) / self._extents), self.log_weights)
