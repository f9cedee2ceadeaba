"""The moment map μ and its inverse, which the linear parametrisation p ↦ P(μ⁻¹(p)) needs."""

from collections import OrderedDict
from functools import cached_property, lru_cache

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.domain import domain
from gtb_cli.moment.solve import MAX_STEPS, RESIDUAL, TARGET_RESIDUAL, LogSum, solve
from gtb_cli.moment.torus import block_length, weighted_sums
from gtb_cli.values import frozen

# Solutions of the latest questions, by what decides them: patches that share knots and weights ask alike
_latest: OrderedDict[tuple[object, ...], FloatArray] = OrderedDict()


@frozen
class MomentMap:
    """The moment map ``μ(s) = Σ_i T_i(s) a_i`` of (n, d) knots and (n,) log(c_i ω_i), or of w weightings, (w, n).

    It is one-to-one onto the interior of the knots' hull (Birch's theorem). The inverse starts from the torus
    coordinates of p for the nearest layers of knots alone; where this fails, from solutions for tamer weights, and at
    last from 0. See `gtb_cli.moment.solve`.
    """

    knots: FloatArray
    log_weights: FloatArray

    def __call__(self, s: FloatArray) -> FloatArray:
        """Return the points μ(s): (d, m) → (m, d)."""
        knots = self._unit_knots
        sums = weighted_sums(knots, self.log_weights, knots, s * self._extents[:, None])
        return np.asarray((sums[1:] / sums[0]).T * self._extents + self._origin)

    def inverse(
        self, p: FloatArray, within: float = 0.0, start: FloatArray | None = None, numbers: IntArray | None = None
    ) -> FloatArray:
        """Solve μ(s) = p for points inside the hull, sooner from a good start: (m, d) → (d, m).

        A residual of `within` times the hull's size suffices. `numbers` says which of several weightings each point
        uses. `ToleranceError` is raised if |μ(s) − p| stays above `RESIDUAL` times the hull's size. The result is
        read-only: the latest ones, of up to 9216 points each, are remembered.
        """
        most_points, most_questions = 9216, 32  # they take 14 MB at most
        if len(p) > most_points or numbers is not None:
            return self._inverse(p, within, start, numbers)
        arrays = (self.knots, self.log_weights, p, start)
        key = (within, self.knots.shape, *(None if array is None else array.tobytes() for array in arrays))
        if (found := _latest.pop(key, None)) is None:
            found = self._inverse(p, within, start, None)
            found.flags.writeable = False
        _latest[key] = found
        if len(_latest) > most_questions:
            _latest.popitem(last=False)
        return found

    def _inverse(self, p: FloatArray, within: float, start: FloatArray | None, numbers: IntArray | None) -> FloatArray:
        unit, length = self._unit(np.ascontiguousarray(p.T)), block_length(len(self.knots))
        s = layer_starts(self._unit_knots, unit) if start is None else start * self._extents[:, None]
        for begin in range(0, len(p), length):
            block = slice(begin, begin + length)
            total = self._sum(None if numbers is None else numbers[block])
            there, target = unit[:, block], max(TARGET_RESIDUAL, within)
            s[:, block], missing = solve(total, there, tame_starts(total, there, s[:, block]), target)
            if not len(missing):
                continue
            # Far from the origin, knots are off their edge by rounding: a layer much too thin to start from.
            total, there = total.columns(missing), there[:, missing]
            s[:, begin + missing], rest = solve(total, there, np.zeros_like(there), target)
            if len(rest):
                residual = np.abs(total.moments(s[:, begin + missing])[0] - there)[:, rest].max()
                found = f"residual {residual:.1e} of the hull's size after {MAX_STEPS} steps"
                raise ToleranceError(f"linear parametrisation: {found}, {RESIDUAL:g} is required")
        return np.asarray(s / self._extents[:, None])

    def starts(self, p: FloatArray) -> FloatArray:
        """Return the torus coordinates that points would have if only the nearest layers of knots counted: (d, m)."""
        return np.asarray(layer_starts(self._unit_knots, self._unit(p)) / self._extents[:, None])

    def near(
        self, p: FloatArray, start: FloatArray, within: float = 0.0, numbers: IntArray | None = None
    ) -> tuple[FloatArray, IntArray]:
        """Solve for (d, m) points from nearby torus coordinates; return all, (d, m), and the columns not found."""
        start, target = start * self._extents[:, None], max(TARGET_RESIDUAL, within)
        s, missing = solve(self._sum(numbers), self._unit(p), start, target)
        return s / self._extents[:, None], missing

    def _sum(self, numbers: IntArray | None) -> LogSum:
        return LogSum(self._unit_knots, self.log_weights if numbers is None else self.log_weights[numbers].T)

    def _unit(self, p: FloatArray) -> FloatArray:
        """Return (d, m) points in the coordinates of the solver."""
        unit = np.subtract(p, self._origin[:, None], order="C")
        unit /= self._extents[:, None]
        if len(unit) == 1:  # far from the origin, rounding may move points out of the hull
            np.clip(unit, self._unit_knots.min(), self._unit_knots.max(), out=unit)
        return np.asarray(unit)

    @cached_property
    def _extents(self) -> FloatArray:
        """Unit of each coordinate, (d,), so that thin hulls are solved like others."""
        return np.asarray(np.ptp(self.knots, axis=0))

    @cached_property
    def _origin(self) -> FloatArray:
        """Origin, (d,): 0 in coordinates whose zeros are exact, as over an edge; otherwise the middle of the hull."""
        low, high = self.knots.min(axis=0), self.knots.max(axis=0)
        return np.where(np.maximum(np.abs(low), np.abs(high)) > 4 * self._extents, (low + high) / 2, 0.0)

    @cached_property
    def _unit_knots(self) -> FloatArray:
        return np.asarray((self.knots - self._origin) / self._extents)


