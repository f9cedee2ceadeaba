"""Bounds of the rational basis over triangles of torus coordinates, and triangles whose images cover those of Δ.

In torus coordinates T_i is exp<a_i, s> up to a common factor, a convex function: over a triangle it lies below the
affine function with the same values at the corners, and above its tangent plane. Towards an edge of Δ the coordinate ρ
across it tends to −∞; there z = exp(δ ρ) replaces ρ, and the edge itself is z = 0.
"""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, rows_of
from gtb_cli.moment.torus import UNDERFLOW_EXPONENT
from gtb_cli.theory.parametrization import LinearParametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

MAX_EXPONENT = 600.0  # exponents are cut off here: so large a bound is of no use, and its triangle will be cut


class Bounds(NamedTuple):
    """Bounds of T_i over triangles or segments, up to a common factor, as (c, n, m) Bernstein coefficients.

    Affine bounds have a coefficient for each corner, quadratic ones (along edges of Δ) also one for each pair of
    corners. The (m,) `exponent` is the largest that occurs: T_i may be off by as many roundings.
    """

    upper: FloatArray
    lower: FloatArray
    exponent: FloatArray


class TorusTriangles(NamedTuple):
    """Triangles with (m, 3, 2) corners in the coordinates of `TorusCoordinates`.

    The (m, 2) `origin` has the torus coordinates at 0 (across an edge, at z = 1); the (m,) `layer` is δ.
    """

    corners: FloatArray
    origin: FloatArray
    layer: FloatArray


