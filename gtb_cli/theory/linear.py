"""The linear parametrisation: a point p of Δ is put where μ(s) = p.

With the knots as control points it is the identity; on an edge of Δ it depends on that edge's knots, weights and
coefficients alone, so that patches which share an edge share its points. Each face has a moment map of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.theory.basis import Location, face_knots
from gtb_cli.theory.moment import MomentMap
from gtb_cli.threads import in_threads

WORTH_THREADS = 20_000
"""Points for which threads are started: fewer are found in less time than it takes."""

LAST_CORNER = 1e-6
"""How near the last corner of its edge, as a fraction of the hull's size, coordinates of a point start from there."""


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
        """Locate (m, d) points of Δ: s such that |μ(s) − p| ≤ `RESIDUAL`, or `within`, times the hull's size.

        See `gtb_cli.theory.parametrization.RationalBasis.locations`.
        """
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

        def located(part: tuple[IntArray, tuple[_Chart, MomentMap]]) -> Location:
            rows, (chart, moments) = part
            here = heights[:, rows]
            s = moments.inverse(chart.coordinates(p[rows], here), within)
            return Location(rows, shape.faces[INTERIOR], moments.knots, s, here)

        # Each chart has its own moment map, which learns from its own points only.
        parts = [(inside[members], self._inner(number)) for number, members in groups(self._charts(heights[:, inside]))]
        yield from in_threads(located, parts, worth=len(inside) > WORTH_THREADS)

    def _charts(self, heights: FloatArray) -> IntArray:
        """(m,) numbers of charts for points inside: twice the nearest edge, and 1 more near its last corner."""
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

    def _inner(self, number: int) -> tuple[_Chart, MomentMap]:
        """A chart, and the moment map of Δ in its coordinates."""
        if number not in self._inners:
            chart, shape = _Chart(self.shape, *divmod(number, 2)), self.shape
            moments = MomentMap(chart.coordinates(shape.knots, shape.heights.T), self.log_weights)
            self._inners[number] = chart, moments
        return self._inners[number]

    @cached_property
    def _edges(self) -> dict[int, MomentMap]:
        return {}

    @cached_property
    def _inners(self) -> dict[int, tuple[_Chart, MomentMap]]:
        return {}


@dataclass(frozen=True, eq=False)
class _Chart:
    """Coordinates along an edge and over it, from its first corner or its last; of a curve, from one of its ends."""

    shape: Domain
    edge: int
    last: int

    def coordinates(self, points: FloatArray, heights: FloatArray) -> FloatArray:
        """(m, d) coordinates of (m, d) points with given (r, m) edge functions."""
        shape, edge = self.shape, self.edge
        steps = points - shape.vertices[(edge + self.last) % len(shape.vertices)]
        if shape.dimension == 1:
            return np.asarray(steps)
        return np.column_stack([steps @ shape.direction(edge), heights[edge] / shape.normal_lengths[edge]])
