"""The linear parametrisation: a parameter p in Δ stands for the torus coordinates s with μ(s) = p.

A patch whose control points are its knots is the identity. Only an edge's own knots, weights and coefficients count on
it, so that patches that share an edge share its points. Each face has its own moment map.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, groups
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.grid import grid_of
from gtb_cli.knots.sheets import sheets
from gtb_cli.newton import put
from gtb_cli.theory.basis import Location, block_length, face_knots
from gtb_cli.theory.moment import MomentMap
from gtb_cli.theory.rectangle import is_rectangle, with_rasters
from gtb_cli.threads import in_threads

WORTH_THREADS = 20_000
"""Fewest points worth starting threads: fewer are found in less time than the start takes."""

COARSE = 1e-10
"""Residual sufficient for points that only serve as starts of others."""

HOPELESS = 0.5
"""Interpolation is given up if it fails for at least this share of the points, as with x^λ for x = 1e30."""

LAST_CORNER = 1e-6
"""Distance, as a fraction of the hull's size, within which a point has coordinates from its edge's last corner."""


PRODUCT_ULPS = 8
"""Units in the last place of log(c_i ω_i) within which weights count as products."""


@dataclass(frozen=True, eq=False)
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
        if resolution and faces is not None and self.shape.dimension == 2:
            rest = yield from self._even(p, faces, resolution)
            for location in self._locations(p[rest], faces[rest], within, 0):
                yield location._replace(rows=rest[location.rows])
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
        yield from in_threads(located, parts, worth=len(inside) > WORTH_THREADS)

    def _torus_coordinates(self, t: FloatArray, within: float) -> FloatArray:
        """(m,) torus coordinates of (m,) points inside an interval."""
        s = np.empty(len(t))
        for location in self._locations(t[:, None], None, within, 0):
            s[location.rows] = location.s[0]
        return s

    def _even(self, p: FloatArray, faces: IntArray, resolution: int) -> Generator[Location, None, IntArray]:
        """Locate the inner vertices of `triangulation`, and return the rows of all others and of those not found.

        Values interpolated from a few of them are their starts, all in the chart of the longest edge.
        """
        shape, inner, lattice = self.shape, np.flatnonzero(faces == INTERIOR), sheets(self.shape, resolution)
        if not lattice.is_worth_it or lattice.counts.sum() != len(inner):
            return np.arange(len(p))
        sides = np.roll(shape.vertices, -1, axis=0) - shape.vertices
        chart = self._chart(2 * int(np.hypot(sides[:, 0], sides[:, 1]).argmax()))
        moments = chart.moments

        def solve(points: FloatArray, start: FloatArray | None) -> FloatArray:
            places = chart.columns(points)
            s, left = np.empty_like(places), np.arange(len(points))
            if start is not None:
                s, left = moments.nearly(places, start)
                if len(left) > HOPELESS * len(points):
                    raise ToleranceError("interpolation says nothing")
            put(s, left, moments.inverse(places.take(left, axis=1).T, COARSE))
            return moments.corrections(places, s)

        def located(block: tuple[slice, slice]) -> tuple[Location, IntArray]:
            rows = inner[block[1]]
            span = slice(int(rows[0]), int(rows[-1]) + 1)
            places, corrections = chart.columns(p[span]), lattice.values(lines, block[0])
            if len(rows) == places.shape[1]:
                s, left = moments.nearly(places, corrections)
            else:  # vertices on edges lie between them
                s, left = moments.nearly(places.take(rows - span.start, axis=1), corrections)
                s = s.take(np.cumsum(faces[span] == INTERIOR) - 1, axis=1)
            return Location(span, shape.faces[INTERIOR], moments.knots, s, None), rows[left]

        try:
            lines = lattice.lines(solve)
        except ToleranceError:
            return np.arange(len(p))
        rest = [np.flatnonzero(faces)]
        for location, left in in_threads(located, lattice.blocks(block_length(len(shape.knots)))):
            yield location
            rest.append(left)
        return np.concatenate(rest)

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


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def axes(self) -> FloatArray:
        """(2, 2) unit vectors along and over the edge, in rows."""
        shape, edge = self.shape, self.edge
        return np.array([shape.direction(edge), shape.normals[edge] / shape.normal_lengths[edge]])

    @cached_property
    def moments(self) -> MomentMap:
        """The moment map of Δ in these coordinates."""
        return MomentMap(self.coordinates(self.shape.knots, self.shape.heights.T), self.log_weights)