@frozen
class TorusCoordinates:
    """Torus coordinates for the inside of Δ, or along and across an edge, on which the (n, 2) knots in them are 0."""

    knots: FloatArray
    log_weights: FloatArray
    is_edge: bool

    def triangles(self, s: FloatArray) -> TorusTriangles:
        """Triangles whose corners have (m, 3, 2) torus coordinates; the second one is −inf on the edge."""
        origin = s.mean(axis=1)
        layer = np.ones(len(s))
        if not self.is_edge:
            return TorusTriangles(s - origin[:, None], origin, layer)
        origin[:, 1] = s[:, :, 1].max(axis=1)
        # In the layer that moves μ most, z is nearly proportional to the distance from the edge.
        logs = self.knots @ origin.T + self.log_weights[:, None]
        pull = np.exp(np.maximum(logs - logs.max(axis=0), UNDERFLOW_EXPONENT)) * self.knots[:, 1:]
        layer = self.knots[pull.argmax(axis=0), 1]
        corners = np.empty_like(s)
        corners[:, :, 0] = s[:, :, 0] - origin[:, :1]
        corners[:, :, 1] = np.exp(layer[:, None] * (s[:, :, 1] - origin[:, 1:]))
        return TorusTriangles(corners, origin, layer)

    def bounds(self, triangles: TorusTriangles) -> Bounds:
        """Enclose T over triangles, or over segments with (m, 2, 2) corners."""
        return self._across(triangles) if self.is_edge else self._inside(triangles)

    def _shares(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, m) T at (m, 2) torus coordinates, and the (m,) largest exponents."""
        e = self.knots @ s.T + self.log_weights[:, None]
        size = np.abs(e).max(axis=0)
        e -= e.max(axis=0)
        t = np.exp(np.maximum(e, UNDERFLOW_EXPONENT))
        return t / t.sum(axis=0), size

    def _inside(self, triangles: TorusTriangles) -> Bounds:
        middle = triangles.corners.mean(axis=1)
        t, size = self._shares(triangles.origin + middle)
        mean = t.T @ self.knots
        steps = triangles.corners - middle[:, None]
        slopes = np.stack([self.knots @ step.T - np.einsum("md,md->m", mean, step) for step in steps.swapaxes(0, 1)])
        return Bounds(t * np.exp(np.minimum(slopes, MAX_EXPONENT)), t * (1 + slopes), size)

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")  # segments on the edge: their bounds are not used
    def _across(self, triangles: TorusTriangles) -> Bounds:
        """Products of bounds along the edge and across it."""
        along, across = (triangles.corners[:, :, axis].T for axis in (0, 1))
        low, high = (np.stack([f(along, axis=0), f(across, axis=0)]) for f in (np.min, np.max))
        middle = (low + high) / 2
        t, size = self._shares(
            np.column_stack(
                [triangles.origin[:, 0] + middle[0], triangles.origin[:, 1] + np.log(middle[1]) / triangles.layer]
            )
        )
        slope = self.knots[:, :1] - self.knots[:, 0] @ t
        ends = [np.exp(np.minimum(slope * (end[0] - middle[0]), MAX_EXPONENT)) for end in (low, high)]
        chord = _interpolated(along, low[0], high[0], ends)
        tangent = 1 + slope * (along - middle[0])[:, None]
        center, radius = (chord + tangent) / 2, (chord - tangent) / 2
        power = self.knots[:, 1:] / triangles.layer
        logs = [np.where(power > 0, power * np.log(end[1] / middle[1]), 0.0) for end in (low, high)]
        ends = [np.exp(np.maximum(each, UNDERFLOW_EXPONENT)) for each in logs]
        above = _interpolated(across, low[1], high[1], ends)
        below = 1 + power * (across / middle[1] - 1)[:, None]
        concave = (power > 0) & (power < 1)
        above, below = np.where(concave, below, above), np.where(concave, above, below)
        corners = range(len(along))
        pairs = [(i, i) for i in corners] + [(i, j) for i in corners for j in corners if i < j]
        upper = np.stack([(chord[i] * above[j] + chord[j] * above[i]) / 2 for i, j in pairs])
        # Where the lower bound across is negative, the upper bound along makes the product least.
        size_below = np.abs(below)
        least = [center[i] * below[j] - radius[i] * size_below[j] + center[j] * below[i] - radius[j] * size_below[i]
                 for i, j in pairs]  # fmt: skip
        return Bounds(t * upper, t * np.stack(least) / 2, size)


def _interpolated(x: FloatArray, low: FloatArray, high: FloatArray, ends: list[FloatArray]) -> FloatArray:
    """(k, n, m) values at (k, m) places of affine functions that have given (n, m) values at `low` and `high`."""
    part = ((x - low) / np.where(high > low, high - low, 1.0))[:, None]
    return np.asarray((1 - part) * ends[0] + part * ends[1])


class Coverings:
    """Torus coordinates of a surface, inside Δ and at each edge, and triangles in them that cover triangles of Δ."""

    def __init__(self, patch: Patch) -> None:
        self.domain = domain = patch.domain
        self.knots = domain.knots - domain.center
        weights = patch.log_products
        self.linear = LinearParametrization(domain, weights)
        self.across = domain.normals / domain.normal_lengths[:, None]
        distances = domain.heights / domain.normal_lengths
        self.coordinates = [TorusCoordinates(self.knots, weights, False)]
        for edge in range(len(domain.vertices)):
            places = np.column_stack([domain.along(edge, domain.knots), distances[:, edge]])
            self.coordinates.append(TorusCoordinates(places, weights, True))

    def located(self, u: FloatArray) -> tuple[IntArray, FloatArray]:
        """(m,) faces that hold (m, 2) points of Δ, and (m, 2) torus coordinates: on an edge those along it, and 0."""
        face, s = np.zeros(len(u), dtype=np.int64), np.zeros((len(u), 2))
        centred = self.knots - self.knots.mean(axis=0)
        for location in self.linear.locations(u):
            face[location.rows] = location.face.number
            if location.face.is_interior:
                turn = np.linalg.lstsq(centred, location.knots - location.knots.mean(axis=0), rcond=None)[0]
                s[location.rows] = (turn @ location.s).T
            elif not location.face.is_corner:
                s[location.rows, 0] = location.s[0]
        return face, s

    def numbers(self, face: IntArray) -> IntArray:
        """(m,) coordinates for triangles with (m, 3) faces of their corners: 0 inside Δ, 1 + k for edge k.

        They are −1 for a triangle that touches a corner of Δ or two edges.
        """
        edge = face.max(axis=1)
        one = ((face == 0) | (face == edge[:, None])).all(axis=1)
        return np.where(one & (edge < len(self.coordinates)), edge, -1)

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")  # NaN is never found to hold
    def covering(
        self, number: int, u: FloatArray, face: IntArray, s: FloatArray
    ) -> tuple[BoolArray, TorusTriangles, IntArray]:
        """Find triangles of torus coordinates, by their number, whose images under μ cover triangles of Δ.

        These have (m, 3, 2) corners `u`, with faces and torus coordinates from `located`. Returned are which of them
        are covered (others must be cut), the triangles that cover them, and the one that each of these helps to cover.

        The straight triangle of torus coordinates is enlarged until μ maps each side beyond the line through the same
        side of the triangle of Δ: Σ T_i λ_k(a_i) ≤ 0 with the barycentric coordinate λ_k that is 0 on this line. The
        image of the boundary then runs around the triangle of Δ, and as μ is one to one, all that it encloses is
        covered. Sides on the edge of Δ stay there. If only one corner is on the edge, what lies beyond the edge is cut
        off, and two triangles cover.
        """
        max_pushes, first_push = 10, 0.02  # parts of heights by which sides are pushed outwards
        max_excess = 0.5  # part of a height by which a side may still lie inside; a more curved triangle is cut
        coordinates, on_edge = self.coordinates[number], face > 0
        # The only corner on the edge comes first.
        single = on_edge.sum(axis=1) == 1
        order = (np.arange(3) + np.where(single, on_edge.argmax(axis=1), 0)[:, None]) % 3
        rows = np.arange(len(u))[:, None]
        u, s, on_edge = u[rows, order], s[rows, order], on_edge[rows, order]
        start = coordinates.triangles(self._beside_edge(number - 1, s, on_edge) if number else s)
        is_fixed = np.roll(on_edge, -1, axis=1) & np.roll(on_edge, 1, axis=1)
        values = barycentric(u - self.domain.center, self.knots)
        push = np.where(is_fixed, 0.0, first_push)
        polygons = np.empty((len(u), 4, 2))
        found, todo = np.zeros(len(u), dtype=bool), np.arange(len(u))
        for _ in range(max_pushes):
            here = rows_of(start, todo)
            polygons[todo] = polygon = _clipped(_enlarged(here.corners, push[todo]), single[todo])
            excess = np.full((len(todo), 3), -np.inf)
            for side, (begin, end) in enumerate(((2, 3), (3, 0), (1, 2))):
                bounds = coordinates.bounds(here._replace(corners=polygon[:, [begin, end]]))
                excess[:, side] = _excess(bounds, values[side][:, todo])
            excess[is_fixed[todo]] = -np.inf
            is_inside = (polygon[:, 2:, 1] >= 0).all(axis=1) | (not number)
            holds = np.asarray((excess <= 0).all(axis=1) & is_inside)
            found[todo[holds]] = True
            left = ~holds & (excess.max(axis=1) < max_excess) & is_inside
            todo, excess = todo[left], excess[left]
            if not len(todo):
                break
            beyond = np.where(excess > -first_push / 2, first_push, 0.0)
            push[todo] += np.where(is_fixed[todo], 0.0, np.where(excess > 0, 2 * excess + 1.5 * first_push, beyond))
        owner = np.concatenate([np.flatnonzero(found), np.flatnonzero(found & single)])
        halves = np.repeat([[1, 2, 3], [0, 1, 3]], [np.count_nonzero(found), np.count_nonzero(found & single)], axis=0)
        return found, rows_of(start, owner)._replace(corners=polygons[owner[:, None], halves]), owner

    def _beside_edge(self, edge: int, s: FloatArray, on_edge: BoolArray) -> FloatArray:
        """(m, 3, 2) torus coordinates along an edge and across it, which are −inf on the edge."""
        along = np.where(on_edge, s[:, :, 0], s @ self.domain.direction(edge))
        return np.stack([along, np.where(on_edge, -np.inf, s @ self.across[edge])], axis=2)


def barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """(3, p, m) barycentric coordinates of (p, 2) points in (m, 3, 2) triangles."""
    (x, y), (px, py) = np.moveaxis(corners, 2, 0).swapaxes(1, 2), points.T[:, :, None]
    found = []
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN in triangles that are lines
        for k in range(3):
            start, end = k - 2, k - 1
            dx, dy = x[end] - x[start], y[end] - y[start]
            found.append(
                ((px - x[start]) * dy - (py - y[start]) * dx) / ((x[k] - x[start]) * dy - (y[k] - y[start]) * dx)
            )
    return np.stack(found)


def _enlarged(corners: FloatArray, push: FloatArray) -> FloatArray:
    """Triangles whose sides (k is opposite corner k) are pushed outwards by (m, 3) parts of the heights over them."""
    weights = -np.repeat(push[:, None], 3, axis=1)
    for k in range(3):
        weights[:, k, k] = 1 + push[:, k - 1] + push[:, k - 2]
    return np.asarray(weights @ corners)


def _clipped(corners: FloatArray, single: BoolArray) -> FloatArray:
    """(m, 4, 2) polygons: triangles with the first corner twice, or cut along z = 0 if it is `single` and below."""
    first = corners[:, 0]
    below = (single & (first[:, 1] < 0))[:, None]
    ends = []
    for other in (corners[:, 2], corners[:, 1]):
        crossing = first - (first[:, 1:] / (other[:, 1:] - first[:, 1:])) * (other - first)
        ends.append(np.where(below, np.column_stack([crossing[:, 0], np.zeros(len(first))]), first))
    return np.stack([*ends, corners[:, 1], corners[:, 2]], axis=1)


def _excess(bounds: Bounds, values: FloatArray) -> FloatArray:
    """(m,) upper bounds of Σ T_i v_i for (n, m) values v, less the rounding."""
    side_roundings = 64  # by which a side may lie inside the line that it must be beyond
    positive, negative = np.maximum(values, 0.0), np.minimum(values, 0.0)
    most = (positive * bounds.upper + negative * bounds.lower).sum(axis=1).max(axis=0)
    return np.asarray(most - side_roundings * EPS * (np.abs(values) * bounds.upper.max(axis=0)).sum(axis=0))
