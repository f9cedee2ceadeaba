"""The linear parametrisation: a parameter p in Δ stands for the torus coordinates s with μ(s) = p.

A patch whose control points are its knots is the identity. Only an edge's own knots, weights and coefficients count on
it, so that patches that share an edge share its points. Each face has its own moment map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, groups
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.knots.face import INTERIOR, Face
from gtb_cli.moment.grid import grid_of
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.newton import put
from gtb_cli.moment.torus import block_length
from gtb_cli.process.forks import in_forks, shared_array
from gtb_cli.process.threads import in_threads
from gtb_cli.theory.basis import Location, face_knots
from gtb_cli.theory.rectangle import is_rectangle, with_rasters
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from gtb_cli.moment.sheets import Sheets

MIN_THREADED_POINTS = 20_000
"""Fewest points worth starting threads: fewer are found in less time than the start takes."""

MIN_EVEN_CELLS = 48
"""Fewest cells along an edge whose vertices are found from a coarser lattice."""

START_RESIDUAL = 1e-10
"""Residual sufficient for points that only serve as starts of others."""

MAX_FAILED_SHARE = 0.5
"""Interpolation is given up if it fails for at least this share of the points, as with x^λ for x = 1e30."""

LAST_CORNER = 1e-6
"""Distance, as a fraction of the hull's size, within which a point has coordinates from its edge's last corner."""

PRODUCT_ULPS = 8
"""Units in the last place of log(c_i ω_i) within which weights count as products."""


@frozen
class LinearParametrization:
    """The linear parametrisation of a patch, which locates p in Δ by solving μ(s) = p.

    Parameters
    ----------
    shape : Domain
    log_weights : (n,) float
        log(c_i ω_i).

    Notes
    -----
    Points on an edge depend only on that edge's knots and weights. Each point inside is solved in coordinates along and
    over its nearest edge: the knots on that edge have an exact 0 there, so that digits are kept up to the edge.
    """

    shape: Domain
    log_weights: FloatArray

    def locations(
        self, p: FloatArray, faces: IntArray | None = None, within: float = 0.0, resolution: int = 0
    ) -> Iterator[Location]:
        """Locate (m, d) points of Δ: find s with |μ(s) − p| at most `RESIDUAL`, or `within`, times the hull's size.

        See `gtb_cli.theory.parametrization.RationalBasis.locations`.
        """
        factors = self._factors
        if not factors:
            yield from self._locations(p, faces, within, resolution)
            return

        def line(axis: int, coordinates: FloatArray) -> FloatArray:
            return factors[axis]._torus_coordinates(coordinates, within)

        yield from with_rasters(self.shape, p, faces, line, lambda p, faces: self._locations(p, faces, within, 0))

    def _locations(self, p: FloatArray, faces: IntArray | None, within: float, resolution: int) -> Iterator[Location]:
        even = self._lattice(p, faces, resolution) if resolution and faces is not None else None
        if even is not None and faces is not None:
            rest = [even.others]
            for location, left in in_threads(even.located, even.blocks):
                yield location
                rest.append(left)
            rows = np.concatenate(rest)
            for location in self._locations(p[rows], faces[rows], within, 0):
                yield location._replace(rows=rows[location.rows])
            return
        shape = self.shape
        heights = shape.heights_of_columns(p, 0, faces)
        on_boundary = (heights == 0).any(axis=0)
        boundary, inside = np.flatnonzero(on_boundary), np.flatnonzero(~on_boundary)
        for number, members in groups(shape.faces.at(heights[:, boundary])):
            face, rows = shape.faces[number], boundary[members]
            s = np.zeros((0, len(rows)))
            if not face.is_corner:
                s = self._edge(number).inverse(shape.along(face.index, p[rows])[:, None], within)
            yield Location(rows, face, face_knots(shape, face), s, heights[:, rows])

        def located(part: tuple[IntArray, _Chart]) -> Location:
            rows, chart = part
            here = heights.take(rows, axis=1)
            s = chart.moments.inverse(chart.coordinates(p.take(rows, axis=0), here), within)
            return Location(rows, shape.faces[INTERIOR], chart.moments.knots, s, here)

        # Each chart has its own moment map, which learns only from its own points.
        parts = [(inside[members], self._chart(number)) for number, members in groups(self._charts(heights[:, inside]))]
        yield from in_threads(located, parts, worth=len(inside) > MIN_THREADED_POINTS)

    def _torus_coordinates(self, t: FloatArray, within: float) -> FloatArray:
        """(m,) torus coordinates of (m,) points inside an interval."""
        s = np.empty(len(t))
        for location in self._locations(t[:, None], None, within, 0):
            s[location.rows] = location.s[0]
        return s

    def evenly(
        self,
        function: Callable[[Iterable[Location], int], FloatArray],
        p: FloatArray,
        faces: IntArray,
        resolution: int,
    ) -> FloatArray:
        """(m, 3) what a function of locations and their number makes of the vertices of `triangulation`.

        They lie on given faces of Δ. Most are located, and the function is called, in copies of this process where that
        is faster.
        """
        even = self._even(function, p, faces, resolution)
        if even is None:
            return function(self.locations(p, faces, 0.0, resolution), len(p))
        result, left = even
        result[left] = function(self.locations(p[left], faces[left]), len(left))
        return result

    def _even(
        self,
        function: Callable[[Iterable[Location], int], FloatArray],
        p: FloatArray,
        faces: IntArray,
        resolution: int,
    ) -> tuple[FloatArray, IntArray] | None:
        """`evenly`, and the rows that are left to do; None if these would be all."""
        if self._factors or self.shape.dimension == 1:
            return None
        from gtb_cli.moment.parallelogram import fill  # a coarse mesh does not need it

        chart, face, length = self.longest, self.shape.faces[INTERIOR], block_length(len(self.shape.knots))

        def values(points: FloatArray, start: FloatArray | None) -> FloatArray:
            places = chart.columns(points)
            s = chart.solved(places, None if start is None else start.T, 0.0)
            blocks = [slice(begin, begin + length) for begin in range(0, len(points), length)]
            located = (Location(rows, face, chart.moments.knots, s[:, rows], None) for rows in blocks)
            return np.column_stack([chart.moments.corrections(places, s).T, function(located, len(points))])

        result = np.empty((len(p), 3))
        with suppress(ToleranceError):
            left = fill(result, values, self.shape, p, np.flatnonzero(faces == INTERIOR), resolution)
            if left is not None:
                return result, np.concatenate([np.flatnonzero(faces != INTERIOR), left])
        even = self._lattice(p, faces, resolution)
        if even is None:
            return None
        result = shared_array(result.shape)

        def made(block: tuple[slice, slice]) -> bytes:
            location, left = even.located(block)
            rows = result[even.span(block)]
            rows[...] = function([location._replace(rows=slice(None))], len(rows))
            return left.tobytes()

        rest = [np.frombuffer(rows, dtype=np.int64) for rows in in_forks(made, even.blocks)]
        return result, np.concatenate([even.others, *rest])

    def _lattice(self, p: FloatArray, faces: IntArray, resolution: int) -> _Even | None:
        """Prepare to locate the inner vertices of `triangulation`, or return None where they are located like others.

        Values interpolated from a few of them are their starts, all in the chart of the longest edge.
        """
        if self.shape.dimension == 1 or resolution < MIN_EVEN_CELLS:
            return None
        from gtb_cli.moment.sheets import sheets  # a coarse mesh does not need it

        lattice, inner = sheets(self.shape, resolution), np.flatnonzero(faces == INTERIOR)
        if not lattice.is_worth_it or lattice.counts.sum() != len(inner):
            return None
        chart = self.longest

        def solve(points: FloatArray, start: FloatArray | None) -> FloatArray:
            places = chart.columns(points)
            return chart.moments.corrections(places, chart.solved(places, start, START_RESIDUAL))

        try:
            return _Even(p, faces, inner, lattice, lattice.lines(solve), chart, self.shape.faces[INTERIOR])
        except ToleranceError:
            return None

    @cached_property
    def longest(self) -> _Chart:
        """The chart of the longest edge."""
        sides = np.roll(self.shape.vertices, -1, axis=0) - self.shape.vertices
        return self._chart(2 * int(np.hypot(sides[:, 0], sides[:, 1]).argmax()))

    def _charts(self, heights: FloatArray) -> IntArray:
        """(m,) numbers of charts for points inside: twice that of the nearest edge, plus 1 near its last corner."""
        shape = self.shape
        edge = shape.nearest_edge(heights)
        if shape.dimension == 1:
            return 2 * edge
        following = (edge + 1) % len(shape.vertices)
        gap = heights[following, np.arange(len(edge))] / shape.normal_lengths[following]
        return np.asarray(2 * edge + (gap < LAST_CORNER * shape.size))

    def _edge(self, number: int) -> MomentMap:
        """The moment map of an edge, by its number among the faces, in coordinates along it."""
        if number not in self._edges:
            face = self.shape.faces[number]
            self._edges[number] = MomentMap(face_knots(self.shape, face), self.log_weights[face.knots])
        return self._edges[number]

    def _chart(self, number: int) -> _Chart:
        """A chart by its number; it keeps what it learns."""
        if number not in self._made:
            self._made[number] = _Chart(self.shape, self.log_weights, *divmod(number, 2))
        return self._made[number]

    @cached_property
    def _factors(self) -> tuple[LinearParametrization, ...]:
        """The parametrisations of two sides of a rectangle if the weights are products of theirs; otherwise none."""
        grid = grid_of(self.shape.knots) if is_rectangle(self.shape) else None
        if grid is None:
            return ()
        table = self.log_weights[grid.order].reshape(len(grid.steps[1]), len(grid.steps[0]))
        sides = table[0], table[:, 0]
        if np.abs(sides[1][:, None] + sides[0] - table[0, 0] - table).max() > PRODUCT_ULPS * EPS * (
            1 + np.abs(table).max()
        ):
            return ()
        knots = self.shape.knots[grid.order].reshape(*table.shape, 2)
        columns = knots[0, :, 0], knots[:, 0, 1]
        return tuple(LinearParametrization(domain(x), w) for x, w in zip(columns, sides, strict=True))

    @cached_property
    def _edges(self) -> dict[int, MomentMap]:
        return {}

    @cached_property
    def _made(self) -> dict[int, _Chart]:
        return {}


@frozen
class _Even:
    """The inner vertices of `triangulation` in blocks, each located from values on a coarse lattice in one chart."""

    p: FloatArray
    faces: IntArray
    inner: IntArray
    lattice: Sheets
    lines: FloatArray
    chart: _Chart
    face: Face

    @cached_property
    def blocks(self) -> list[tuple[slice, slice]]:
        """Ranges of the lattice's rows, and of the inner vertices."""
        return self.lattice.blocks(block_length(len(self.chart.shape.knots)))

    @property
    def others(self) -> IntArray:
        """The rows of vertices that are not inside."""
        return np.flatnonzero(self.faces)

    def span(self, block: tuple[slice, slice]) -> slice:
        """The rows from the first to the last vertex of a block, and those on edges between them."""
        return slice(int(self.inner[block[1].start]), int(self.inner[block[1].stop - 1]) + 1)

    def located(self, block: tuple[slice, slice]) -> tuple[Location, IntArray]:
        """Locate a block, and say which rows of it are not found in this way."""
        rows, span, moments = self.inner[block[1]], self.span(block), self.chart.moments
        places, corrections = self.chart.columns(self.p[span]), self.lattice.values(self.lines, block[0])
        if len(rows) == places.shape[1]:
            s, left = moments.nearly(places, corrections)
        else:  # vertices on edges lie between them
            s, left = moments.nearly(places.take(rows - span.start, axis=1), corrections)
            s = s.take(np.cumsum(self.faces[span] == INTERIOR) - 1, axis=1)
        return Location(span, self.face, moments.knots, s, None), rows[left]


