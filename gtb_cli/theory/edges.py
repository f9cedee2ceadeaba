"""Curves of the edges of patches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.theory.parametrization import RationalBasis
from gtb_cli.theory.patch import Patch

EdgeRef = tuple[int, int]
"""(patch, edge): edge j of the hull of a patch's knots; for a curve, end j."""

CURVE_TOLERANCE = 1e-9
"""Largest difference between edges that carry the same curve: of points, relative to the model's size; of knots,
relative to the edge's length; and of logarithms of weights. It allows for data typed or computed twice, and is far
below anything visible."""


def edge_name(patches: Sequence[Patch], ref: EdgeRef) -> str:
    """Return the name of an edge in messages, such as ``lid edge 2``."""
    index, edge = ref
    return f"{patches[index].name or f'patches[{index}]'} edge {edge}"


@dataclass(frozen=True, eq=False)
class Curve:
    """The data that determine an edge's curve: knots on [0, 1], normalised log weights, points."""

    knots: FloatArray
    log_weights: FloatArray
    points: FloatArray

    @property
    def ends(self) -> FloatArray:
        """(2, 3) points."""
        return self.points[[0, -1]]

    @property
    def size(self) -> float:
        """Largest extent along an axis, in model units."""
        return float(np.ptp(self.points, axis=0).max())

    def reversed(self) -> Curve:
        """The same curve in the opposite direction."""
        return Curve(1 - self.knots[::-1], self.log_weights[::-1], self.points[::-1])

    def same_as(self, other: Curve, tolerance: float) -> bool:
        """Whether the data are the same, with points within a distance."""
        return (
            len(self.knots) == len(other.knots)
            and bool(np.abs(self.points - other.points).max() <= tolerance)
            and bool(np.abs(self.knots - other.knots).max() <= CURVE_TOLERANCE)
            and bool(np.abs(self.log_weights - other.log_weights).max() <= CURVE_TOLERANCE)
        )


def edge_curve(patch: Patch, edge: int) -> Curve:
    """Return the data that determine the curve of an edge."""
    return _EdgeBasis.of(patch.rational_basis, edge).curve(patch)


def edge_curves(patches: Sequence[Patch], refs: Iterable[EdgeRef]) -> list[Curve]:
    """Return the curves of edges; patches with the same basis share all but the points."""
    bases: dict[tuple[RationalBasis, int], _EdgeBasis] = {}
    curves = []
    for index, edge in refs:
        key = (patches[index].rational_basis, edge)
        if key not in bases:
            bases[key] = _EdgeBasis.of(*key)
        curves.append(bases[key].curve(patches[index]))
    return curves


@dataclass(frozen=True, eq=False)
class _EdgeBasis:
    """Knots and log weights of an edge's curve, and the control points with their shares in the curve's points."""

    knots: FloatArray
    log_weights: FloatArray
    members: IntArray
    first: IntArray
    shares: FloatArray | None

    @staticmethod
    def of(basis: RationalBasis, edge: int) -> _EdgeBasis:
        shape = basis.domain
        members = shape.edge_knots(edge)
        weights = basis.log_weights[members]
        knots = np.zeros(len(members))
        if shape.dimension == 2:
            knots = shape.along(edge, shape.knots[members])
            knots = knots / knots[-1]
        # Copies of a knot act as one (Thm 4.1).
        first, shares = np.flatnonzero(np.diff(knots, prepend=-1.0) > CURVE_TOLERANCE), None
        if len(first) < len(knots):
            copies = np.repeat(np.arange(len(first)), np.diff(first, append=len(knots)))
            shares = np.exp(weights - np.maximum.reduceat(weights, first)[copies])
            total = np.add.reduceat(shares, first)
            shares, weights = shares / total[copies], np.maximum.reduceat(weights, first) + np.log(total)
            knots = knots[first]
        return _EdgeBasis(knots, weights - (1 - knots) * weights[0] - knots * weights[-1], members, first, shares)

    def curve(self, patch: Patch) -> Curve:
        """The curve of a patch with this basis."""
        points = patch.control_points[self.members]
        if self.shares is not None:
            points = np.add.reduceat(self.shares[:, None] * points, self.first)
        return Curve(self.knots, self.log_weights, points)


def edge_points(patch: Patch, edge: int, count: int) -> FloatArray:
    """(count, 3) points of a surface's edge at equal fractions of its knots' hull, from the edge's own data."""
    return edge_points_at(patch, edge, np.linspace(0.0, 1.0, count))


def edge_points_at(patch: Patch, edge: int, fractions: FloatArray) -> FloatArray:
    """(m, 3) points of a surface's edge at (m,) fractions of its knots' hull, from the edge's own data."""
    v, start, end = patch.domain.vertices, edge, (edge + 1) % len(patch.domain.vertices)
    faces = np.full(len(fractions), patch.domain.faces.edge(edge).number)
    faces[fractions == 0] = patch.domain.faces.corners[start]
    faces[fractions == 1] = patch.domain.faces.corners[end]
    p = v[start] + fractions[:, None] * (v[end] - v[start])
    return patch.points_at(patch.rational_basis.locations(p, "linear", faces), len(fractions))
