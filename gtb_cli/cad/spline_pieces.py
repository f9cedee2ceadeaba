"""B-spline pieces of patches: where they are fitted, with which conditions, and what is measured of them."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, angles_between, unit
from gtb_cli.cad.edge_halves import HalfEdge
from gtb_cli.cad.exact_surfaces import SplineSurface
from gtb_cli.cad.part_borders import Border
from gtb_cli.theory.basis import Location
from gtb_cli.theory.patch import Patch

Halves: TypeAlias = list[list[HalfEdge] | None]  # of each edge of a patch: from its start, and from its end
Borders: TypeAlias = list[Border | None]  # of each edge
EDGES = ((1, 0), (0, 0), (1, -1), (0, -1))  # sides of a piece: the axis across, and the row


class FittedPieces(NamedTuple):
    """The pieces of a patch, one at each corner, and what was measured of them at places where they are not fitted.

    `error` is the largest distance at equal parameters, and `gap` that of edges from exact halves; `bend` is the
    largest angle in degrees between pieces along seams, and `angle` that to the patch's tangent planes along edges.
    `lost` is the share of places on edges and seams whose planes B-splines cannot follow.
    """

    surfaces: tuple[SplineSurface, ...]
    error: float
    gap: float
    bend: float
    angle: float
    lost: float


class Splines:
    """B-splines of a degree on spans of [0, 1], with the places where they are fitted, and where measured."""

    def __init__(self, degree: int, ends: FloatArray, conditions: int = 0) -> None:
        self.degree, spans, starts, lengths = degree, len(ends) - 1, ends[:-1, None], np.diff(ends)[:, None]
        self.knots = np.pad(ends, degree, mode="edge")
        # Greville's points: an interpolating spline of any degree does not oscillate between them.
        self.greville = np.convolve(self.knots, np.full(degree, 1 / degree), "valid")[1:-1]
        self.greville[-1] = 1.0
        count = 2 - (-degree // spans)  # more places than poles
        self.fitted, self.conditions = (
            (starts + lengths * (np.polynomial.legendre.leggauss(each)[0] / 2 + 0.5)).ravel()
            for each in (count, conditions or count)
        )
        self.between = (starts + lengths * [0.04, 0.57]).ravel()
        self.along = np.append((starts + lengths * (1 - np.cos(np.pi * np.arange(20) / 20)) / 2).ravel(), 1.0)
        self.slopes = degree / ends[1], degree / (1 - ends[-2])  # of the second pole and the last but one, at the ends

    def spline(self, poles: FloatArray) -> Any:
        """Return the curve with these poles along the first axis, a `BSpline` of scipy."""
        from scipy.interpolate import BSpline

        return BSpline(self.knots, poles, self.degree)

    def values(self, places: FloatArray, order: int = 0) -> FloatArray:
        """Return (n, m) values of the m B-splines, or derivatives of an order."""
        return np.asarray(self.spline(np.eye(len(self.greville)))(places, order))

    def curve(self, rows: FloatArray) -> FloatArray:
        """Return the poles of the interpolant of values at Greville's points, along the first axis."""
        from scipy.interpolate import make_interp_spline

        return np.asarray(make_interp_spline(self.greville, rows, self.degree, t=self.knots, axis=0).c)


