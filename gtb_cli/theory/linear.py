"""The linear parametrisation: a point p of Δ is put where μ(s) = p.

With the knots as control points it is the identity; on an edge of Δ it depends on that edge's knots, weights and
coefficients alone, so that patches which share an edge share its points. Each face has a moment map of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.theory.basis import Location, face_knots, is_corner
from gtb_cli.theory.domain import Domain
from gtb_cli.theory.moment import MomentMap

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
        """Locate (m, d) points of Δ.

        `faces`, rows of `Domain.faces`, says where they are known to lie, whatever rounding has made of them.

        Yields
        ------
        Location
            With s such that |μ(s) − p| ≤ `RESIDUAL`, or `within` if that is more, times the hull's size.

        Raises
        ------
        DomainError
            A point is not finite or outside Δ.
        ToleranceError
            The residual was not reached.
        """
        shape = self.shape
        heights = shape.heights_of_columns(p, 0, faces)
        r = len(shape.vertices)
        # Points inside are handled by nearest edge, numbered from −r; those near its last corner from −2r.
        group = shape.nearest_edge(heights) - r
        if shape.dimension == 2:
            following = (group + 1) % r
            gap = heights[following, np.arange(len(p))] / shape.normal_lengths[following]
            group[gap < LAST_CORNER * shape.size] -= r
        boundary = np.flatnonzero((heights == 0).any(axis=0))
        group[boundary] = shape.face_of(heights[:, boundary])
        for index in (np.flatnonzero(np.bincount(group + 2 * r)) - 2 * r).tolist():
            rows = np.flatnonzero(group == index)
            here = heights[:, rows]
            if is_corner(shape, index):
                yield Location(rows, index, face_knots(shape, index), np.zeros((0, len(rows))), here)
                continue
            moments = self._moments(index)
            if index > 0:
                points = shape.along(index - 1, p[rows])[:, None]
            elif shape.dimension == 1:
                points = p[rows] - shape.vertices[index]
            else:
                points = self._along_and_over(index, p[rows], here[index % r])
            yield Location(rows, max(index, 0), moments.knots, moments.inverse(points, within), here)

    @cached_property
    def _made(self) -> dict[int, MomentMap]:
        return {}

    def _moments(self, index: int) -> MomentMap:
        """The moment map of an edge (1 … r), or of Δ in coordinates of an edge (−2r … −1), or from an end (−2, −1)."""
        shape = self.shape
        if index not in self._made:
            if index > 0:
                knots, weights = face_knots(shape, index), self.log_weights[shape.faces[index]]
            elif shape.dimension == 1:
                knots, weights = shape.knots - shape.vertices[index], self.log_weights
            else:
                heights = shape.heights[:, index % len(shape.vertices)]
                knots, weights = self._along_and_over(index, shape.knots, heights), self.log_weights
            self._made[index] = MomentMap(knots, weights)
        return self._made[index]

    def _along_and_over(self, index: int, points: FloatArray, heights: FloatArray) -> FloatArray:
        """(m, 2) coordinates along edge index mod r and over it, from its first corner, or its last if index < −r."""
        shape = self.shape
        r = len(shape.vertices)
        edge = index % r
        corner = edge if index >= -r else (edge + 1) % r
        along = (points - shape.vertices[corner]) @ shape.direction(edge)
        return np.column_stack([along, heights / shape.normal_lengths[edge]])


def linear_locations(shape: Domain, log_weights: FloatArray, p: FloatArray) -> Iterator[Location]:
    """Locate (m, d) points once; see `LinearParametrization.locations`."""
    return LinearParametrization(shape, log_weights).locations(p)
