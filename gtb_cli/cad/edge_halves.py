"""Edges that fitted surfaces share with others: halves of exact curves, or of equal parameters."""

import math
from collections.abc import Callable, Collection
from functools import partial
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.bezier.pieces import bezier_pieces
from gtb_cli.cad.exact_surfaces import homogeneous_points
from gtb_cli.errors import DomainError
from gtb_cli.models.joints import Joint
from gtb_cli.models.model import Model, joints_of
from gtb_cli.theory.edges import EdgeRef
from gtb_cli.theory.patch import Patch


class HalfEdge(NamedTuple):
    """Half of an edge, as an adjacent fitted surface takes it over.

    Its (D + 1, 4) control points and weights, which are 1 at both ends, start at a corner; the fractions are their
    places along the whole edge. If it is not exact, only these places are taken over. `own` turns these fractions into
    those of the fitted surface's edge, from the same corner.
    """

    rows: FloatArray
    fractions: FloatArray
    is_exact: bool = True
    own: Callable[[FloatArray], FloatArray] | None = None

    def at(self, t: FloatArray) -> tuple[FloatArray | None, FloatArray, FloatArray]:
        """Return (k, 3) points at (k,) parameters in [0, 1], their weights, and places as fractions of this half."""
        degree, k = len(self.rows) - 1, np.arange(len(self.rows))
        shares = np.array([math.comb(degree, j) for j in k]) * t[:, None] ** k * (1 - t[:, None]) ** (degree - k)
        shares = shares * self.rows[:, 3]
        weights = shares.sum(axis=1)
        points = shares @ self.rows[:, :3] / weights[:, None] if self.is_exact else None
        if self.own is None:
            return points, weights, shares @ self.fractions / (weights * self.end)
        return points, weights, self.own(shares @ self.fractions / weights) / self.end

    @property
    def end(self) -> float:
        """The end of this half, as a fraction of the edge."""
        return float(self.fractions[-1] if self.own is None else self.own(self.fractions[-1:])[0])


def half_edges(spec: Patch | Model, fitted: Collection[int]) -> dict[EdgeRef, list[HalfEdge]]:
    """Return the halves of edges of fitted patches, from the start and from the end of each edge.

    They are exact where one of the patches at the edge, best an exact one, has it as Bézier curves; they are those of
    equal fractions where fitted patches have it at different parameters.
    """
    even = HalfEdge(np.array([[0.0, 0.0, 0.0, 1.0]] * 2), np.array([0.0, 0.5]), False)
    joints = joints_of(spec)
    refs = [(index, k) for index, patch in enumerate(spec.patches) for k in range(len(patch.domain.vertices))]
    groups = {ref: [Joint(ref, ref, False)] for ref in refs}
    for joint in joints.shared:
        del groups[joint.second]
        groups[joint.first].append(joint)
    found: dict[EdgeRef, list[HalfEdge]] = {}
    for uses in (uses for ref, uses in groups.items() if ref not in joints.collapsed):
        theirs = [use for use in uses if use.second[0] in fitted]
        if not theirs:
            continue
        source = next((use for use in uses if use.second[0] not in fitted), theirs[0])
        try:
            halves = _halves(spec.patches[source.second[0]], source.second[1])
            found |= {use.second: _carried(halves, spec, source, use) for use in theirs}
        except DomainError:
            found |= {use.second: _carried([even] * 2, spec, uses[0], use) for use in theirs if use.match}
    return found


def _carried(halves: list[HalfEdge], spec: Patch | Model, one: Joint, other: Joint) -> list[HalfEdge]:
    """Return the halves of an edge for another one, both joined with the same first edge."""
    turned = one.opposite != other.opposite
    if one.match or other.match:

        def own(fractions: FloatArray, is_last: int) -> FloatArray:
            found = other.across(spec.patches, one.back(spec.patches, 1 - fractions if is_last else fractions))
            return 1 - found if is_last != turned else found

        halves = [half._replace(own=partial(own, is_last=k)) for k, half in enumerate(halves)]
    return halves[::-1] if turned else halves


def _halves(patch: Patch, edge: int) -> list[HalfEdge]:
    """Return the exact halves of an edge, each starting at its own end of the edge."""
    curve = patch.boundary(edge)
    places = np.zeros((len(curve.knots), 3))
    places[:, 0] = curve.knots[:, 0] / curve.knots[:, 0].max()
    halves = []
    pairs = zip(bezier_pieces(curve), bezier_pieces(curve.replace(control_points=places)), strict=True)
    for side, (half, placed) in enumerate(pairs):
        way = slice(None, None, -1) if side else slice(None)
        rows, fractions = homogeneous_points(half)[way], placed.control_points[way, 0]
        powers = np.log(rows[:, 3])
        rows[:, 3] = np.exp(powers - powers[0] + (powers[0] - powers[-1]) * np.arange(len(rows)) / (len(rows) - 1))
        halves.append(HalfEdge(rows, 1 - fractions if side else fractions))
    return halves
