"""The domain Δ: convex hull of the knots, its edges, and the edge functions h_j with their scale."""

import math
from collections.abc import Iterator
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, finite, positive, read_only, two_product
from gtb_cli.display import notebook_html
from gtb_cli.errors import DomainError
from gtb_cli.knots.face import Face, Faces
from gtb_cli.knots.hull import convex_hull, knot_tolerance
from gtb_cli.values import by_value

EdgeNormals: TypeAlias = Literal["auto", "unit", "primitive"]

SIZES = 1e-100, 1e100  # of Δ, and edge scales: products of two neither overflow nor underflow
LAYER_TOLERANCE = 1e-9  # fraction of the hull's size: knots whose distances from an edge differ by less form one layer


@by_value
class Domain:
    """Convex hull Δ of the knots, with its facets (edges; for a curve the two ends) and edge functions.

    ``h_j(u) = <normals[j], u - vertices[j]> = s_j (<ξ_j, u> + ρ_j)``, nonnegative inside (Sections 2.1 and 2.2 of the
    paper; Def. 2.1, Def. 2.2). Made by `domain`.

    Attributes
    ----------
    knots : (n, d) float
    vertices : (r, d) float
        Corners of Δ: counter-clockwise from the lowest, then leftmost, one; for d = 1 the two ends, ascending.
        Edge j runs from vertex j to vertex j + 1; for d = 1, facet j is the end j.
    normals : (r, d) float
        Scaled inward normals s_j ξ_j.
    incidence : (n, r) bool
        Whether knot i lies on edge j; decided once, by `knot_tolerance`.
    heights : (n, r) float
        The exponents h_j(a_i), exactly 0 where `incidence` holds.
    """

    knots: FloatArray
    vertices: FloatArray
    normals: FloatArray
    incidence: BoolArray
    heights: FloatArray
    edge_normals: EdgeNormals
    edge_scale: float | FloatArray
    _repr_html_ = notebook_html

    def __repr__(self) -> str:
        what = "interval" if self.dimension == 1 else f"{len(self.vertices)}-sided polygon"
        return f"<Domain: {what}, {len(self.knots)} knots>"

    @property
    def dimension(self) -> int:
        """1 for a curve, 2 for a surface."""
        return int(self.knots.shape[1])

    @cached_property
    def center(self) -> FloatArray:
        """Middle of the bounding box, (d,), which is subtracted before knots are multiplied by anything."""
        return np.asarray((self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2, dtype=np.float64)

    @cached_property
    def size(self) -> float:
        """Largest extent of Δ along an axis."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def tolerance(self) -> float:
        """Distance within which a parameter, inside or outside, is on an edge: some roundings of the largest number."""
        return 4 * EPS * max(self.size, float(np.abs(self.vertices).max()))

    @cached_property
    def faces(self) -> Faces:
        """Δ itself, its edges and its corners."""
        return Faces(self.dimension, self.incidence)

    def edge_functions(self, u: ArrayLike) -> FloatArray:
        """Evaluate the edge functions h_j(u) ≥ 0 in Δ, exactly 0 within `tolerance` of edge j: (m, d) → (m, r).

        The relative error is below 1e-12 however near the edge is, and a few roundings for an edge along an axis.
        Raises `DomainError` for a parameter that is not finite or lies outside Δ.
        """
        return np.ascontiguousarray(self.heights_of_columns(self.grid(u)[0]).T)

    def grid(self, u: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
        """Return parameters, given as (…, d), as (m, d), and the shape of the grid in which they were given.

        For a curve, they may be (…), and a last axis of length 1 counts as d, unless it is the only axis. Raises
        `DomainError` if the last axis has another length, or the values are not numbers.
        """
        try:
            array = np.asarray(u, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise DomainError(f"parameters: not a regular array of numbers ({error})") from None
        if self.dimension == 1 and (array.ndim < 2 or array.shape[-1] != 1):
            array = array[..., None]
        if array.ndim == 0 or array.shape[-1] != self.dimension:
            raise DomainError(f"parameters: expected shape (…, 2), as those of a surface, got {array.shape}")
        return array.reshape(-1, self.dimension), array.shape[:-1]

    @np.errstate(over="ignore", invalid="ignore")  # from infinite parameters, which are refused
    def heights_of_columns(self, u: FloatArray, first: int = 0, faces: IntArray | None = None) -> FloatArray:
        """Evaluate the edge functions with a row for each edge: (m, d) parameters → (r, m).

        `first` is the index of the first parameter in messages. `faces` has the numbers of the faces on which
        parameters are known to lie, despite rounding.
        """
        h = np.zeros((len(self.vertices), len(u)))
        for coordinates, corners, normals in zip(u.T.copy(), self.vertices.T, self.normals.T, strict=True):
            for j in np.flatnonzero(normals).tolist():  # edges along an axis take half the time
                h[j] += (coordinates - corners[j]) * normals[j]
        near = ~(h >= self._near[:, None])  # also NaN
        if faces is not None:
            known = np.flatnonzero(faces)
            on = self.faces.vanishing.take(faces[known], axis=0).T
            h[:, known], near[:, known] = np.where(on, 0.0, h[:, known]), near[:, known] & ~on
        if near.any():
            edges, points = np.nonzero(near)
            lengths = self.normal_lengths[edges]
            distance = self._distance_without_cancellation(edges, u[points])
            distance[np.abs(distance) <= self.tolerance] = 0.0
            if not (distance >= 0).all():
                wrong = int(points[~(distance >= 0)].min())
                place = ", ".join(map(repr, u[wrong].tolist()))
                fault = f"({place}) is outside the domain, by up to {-distance.min():.3g}"
                fault = fault if np.isfinite(u[wrong]).all() else f"must be finite, got ({place})"
                raise DomainError(f"parameters[{first + wrong}]: {fault}")
            h[edges, points] = distance * lengths
        return h

    def nearest_edge(self, heights: FloatArray) -> IntArray:
        """Return the index of the edge nearest to each point, from edge functions: (r, m) → (m,)."""
        return np.asarray(np.argmin(heights / self.normal_lengths[:, None], axis=0))

    def edge_knots(self, edge: int) -> IntArray:
        """Return the indices of the knots on an edge, in order along it (equal places in order of index)."""
        members = np.flatnonzero(self.incidence[:, edge])
        if self.dimension == 1:
            return members
        return members[np.argsort(self.along(edge, self.knots[members]), kind="stable")]

    def face_knots(self, face: Face) -> FloatArray:
        """Return coordinates of the knots on a face, (k, e): along an edge from its first corner; none at a corner."""
        members = self.knots[face.knots]
        return np.empty((len(members), 0)) if face.is_corner else self.along(face.index, members)[:, None]

    @cached_property
    def edge_fractions(self) -> tuple[tuple[IntArray, FloatArray, IntArray], ...]:
        """Knots of each edge (or end) in order, their fractions of it, and which knot is the first at its place."""
        found = []
        for edge in range(len(self.vertices)):
            members = self.edge_knots(edge)
            fractions = self.along(edge, self.knots[members]) if self.dimension == 2 else np.zeros(len(members))
            length = float(fractions[-1]) or 1.0
            fractions /= length
            first = np.flatnonzero(np.diff(fractions, prepend=-1.0) > self.tolerance / length)
            found.append((members, fractions, first))
        return tuple(found)

    def direction(self, edge: int) -> FloatArray:
        """Return the unit vector along an edge, (2,), from its first corner to its last."""
        vector = self.vertices[(edge + 1) % len(self.vertices)] - self.vertices[edge]
        return np.asarray(vector / np.hypot(vector[0], vector[1]))

    def along(self, edge: int, points: FloatArray) -> FloatArray:
        """Return how far along an edge points are, from its first corner, in units of the knots: (m, 2) → (m,)."""
        return np.asarray((points - self.vertices[edge]) @ self.direction(edge))

    @cached_property
    def normal_lengths(self) -> FloatArray:
        """Lengths |s_j ξ_j|, (r,), by which edge functions are divided to give distances."""
        return np.asarray(np.sqrt((self.normals**2).sum(axis=1)))

    @cached_property
    def _near(self) -> FloatArray:
        """Edge functions, (r,), below which the products of a slanted edge may cancel, or rounding decides."""
        cancelling_distance = 2.0**-10  # of the hull's size: nearer to an edge, distances are computed again
        slanted = (self.normals != 0).all(axis=1) if self.dimension == 2 else np.zeros(2, dtype=bool)
        return np.asarray(np.where(slanted, cancelling_distance * self.size, self.tolerance) * self.normal_lengths)

    def _distance_without_cancellation(self, edges: IntArray, u: FloatArray) -> FloatArray:
        """Return signed distances of u[k] from edge edges[k], (m,), with a relative error of a few roundings.

        The cross product of the differences is in double-double arithmetic (Dekker, Knuth).
        """
        if self.dimension == 1:
            return np.asarray(np.sign(self.normals[edges, 0]) * (u[:, 0] - self.vertices[edges, 0]))
        start, end = self.vertices[edges], self.vertices[(edges + 1) % len(self.vertices)]
        (ex, ex_low), (ey, ey_low) = (_two_difference(end[:, k], start[:, k]) for k in (0, 1))
        (wx, wx_low), (wy, wy_low) = (_two_difference(u[:, k], start[:, k]) for k in (0, 1))
        first, first_low = two_product(ex, wy)
        second, second_low = two_product(ey, wx)
        high, low = _two_difference(first, second)
        low += first_low - second_low
        low += (ex * wy_low + ex_low * wy) - (ey * wx_low + ey_low * wx)
        return np.asarray((high + low) / np.hypot(ex, ey))


def domain(knots: ArrayLike, edge_normals: EdgeNormals = "auto", edge_scale: ArrayLike = 1.0) -> Domain:
    """Build the domain of a set of real knots a_i, (n, d) or (n,) for d = 1, in any order, repetitions allowed.

    The normals ξ_j are unit vectors, or primitive integer vectors (the paper's choice for lattice polygons), which
    require integer corners of Δ; "auto" is primitive if the corners are integers, otherwise unit. For d = 1 all are the
    same. The edge scales s_j (for d = 1, k_0 and k_1) are one positive factor or (r,): Def. 2.1, Def. 2.2, Remark 2.1.
    Raises `DomainError` for knots with a wrong shape, not finite, or on one line, and for wrong factors.
    """
    low, high = SIZES
    points = finite("knots", knots)
    if np.abs(points).max(initial=0.0) > high:
        raise DomainError(f"knots: coordinates beyond {high:g} are not supported, got {np.abs(points).max():g}")
    points = points[:, None] if points.ndim == 1 else points
    if points.ndim != 2 or points.shape[1] not in (1, 2) or len(points) < 2:
        raise DomainError(f"knots: expected shape (n,), (n, 1) or (n, 2) with n > 1, got {np.shape(knots)}")
    if edge_normals not in get_args(EdgeNormals):
        raise DomainError(f"edge_normals: expected auto, unit or primitive, got {edge_normals!r}")
    scale = positive("edge_scale", edge_scale)
    if not ((scale >= low) & (scale <= high)).all():
        raise DomainError(f"edge_scale: expected factors between {low:g} and {high:g}, got {edge_scale!r}")
    return _built(points.tobytes(), points.shape[1], edge_normals, scale.tobytes(), scale.shape)


@lru_cache(maxsize=64)  # the patches of a model often have one domain
def _built(knots: bytes, dimension: int, edge_normals: EdgeNormals, factors: bytes, count: tuple[int, ...]) -> Domain:
    points, scale = np.frombuffer(knots).reshape(-1, dimension), np.frombuffer(factors).reshape(count)
    if dimension == 1:
        vertices = np.array([points.min(axis=0), points.max(axis=0)])
        if not vertices[0] < vertices[1]:
            raise DomainError(f"knots: a curve needs two different knots, all are {points[0, 0]:g}")
        normals = np.array([[1.0], [-1.0]])
    else:
        vertices = points[convex_hull(points)]
        normals = _normals(vertices, edge_normals)
    size = float(np.ptp(vertices, axis=0).max())
    if size < SIZES[0]:
        raise DomainError(f"knots: a hull smaller than {SIZES[0]:g} is not supported, got {size:g}")
    if scale.ndim > 1 or (scale.ndim == 1 and len(scale) != len(vertices)):
        found = len(scale) if scale.ndim == 1 else f"shape {scale.shape}"
        raise DomainError(f"edge_scale: must be one number or {len(vertices)}, one for each edge, got {found}")
    scaled = normals * (scale[:, None] if scale.ndim else scale)

    difference = points[:, None, :] - vertices[None, :, :]
    heights = np.einsum("ijk,jk->ij", difference, scaled)
    lengths = np.sqrt(np.einsum("jk,jk->j", scaled, scaled))
    tolerance = knot_tolerance(points)
    incidence = heights <= tolerance * lengths
    if dimension == 2:
        # Two edges have only their corner in common, however sharp it is.
        rows = np.flatnonzero(incidence.sum(axis=1) > 1)
        gaps = np.abs(difference[rows]).max(axis=2)
        corner, nearest = gaps.argmin(axis=1), (heights[rows] / lengths).argmin(axis=1)
        is_there = gaps.min(axis=1) <= tolerance
        incidence[rows] = False
        for edge in (corner - 1, corner):
            incidence[rows, np.where(is_there, edge, nearest)] = True
        heights = np.maximum(heights, EPS * tolerance * lengths)
    heights[incidence] = 0.0
    incidence.flags.writeable = False
    vertices, scaled, heights = read_only(vertices), read_only(scaled), read_only(heights)
    return Domain(points, vertices, scaled, incidence, heights, edge_normals, scale if scale.ndim else float(scale))


def layers(heights: FloatArray) -> Iterator[IntArray]:
    """Yield the indices of the knots of equal positive height over an edge, lowest first: their shares vanish alike."""
    order = np.argsort(heights, kind="stable")
    order = order[heights[order] > 0]
    steps = np.flatnonzero(np.diff(heights[order]) > LAYER_TOLERANCE * heights.max()) + 1
    yield from (order[start:end] for start, end in pairwise([0, *steps.tolist(), len(order)]))


def has_integer_corners(vertices: FloatArray) -> bool:
    """Tell whether all vertices are integers that floats hold, so that the normals of edges may be primitive."""
    return bool((vertices == np.rint(vertices)).all()) and float(np.abs(vertices).max()) < 2.0**52


def _normals(vertices: FloatArray, edge_normals: EdgeNormals) -> FloatArray:
    edges = np.roll(vertices, -1, axis=0) - vertices
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    integer = has_integer_corners(vertices)
    if edge_normals == "primitive" and not integer:
        corner = tuple(float(x) for x in vertices[int(np.argmax((vertices != np.rint(vertices)).any(axis=1)))])
        raise DomainError(f"edge_normals: primitive needs integer corners of the hull, got {corner}")
    if edge_normals == "unit" or not integer:
        return np.asarray(normals / np.hypot(normals[:, 0], normals[:, 1])[:, None])
    return np.asarray(normals / [[float(math.gcd(int(a), int(b)))] for a, b in normals])


def _two_difference(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a - b as a float and its rounding error."""
    high = a - b
    back = high - a
    return high, (a - (high - back)) - (b + back)
