"""Patches with smooth corners as B-spline pieces: a polar one at each corner, and ordinary ones round the centre.

At a corner of 180° a rectangle has no normal, and where the neighbours' curvatures jump none is smooth. A polar piece has
the corner as a side without length, and there any curvature that depends on the direction.
"""

from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, unit
from gtb_cli.cad.half_edges import HalfEdge
from gtb_cli.cad.part_borders import Border
from gtb_cli.cad.pieces import (
    EDGES,
    FittedPieces,
    Piece,
    Splines,
    edge_normals,
    fit_inside,
    grid,
    largest_angle,
    normals_at,
    points_at,
    surface_of,
)
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch

DEGREE, TURNS = 7, 5  # of pieces, and of normals along seams
CONDITIONS = 8  # on planes in each span, enough for normals not to waver between
SHARE = 30.0  # of planes beside positions


class _Way(NamedTuple):
    """A curve through a place: its derivative, unit normal, n · second derivative, and derivative of normals."""

    rate: FloatArray
    normal: FloatArray
    bend: float
    turn: FloatArray


class _Seam:
    """A curve between pieces and the normals along it, splines near those of the patch, with poles that are given."""

    def __init__(self, splines: Splines, points: FloatArray, normals: FloatArray) -> None:
        self.splines, self.turns = splines, Splines(TURNS, np.array([0.0, 1.0]))
        self.given = points, normals
        self.poles, self.arrows = ({k: rows[k] for k in (0, -1)} for rows in self.given)
        self.fit()
        for pole, end in ((1, 0), (-2, -1)):  # the curve starts in the tangent plane
            normal = normals[end]
            self.poles[pole] = self.curve[pole] - normal * (normal @ (self.curve[pole] - points[end]))
        self.fit()

    def fit(self) -> None:
        """Fit what is not given."""
        self.curve = _least(self.splines, PLACES, self.given[0], self.poles)
        self.normals = _least(self.turns, PLACES, self.given[1], self.arrows)

    def at(self, x: float, sign: int = 1) -> _Way:
        """Return the way along it, or with sign −1 back, through its point at a parameter."""
        spline, arrow = _spline(self.splines, self.curve), _spline(self.turns, self.normals)
        rate, second, n = spline(x, 1), spline(x, 2), arrow(x)
        slant = n @ rate / (rate @ rate)
        length = np.linalg.norm(n - slant * rate)
        normal = (n - slant * rate) / length
        return _Way(sign * rate, normal, normal @ second, sign * (arrow(x, 1) - slant * second) / length)

    def field(self, x: FloatArray) -> FloatArray:
        """Return (n, 3) unit normals at parameters, square to the curve."""
        rates, normals = unit(_spline(self.splines, self.curve)(x, 1)), _spline(self.turns, self.normals)(x)
        return unit(normals - (normals * rates).sum(axis=1, keepdims=True) * rates)

    def bent(self, end: int, form: FloatArray) -> None:
        """Take a second fundamental form, (3, 3), at an end: normals turn, and the curve bends, as it says."""
        way = self.at(-end, (1, -1)[end])
        turned = (1, -2)[end]
        self.arrows[turned] = way.normal - form @ way.rate / self.turns.slopes[end]
        third, knots = (2, -3)[end], np.unique(self.splines.knots)
        first = knots[1] - knots[0] if end == 0 else knots[-1] - knots[-2]
        second = knots[2] - knots[0] if end == 0 else knots[-1] - knots[-3]
        lacking = way.rate @ form @ way.rate - way.bend
        self.poles[third] = self.curve[third] + way.normal * (
            lacking * first * second / (self.splines.degree * (self.splines.degree - 1))
        )


PLACES = (1 - np.cos(np.pi * np.arange(81) / 80)) / 2  # where seams are fitted


