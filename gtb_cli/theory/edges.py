"""The curves along the edges of patches, from the knots, weights and control points on each edge alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, dot
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponentials
from gtb_cli.theory.corner_powers import summed
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

EdgeRef = tuple[int, int]  # (patch, edge): edge j of the hull of a patch's knots; for a curve, end j

# Edges are one curve if points (of the model's size), knots (of their gaps) and logarithms of weights differ by at most
# this: their data were typed or computed twice.
CURVE_TOLERANCE = 1e-9


def patch_name(patch: Patch, index: int) -> str:
    """Return the name of a patch of a model in messages: its own, or its place in the spec."""
    return patch.name or f"patches[{index}]"


def edge_name(patches: Sequence[Patch], ref: EdgeRef) -> str:
    """Return the name of an edge in messages, such as ``lid edge 2``."""
    index, edge = ref
    return f"{patch_name(patches[index], index)} edge {edge}"


@frozen
class Curve:
    """An edge's curve: (k,) knots on [0, 1], (k,) logarithms of weights that are 1 at both ends, (k, 3) points."""

    knots: FloatArray
    log_weights: FloatArray
    points: FloatArray

    @property
    def ends(self) -> FloatArray:
        """The first and the last control point, (2, 3)."""
        return self.points[[0, -1]]

    @property
    def size(self) -> float:
        """Largest extent along an axis, in model units."""
        return float(np.ptp(self.points, axis=0).max())

    def reversed(self) -> Curve:
        """Return the curve in the opposite direction."""
        return Curve(1 - self.knots[::-1], self.log_weights[::-1], self.points[::-1])

    def same_as(self, other: Curve, tolerance: float) -> bool:
        """Tell whether two curves have equal data: points within `tolerance`, knots within a part of their gaps."""
        count = len(self.knots)
        if count != len(other.knots) or np.abs(self.points - other.points).max() > tolerance:
            return False
        # Where knots crowd, so do features of the curve; where weights vary, a knot matters far out on the torus.
        regularity = np.diff(self.knots).min() * (count - 1) if count > 1 else 1.0
        regularity /= 1.0 + np.abs(self.log_weights).max()
        has_same_knots = np.abs(self.knots - other.knots).max() <= CURVE_TOLERANCE * regularity
        return bool(has_same_knots and np.abs(self.log_weights - other.log_weights).max() <= CURVE_TOLERANCE)

    def points_at(self, fractions: FloatArray) -> FloatArray:
        """Return points at fractions of the knots' hull, between its ends: (m,) → (m, 3)."""
        return self._at(fractions)[0]

    def points_between(self, fractions: FloatArray) -> FloatArray:
        """Return points at ascending fractions that begin and end with the ends of the hull: (m,) → (m, 3)."""
        return np.concatenate([self.ends[:1], self.points_at(fractions[1:-1]), self.ends[1:]])

    def nearest(
        self, points: FloatArray, start: FloatArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Find where the curve is nearest to (m, 3) points: at (m,) fractions between (m,) bounds, and points."""
        # By the Gauss-Newton method: each step narrows the bounds; where it leaves them, they are halved instead.
        roundings, most_steps = 16, 100  # of the largest coordinate, or of a fraction; halving alone needs 53 steps
        t, rounding = np.clip(start, EPS, 1 - EPS), roundings * EPS * float(np.abs(self.points).max())
        for _ in range(most_steps):
            place, rate = self._at(t)
            ahead, square = dot(points - place, rate), dot(rate, rate)
            step = ahead / np.maximum(square, np.finfo(float).tiny)
            going = (np.abs(step) > roundings * EPS) & (np.abs(step) * np.sqrt(square) > rounding)
            if not going.any():
                break
            low, high = np.where(ahead > 0, t, low), np.where(ahead < 0, t, high)
            goal = np.where((t + step > low) & (t + step < high), t + step, (low + high) / 2)
            t = np.where(going, np.clip(goal, EPS, 1 - EPS), t)
        return t, place

    def _at(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points at fractions t inside, and their derivatives by t: (m,) → (m, 3) each."""
        knots, middle = self.knots[:, None], self.points.mean(axis=0)
        shares = exponentials(knots, self.log_weights, self.moments.inverse(t[:, None]))
        shares /= shares.sum(axis=0)
        moments = shares * (knots - t)
        spread = np.maximum((moments * (knots - t)).sum(axis=0), np.finfo(float).tiny)
        points, slopes = (values.T @ (self.points - middle) for values in (shares, moments))
        return points + middle, slopes / spread[:, None]

    @cached_property
    def moments(self) -> MomentMap:
        """The map from torus coordinates to fractions."""
        return MomentMap(self.knots[:, None], self.log_weights)


def edge_curve(patch: Patch, edge: int) -> Curve:
    """Return the curve of an edge."""
    members, knots, first = patch.domain.edge_fractions[edge]
    weights, points = patch.log_products[members], patch.control_points[members]
    if len(first) < len(knots):  # copies of a knot act as one (Thm 4.1)
        copies = np.repeat(np.arange(len(first)), np.diff(first, append=len(knots)))
        tops, sums = summed(copies, weights, np.column_stack([np.ones(len(knots)), points]))
        knots, weights, points = knots[first], tops + np.log(sums[:, 0]), sums[:, 1:] / sums[:, :1]
    return Curve(knots, weights - (1 - knots) * weights[0] - knots * weights[-1], points)


def edge_curves(patches: Sequence[Patch], refs: Iterable[EdgeRef]) -> list[Curve]:
    """Return the curves of edges."""
    return [edge_curve(patches[index], edge) for index, edge in refs]


def edge_points_at(patch: Patch, edge: int, fractions: FloatArray) -> FloatArray:
    """Return points of a surface's edge at fractions of its knots' hull, from the edge's own data: (m,) → (m, 3)."""
    v, start, end = patch.domain.vertices, edge, (edge + 1) % len(patch.domain.vertices)
    faces = np.full(len(fractions), patch.domain.faces.edge(edge).number)
    faces[fractions == 0] = patch.domain.faces.corners[start]
    faces[fractions == 1] = patch.domain.faces.corners[end]
    p = v[start] + fractions[:, None] * (v[end] - v[start])
    return patch.points_at(patch.rational_basis.locations(p, "linear", faces), len(fractions))