def layer_starts(knots: FloatArray, p: FloatArray) -> FloatArray:
    """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)``: (d, m) torus coordinates of points if only the nearest layers of knots counted.

    δ_j is the distance from edge j of the hull of (n, d) unit knots to the nearest knots not on it.
    """
    normals, offsets, layer = _layers(np.ascontiguousarray(knots).tobytes(), knots.shape[1])
    heights = np.maximum((normals @ p - offsets) / layer, 1e-17)  # nearer to an edge, points start there
    return np.asarray((normals / layer).T @ np.log(heights))


@lru_cache(1024)  # the patches of a family, and of a model, share their knots
def _layers(knots: bytes, dimension: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    shape = domain(np.frombuffer(knots).reshape(-1, dimension), "unit")
    offsets = np.einsum("jk,jk->j", shape.normals, shape.vertices)
    layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
    return shape.normals, offsets[:, None], layer[:, None]


def tame_starts(total: LogSum, p: FloatArray, start: FloatArray) -> FloatArray:
    """Return starts that follow the solutions for powers of the weights, from tame ones on.

    As the power t of steep weights grows, s(t) tends to −t g + s_F, where g is the gradient of the cell of the regular
    decomposition that holds p, and s_F its own solution: it is extrapolated as a linear function of t.
    """
    tame = max(3.0, len(total.knots))  # the range of logarithms that the first start stands
    if np.ptp(total.log_weights, axis=0).max() <= tame:
        return start
    w = total.log_weights.reshape(len(total.knots), -1)
    affine = np.column_stack([total.knots, np.ones(len(w))])
    slopes = np.linalg.lstsq(affine, w)[0]
    bends = (w - affine @ slopes).reshape(total.log_weights.shape)
    t = tame / max(float(np.ptp(bends, axis=0).max()), tame)
    if t == 1:
        return start
    s, before, power = start, start, 0.0
    while t < 1:
        found, _ = solve(LogSum(total.knots, t * bends), p, s, 1e-3)
        following = min(2 * t, 1.0)
        s = found + (found - before) * ((following - t) / (t - power)) if power else found
        before, power, t = found, t, following
    return np.asarray(s - slopes[:-1])