@frozen
class _Chart:
    """Coordinates along and over an edge, from its first corner or its last; for a curve, from one of its ends."""

    shape: Domain
    log_weights: FloatArray
    edge: int
    last: int

    def coordinates(self, points: FloatArray, heights: FloatArray) -> FloatArray:
        """(m, d) coordinates of (m, d) points with (r, m) edge functions."""
        shape, edge = self.shape, self.edge
        steps = points - shape.vertices[(edge + self.last) % len(shape.vertices)]
        if shape.dimension == 1:
            return np.asarray(steps)
        return np.column_stack([steps @ shape.direction(edge), heights[edge] / shape.normal_lengths[edge]])

    def columns(self, points: FloatArray) -> FloatArray:
        """(2, m) coordinates of (m, 2) points, to rounding."""
        corner = self.shape.vertices[(self.edge + self.last) % len(self.shape.vertices)]
        steps = np.empty((2, len(points)))
        return np.asarray(self.axes @ np.subtract(points.T, corner[:, None], out=steps))

    def solved(self, places: FloatArray, start: FloatArray | None, within: float) -> FloatArray:
        """(2, m) torus coordinates of (2, m) coordinates, sooner found from approximate corrections, if there are any.

        Raises
        ------
        ToleranceError
            These say nothing, or |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        s, left = np.empty_like(places), np.arange(places.shape[1])
        if start is not None:
            s, left = self.moments.nearly(places, start, within)
            if len(left) > MAX_FAILED_SHARE * len(places.T):
                raise ToleranceError("interpolation says nothing")
        put(s, left, self.moments.inverse(places.take(left, axis=1).T, within))
        return s

    @cached_property
    def axes(self) -> FloatArray:
        """(2, 2) unit vectors along and over the edge, in rows."""
        shape, edge = self.shape, self.edge
        return np.array([shape.direction(edge), shape.normals[edge] / shape.normal_lengths[edge]])

    @cached_property
    def moments(self) -> MomentMap:
        """The moment map of Δ in these coordinates."""
        return MomentMap(self.coordinates(self.shape.knots, self.shape.heights.T), self.log_weights)