def polar_pieces(patch: Patch, name: str, spans: int, halves: list[list[HalfEdge] | None], borders: list[Border | None]) -> FittedPieces:
    """Fit a patch by a polar piece at each corner, out to the middles of its edges, and as many pieces round the centre.

    Pieces agree at seams with normals of their own, near the patch's: where seams meet, one second fundamental form
    says how all bend, so that no conditions contradict. `error` is the largest distance along normals.

    A `DomainError` says that the patch has no normal at a corner or a seam.
    """
    v = patch.domain.vertices
    r = len(v)
    radial, half, whole = (
        Splines(DEGREE, np.linspace(0.0, 1.0, count + 1), CONDITIONS) for count in (spans, spans, 2 * spans)
    )
    pairs = [pair or (None, None) for pair in halves]
    ends = np.array([0.5 if pair[0] is None else pair[0].end for pair in pairs])[:, None]
    middles, center = (1 - ends) * v + ends * np.roll(v, -1, axis=0), v.mean(axis=0)
    between = (middles + np.roll(middles, 1, axis=0)) / 2  # of the middles: places of seams
    polar = [
        Piece(np.array([[v[k], v[k]], [middles[k], middles[k - 1]]]), k, (k, None, (k - 1) % r), (pairs[k][0], None, pairs[k - 1][1]), (borders[k], None, borders[k - 1]))
        for k in range(r)
    ]
    inner = [Piece(np.array([[middles[k], between[k]], [between[(k + 1) % r], center]])) for k in range(r)]
    points = patch.evaluate(v)
    origin, size = (points.min(axis=0) + points.max(axis=0)) / 2, float(np.ptp(points, axis=0).max())
    zero, one = np.zeros(1), np.ones(1)
    lines = [grid(radial.greville, zero), grid(radial.greville, one), grid(one, PLACES)]
    edges = [grid(radial.conditions, zero), grid(radial.conditions, one)]
    measured = [grid(radial.along[1:], zero), grid(radial.along[1:], one)]
    grids = [[grid(s.fitted, t.fitted), grid(s.between, t.between)] for s, t in ((radial, whole), (half, half))]
    first, last, curves, *polar_points = points_at(patch, polar, [*lines, *grids[0]])
    corners, turns, *planes, one_side, other_side, polar_normals = normals_at(
        patch, polar, [np.zeros((1, 2)), lines[2], *edges, *measured, grids[0][1]]
    )
    rows, *inner_points = points_at(patch, inner, [grid(PLACES, one), *grids[1]])
    row_turns, inner_normals = normals_at(patch, inner, [grid(PLACES, one), grids[1][1]])
    if not all(np.isfinite(each).all() for each in (corners, turns, row_turns, *planes)):
        raise DomainError("has no normal at a corner or seam")
    nets = [_polar_net(piece, radial, whole, [(rim[k] - origin) / size for rim in (first, last)]) for k, piece in enumerate(polar)]
    outer = [_Seam(whole, (curves[k] - origin) / size, turns[k]) for k in range(r)]  # from side k to the one before
    for k in range(r):
        meeting = (outer[k], 0), (outer[(k + 1) % r], -1)
        form = _form([_edge_way(nets[k][:, 0], radial, planes[0][k], turns[k][0])], meeting)
        for seam, end in meeting:
            seam.bent(end, form)
    for seam in outer:
        seam.fit()
    spokes = []  # from the middles of seams to the centre
    for k in range(r):
        known = outer[k].at(0.5)
        start = _spline(whole, outer[k].curve)(0.5)
        # t = 1 of inner piece k: from between[k] to the centre
        spoke = _Seam(half, np.vstack([start, (rows[k][1:] - origin) / size]), np.vstack([known.normal, row_turns[k][1:]]))
        spoke.bent(0, _form([known], [(spoke, 0)]))
        spoke.fit()
        spokes.append(spoke)
    form = _form([], [(spoke, -1) for spoke in spokes])
    for spoke in spokes:
        spoke.bent(-1, form)
        spoke.fit()
    error = gap = bend = angle = 0.0
    surfaces = []
    for k, net in enumerate(nets):
        net[-1, :, :3] = outer[k].curve
        tips = np.tile(corners[k], (len(whole.conditions), 1))
        sides = [plane[k] / radial.conditions[:, None] for plane in planes]  # derivatives there grow with the distance
        conditions = [sides[0], tips, sides[1], outer[k].field(whole.conditions)]
        fit_inside(net, (radial, whole), (polar_points[0][k] - origin) / size, conditions, SHARE, 1 / radial.fitted)
        n, tip = corners[k][0], net[0, 0, :3]
        net[1, :, :3] -= np.outer((net[1, :, :3] - tip * net[1, :, 3:]) @ n, n)
    inner_nets = []
    for k in range(r):
        net = np.zeros((len(half.greville), len(half.greville), 4))
        net[..., 3] = 1.0
        net[:, 0, :3] = half.curve(_spline(whole, outer[(k + 1) % r].curve)(1 - half.greville / 2))
        net[0, :, :3] = half.curve(_spline(whole, outer[k].curve)(half.greville / 2))
        net[:, -1, :3], net[-1, :, :3] = spokes[k].curve, spokes[(k + 1) % r].curve
        places = half.conditions
        fit_inside(
            net,
            (half, half),
            (inner_points[0][k] - origin) / size,
            [outer[(k + 1) % r].field(1 - places / 2), outer[k].field(places / 2), spokes[k].field(places), spokes[(k + 1) % r].field(places)],
            SHARE,
        )
        inner_nets.append(net)
    joints = 20 * spans
    normals = [[edge_normals(net, axis, last, half) for axis, last in EDGES] for net in inner_nets]
    for k, net in enumerate(nets):
        tip = edge_normals(np.stack([net[1], 2 * net[1] - net[0]]), *EDGES[1], whole)  # 180° off where the corner folds
        angle = max(
            angle,
            largest_angle(edge_normals(net, *EDGES[0], radial)[1:], one_side[k]),
            largest_angle(edge_normals(net, *EDGES[2], radial)[1:], other_side[k]),
            largest_angle(tip, corners[k]),
        )
        seam = edge_normals(net, *EDGES[3], whole)
        bend = max(
            bend,
            largest_angle(seam[: joints + 1], normals[k][1]),
            largest_angle(seam[joints:][::-1], normals[k - 1][0]),
            largest_angle(normals[k][3], normals[(k + 1) % r][2]),
        )
    for pieces, found, splines, between_points, faces in (
        (polar, nets, (radial, whole), polar_points[1], polar_normals),
        (inner, inner_nets, (half, half), inner_points[1], inner_normals),
    ):
        values = [each.values(each.between) for each in splines]
        for k, net in enumerate(found):
            here = np.einsum("si,tj,ijx->stx", *values, net, optimize=True).reshape(-1, 4)
            away = here[:, :3] / here[:, 3:] * size + origin - between_points[k]
            error = max(error, float(np.abs((away * faces[k]).sum(axis=1)).max()))
            surface, apart = surface_of(name, pieces[k], net, splines, origin, size)
            surfaces.append(surface)
            gap = max(gap, apart)
    return FittedPieces(tuple(surfaces), error, gap, bend, angle, 0.0)


