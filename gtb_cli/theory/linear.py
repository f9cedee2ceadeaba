"""The linear parametrisation: a parameter p in Δ stands for the torus coordinates s with μ(s) = p.

A patch whose control points are its knots is the identity. Only an edge's own knots, weights and coefficients count on
it, so that patches that share an edge share its points. Each face has its own moment map.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups, put_columns
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.basis import Location, face_knots
from gtb_cli.values import frozen

if TYPE_CHECKING:
    from gtb_cli.moment.lattices import VertexLattices


@frozen
class LinearParametrization:
    """The linear parametrisation of a patch, which locates p in Δ by solving μ(s) = p.

    Parameters
    ----------
    shape : Domain
    log_weights : (n,) or (w, n) float
        log(c_i ω_i), or several vectors of them.

    Notes
    -----
    Points on an edge depend only on that edge's knots and weights. Each point inside is solved in coordinates along and
    over its nearest edge: the knots on that edge have an exact 0 there, so that digits are kept up to the edge.
    """

    shape: Domain
    log_weights: FloatArray

    def locations(
        self,
        p: FloatArray,
        faces: IntArray | None = None,
        within: float = 0.0,
        resolution: int = 0,
        numbers: IntArray | None = None,
    ) -> Iterator[Location]:
        """Locate (m, d) points of Δ: find s with |μ(s) − p| at most `RESIDUAL`, or `within`, times the hull's size.

        Points may be the vertices of `triangulation` with a `resolution`: these are found sooner. Of several vectors of
        weights, `numbers` has each point's. See `gtb_cli.theory.parametrization.RationalBasis.locations`.
        """
        even = None if faces is None or numbers is not None else self._even(p, faces, resolution)
        if even is None or faces is None:
            yield from self._located(p, faces, within, numbers)
            return
        rest = [np.flatnonzero(faces != INTERIOR)]
        for location, left in map(even.located, even.blocks):
            yield location
            rest.append(left)
        rows = np.concatenate(rest)
        for location in self._located(p[rows], faces[rows], within, None):
            yield location._replace(rows=rows[location.rows])

    def _located(
        self, p: FloatArray, faces: IntArray | None, within: float, numbers: IntArray | None
    ) -> Iterator[Location]:
        shape = self.shape
        heights = shape.heights_of_columns(p, 0, faces)
        on_boundary = (heights == 0).any(axis=0)
        boundary, inside = np.flatnonzero(on_boundary), np.flatnonzero(~on_boundary)
        for number, members in groups(shape.faces.at(heights[:, boundary])):
            face, rows = shape.faces[number], boundary[members]
            s = np.zeros((0, len(rows)))
            if not face.is_corner:
                along = shape.along(face.index, p[rows])[:, None]
                s = self._edge(number).inverse(along, within, None, None if numbers is None else numbers[rows])
            yield Location(rows, face, face_knots(shape, face), s, heights[:, rows])

        for number, members in groups(self._nearest(heights[:, inside])):
            rows, system = inside[members], self._coordinates(number)
            here = heights.take(rows, axis=1)
            places, own = system.rows(p.take(rows, axis=0), here), None if numbers is None else numbers[rows]
            s = system.moments.inverse(places, within, None, own)
            yield Location(rows, shape.faces[INTERIOR], system.moments.knots, s, here)

    def _even(self, p: FloatArray, faces: IntArray, resolution: int) -> _Even | None:
        """Prepare to locate the inner vertices of `triangulation`, or return None where they are located like others.

        Values interpolated from a few of them are their starts, all in the coordinates of the longest edge.
        """
        if resolution < 48 or self.shape.dimension == 1:  # interpolation needs 12 nodes in a line
            return None
        from gtb_cli.moment.lattices import vertex_lattices  # a coarse mesh does not need it

        lattice, inner = vertex_lattices(self.shape, resolution), np.flatnonzero(faces == INTERIOR)
        if not lattice.is_worth_it or lattice.counts.sum() != len(inner):
            return None
        system = self.longest

        def solve(points: FloatArray, start: FloatArray | None) -> FloatArray:
            places = system.columns(points)
            return system.solved(places, start, 1e-10) - system.moments.starts(places)

        try:
            return _Even(p, faces, inner, lattice, lattice.lines(solve), system)
        except ToleranceError:
            return None

    @property
    def longest(self) -> _EdgeCoordinates:
        """Coordinates along and over the longest edge."""
        return self._coordinates(self._longest_number)

    @cached_property
    def _longest_number(self) -> int:
        sides = np.roll(self.shape.vertices, -1, axis=0) - self.shape.vertices
        return 2 * int(np.hypot(sides[:, 0], sides[:, 1]).argmax())

    def _nearest(self, heights: FloatArray) -> IntArray:
        """(m,) numbers of coordinates for points inside: twice that of the nearest edge, plus 1 near its last corner.

        Points far from all edges lose no digits in any of them, and are located together, in those of the longest edge.
        """
        shape, columns = self.shape, np.arange(heights.shape[1])
        edge = shape.nearest_edge(heights)
        if shape.dimension == 1:
            return 2 * edge
        following = (edge + 1) % len(shape.vertices)
        depth, gap = (heights[each, columns] / shape.normal_lengths[each] for each in (edge, following))
        near = np.asarray(2 * edge + (gap < 1e-6 * shape.size))
        return np.where(depth > shape.size / 64, self._longest_number, near)

    def _edge(self, number: int) -> MomentMap:
        """The moment map of an edge, by its number among the faces, in coordinates along it."""
        if number not in self._edges:
            face = self.shape.faces[number]
            self._edges[number] = MomentMap(face_knots(self.shape, face), self.log_weights[..., face.knots])
        return self._edges[number]

    def _coordinates(self, number: int) -> _EdgeCoordinates:
        """Coordinates by their number."""
        if number not in self._made:
            self._made[number] = _EdgeCoordinates(self.shape, self.log_weights, *divmod(number, 2))
        return self._made[number]

    @cached_property
    def _edges(self) -> dict[int, MomentMap]:
        return {}

    @cached_property
    def _made(self) -> dict[int, _EdgeCoordinates]:
        return {}


@frozen
class _Even:
    """The inner vertices of `triangulation` in blocks, each located from values on a coarse lattice in one system."""

    p: FloatArray
    faces: IntArray
    inner: IntArray
    lattice: VertexLattices
    lines: FloatArray
    system: _EdgeCoordinates

    @property
    def blocks(self) -> list[tuple[slice, slice]]:
        """Ranges of the lattice's rows, and of the inner vertices."""
        return self.lattice.blocks(block_length(len(self.system.shape.knots)))

    def located(self, block: tuple[slice, slice]) -> tuple[Location, IntArray]:
        """Locate a block, and say which rows of it are not found in this way."""
        rows, moments = self.inner[block[1]], self.system.moments
        span = slice(int(rows[0]), int(rows[-1]) + 1)
        places, corrections = self.system.columns(self.p[rows]), self.lattice.values(self.lines, block[0])
        s, left = moments.very_near(places, moments.starts(places) + corrections)
        if len(rows) < span.stop - span.start:  # vertices on edges lie between them
            s = s.take(np.cumsum(self.faces[span] == INTERIOR) - 1, axis=1)
        return Location(span, self.system.shape.faces[INTERIOR], moments.knots, s, None), rows[left]


