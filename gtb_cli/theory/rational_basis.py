"""The rational basis T_i of a patch, and its parametrisations.

The toric parametrisation, the paper's, has ``s(u) = Σ_j s_j ξ_j log h_j(u)``. The linear one has μ(s(u)) = u, so that a
patch whose control points are its knots is the identity. The image is the same.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from functools import cached_property
from typing import Protocol

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import CUT_OFF_SHARE, block_length, exponentials, weighted_sums
from gtb_cli.theory.basis import Location, torus_coordinates
from gtb_cli.values import frozen
from gtb_cli.vocabulary import Parametrization, check_word


@frozen
class RationalBasis:
    """The rational basis ``T_i = c_i ω_i β_i / Σ c ω β`` for a domain and (n,) log(c_i ω_i): eq. (202), eq. (205)."""

    domain: Domain
    log_weights: FloatArray

    def locations(
        self, u: FloatArray, parametrization: Parametrization = "toric", faces: IntArray | None = None
    ) -> Iterable[Location]:
        """Locate (m, d) parameters, for `values` and `blend`. Where their faces are known, rounding cannot change them.

        `DomainError` is raised if a parameter lies outside Δ or the parametrisation is unknown, `ToleranceError` if a
        linear one was not found to `RESIDUAL`.
        """
        check_word("parametrization", parametrization, ("toric", "linear"))
        return toric_locations(self.domain, u, faces) if parametrization == "toric" else self.linear.locations(u, faces)

    @cached_property
    def linear(self) -> LinearParametrization:
        """The linear parametrisation."""
        return LinearParametrization(self.domain, self.log_weights)

    def values(self, locations: Iterable[Location], count: int) -> FloatArray:
        """Return the values T_i at located parameters, (count, n), with exact zeros off the face of each location."""
        result = np.zeros((count, len(self.domain.knots)))
        for rows, face, knots, s in locations:
            e = exponentials(knots, self.log_weights[face.knots], s)
            e /= e.sum(axis=0)
            e[e <= CUT_OFF_SHARE] = 0.0
            values = np.zeros((e.shape[1], result.shape[1]))
            values[:, face.knots] = e.T
            result[rows] = values
        return result

    def blend(self, values: FloatArray, locations: Iterable[Location], count: int) -> FloatArray:
        """Return sums ``Σ_i T_i values_i`` of (n, k) values, such as control points: (count, k), without storing T.

        The sum at a corner with one knot is exactly the value of that knot.
        """
        result = np.empty((count, values.shape[1]))
        for rows, face, knots, s in tuple(locations):  # all are located first: data flow down once
            sums = weighted_sums(knots, self.log_weights[face.knots], values[face.knots], s)
            sums[1:] /= sums[0]
            result[rows] = sums[1:].T
        return result


class Blend(Protocol):
    """The part of a patch that its own fields use: control points under a rational basis."""

    @property
    def rational_basis(self) -> RationalBasis:
        """The functions T_i."""

    @property
    def control_points(self) -> FloatArray:
        """The control points b_i, (n, 3)."""


def toric_locations(domain: Domain, u: FloatArray, faces: IntArray | None = None) -> Iterator[Location]:
    """Locate (m, d) parameters in the toric parametrisation; see `RationalBasis.locations`."""
    length = block_length(len(domain.knots))
    centred = domain.knots - domain.center
    for start in range(0, len(u), length):
        known = None if faces is None else faces[start : start + length]
        heights = domain.heights_of_columns(u[start : start + length], start, known)
        boundary = domain.faces.on_boundary(heights)
        s = torus_coordinates(domain, np.where(heights == 0, 1.0, heights) if boundary else heights)
        if sum(len(rows) for _, rows in boundary) < heights.shape[1]:
            yield Location(slice(start, start + heights.shape[1]), domain.faces[INTERIOR], centred, s)
        for face, rows in boundary:
            along = np.zeros((0, len(rows))) if face.is_corner else domain.direction(face.index)[None] @ s[:, rows]
            yield Location(start + rows, face, domain.face_knots(face), along)


@frozen
class LinearParametrization:
    """The linear parametrisation for (n,) log(c_i ω_i), or (w, n) several vectors of them: p in Δ stands for μ⁻¹(p).

    Points on an edge depend only on that edge's knots and weights, so that patches that share an edge share its points.
    Each point inside is solved in coordinates along and over its nearest edge: the knots on that edge have an exact 0
    there, so that digits are kept up to the edge.
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

        Vertices of `triangulation` with a `resolution` are found sooner. Where there are several vectors of weights,
        `numbers` says which one each point uses. See `RationalBasis.locations`.
        """
        shape, left = self.shape, np.arange(len(p))
        if faces is not None and numbers is None:
            left = yield from self._even(p, faces, resolution)
            p, faces = p[left], faces[left]
        heights = shape.heights_of_columns(p, 0, faces)
        inside = np.flatnonzero((heights > 0).all(axis=0))
        for face, rows in shape.faces.on_boundary(heights):
            knots, s = shape.face_knots(face), np.zeros((0, len(rows)))
            if not face.is_corner:
                along, own = shape.along(face.index, p[rows])[:, None], None if numbers is None else numbers[rows]
                s = MomentMap(knots, self.log_weights[..., face.knots]).inverse(along, within, None, own)
            yield Location(left[rows], face, knots, s)

        for number, members in groups(self._nearest(heights[:, inside])):
            rows, system = inside[members], self._systems[number]
            own = None if numbers is None else numbers[rows]
            s = system.moments.inverse(system.rows(p.take(rows, axis=0), heights.take(rows, axis=1)), within, None, own)
            yield Location(left[rows], shape.faces[INTERIOR], system.moments.knots, s)

    def _even(self, p: FloatArray, faces: IntArray, resolution: int) -> Generator[Location, None, IntArray]:
        """Locate most inner vertices of `triangulation`, by starts interpolated from solutions at a few of them.

        Return the other rows: all where interpolation fails.
        """
        every = np.arange(len(p))
        if resolution < 48 or self.shape.dimension == 1:  # interpolation needs 12 nodes in a line
            return every
        from gtb_cli.moment.coarse_to_fine import vertex_lattices  # a coarse mesh does not need it

        lattice, inner = vertex_lattices(self.shape, resolution), np.flatnonzero(faces == INTERIOR)
        if not lattice.is_worth_it or lattice.counts.sum() != len(inner):
            return every
        system, moments = self.longest, self.longest.moments

        def solve(points: FloatArray, start: FloatArray | None) -> FloatArray:
            places = system.columns(points)
            base = moments.starts(places)
            s, left = np.empty_like(base), np.arange(len(points))
            if start is not None:
                s, left = moments.near(places, base + start, 1e-10)
                if len(left) > len(points) / 2:  # as with x^λ for x = 1e30
                    raise ToleranceError("interpolation says nothing")
            s[:, left] = moments.inverse(places[:, left].T, 1e-10)
            return s - base

        try:
            lines = lattice.lines(solve)
        except ToleranceError:
            return every
        rest = [np.flatnonzero(faces != INTERIOR)]
        for lattice_rows, block in lattice.blocks(block_length(len(self.shape.knots))):
            rows = inner[block]
            span = slice(int(rows[0]), int(rows[-1]) + 1)
            places = system.columns(p[rows])
            s, left = moments.near(places, moments.starts(places) + lattice.values(lines, lattice_rows))
            if len(rows) < span.stop - span.start:  # vertices on edges lie between them
                s = s.take(np.cumsum(faces[span] == INTERIOR) - 1, axis=1)
            yield Location(span, self.shape.faces[INTERIOR], moments.knots, s)
            rest.append(rows[left])
        return np.concatenate(rest)

    @cached_property
    def _systems(self) -> tuple[EdgeCoordinates, ...]:
        """Coordinates at each edge: number 2 j from the first corner of edge j, 2 j + 1 from its last."""
        numbers = range(2 * len(self.shape.vertices))
        return tuple(EdgeCoordinates(self.shape, self.log_weights, *divmod(number, 2)) for number in numbers)

    @cached_property
    def longest(self) -> EdgeCoordinates:
        """Coordinates along and over the longest edge."""
        sides = np.roll(self.shape.vertices, -1, axis=0) - self.shape.vertices
        return self._systems[2 * int(np.hypot(sides[:, 0], sides[:, 1]).argmax())]

    def _nearest(self, heights: FloatArray) -> IntArray:
        """Choose coordinates for points inside, by number, (m,): of the nearest edge or, far from all, the longest."""
        shape, columns = self.shape, np.arange(heights.shape[1])
        edge = shape.nearest_edge(heights)
        if shape.dimension == 1:
            return 2 * edge
        following = (edge + 1) % len(shape.vertices)
        depth, gap = (heights[each, columns] / shape.normal_lengths[each] for each in (edge, following))
        near = np.asarray(2 * edge + (gap < 1e-6 * shape.size))
        return np.where(depth > shape.size / 64, 2 * self.longest.edge, near)


@frozen
class EdgeCoordinates:
    """Coordinates along and over an edge, from its first corner or its last; for a curve, from one of its ends."""

    shape: Domain
    log_weights: FloatArray
    edge: int
    last: int

    @property
    def _corner(self) -> FloatArray:
        return np.asarray(self.shape.vertices[(self.edge + self.last) % len(self.shape.vertices)])

    def rows(self, points: FloatArray, heights: FloatArray) -> FloatArray:
        """Return the coordinates of (m, d) points with (r, m) edge functions: (m, d)."""
        shape, edge = self.shape, self.edge
        steps = points - self._corner
        if shape.dimension == 1:
            return np.asarray(steps)
        return np.column_stack([steps @ shape.direction(edge), heights[edge] / shape.normal_lengths[edge]])

    def columns(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points, to rounding: (m, 2) → (2, m)."""
        shape, edge = self.shape, self.edge
        axes = np.array([shape.direction(edge), shape.normals[edge] / shape.normal_lengths[edge]])
        return np.asarray(axes @ (points.T - self._corner[:, None]))

    @cached_property
    def moments(self) -> MomentMap:
        """The moment map of Δ in these coordinates."""
        return MomentMap(self.rows(self.shape.knots, self.shape.heights.T), self.log_weights)
