"""Proofs that chords are within a tolerance of a curve at every point, and not only at samples.

In the torus coordinate s all exponents are linear. So log T_i is concave in s, with slope a_i − μ, and μ increases.
Values at the ends of an interval [α, β] therefore bound T, μ and the derivatives of the curve on all of it: tangents of
log T_i at both ends meet above it.
"""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, joined, rows_of
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT, block_length
from gtb_cli.theory.patch import Patch


class Intervals(NamedTuple):
    """Intervals of the torus coordinate, in units of the reciprocal of the size of Δ; infinite at ends of the curve."""

    row: IntArray  # (m,) the chord that each part of the curve is compared with
    start: FloatArray
    end: FloatArray


class _Ends(NamedTuple):
    """One end of each interval: T there, and the place of the curve along and across the chord."""

    logs: FloatArray  # (n, m) log T_i
    shares: FloatArray  # (n, m) T_i
    slopes: FloatArray  # (n, m) a_i − μ, in units of the size of Δ
    x: FloatArray  # (m,)
    y: FloatArray  # (3, m)


class ChordProofs:
    """Proofs that chords are within a tolerance of one curve.

    On an interval [α, β], P is within (β − α)²/8 · max |P''| of the point at the same fraction of its chord, with
    ``P'' = Σ T_i (b_i − v)((a_i − μ)² − Var a)`` for any v. This is used along and across the segment of the mesh:
    distances across grow by no more, and along it the curve does not run beyond the ends of the interval unless ``P'``
    changes its sign. At an end of the curve let δ be the distance to the next knot and η_i = |a_i − a_0| / δ; in
    z = exp(δ (s − β)), from 0 to 1, the curve is
    ``P_0 + (z (P(β) − P_0) + Σ V_i (z^{η_i} − z)(b_i − P_0)) / D(z)`` with V = T(β); D ≥ z unless μ(β) is beyond that
    knot, and D ≥ V_0. The bounds include rounding.
    """

    def __init__(self, patch: Patch) -> None:
        self.basis, domain = patch.rational_basis, patch.domain
        knots = patch.knots[:, 0].copy()
        for end in (0, 1):
            knots[domain.incidence[:, end]] = domain.vertices[end, 0]
        self.knots, self.size, self.ends = knots, domain.size, domain.incidence.T
        self.log_weights, self.points = patch.log_products, patch.control_points
        # (n,) distances of the knots from either end, in units of the size of Δ
        self.gaps = [(knots - knots.min()) / self.size, (knots.max() - knots) / self.size]
        # The lengths by which a tail, an interval up to an end of the curve, is shortened: a factor of 4 in z
        self.steps = [float(np.log(4.0) / gaps[gaps > 0].min()) for gaps in self.gaps]
        self.reach = [self._reach(side) for side in (0, 1)]

    def failing(self, u: FloatArray, chords: FloatArray, tolerance: float) -> BoolArray:
        """Mark (k, 2, 3) chords not proved to be within the tolerance of the curve between their (k, 2) parameters."""
        max_halvings = 200  # all but a few rounds halve intervals; what is still open then fails
        alive = 8  # arrays as large as T
        places, inverse = np.unique(u, return_inverse=True)
        s = np.empty(len(places))  # torus coordinates, infinite at the ends of the curve
        for location in self.basis.locations(places[:, None], "linear"):
            s[location.rows] = location.s[0] if len(location.s) else (-np.inf, np.inf)[location.face.index]
        start, end = s[inverse.reshape(u.shape)].T * self.size
        fails = np.zeros(len(start), dtype=bool)
        todo = Intervals(np.arange(len(start)), start, end)
        length = max(64, block_length(len(self.knots)) // alive)
        for _ in range(max_halvings):
            left = [rows_of(todo, slice(0))]
            for begin in range(0, len(todo.row), length):
                block = rows_of(todo, slice(begin, begin + length))
                far, open_ = self._compared(block, chords[block.row], tolerance)
                fails[block.row[far]] = True
                left.append(rows_of(block, open_))
            todo = joined(left)
            todo = rows_of(todo, ~fails[todo.row])
            if not len(todo.row):
                return fails
            places = self._cuts(todo)
            stuck = (places <= todo.start) | (places >= todo.end)
            fails[todo.row[stuck]] = True
            todo, places = rows_of(todo, ~stuck), places[~stuck]
            todo = Intervals(np.tile(todo.row, 2), np.append(todo.start, places), np.append(places, todo.end))
        fails[todo.row] = True
        return fails

    def _cuts(self, intervals: Intervals) -> FloatArray:
        """Choose where to cut intervals: in the middle, or nearer to the end of the curve that they reach."""
        start, end = intervals.start, intervals.end
        with np.errstate(invalid="ignore"):  # infinities of opposite signs
            places = (start + end) / 2
        for side, sign, near, far in ((0, 1, start, end), (1, -1, end, start)):
            shorter = np.where(sign * far > sign * self.reach[side], self.reach[side], far - sign * self.steps[side])
            places = np.where(np.isinf(near), shorter, places)
        return np.asarray(np.where(np.isinf(start) & np.isinf(end), self.reach[0], places))

    def _reach(self, side: int) -> float:
        """Return the torus coordinate beyond which the knots at the first, or last, end have most of T."""
        at = self.ends[side]
        total = np.logaddexp.reduce(self.log_weights[at])
        others = self.log_weights[~at] - total + np.log(2.0 * len(at))
        return float((-1 if side else 1) * (-others / self.gaps[side][~at]).min())

    def _seen_from(self, chords: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return lengths of chords, (m,), the control points as seen from each, and the rounding of distances, (m,).

        The points are places along the chord, (n, m), from its first end, and vectors across, (3, n, m).
        """
        origin, corner = chords[:, 0], chords[:, 1]
        direction = corner - origin
        length = np.sqrt((direction**2).sum(axis=1))
        direction /= np.where(length > 0, length, 1.0)[:, None]
        relative = self.points.T[:, :, None] - origin.T[:, None]
        along = (relative * direction.T[:, None]).sum(axis=0)
        size = np.maximum(np.abs(origin).max(axis=1), np.abs(self.points).max())
        rounding = EPS * (8 * size + (len(self.knots) + 16) * np.abs(relative).max())
        return length, along, relative - along * direction.T[:, None], rounding

    def _at(self, s: FloatArray, along: FloatArray, across: FloatArray) -> _Ends:
        """Evaluate T and the curve at (m,) torus coordinates."""
        at = np.where(np.isfinite(s), s, 0.0)
        # Relative to the knot with the largest T, differences of exponents are exact to rounding.
        leader = (self.knots[:, None] / self.size * at + self.log_weights[:, None]).argmax(axis=0)
        steps = (self.knots[:, None] - self.knots[leader]) / self.size
        e = steps * at + (self.log_weights[:, None] - self.log_weights[leader])
        for own, infinite in zip(self.ends, (s == -np.inf, s == np.inf), strict=True):
            e[:, infinite] = np.where(own, self.log_weights, -np.inf)[:, None]
        e -= e.max(axis=0)
        t = np.exp(np.maximum(e, UNDERFLOW_EXPONENT))
        total = t.sum(axis=0)
        slopes = steps - (steps * t).sum(axis=0) / total
        logs = e - np.log(total)
        shares = np.exp(np.maximum(logs, UNDERFLOW_EXPONENT))
        return _Ends(logs, shares, slopes, (shares * along).sum(axis=0), (shares * across).sum(axis=1))

    def _compared(self, intervals: Intervals, chords: FloatArray, tolerance: float) -> tuple[BoolArray, BoolArray]:
        """Tell which parts of the curve are farther than the tolerance from (m, 2, 3) chords, and which are open."""
        spent_share = 0.02  # of the tolerance: a bound that is known this well, yet does not hold, will not hold
        length, *points, rounding = self._seen_from(chords)
        first, last = ends = [self._at(s, *points) for s in (intervals.start, intervals.end)]
        across = np.stack([np.linalg.norm(end.y, axis=0) for end in ends])
        beyond = np.stack([np.maximum(np.maximum(-end.x, end.x - length), 0.0) for end in ends])
        # By how much the points between may be farther than both ends, across and along the chord.
        more = self._between(intervals, first, last, points)
        for side, (at, other) in enumerate(((first, last), (last, first))):
            tail = np.flatnonzero(np.isinf((intervals.start, intervals.end)[side]))
            if len(tail):
                along = (points[0] - at.x)[:, tail]
                off = np.linalg.norm((points[1] - at.y[:, None])[:, :, tail], axis=0)
                more[:, tail] = self._tail(side, other.shares[:, tail], other.slopes[:, tail], along, off)
        bound = np.hypot(*(np.stack([across.max(axis=0), beyond.max(axis=0)]) + more)) + rounding
        holds = bound <= tolerance
        is_seen = np.hypot(across, beyond).max(axis=0) > tolerance
        far = ~holds & (is_seen | (np.hypot(*more) <= spent_share * tolerance))
        return far, ~holds & ~far

    def _between(self, intervals: Intervals, first: _Ends, last: _Ends, points: list[FloatArray]) -> FloatArray:
        """Bound distances, (2, m), of parts of the curve from their chords, across and along; infinite for tails."""
        along = points[0] - (first.x + last.x) / 2
        off = np.linalg.norm(points[1] - (first.y + last.y)[:, None] / 2, axis=0)
        width = intervals.end - intervals.start
        finite = np.isfinite(width)
        width = np.where(finite, width, 0.0)
        # Where tangents of log T_i from both ends meet; it increases up to a_i = μ.
        rise, fall = np.maximum(first.slopes, 0.0), np.maximum(-last.slopes, 0.0)
        both = (rise > 0) & (fall > 0)
        with np.errstate(invalid="ignore"):  # tails
            meet = (last.logs - first.logs + fall * width) / np.where(both, rise + fall, 1.0)
        peak = np.where(both, first.logs + rise * np.clip(meet, 0.0, width), np.maximum(first.logs, last.logs))
        most = np.exp(np.clip(peak, UNDERFLOW_EXPONENT, 0.0))
        squares = np.maximum(first.slopes**2, last.slopes**2)
        variance = np.minimum((most * ((first.slopes + last.slopes) / 2) ** 2).sum(axis=0), 0.25)
        # Bounds of the second derivative, T_i ((a_i − μ)² − Var a), for each knot and along the chord.
        factor = most * np.maximum(squares, variance)
        second = (factor * np.abs(along)).sum(axis=0)
        speeds = [(end.shares * along * end.slopes).sum(axis=0) for end in (first, last)]
        noise = (len(self.knots) + 16) * EPS * (most * np.abs(along) * np.sqrt(squares)).sum(axis=0)
        steady = np.sign(speeds[0]) * np.sign(speeds[1]) > 0
        steady &= np.minimum(*np.abs(speeds)) > width / 2 * second + noise
        bounds = width**2 / 8 * np.stack([(factor * off).sum(axis=0), np.where(steady, 0.0, second)])
        return np.where(finite, bounds, np.inf)

    def _tail(
        self, side: int, shares: FloatArray, slopes: FloatArray, along: FloatArray, off: FloatArray
    ) -> FloatArray:
        """Bound the distances of tails from their own chords, across and along, (2, m).

        Given are V = T and a_i − μ at β, the end of each tail that is not an end of the curve, and the control points
        relative to the other end: (n, m) places along the chord, and distances from it.
        """
        at, gaps = self.ends[side], self.gaps[side]
        least = gaps[gaps > 0].min()
        first = np.flatnonzero(gaps == least)
        # The largest of z − z^η between 0 and 1, where its derivative is 0.
        eta = np.maximum(gaps / least, 1.0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            most = np.where(eta > 1, (eta - 1) * np.exp(-eta / (eta - 1) * np.log(eta)), 0.0)
        most[at] = 0.0
        base = shares[at].sum(axis=0)
        bounds = np.stack([(shares * most[:, None] * np.abs(part)).sum(axis=0) / base for part in (off, along)])
        # Along the chord nothing turns back if what the next knots add outweighs all that others take away.
        ahead = shares * along
        room = -slopes[first[0]] if side else slopes[first[0]]  # from μ to the next knot
        speed = ahead[first].sum(axis=0)
        noise = (len(self.knots) + 16) * EPS * np.abs(ahead[~at]).sum(axis=0)
        for sign in (1.0, -1.0):
            against = (np.maximum(-sign * ahead[gaps > least], 0.0) * gaps[gaps > least, None]).sum(axis=0)
            bounds[1, sign * speed * room > against + noise] = 0.0
        return np.where((room >= 0) & (base > 0), bounds, np.inf)
