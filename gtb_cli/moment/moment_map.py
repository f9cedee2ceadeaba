"""The moment map μ and its inverse.

``μ(s) = Σ_i T_i(s) a_i`` maps the torus coordinates one-to-one onto the interior of the knots' hull (Birch's theorem).
The linear parametrisation needs the inverse: p ↦ P(μ⁻¹(p)).
"""

from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, put_columns
from gtb_cli.errors import ToleranceError
from gtb_cli.moment.solve import MAX_STEPS, RESIDUAL, TARGET_RESIDUAL, LogSum, short_steps, solve
from gtb_cli.moment.starts import LayerStarts, extents_of, layer_starts, origin_of, tame_starts
from gtb_cli.moment.torus import SAFE_EXPONENT, block_length, weighted_sums
from gtb_cli.values import frozen


@frozen
class MomentMap:
    """``μ(s) = Σ_i T_i(s) a_i`` for one set of knots, and its inverse.

    Parameters
    ----------
    knots : (n, d) float
    log_weights : (n,) or (w, n) float
        log(c_i ω_i), or several vectors of them.

    Notes
    -----
    The inverse starts from the torus coordinates of p for the nearest layers of knots alone; where this fails,
    from solutions for tamer weights, and at last from 0. See `gtb_cli.moment.solve`.
    """

    knots: FloatArray
    log_weights: FloatArray

    def __call__(self, s: FloatArray) -> FloatArray:
        """(m, d) points μ(s) at (d, m) torus coordinates."""
        knots = self._unit_knots
        sums = weighted_sums(knots, self.log_weights, knots, s * self._extents[:, None])
        return np.asarray((sums[1:] / sums[0]).T * self._extents + self._origin)

    def inverse(
        self,
        p: FloatArray,
        within: float = 0.0,
        start: FloatArray | None = None,
        numbers: IntArray | None = None,
    ) -> FloatArray:
        """(d, m) torus coordinates s with μ(s) = p, for (m, d) points inside the hull.

        A residual of `within` times the hull's size suffices if `within` exceeds `TARGET_RESIDUAL`. From a good `start`
        they are found sooner. Of several vectors of weights, `numbers` has each point's.

        Raises
        ------
        ToleranceError
            |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        unit, length = self._unit(np.ascontiguousarray(p.T)), block_length(len(self.knots))
        s, target = self._starts(unit) if start is None else start * self._extents[:, None], self._target(within)
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            total = self._sum(None if numbers is None else numbers[block])
            s[:, block] = _solved(total, unit[:, block], s[:, block], target)
        return np.asarray(s / self._extents[:, None])

    def starts(self, p: FloatArray) -> FloatArray:
        """(d, m) torus coordinates of (d, m) points if only the nearest layers of knots counted."""
        return np.asarray(self._starts(self._unit(p)) / self._extents[:, None])

    def near(
        self, p: FloatArray, start: FloatArray, within: float = 0.0, numbers: IntArray | None = None
    ) -> tuple[FloatArray, IntArray]:
        """(d, m) torus coordinates of (d, m) points from nearby ones, and the columns that are not found."""
        s, missing = solve(self._sum(numbers), self._unit(p), start * self._extents[:, None], self._target(within))
        return s / self._extents[:, None], missing

    def very_near(self, p: FloatArray, start: FloatArray, within: float = 0.0) -> tuple[FloatArray, IntArray]:
        """Return what `near` does after short steps alone; what is not found so, or not to all digits, is missing."""
        start, total = start * self._extents[:, None], self._sum(None)
        far = np.flatnonzero(~(total.reach[:-1] @ np.abs(start) + total.reach[-1] <= SAFE_EXPONENT))
        there, start[:, far] = start[:, far], np.nan
        s, missing = short_steps(total, self._unit(p), start, self._target(within))
        put_columns(s, far, there)
        return s / self._extents[:, None], missing

    @staticmethod
    def _target(within: float) -> float:
        return max(TARGET_RESIDUAL, within)

    def _sum(self, numbers: IntArray | None) -> LogSum:
        return self._one_sum if numbers is None else LogSum(self._unit_knots, self.log_weights[numbers].T)

    def _unit(self, p: FloatArray) -> FloatArray:
        """(d, m) points in the coordinates of the solver."""
        unit = np.subtract(p, self._origin[:, None], order="C")
        unit /= self._extents[:, None]
        if len(unit) == 1:  # far from the origin, rounding may move points out of the hull
            np.clip(unit, self._unit_knots.min(), self._unit_knots.max(), out=unit)
        return np.asarray(unit)

    @cached_property
    def _starts(self) -> LayerStarts:
        return layer_starts(self._unit_knots)

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
    def _one_sum(self) -> LogSum:
        return LogSum(self._unit_knots, self.log_weights)


def _solved(total: LogSum, p: FloatArray, start: FloatArray, target: float) -> FloatArray:
    """Solve from a start, then from tamer weights and at last from 0."""
    s, missing = solve(total, p, tame_starts(total, p, start), target)
    if len(missing):
        # Far from the origin, knots are off their edge by rounding: a layer that is much too thin to start from.
        there = p[:, missing]
        s[:, missing], rest = solve(total.columns(missing), there, np.zeros_like(there), target)
        missing = missing[rest]
    if len(missing):
        residual = np.abs(total.columns(missing).moments(s[:, missing]).mean - p[:, missing]).max()
        raise ToleranceError(
            f"linear parametrisation: residual {residual:.1e} of the hull's size after {MAX_STEPS} steps, "
            f"{RESIDUAL:g} is required"
        )
    return s
