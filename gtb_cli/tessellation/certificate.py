"""Bounds of the distance between a curve and its polyline that hold for every point, not only for samples.

In the torus coordinate s all exponents are linear. So log T_i is concave in s, with slope a_i − μ, and μ increases.
Values at the ends of a piece [α, β] therefore bound T, μ and the derivatives of the curve on all of it: tangents of
log T_i at both ends meet above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, groups, joined, rows_of
from gtb_cli.certificates.surface import SPENT_SHARE, WAY_OUT, SurfaceCertificate
from gtb_cli.errors import ToleranceError
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT, block_length
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision
from gtb_cli.theory.patch import Patch

MAX_HALVINGS = 200
"""Rounds after which pieces of curves that are still open fail; all but a few rounds halve them."""

MAX_ROUNDS = 40
"""Times that triangles are certified, and split if that fails, before refinement gives up."""

MAX_WORK = 30_000_000
"""Knots times parts of surfaces that are bounded before refinement gives up: about a minute, as 1.2 to 3.6 µs were
measured for each."""

PILOT_FACES = 64
"""Faces that are certified first, from which the work for all others is foreseen."""

WORTH_PILOT = 32
"""Fewest times as many faces for which this is done."""

PILOT_RATIO = 1.5
"""Ratio of the work foreseen to that allowed from which on refinement gives up at once."""

WORK_ARRAYS = 8
"""Arrays as large as T that are alive at once."""


class Certificates:
    """Certificates of the cells of a subdivision.

    Parameters
    ----------
    sampler : Sampler
    """

    def __init__(self, sampler: Sampler) -> None:
        self.sampler = sampler
        self.rounds = 0
        self.torus = np.empty(0)  # of the vertices
        self.curves: dict[int, CurveCertificate] = {}
        self.surfaces: dict[int, SurfaceCertificate] = {}

    def failing(self, mesh: Subdivision, rows: IntArray, tolerance: float) -> IntArray:
        """Those of some cells that are not certain to be within the tolerance of their curves or surfaces."""
        if mesh.is_surface:
            return self._failing_triangles(mesh, rows, tolerance)
        new = np.arange(len(self.torus), len(mesh.points))
        s = _torus_coordinates(self.sampler, *rows_of(mesh.vertices, new)[:3])
        self.torus = np.append(self.torus, s)
        result = [rows[:0]]
        for index, where in groups(mesh.cells.patch[rows]):
            own = rows[where]
            if index not in self.curves:
                self.curves[index] = CurveCertificate(self.sampler.evaluated[index])
            ends = []
            for vertex, u in zip(mesh.cells.cells[own].T, mesh.cells.corners[own].swapaxes(0, 1), strict=True):
                s = self.torus.take(vertex)
                # A vertex shared with another curve has other coordinates on this one.
                other = np.flatnonzero(mesh.vertices.patch[vertex] != index)
                patch = np.full(len(other), index)
                s[other] = _torus_coordinates(self.sampler, patch, u[other], np.zeros_like(patch))
                ends.append(s)
            result.append(own[self.curves[index].failing(ends, mesh.corners(own), tolerance)])
        return np.concatenate(result)

    def _failing_triangles(self, mesh: Subdivision, rows: IntArray, tolerance: float) -> IntArray:
        if len(rows) >= WORTH_PILOT * PILOT_FACES:
            some, before = rows[:: len(rows) // PILOT_FACES], self._work
            self._failing_of(mesh, some, tolerance)
            needed = (self._work - before) / len(some) * len(rows)
            if needed > PILOT_RATIO * MAX_WORK:
                raise ToleranceError(
                    f"tolerance: {tolerance:g} takes too long to certify, {len(rows)} faces about "
                    f"{needed / MAX_WORK:.2g} times as long as is allowed: {WAY_OUT}"
                )
        fails = self._failing_of(mesh, rows, tolerance)
        self.rounds += 1
        if self.rounds > MAX_ROUNDS and fails.any():
            place = ", ".join(f"{x:.4g}" for x in np.mean(mesh.corners(rows[fails][:1]), axis=(0, 1)))
            raise ToleranceError(
                f"tolerance: {tolerance:g} cannot be certified for {fails.sum()} of {len(mesh)} faces, the first near "
                f"({place})"
            )
        return rows[fails]

    def _failing_of(self, mesh: Subdivision, rows: IntArray, tolerance: float) -> BoolArray:
        """(k,) whether some triangles are not certain to be within the tolerance."""
        fails = np.zeros(len(rows), dtype=bool)
        for index, own in groups(mesh.cells.patch[rows]):
            if index not in self.surfaces:
                self.surfaces[index] = SurfaceCertificate(self.sampler.evaluated[index])
            surface = self.surfaces[index]
            points = np.stack(mesh.corners(rows[own]), axis=1)
            left = MAX_WORK - self._work + surface.work
            fails[own] = surface.failing(mesh.cells.corners[rows[own]], points, tolerance, left)
        return fails

    @property
    def _work(self) -> int:
        return sum(surface.work for surface in self.surfaces.values())


def _torus_coordinates(sampler: Sampler, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
    """(m,) torus coordinates of points of curves, infinite at their ends."""
    result = np.empty(len(patch))
    face = face if sampler.faces is None else sampler.faces[patch, face]
    for index, rows in groups(patch):
        for location in sampler.locations(index, parameters[rows], face[rows]):
            s = location.s[0] if len(location.s) else (-np.inf, np.inf)[location.face.index]
            result[rows[location.rows]] = s
    return result


class Pieces(NamedTuple):
    """Pieces of a curve between torus coordinates, which are infinite at its ends.

    Attributes
    ----------
    row : (m,) int
        The chord that each piece is compared with.
    start, end : (m,) float
        In units of the reciprocal of the size of Δ.
    """

    row: IntArray
    start: FloatArray
    end: FloatArray


class CurveCertificate:
    """Proofs that segments are within a tolerance of a curve.

    Parameters
    ----------
    patch : Patch
        A curve.

    Notes
    -----
    On a piece [α, β], P is within (β − α)²/8 · max |P''| of the point at the same fraction of its chord, with
    ``P'' = Σ T_i (b_i − v)((a_i − μ)² − Var a)`` for any v. This is used along and across the segment of the mesh:
    distances across grow by no more, and along it the curve does not run beyond the ends of the piece unless ``P'``
    changes its sign. At an end of the curve let δ be the distance to the next knot and η_i = |a_i − a_0| / δ; in
    z = exp(δ (s − β)), from 0 to 1, the curve is
    ``P_0 + (z (P(β) − P_0) + Σ V_i (z^{η_i} − z)(b_i − P_0)) / D(z)`` with V = T(β); D ≥ z unless μ(β) is beyond that
    knot, and D ≥ V_0. The bounds include rounding.
    """

    def __init__(self, patch: Patch) -> None:
        domain = patch.domain
        knots = patch.knots[:, 0].copy()
        for end in (0, 1):
            knots[domain.incidence[:, end]] = domain.vertices[end, 0]
        self.size = domain.size
        self.knots = knots
        self.ends = domain.incidence.T
        self.log_weights = patch.log_products
        self.points = patch.control_points

    def failing(self, ends: Sequence[FloatArray], chords: Sequence[FloatArray], tolerance: float) -> BoolArray:
        """Which pieces are not within the tolerance of their chords, or cannot be shown to be.

        Parameters
        ----------
        ends : two of (m,) float
            Torus coordinates of the ends of the pieces, −inf and inf at the ends of the curve.
        chords : two of (m, 3) float
            Their ends, nearly the points of the curve there.
        tolerance : float
        """
        start, end = (np.asarray(s) * self.size for s in ends)
        fails = np.zeros(len(start), dtype=bool)
        todo = Pieces(np.arange(len(start)), start, end)
        length = max(64, block_length(len(self.knots)) // WORK_ARRAYS)
        for _ in range(MAX_HALVINGS):
            todo = rows_of(todo, ~fails[todo.row])
            if not len(todo.row):
                return fails
            left = []
            for begin in range(0, len(todo.row), length):
                block = rows_of(todo, slice(begin, begin + length))
                far, open_ = self._compared(block, chords, tolerance)
                fails[block.row[far]] = True
                left.append(rows_of(block, open_))
            todo = joined(left)
            todo = rows_of(todo, ~fails[todo.row])
            places = self._cuts(todo)
            stuck = (places <= todo.start) | (places >= todo.end)
            fails[todo.row[stuck]] = True
            todo, places = rows_of(todo, ~stuck), places[~stuck]
            todo = Pieces(np.tile(todo.row, 2), np.append(todo.start, places), np.append(places, todo.end))
        fails[todo.row] = True
        return fails

    def _cuts(self, pieces: Pieces) -> FloatArray:
        """Where to cut pieces: in the middle; those up to an end of the curve nearer to it."""
        start, end = pieces.start, pieces.end
        with np.errstate(invalid="ignore"):  # infinities of opposite signs
            places = (start + end) / 2
        for sign, near, far, reach, step in (
            (1.0, start, end, self._reach[0], self._steps[0]),
            (-1.0, end, start, self._reach[1], self._steps[1]),
        ):
            shorter = np.where(sign * far > sign * reach, reach, far - sign * step)
            places = np.where(np.isinf(near), shorter, places)
        return np.asarray(np.where(np.isinf(start) & np.isinf(end), self._reach[0], places))

    @cached_property
    def _gaps(self) -> list[FloatArray]:
        """(n,) distances of the knots from either end, in units of the size of Δ."""
        low, high = self.knots.min(), self.knots.max()
        return [(self.knots - low) / self.size, (high - self.knots) / self.size]

    @cached_property
    def _steps(self) -> list[float]:
        """By how much a tail, a piece up to an end of the curve, is shortened: by a factor of 4 in z."""
        return [float(np.log(4.0) / gaps[gaps > 0].min()) for gaps in self._gaps]

    @cached_property
    def _reach(self) -> list[float]:
        """Torus coordinates beyond which the knots at the first, or last, end have most of T."""
        reach = []
        for side, sign in ((0, 1.0), (1, -1.0)):
            at = self.ends[side]
            total = np.logaddexp.reduce(self.log_weights[at])
            others = self.log_weights[~at] - total + np.log(2.0 * len(at))
            reach.append(float(sign * (-others / self._gaps[side][~at]).min()))
        return reach

    def _state(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, m) logarithms of T, and (n, m) a_i − μ, in units of the size of Δ."""
        finite = np.isfinite(s)
        at = np.where(finite, s, 0.0)
        leader = (self.knots[:, None] / self.size * at + self.log_weights[:, None]).argmax(axis=0)
        steps = (self.knots[:, None] - self.knots[leader]) / self.size
        e = steps * at + (self.log_weights[:, None] - self.log_weights[leader])
        for side, infinite in ((0, s == -np.inf), (1, s == np.inf)):
            if infinite.any():
                e[:, infinite] = np.where(self.ends[side], self.log_weights, -np.inf)[:, None]
        e -= e.max(axis=0)
        t = np.exp(np.maximum(e, UNDERFLOW_EXPONENT))
        total = t.sum(axis=0)
        for side, infinite in ((0, s == -np.inf), (1, s == np.inf)):
            if infinite.any():
                leader[infinite] = int(np.flatnonzero(self.ends[side])[0])
        steps = (self.knots[:, None] - self.knots[leader]) / self.size
        return e - np.log(total), steps - (steps * t).sum(axis=0) / total

    def _compared(self, pieces: Pieces, chords: Sequence[FloatArray], tolerance: float) -> tuple[BoolArray, BoolArray]:
        """(m,) which pieces are farther than the tolerance from their chords, and which are not known to hold."""
        origin, corner = (chord[pieces.row] for chord in chords)
        direction = corner - origin
        length = np.sqrt((direction**2).sum(axis=1))
        direction /= np.where(length > 0, length, 1.0)[:, None]
        relative = [self.points[:, k, None] - origin[:, k] for k in range(3)]
        along = sum(relative[k] * direction[:, k] for k in range(3))
        across = [relative[k] - along * direction[:, k] for k in range(3)]
        logs, centred = zip(*(self._state(s) for s in (pieces.start, pieces.end)), strict=True)
        shares = [np.exp(np.maximum(each, UNDERFLOW_EXPONENT)) for each in logs]
        x = [(t * along).sum(axis=0) for t in shares]
        y = [[(t * part).sum(axis=0) for part in across] for t in shares]
        apart = [np.sqrt(sum(part**2 for part in each)) for each in y]
        beyond = [np.maximum(np.maximum(-each, each - length), 0.0) for each in x]
        rounding = EPS * (
            8 * np.maximum(np.abs(origin).max(axis=1), np.abs(self.points).max())
            + (len(self.knots) + 16) * max(np.abs(part).max() for part in relative)
        )
        seen = np.maximum(*(np.hypot(apart[k], beyond[k]) for k in (0, 1)))
        # Relative to the middle of the piece's chord.
        along = along - (x[0] + x[1]) / 2
        off = np.sqrt(sum((part - (y[0][k] + y[1][k]) / 2) ** 2 for k, part in enumerate(across)))
        off_across, off_along = self._inside(pieces, logs, shares, centred, along, off)
        for side in (0, 1):
            tail = np.flatnonzero(np.isinf(pieces.start if side == 0 else pieces.end))
            if len(tail):
                base = [part[:, tail] for part in across]
                off_across[tail], off_along[tail] = self._tail(
                    side,
                    shares[1 - side][:, tail],
                    centred[1 - side][:, tail],
                    along[:, tail] - (x[side] - (x[0] + x[1]) / 2)[tail],
                    np.sqrt(sum((part - y[side][k][tail]) ** 2 for k, part in enumerate(base))),
                )
        known = np.hypot(off_across, off_along)
        bound = np.hypot(np.maximum(*apart) + off_across, np.maximum(*beyond) + off_along) + rounding
        holds = bound <= tolerance
        far = ~holds & ((seen > tolerance) | (known <= SPENT_SHARE * tolerance))
        return far, ~holds & ~far

    def _inside(
        self,
        pieces: Pieces,
        logs: tuple[FloatArray, ...],
        shares: list[FloatArray],
        centred: tuple[FloatArray, ...],
        along: FloatArray,
        off: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """How far a piece may be from its own chord, across and along the segment; infinite for tails."""
        width = pieces.end - pieces.start
        finite = np.isfinite(width)
        width = np.where(finite, width, 0.0)
        # Where tangents of log T_i from both ends meet; it increases up to a_i = μ.
        rise, fall = np.maximum(centred[0], 0.0), np.maximum(-centred[1], 0.0)
        both = (rise > 0) & (fall > 0)
        with np.errstate(invalid="ignore"):  # tails
            meet = (logs[1] - logs[0] + fall * width) / np.where(both, rise + fall, 1.0)
        peak = np.where(both, logs[0] + rise * np.clip(meet, 0.0, width), np.maximum(*logs))
        most = np.exp(np.clip(peak, UNDERFLOW_EXPONENT, 0.0))
        squares = np.maximum(centred[0] ** 2, centred[1] ** 2)
        variance = np.minimum((most * ((centred[0] + centred[1]) / 2) ** 2).sum(axis=0), 0.25)
        factor = most * np.maximum(squares, variance)
        across_bound = width**2 / 8 * (factor * off).sum(axis=0)
        second = (factor * np.abs(along)).sum(axis=0)
        along_bound = width**2 / 8 * second
        speeds = [(shares[k] * along * centred[k]).sum(axis=0) for k in (0, 1)]
        spread = np.maximum(np.abs(centred[0]), np.abs(centred[1]))
        noise = (len(self.knots) + 16) * EPS * (most * np.abs(along) * spread).sum(axis=0)
        steady = np.sign(speeds[0]) * np.sign(speeds[1]) > 0
        steady &= np.minimum(*np.abs(speeds)) > width / 2 * second + noise
        return (
            np.where(finite, across_bound, np.inf),
            np.where(steady, 0.0, np.where(finite, along_bound, np.inf)),
        )

    def _tail(
        self, side: int, shares: FloatArray, centred: FloatArray, along: FloatArray, off: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The same for a piece from an end of the curve to β: V, a_i − μ at β, and points relative to that end."""
        at, gaps = self.ends[side], self._gaps[side]
        least = gaps[gaps > 0].min()
        eta = np.maximum(gaps / least, 1.0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            most = np.where(eta > 1, (eta - 1) * np.exp(-eta / (eta - 1) * np.log(eta)), 0.0)
        most[at] = 0.0
        first = np.flatnonzero(gaps == least)
        room = -centred[first[0]] if side else centred[first[0]]  # from μ to the next knot
        base = shares[at].sum(axis=0)
        bounds = [(shares * most[:, None] * np.abs(part)).sum(axis=0) / base for part in (off, along)]
        ahead = shares * along
        later = (gaps > least)[:, None]
        speed = ahead[first].sum(axis=0)
        noise = (len(self.knots) + 16) * EPS * np.abs(ahead[~at]).sum(axis=0)
        steady = np.zeros(len(speed), dtype=bool)
        for sign in (1.0, -1.0):
            against = (np.where(later, np.maximum(-sign * ahead, 0.0), 0.0) * gaps[:, None]).sum(axis=0)
            steady |= sign * speed * room > against + noise
        valid = (room >= 0) & (base > 0)
        return (
            np.where(valid, bounds[0], np.inf),
            np.where(valid, np.where(steady, 0.0, bounds[1]), np.inf),
        )