@frozen
class _EdgeCoordinates:
    """Coordinates along and over an edge, from its first corner or its last; for a curve, from one of its ends."""

    shape: Domain
    log_weights: FloatArray
    edge: int
    last: int

    def rows(self, points: FloatArray, heights: FloatArray) -> FloatArray:
        """(m, d) coordinates of (m, d) points with (r, m) edge functions."""
        shape, edge = self.shape, self.edge
        steps = points - shape.vertices[(edge + self.last) % len(shape.vertices)]
        if shape.dimension == 1:
            return np.asarray(steps)
        return np.column_stack([steps @ shape.direction(edge), heights[edge] / shape.normal_lengths[edge]])

    def columns(self, points: FloatArray) -> FloatArray:
        """(2, m) coordinates of (m, 2) points, to rounding."""
        shape, edge = self.shape, self.edge
        axes = np.array([shape.direction(edge), shape.normals[edge] / shape.normal_lengths[edge]])
        corner = shape.vertices[(edge + self.last) % len(shape.vertices)]
        return np.asarray(axes @ np.subtract(points.T, corner[:, None], out=np.empty((2, len(points)))))

    def solved(self, places: FloatArray, start: FloatArray | None, within: float) -> FloatArray:
        """(2, m) torus coordinates of (2, m) coordinates, sooner found from approximate corrections, if there are any.

        Raises
        ------
        ToleranceError
            These say nothing, or |μ(s) − p| stays above `RESIDUAL` times the hull's size.
        """
        s, left = np.empty_like(places), np.arange(places.shape[1])
        if start is not None:
            s, left = self.moments.very_near(places, self.moments.starts(places) + start, within)
            if len(left) > len(places.T) / 2:  # as with x^λ for x = 1e30
                raise ToleranceError("interpolation says nothing")
        put_columns(s, left, self.moments.inverse(places.take(left, axis=1).T, within))
        return s

    @cached_property
    def moments(self) -> MomentMap:
        """The moment map of Δ in these coordinates."""
        return MomentMap(self.rows(self.shape.knots, self.shape.heights.T), self.log_weights)
