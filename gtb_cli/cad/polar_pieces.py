"""Patches with smooth corners as B-spline pieces: a polar one at each corner, and as many others round the centre.

At a corner of 180° a rectangle has no normal, and no smooth one has the curvatures of both sides. A polar piece has the
corner as a side without length, and there normals at once and any curvature that depends on the direction.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, unit
from gtb_cli.cad import spline_pieces
from gtb_cli.cad.curved_pieces import curve_pieces
from gtb_cli.cad.spline_pieces import (
    EDGES,
    Borders,
    FittedPieces,
    Halves,
    Piece,
    SplinePair,
    Splines,
    grid,
    largest_angle,
    normals_along,
    normals_at,
)
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch

DEGREE, TURNS = 7, 5  # of pieces, and of normals along seams
PLACES = (1 - np.cos(np.pi * np.arange(81) / 80)) / 2  # where seams are fitted


class _Way(NamedTuple):
    """A curve through a place: its derivative, unit normal, n · second derivative, and derivative of normals."""

    rate: FloatArray
    normal: FloatArray
    bend: float
    turn: FloatArray


class _Seam:
    """A curve between pieces and the normals along it: splines near the patch's, with poles that are given."""

    def __init__(self, splines: Splines, points: FloatArray, normals: FloatArray) -> None:
        self.splines, self.turns = splines, Splines(TURNS, np.array([0.0, 1.0]))
        self.rows = points, normals
        self.poles, self.arrows = ({end: rows[end] for end in (0, -1)} for rows in self.rows)
        self.fit()
        for pole, end in ((1, 0), (-2, -1)):  # it starts in the tangent plane
            self.poles[pole] = self.curve[pole] - normals[end] * (normals[end] @ (self.curve[pole] - points[end]))
        self.fit()

    def fit(self) -> None:
        """Fit what is not given."""
        self.curve = _least(self.splines, PLACES, self.rows[0], self.poles)
        self.normals = _least(self.turns, PLACES, self.rows[1], self.arrows)
        self.points, self.arrow = self.splines.spline(self.curve), self.turns.spline(self.normals)

    def field(self, x: FloatArray) -> FloatArray:
        """Return (n, 3) unit normals at parameters, square to the curve."""
        rates, normals = unit(self.points(x, 1)), self.arrow(x)
        return unit(normals - (normals * rates).sum(axis=1, keepdims=True) * rates)

    def at(self, x: float, sign: int = 1) -> _Way:
        """Return the way along it, or with sign −1 back, through its point at a parameter."""
        rate, second, normal = self.points(x, 1), self.points(x, 2), self.arrow(x)
        slant = normal @ rate / (rate @ rate)
        length = np.linalg.norm(normal - slant * rate)
        normal, turn = (normal - slant * rate) / length, (self.arrow(x, 1) - slant * second) / length
        return _Way(sign * rate, normal, float(normal @ second), sign * turn)

    def bent(self, end: int, form: FloatArray) -> None:
        """Take a second fundamental form, (3, 3), at an end: normals turn, and the curve bends, as it says."""
        way, degree = self.at(-end, (1, -1)[end]), self.splines.degree
        self.arrows[(1, -2)[end]] = way.normal - form @ way.rate / self.turns.slopes[end]
        first, second = np.abs(np.unique(self.splines.knots)[[1, 2] if end == 0 else [-2, -3]] + end)
        lacking = (way.rate @ form @ way.rate - way.bend) * first * second / (degree * (degree - 1))
        third = (2, -3)[end]
        self.poles[third] = self.curve[third] + way.normal * lacking


_Stretch: TypeAlias = tuple[_Seam, float, float]  # of a seam, from one of its parameters to another


