"""Patches without exact surfaces as B-spline pieces that keep their tangent planes along all edges and seams."""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, angles_between
from gtb_cli.cad.exact_surfaces import SplineSurface
from gtb_cli.cad.half_edges import HalfEdge
from gtb_cli.theory.basis import Location
from gtb_cli.theory.patch import Patch

DEGREE = 6

EDGES = ((1, 0), (0, 0), (1, -1), (0, -1))  # of a piece: the axis across, and the row; two edges, then two seams


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


class _Splines:
    """B-splines of a degree on graded spans of [0, 1], with the places where they are fitted, and where measured."""

    def __init__(self, degree: int, spans: int) -> None:
        self.degree = degree
        ends = np.linspace(0.0, 1.0, spans + 1) ** 2  # denser at the edges of Δ, where derivatives may have no bound
        starts, lengths = ends[:-1, None], np.diff(ends)[:, None]
        self.knots = np.pad(ends, degree, mode="edge")
        # Greville's points: an interpolating spline of any degree does not oscillate between them.
        self.greville = np.convolve(self.knots, np.full(degree, 1 / degree), "valid")[1:-1]
        self.greville[-1] = 1.0
        gauss = np.polynomial.legendre.leggauss(2 - (-degree // spans))[0]  # more places than poles
        self.fitted = (starts + lengths * (gauss / 2 + 0.5)).ravel()
        self.between = (starts + lengths * [0.04, 0.57]).ravel()
        self.along = np.append((starts + lengths * (1 - np.cos(np.pi * np.arange(20) / 20)) / 2).ravel(), 1.0)
        self.slopes = degree / ends[1], degree / (1 - ends[-2])  # of the second pole and the last but one, at the ends

    def values(self, places: FloatArray) -> FloatArray:
        """Return (n, m) values of the m B-splines."""
        from scipy.interpolate import BSpline

        return np.asarray(BSpline.design_matrix(places, self.knots, self.degree).toarray())

    def curve(self, rows: FloatArray) -> FloatArray:
        """Return the poles of the interpolant of values at Greville's points, along the first axis."""
        from scipy.interpolate import make_interp_spline

        return np.asarray(make_interp_spline(self.greville, rows, self.degree, t=self.knots, axis=0).c)


class _Quarter(NamedTuple):
    """The part of a patch at corner k, with parameters (s, t): t = 0 on edge k, s = 0 on the edge before.

    It ends at places inside both edges and at the centroid. `halves` are the exact halves of the two edges, or None.
    """

    k: int
    corners: FloatArray
    halves: tuple[HalfEdge | None, HalfEdge | None]

    def weights(self, places: FloatArray) -> FloatArray:
        """Return (n,) weights at (n, 2) places: those of the halves on edges, and 1 on seams."""
        result = np.ones(len(places))
        for half, (own, inwards) in zip(self.halves, (places.T, places.T[::-1]), strict=True):
            if half is not None:
                result *= 1 + (half.at(own)[1] - 1) * (1 - inwards)
        return result

    def knots(self, places: FloatArray) -> FloatArray:
        """Return (n, 2) points of Δ; those on the lines to the centroid do not depend on halves."""
        x, y = (
            own if half is None else own + (half.at(own)[2] - own) * (1 - inwards)
            for half, (own, inwards) in zip(self.halves, (places.T, places.T[::-1]), strict=True)
        )
        shares = np.array([[(1 - x) * (1 - y), (1 - x) * y], [x * (1 - y), x * y]])
        return np.asarray(np.einsum("ijn,ijx->nx", shares, self.corners))


def fitted_pieces(patch: Patch, name: str, spans: int, halves: list[list[HalfEdge] | None]) -> FittedPieces:
    """Fit a patch by as many pieces as it has corners, in the linear parametrisation.

    Edges interpolate the patch's, or are their exact halves; seams are shared. The rest is least squares of positions,
    and of n · ∂S = 0 across edges and seams with the patch's normals n.
    """
    splines, v = _Splines(DEGREE, spans), patch.domain.vertices
    r = len(v)
    pairs = [pair or (None, None) for pair in halves]
    ends = np.array([0.5 if pair[0] is None else pair[0].end for pair in pairs])[:, None]
    middles, center = (1 - ends) * v + ends * np.roll(v, -1, axis=0), v.mean(axis=0)
    quarters = [
        _Quarter(k, np.array([[v[k], middles[k - 1]], [middles[k], center]]), (pairs[k][0], pairs[k - 1][1]))
        for k in range(r)
    ]
    low, high = patch.control_points.min(axis=0), patch.control_points.max(axis=0)
    origin, size = (low + high) / 2, float((high - low).max())
    zero, one = np.zeros(1), np.ones(1)
    lines = [_grid(splines.greville, zero), _grid(zero, splines.greville), _grid(one, splines.greville)]
    grids = [_grid(splines.fitted, splines.fitted), _grid(splines.between, splines.between)]
    *rims, fitted, between = _points(patch, quarters, [*lines, *grids])
    near = zero + 1 / splines.slopes[0], one - 1 / splines.slopes[1]
    rows = [
        _grid(*((splines.fitted, x) if axis else (x, splines.fitted)))
        for axis, last in EDGES
        for x in (near[last], (zero, one)[last])
    ]
    measured = [_grid(splines.along, zero), _grid(zero, splines.along)]
    *planes, first, second, ways = _normals(patch, quarters, [*rows, *measured, np.array([[1.0, 0.0], [1.0, 1.0]])])
    nets = _frames(quarters, splines, [(rim - origin) / size for rim in rims], ways)
    least = np.cos(np.radians(10))  # if normals turn farther within the first pole, B-splines cannot follow their limit
    followed = [(near * last).sum(axis=2) > least for near, last in zip(planes[::2], planes[1::2], strict=True)]
    given = [np.where(kept[..., None], last, np.nan) for kept, last in zip(followed, planes[1::2], strict=True)]
    for k, net in enumerate(nets):
        _fit_inside(net, splines, (fitted[k] - origin) / size, [normals[k] for normals in given])
    values = splines.values(splines.between)
    along = splines.values(splines.along)
    error = gap = bend = angle = 0.0
    normals = [[_edge_normals(net, axis, last, splines) for axis, last in EDGES] for net in nets]
    surfaces = []
    for k, net in enumerate(nets):
        found = np.einsum("si,tj,ijx->stx", values, values, net, optimize=True).reshape(-1, 4)
        away = found[:, :3] / found[:, 3:] * size + origin - between[k]
        error = max(error, float(np.sqrt((away**2).sum(axis=1)).max()))
        angle = max(angle, _largest_angle(normals[k][0], first[k]), _largest_angle(normals[k][1], second[k]))
        bend = max(bend, _largest_angle(normals[k][3], normals[(k + 1) % r][2]))
        points = np.dstack([net[..., :3] / net[..., 3:] * size + origin, net[..., 3]])
        for half, rows in zip(quarters[k].halves, (points[:, 0], points[0]), strict=True):
            if half is not None and (exact := half.at(splines.along)[0]) is not None:
                shares = along * rows[:, 3]
                curve = shares @ rows[:, :3] / shares.sum(axis=1, keepdims=True)
                gap = max(gap, float(np.linalg.norm(curve - exact, axis=1).max()))
        surfaces.append(SplineSurface(name, (DEGREE, DEGREE), (splines.knots, splines.knots), points))
    return FittedPieces(tuple(surfaces), error, gap, bend, angle, 1 - float(np.mean(followed)))


def _grid(s: FloatArray, t: FloatArray) -> FloatArray:
    """Return (m n, 2) places of a grid."""
    return np.stack(np.meshgrid(s, t, indexing="ij"), axis=-1).reshape(-1, 2)


def _located(patch: Patch, quarters: list[_Quarter], places: FloatArray) -> tuple[list[Location], int]:
    """Return the locations of the same (n, 2) places in all quarters, those of edges on them."""
    shape = patch.domain
    faces = np.zeros((len(quarters), len(places)), dtype=np.int64)
    for row, quarter in zip(faces, quarters, strict=True):
        s, t = places.T == 0
        row[t] = shape.faces.edge(quarter.k).number
        row[s] = shape.faces.edge(quarter.k - 1 if quarter.k else len(quarters) - 1).number
        row[s & t] = shape.faces.corner(quarter.k).number
    knots = np.concatenate([quarter.knots(places) for quarter in quarters])
    return list(patch.rational_basis.locations(knots, "linear", faces.ravel())), faces.size


def _points(patch: Patch, quarters: list[_Quarter], places: list[FloatArray]) -> list[FloatArray]:
    """Return (r, n, 3) points at places of each quarter, exact on edges with exact halves."""
    every = np.concatenate(places)
    points = patch.points_at(*_located(patch, quarters, every)).reshape(len(quarters), -1, 3)
    for quarter, here in zip(quarters, points, strict=True):
        for half, own, inwards in zip(quarter.halves, every.T, every.T[::-1], strict=True):
            if half is not None and (exact := half.at(own[inwards == 0])[0]) is not None:
                here[inwards == 0] = exact
    return np.split(points, np.cumsum([len(one) for one in places])[:-1], axis=1)


def _normals(patch: Patch, quarters: list[_Quarter], places: list[FloatArray]) -> list[FloatArray]:
    """Return (r, n, 3) normals at places of each quarter."""
    normals = patch.normals_at(*_located(patch, quarters, np.concatenate(places))).reshape(len(quarters), -1, 3)
    return np.split(normals, np.cumsum([len(one) for one in places])[:-1], axis=1)


def _frames(quarters: list[_Quarter], splines: _Splines, rims: list[FloatArray], ways: FloatArray) -> list[FloatArray]:
    """Return (m, m, 4) homogeneous poles of each piece, those of edges and seams and all weights, 0 elsewhere.

    Seams begin and end in the tangent planes there, of which `ways` are the (r, 2, 3) normals.
    """
    count = len(splines.greville)
    nets = []
    for k, quarter in enumerate(quarters):
        weights = quarter.weights(_grid(splines.greville, splines.greville)).reshape(count, count)
        net = np.zeros((count, count, 4))
        net[..., 3] = splines.curve(splines.curve(weights).T).T
        for axis in (0, 1):
            here = weights.swapaxes(0, 1 - axis)[0][:, None]
            net.swapaxes(0, 1 - axis)[0] = splines.curve(np.hstack([rims[axis][k] * here, here]))
        nets.append(net)
    for k, net in enumerate(nets):
        seam = splines.curve(np.hstack([rims[2][k], np.ones((count, 1))]))
        seam[0] = net[-1, 0]
        seam[-1, :3] = rims[2][0, -1]
        for pole, end, normal in ((1, 0, ways[k, 0]), (-2, -1, ways[k, 1])):
            if np.isfinite(normal).all():
                seam[pole, :3] -= normal * (normal @ (seam[pole, :3] - seam[end, :3]))
        net[-1] = nets[(k + 1) % len(nets)][:, -1] = seam
    return nets


def _fit_inside(net: FloatArray, splines: _Splines, points: FloatArray, planes: list[FloatArray]) -> None:
    """Fit the inner poles of a piece to (n², 3) points, and to the (n, 3) normals on its four edges that are not NaN.

    With G = BᵀB of the inner B-splines, least squares of positions alone is G⁻¹Bᵀ along both axes, and conditions C
    move it by (G⊗G)⁻¹Cᵀλ, where (I + C (G⊗G)⁻¹Cᵀ) λ is what they lack: as many equations as there are conditions.
    """
    share = 3.0  # weight of conditions of planes, as derivatives by parameters in [0, 1], beside positions
    values = splines.values(splines.fitted)
    inner = values[:, 1:-1]
    weights = values @ net[..., 3] @ values.T
    frame = np.einsum("si,tj,ijx->stx", values, values, net[..., :3], optimize=True)
    left = points.reshape(frame.shape) * weights[..., None] - frame
    inverse = np.linalg.pinv(inner)
    free = np.einsum("is,jt,stx->ijx", inverse, inverse, left, optimize=True)
    conditions, lacking = [], []
    for (axis, last), normals in zip(EDGES, planes, strict=True):
        kept = np.isfinite(normals).all(axis=1)
        known, found, following = net.swapaxes(0, axis), free.swapaxes(0, axis), (1, -2)[last]
        edge, across = values[kept] @ known[last], values[kept] @ known[following]
        lacks = edge[:, :3] / edge[:, 3:] * across[:, 3:] - across[:, :3] - inner[kept] @ found[last]
        towards = normals[kept] * (splines.slopes[last] * share * np.sqrt(len(values)))
        rows = np.zeros((len(edge), *free.shape))
        rows.swapaxes(1, 1 + axis)[:, last] = inner[kept][..., None] * towards[:, None]
        conditions.append(rows)
        lacking.append((towards * lacks).sum(axis=1))
    root = np.linalg.inv(np.linalg.qr(inner)[1])
    half = np.einsum("ik,jl,aijx->aklx", root, root, np.concatenate(conditions), optimize=True)
    flat = half.reshape(len(half), -1)
    multipliers = np.linalg.solve(np.eye(len(flat)) + flat @ flat.T, np.concatenate(lacking))
    moved = (multipliers @ flat).reshape(free.shape)
    net[1:-1, 1:-1, :3] = free + np.einsum("ik,jl,klx->ijx", root, root, moved, optimize=True)


def _edge_normals(net: FloatArray, axis: int, last: int, splines: _Splines) -> FloatArray:
    """Return (n, 3) unit normals of a piece along an edge where it is measured; NaN where it has none."""
    from scipy.interpolate import BSpline

    rounding = 1e-9  # of the longest derivatives' product: below it, as on an edge without length, there is no normal
    here, following = net.swapaxes(0, axis)[[last, (1, -2)[last]]]
    edge = BSpline(splines.knots, here, splines.degree)
    values = edge(splines.along)
    points = values[:, :3] / values[:, 3:]
    # Derivatives of rational points, but for a positive factor, which directions do not need.
    inwards = BSpline(splines.knots, (following - here) * (1, -1)[last], splines.degree)
    rates = [spline(splines.along) for spline in (edge.derivative(), inwards)]
    along, across = (rate[:, :3] - points * rate[:, 3:] for rate in rates)
    normals = np.cross(along, across) * (-1, 1)[axis]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    least = rounding * np.linalg.norm(along, axis=1).max() * np.linalg.norm(across, axis=1).max()
    return np.asarray(np.where(lengths > least, normals / np.where(lengths > 0, lengths, 1.0), np.nan))


def _largest_angle(one: FloatArray, other: FloatArray) -> float:
    """Return the largest angle in degrees between (n, 3) unit normals, but for those that are NaN."""
    return float(np.nan_to_num(angles_between(one, other)).max())