class Piece(NamedTuple):
    """A part of a patch between four corners, with parameters (s, t).

    `edges` are the patch's edges, if any, along t = 0, s = 0 and t = 1, and `halves` their exact halves, which start at
    the patch's `corner`: it is at s = t = 0, or all of s = 0. `borders` are those of a part along them.
    """

    corners: FloatArray
    corner: int | None = None
    edges: tuple[int | None, int | None, int | None] = (None, None, None)
    halves: tuple[HalfEdge | None, HalfEdge | None, HalfEdge | None] = (None, None, None)
    borders: tuple[Border | None, Border | None, Border | None] = (None, None, None)

    def weights(self, places: FloatArray) -> FloatArray:
        """Return (n,) weights at (n, 2) places: those of the halves on edges, and 1 on seams."""
        result = np.ones(len(places))
        for half, (own, inwards) in zip(self.halves, sides_of(places), strict=True):
            if half is not None:
                result *= 1 + (half.at(own)[1] - 1) * (1 - inwards)
        return result

    def knots(self, places: FloatArray) -> FloatArray:
        """Return (n, 2) points of Δ; those on seams do not depend on halves."""
        x, y = places.T
        moves = [
            0.0 if half is None else (half.at(own)[2] - own) * (1 - inwards)
            for half, (own, inwards) in zip(self.halves, sides_of(places), strict=True)
        ]
        x, y = x + moves[0] + moves[2], y + moves[1]
        shares = np.array([[(1 - x) * (1 - y), (1 - x) * y], [x * (1 - y), x * y]])
        return np.asarray(np.einsum("ijn,ijx->nx", shares, self.corners))


SplinePair: TypeAlias = tuple[Splines, Splines]  # along s and t
Fitted: TypeAlias = tuple[Piece, FloatArray, SplinePair]  # a piece, its poles, and its B-splines


def corner_pieces(patch: Patch, halves: Halves, borders: Borders, *, is_polar: bool) -> tuple[list[Piece], FloatArray]:
    """Return a piece at each corner, to the centroid of Δ unless it is polar, and the (r, 2) middles of edges."""
    v = patch.domain.vertices
    pairs = [pair or (None, None) for pair in halves]
    ends = np.array([0.5 if pair[0] is None else pair[0].end for pair in pairs])[:, None]
    middles, pieces = (1 - ends) * v + ends * np.roll(v, -1, axis=0), []
    for k in range(len(v)):
        own, before = (k, pairs[k][0], borders[k]), ((k - 1) % len(v), pairs[k - 1][1], borders[k - 1])
        start, end = (v[k], middles[k - 1]) if is_polar else (middles[k - 1], v.mean(axis=0))
        sides: Any = (own, 3 * [None], before) if is_polar else (own, before, 3 * [None])
        pieces.append(Piece(np.array([[v[k], start], [middles[k], end]]), k, *zip(*sides, strict=True)))
    return pieces, middles