def _polar_net(piece: Piece, radial: Splines, whole: Splines, rims: list[FloatArray]) -> FloatArray:
    """Return the homogeneous poles of a polar piece on its corner and edges, and all weights."""
    weights = piece.weights(grid(radial.greville, whole.greville)).reshape(len(radial.greville), -1)
    net = np.zeros((*weights.shape, 4))
    net[..., 3] = whole.curve(radial.curve(weights).T).T
    for row, rim in zip((0, -1), rims, strict=True):
        here = weights[:, row, None]
        net[:, row] = radial.curve(np.hstack([rim * here, here]))
    net[0, :, :3] = net[0, 0, :3]
    return net


def _edge_way(rows: FloatArray, radial: Splines, normals: FloatArray, normal: FloatArray) -> _Way:
    """Return the way of an edge at its middle, where its rational curve ends."""
    spline, turns = _spline(radial, rows), _spline(radial, _least(radial, radial.conditions, normals, {}))
    (*point, _), (*rate, weight) = spline(1.0), spline(1.0, 1)
    way, turn = np.array(rate) - weight * np.array(point), turns(1.0, 1)
    return _Way(way, normal, -turn @ way, turn)


def _form(known: list[_Way], seams: list[tuple[_Seam, int]]) -> FloatArray:
    """Return the second fundamental form, (3, 3), of known ways through a place, and nearest to seams that end there."""
    much = 1e6  # weight of what is known
    ways = [(much, way) for way in known] + [(1.0, seam.at(-end, (1, -1)[end])) for seam, end in seams]
    normal = ways[0][1].normal
    frame = np.linalg.svd(normal[None])[2][1:]
    rows, wanted = [], []
    for weight, way in ways:
        x, y = frame @ way.rate
        rows += [[weight * x * x, weight * 2 * x * y, weight * y * y], [-weight * x * y, weight * (x * x - y * y), weight * x * y]]
        wanted += [weight * way.bend, -weight * way.turn @ ([-y, x] @ frame)]
    a, b, c = np.linalg.lstsq(np.array(rows), np.array(wanted))[0]
    return np.asarray(frame.T @ [[a, b], [b, c]] @ frame)


def _least(splines: Splines, places: FloatArray, rows: FloatArray, given: dict[int, FloatArray]) -> FloatArray:
    """Return the poles that fit rows at places best, some of them given."""
    values = splines.values(places)
    poles = np.zeros((values.shape[1], rows.shape[1]))
    for k, pole in given.items():
        poles[k] = pole
    free = np.delete(np.arange(len(poles)), list(given))
    poles[free] = np.linalg.lstsq(values[:, free], rows - values @ poles)[0]
    return poles


def _spline(splines: Splines, poles: FloatArray) -> "BSpline":
    from scipy.interpolate import BSpline

    return BSpline(splines.knots, poles, splines.degree)