def polar_pieces(patch: Patch, name: str, spans: int, halves: Halves, borders: Borders) -> FittedPieces:
    """Fit a patch by a polar piece at each corner, out to the middles of its edges, and as many round the centre.

    Seams have normals of their own, near the patch's; where they meet, one second fundamental form says how all turn
    and bend, so that no conditions contradict. Edges are the borders of a part, or as in `fitted_pieces`. Of what is
    measured, `error` is along normals, or the share of curvature that is missed where borders have forms, which pieces
    leave the patch to meet. A `DomainError` says that the patch has no normal at a corner or seam.
    """
    v = patch.domain.vertices
    r = len(v)
    half, whole = (Splines(DEGREE, np.linspace(0.0, 1.0, count + 1), conditions=8) for count in (spans, 2 * spans))
    polar, middles = spline_pieces.corner_pieces(patch, halves, borders, is_polar=True)
    joints = (middles + np.roll(middles, 1, axis=0)) / 2
    inner = [Piece(np.array([[middles[k], joints[k]], [joints[(k + 1) % r], v.mean(axis=0)]])) for k in range(r)]
    corners = patch.evaluate(v)
    origin, size = (corners.min(axis=0) + corners.max(axis=0)) / 2, float(np.ptp(corners, axis=0).max())
    zero, one = np.zeros(1), np.ones(1)
    grids = [[grid(s.fitted, t.fitted), grid(s.between, t.between)] for s, t in ((half, whole), (half, half))]
    rims = [grid(half.greville, zero), grid(half.greville, one), grid(one, PLACES)]
    *sides, curves, fitted, between = spline_pieces.points_at(patch, polar, [*rims, *grids[0]])
    edges = [grid(each, end) for each in (half.conditions, half.along) for end in (zero, one)]
    *planes, tips, turns, faces = normals_at(patch, polar, [*edges, np.zeros((1, 2)), rims[2], grids[0][1]])
    lines, *more = spline_pieces.points_at(patch, inner, [grid(PLACES, one), *grids[1]])
    line_turns, more_faces = normals_at(patch, inner, [grid(PLACES, one), grids[1][1]])
    if not all(np.isfinite(each).all() for each in (*planes, tips, turns, line_turns)):
        raise DomainError("has no normal at a corner or seam")
    nets = []
    for piece, first, last in zip(polar, *((side - origin) / size for side in sides), strict=True):
        nets.append(spline_pieces.framed(piece, (half, whole), [(0, first), (2, last)]))
        nets[-1][0] = nets[-1][0, 0]
    outer = [_Seam(whole, (curves[k] - origin) / size, turns[k]) for k in range(r)]  # from side k to the one before
    for k in range(r):
        _bend([_edge_way(nets[k][:, 0], half, planes[0][k], turns[k][0])], [(outer[k], 0), (outer[(k + 1) % r], -1)])
    spokes = []  # from the middles of outer seams to the centre
    for seam, line, line_normals in zip(outer, lines, line_turns, strict=True):
        seam.fit()
        middle, rows = seam.at(0.5), (line - origin) / size
        rows[0], line_normals[0] = seam.points(0.5), middle.normal
        spokes.append(_Seam(half, rows, line_normals))
        _bend([middle], [(spokes[-1], 0)])
    _bend([], [(spoke, -1) for spoke in spokes])
    for spoke in spokes:
        spoke.fit()
    for k, net in enumerate(nets):
        tip = tips[k, 0]
        known = [planes[0][k] / half.conditions[:, None], np.tile(tip, (len(whole.conditions), 1))]
        known.append(planes[1][k] / half.conditions[:, None])  # as derivatives there grow with the distance
        _fit(net, (half, whole), (fitted[k] - origin) / size, [(outer[k], 0, 1)], known)
        net[1, :, :3] -= np.outer((net[1, :, :3] - net[0, :, :3] * net[1, :, 3:]) @ tip, tip)
    for k in range(r):
        around = [(outer[(k + 1) % r], 1, 0.5), (outer[k], 0, 0.5), (spokes[k], 0, 1), (spokes[(k + 1) % r], 0, 1)]
        nets.append(np.ones((len(half.greville), len(half.greville), 4)))
        nets[-1][..., :3] = 0.0
        _fit(nets[-1], (half, half), (more[0][k] - origin) / size, around, [])
    forms = [spline_pieces.forms_at(patch, piece, grid(half.conditions, end)) for piece in polar for end in (zero, one)]
    if curved := any(each is not None for each in forms):
        scaled = [None if form is None else form * size for form in forms]
        missed = curve_pieces(nets, (half, whole), [(planes[k % 2][k // 2], form) for k, form in enumerate(scaled)])
    angle = bend = 0.0
    faced = [[normals_along(net, *EDGES[3], whole)] for net in nets[:r]]
    faced += [[normals_along(net, *side, half) for side in EDGES] for net in nets[r:]]
    count = len(half.along)
    for k, net in enumerate(nets[:r]):
        found = [normals_along(net, *EDGES[side], half) for side in (0, 2)]
        found.append(normals_along(np.stack([net[1], 2 * net[1] - net[0]]), *EDGES[1], whole))  # 180° off if it folds
        angle = max(angle, *map(largest_angle, found, (planes[2][k], planes[3][k], tips[k, 0])))
        (rim,), before, here, after = faced[k], faced[r + (k - 1) % r], faced[r + k], faced[r + (k + 1) % r]
        bend = max(bend, largest_angle(rim[:count], here[1]), largest_angle(rim[: count - 2 : -1], before[0]))
        bend = max(bend, largest_angle(here[3], after[2]))
    made = [*zip([*polar, *inner], nets, r * [(half, whole)] + r * [(half, half)], strict=True)]
    surfaces, away, gap = spline_pieces.measured_surfaces(name, made, [*between, *more[1]], origin, size)
    pairs = zip(away, [*faces, *more_faces], strict=True)
    error = missed if curved else max(float(np.abs((each * towards).sum(axis=1)).max()) for each, towards in pairs)
    return FittedPieces(surfaces, error, gap, bend, angle, 0.0)


def _fit(
    net: FloatArray, splines: SplinePair, points: FloatArray, seams: Sequence[_Stretch], known: list[FloatArray]
) -> None:
    """Fit a piece with known normals on its first sides, if it is polar, and seams on the others.

    Near the pole positions of a polar piece weigh more.
    """
    share = 30.0  # beside positions
    sides, planes = EDGES[len(known) :], [*known]
    for (axis, last), (seam, start, end) in zip(sides, seams, strict=True):
        along = splines[1 - axis]
        net.swapaxes(0, axis)[last, :, :3] = along.curve(seam.points(start + (end - start) * along.greville))
        planes.append(seam.field(start + (end - start) * along.conditions))
    spline_pieces.fit_inside(net, splines, points, planes, share, 1 / splines[0].fitted if known else np.ones(1))


def _edge_way(poles: FloatArray, splines: Splines, normals: FloatArray, normal: FloatArray) -> _Way:
    """Return the way of an edge at its middle, where its rational curve ends."""
    spline, turns = splines.spline(poles), splines.spline(_least(splines, splines.conditions, normals, {}))
    rate, turn = spline(1.0, 1)[:3] - spline(1.0)[:3] * spline(1.0, 1)[3], turns(1.0, 1)
    return _Way(rate, normal, -turn @ rate, turn)


def _bend(known: list[_Way], seams: list[tuple[_Seam, int]]) -> None:
    """Bend seams at the ends where they meet, by the form of known ways through the place that is nearest to all."""
    much = 1e6  # weight of what is known
    ways = [(much, way) for way in known] + [(1.0, seam.at(-end, (1, -1)[end])) for seam, end in seams]
    frame = np.linalg.svd(ways[0][1].normal[None])[2][1:]
    rows, wanted = [], []
    for weight, way in ways:
        x, y = frame @ way.rate
        rows += [weight * np.array([x * x, 2 * x * y, y * y]), weight * np.array([-x * y, x * x - y * y, x * y])]
        wanted += [weight * way.bend, -weight * way.turn @ ([-y, x] @ frame)]
    a, b, c = np.linalg.lstsq(np.array(rows), np.array(wanted))[0]
    for seam, end in seams:
        seam.bent(end, frame.T @ [[a, b], [b, c]] @ frame)


def _least(splines: Splines, places: FloatArray, rows: FloatArray, given: dict[int, FloatArray]) -> FloatArray:
    """Return the poles that fit rows at places best, with some given."""
    values = splines.values(places)
    poles = np.zeros((values.shape[1], rows.shape[1]))
    for k, pole in given.items():
        poles[k] = pole
    free = np.delete(np.arange(len(poles)), list(given))
    poles[free] = np.linalg.lstsq(values[:, free], rows - values @ poles)[0]
    return poles