def sides_of(places: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return parameters along the sides t = 0, s = 0 and t = 1 of a piece, and those across."""
    s, t = places.T
    return [(s, t), (t, s), (s, 1 - t)]


def grid(s: FloatArray, t: FloatArray) -> FloatArray:
    """Return (m n, 2) places of a grid."""
    return np.stack(np.meshgrid(s, t, indexing="ij"), axis=-1).reshape(-1, 2)


def _located(patch: Patch, pieces: list[Piece], places: FloatArray) -> tuple[list[Location], int]:
    """Return the locations of the same (n, 2) places in all pieces, those of edges on them."""
    shape = patch.domain
    faces = np.zeros((len(pieces), len(places)), dtype=np.int64)
    for row, piece in zip(faces, pieces, strict=True):
        sides = places[:, 1] == 0, places[:, 0] == 0, places[:, 1] == 1
        for edge, on_side in zip(piece.edges, sides, strict=True):
            if edge is not None:
                row[on_side] = shape.faces.edge(edge).number
        if piece.corner is not None:
            row[sides[1] & (sides[0] | (piece.edges[1] is None))] = shape.faces.corner(piece.corner).number
    knots = np.concatenate([piece.knots(places) for piece in pieces])
    return list(patch.rational_basis.locations(knots, "linear", faces.ravel())), faces.size


def _borders(patch: Patch, piece: Piece, places: FloatArray) -> Iterator[tuple[BoolArray, Border, FloatArray]]:
    """Yield which places are on a border, that border, and their fractions of the edge."""
    for edge, border, (_, inwards) in zip(piece.edges, piece.borders, sides_of(places), strict=True):
        if border is not None and edge is not None:
            start, end = np.roll(patch.domain.vertices, -edge, axis=0)[:2]
            feet = piece.knots(places[inwards == 0]) - start
            yield inwards == 0, border, feet @ (end - start) / ((end - start) @ (end - start))


def forms_at(patch: Patch, piece: Piece, places: FloatArray) -> FloatArray | None:
    """Return the (n, 3, 3) second fundamental forms of a part at places on one of its borders, if it has any."""
    rows = [border(fractions) for on_side, border, fractions in _borders(patch, piece, places) if on_side.all()]
    return rows[0][:, 6:].reshape(-1, 3, 3) if rows and rows[0].shape[1] > 6 else None


def points_at(patch: Patch, pieces: list[Piece], places: list[FloatArray]) -> list[FloatArray]:
    """Return (r, n, 3) points at places of each piece, exact on edges with exact halves, or on borders."""
    every = np.concatenate(places)
    points = patch.points_at(*_located(patch, pieces, every)).reshape(len(pieces), -1, 3)
    for piece, here in zip(pieces, points, strict=True):
        for half, (own, inwards) in zip(piece.halves, sides_of(every), strict=True):
            if half is not None and (exact := half.at(own[inwards == 0])[0]) is not None:
                here[inwards == 0] = exact
        for on_side, border, fractions in _borders(patch, piece, every):
            here[on_side] += border(fractions)[:, :3]
    return np.split(points, np.cumsum([len(one) for one in places])[:-1], axis=1)


def normals_at(patch: Patch, pieces: list[Piece], places: list[FloatArray]) -> list[FloatArray]:
    """Return (r, n, 3) normals at places of each piece."""
    every = np.concatenate(places)
    normals = patch.normals_at(*_located(patch, pieces, every)).reshape(len(pieces), -1, 3)
    for piece, here in zip(pieces, normals, strict=True):
        for on_side, border, fractions in _borders(patch, piece, every):
            here[on_side] = unit(here[on_side] + border(fractions)[:, 3:6])
    return np.split(normals, np.cumsum([len(one) for one in places])[:-1], axis=1)


def framed(piece: Piece, splines: SplinePair, rims: Iterable[tuple[int, FloatArray]]) -> FloatArray:
    """Return the homogeneous poles of a piece on sides with given points, 0 elsewhere, and all weights."""
    first, second = splines
    weights = piece.weights(grid(first.greville, second.greville)).reshape(len(first.greville), -1)
    net = np.zeros((*weights.shape, 4))
    net[..., 3] = second.curve(first.curve(weights).T).T
    for side, rim in rims:
        axis, row = EDGES[side]
        here = weights.swapaxes(0, axis)[row][:, None]
        net.swapaxes(0, axis)[row] = splines[1 - axis].curve(np.hstack([rim * here, here]))
    return net


def fit_inside(
    net: FloatArray, splines: SplinePair, points: FloatArray, planes: list[FloatArray], share: float, stress: FloatArray
) -> None:
    """Fit the inner poles of a piece to (m n, 3) points, and to the normals on its four sides that are not NaN.

    The share is the weight of planes, conditions of derivatives by parameters in [0, 1], beside positions; the stress
    is that of positions by their first parameter, (m,), or (1,) of all.

    With G = BᵀB of the inner B-splines, least squares of positions alone is G⁻¹Bᵀ along both axes, and conditions C
    move it by (G⊗G)⁻¹Cᵀλ, where (I + C (G⊗G)⁻¹Cᵀ) λ is what they lack: as many equations as there are conditions.
    """
    first, second = (each.values(each.fitted) for each in splines)
    weights = first @ net[..., 3] @ second.T
    frame = np.einsum("si,tj,ijx->stx", first, second, net[..., :3], optimize=True)
    left = points.reshape(frame.shape) * weights[..., None] - frame
    stressed = (first.T * stress).T
    inverses = [np.linalg.pinv(values[:, 1:-1]) for values in (stressed, second)]
    free = np.einsum("is,jt,stx->ijx", *inverses, (left.T * stress).T, optimize=True)
    conditions, lacking = [], []
    for (axis, last), normals in zip(EDGES, planes, strict=True):
        kept = np.isfinite(normals).all(axis=1)
        values = splines[1 - axis].values(splines[1 - axis].conditions)
        inner = values[:, 1:-1]
        known, found, following = net.swapaxes(0, axis), free.swapaxes(0, axis), (1, -2)[last]
        edge, across = values[kept] @ known[last], values[kept] @ known[following]
        lacks = edge[:, :3] / edge[:, 3:] * across[:, 3:] - across[:, :3] - inner[kept] @ found[last]
        towards = normals[kept] * (splines[axis].slopes[last] * share * np.sqrt(len(values)))
        rows = np.zeros((len(edge), *free.shape))
        rows.swapaxes(1, 1 + axis)[:, last] = inner[kept][..., None] * towards[:, None]
        conditions.append(rows)
        lacking.append((towards * lacks).sum(axis=1))
    roots = [np.linalg.inv(np.linalg.qr(values[:, 1:-1])[1]) for values in (stressed, second)]
    half = np.einsum("ik,jl,aijx->aklx", *roots, np.concatenate(conditions), optimize=True)
    flat = half.reshape(len(half), -1)
    multipliers = np.linalg.solve(np.eye(len(flat)) + flat @ flat.T, np.concatenate(lacking))
    moved = (multipliers @ flat).reshape(free.shape)
    net[1:-1, 1:-1, :3] = free + np.einsum("ik,jl,klx->ijx", *roots, moved, optimize=True)


def normals_along(net: FloatArray, axis: int, last: int, splines: Splines) -> FloatArray:
    """Return (n, 3) unit normals of a piece along an edge where it is measured; NaN where it has none."""
    rounding = 1e-9  # of the longest derivatives' product: below it, as on an edge without length, there is no normal
    here, following = net.swapaxes(0, axis)[[last, (1, -2)[last]]]
    edge = splines.spline(here)
    values = edge(splines.along)
    points = values[:, :3] / values[:, 3:]
    # Derivatives of rational points, but for a positive factor, which directions do not need.
    inwards = splines.spline((following - here) * (1, -1)[last])
    rates = [spline(splines.along) for spline in (edge.derivative(), inwards)]
    along, across = (rate[:, :3] - points * rate[:, 3:] for rate in rates)
    normals = np.cross(along, across) * (-1, 1)[axis]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    least = rounding * np.linalg.norm(along, axis=1).max() * np.linalg.norm(across, axis=1).max()
    return np.asarray(np.where(lengths > least, normals / np.where(lengths > 0, lengths, 1.0), np.nan))


def largest_angle(one: FloatArray, other: FloatArray) -> float:
    """Return the largest angle in degrees between (n, 3) unit normals, but for those that are NaN."""
    return float(np.nan_to_num(angles_between(one, other)).max())


def measured_surfaces(
    name: str, made: Iterable[Fitted], between: Iterable[FloatArray], origin: FloatArray, size: float
) -> tuple[tuple[SplineSurface, ...], list[FloatArray], float]:
    """Return pieces as surfaces, how far these are from points between those fitted, and their edges from halves."""
    surfaces, away, gap = [], list[FloatArray](), 0.0
    for (piece, net, splines), wanted in zip(made, between, strict=True):
        found = np.einsum("si,tj,ijx->stx", *(each.values(each.between) for each in splines), net, optimize=True)
        found = found.reshape(-1, 4)
        away.append(found[:, :3] / found[:, 3:] * size + origin - wanted)
        points = np.dstack([net[..., :3] / net[..., 3:] * size + origin, net[..., 3]])
        sides = zip(piece.halves, piece.borders, (points[:, 0], points[0], points[:, -1]), (0, 1, 0), strict=True)
        for half, border, rows, along in sides:
            places = splines[along].along
            if half is not None and border is None and (exact := half.at(places)[0]) is not None:
                shares = splines[along].values(places) * rows[:, 3]
                curve = shares @ rows[:, :3] / shares.sum(axis=1, keepdims=True)
                gap = max(gap, float(np.linalg.norm(curve - exact, axis=1).max()))
        first, second = splines
        surfaces.append(SplineSurface(name, (first.degree, second.degree), (first.knots, second.knots), points))
    return tuple(surfaces), away, gap
