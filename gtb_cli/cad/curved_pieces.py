"""Polar pieces changed so that they meet the curvature of a part's faces, and their own varies as little as it can.

Near a surface, the second fundamental form is linear in moves of its poles along normals, as metric and connection stay
as they are. So a few rounds of least squares bring the forms of near places together, and those at edges to the part's.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, unit
from gtb_cli.cad.spline_pieces import Splines, grid
from gtb_cli.errors import DomainError

ROUNDS, SMALL = 8, 5e-4  # of least squares, as long as poles move by more than a share of the size
ANGLES, JUMPS, BENDS = 1e6, 3e2, 1e3  # weights of conditions at seams and edges beside the variation of forms
RIDGE = 1e-11  # share of the diagonal, beyond its rounding
SLIDE = 100.0  # that of moves along the surface, which only poles next but one to edges make

_Rows = tuple[int, FloatArray]
_Moves = list[tuple[IntArray, FloatArray]]


class CurvedEdge(NamedTuple):
    """What a polar piece meets along an edge, where its conditions are: (n, 3) unit normals, (n, 3, 3) forms or None.

    The pieces have these normals there already.
    """

    normals: FloatArray
    forms: FloatArray | None


class _Places:
    """Places of a piece, at which derivatives and second forms are given by rows: linear in its poles."""

    def __init__(self, net: FloatArray, splines: tuple[Splines, Splines], places: FloatArray) -> None:
        from scipy.interpolate import BSpline

        s, t = (
            [BSpline(each.knots, np.eye(len(each.greville)), each.degree)(x, order) for order in range(3)]
            for each, x in zip(splines, places.T, strict=True)
        )
        orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        tables = [np.einsum("ni,nj->nij", s[i], t[j]).reshape(len(places), -1) for i, j in orders]
        poles, weights = net[..., :3].reshape(-1, 3), net[..., 3].ravel()
        w = [(table @ weights)[:, None] for table in tables]
        values = tables[0] / w[0]
        self.rates = [(tables[k] - values * w[k]) / w[0] for k in (1, 2)]
        self.points = values @ poles
        self.along, self.across = (rate @ poles for rate in self.rates)
        self.normals = unit(np.cross(self.along, self.across))
        self.parts = np.linalg.inv(np.stack([self.along, self.across, self.normals], axis=2))[:, :2]  # of vectors
        self.seconds = []
        for k, (i, j) in ((3, (0, 0)), (4, (0, 1)), (5, (1, 1))):
            second = (tables[k] - self.rates[i] * w[1 + j] - self.rates[j] * w[1 + i] - values * w[k]) / w[0]
            a, b = np.einsum("nij,nj->in", self.parts, second @ poles)[..., None]
            self.seconds.append(second - a * self.rates[0] - b * self.rates[1])

    def form(self, one: FloatArray, other: FloatArray, chosen: IntArray | slice = slice(None)) -> FloatArray:
        """Return (n, 3 m) rows of the second forms of pairs of (n, 3) tangent vectors at chosen places."""
        a, b = (np.einsum("nij,nj->in", self.parts[chosen], each)[..., None] for each in (one, other))
        shares = a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]
        rows = np.sum([share * second[chosen] for share, second in zip(shares, self.seconds, strict=True)], axis=0)
        return np.asarray((rows[..., None] * self.normals[chosen][:, None]).reshape(len(rows), -1))

    def slopes(self, axis: int, tangents: FloatArray, normals: FloatArray) -> FloatArray:
        """Return (n, 3 m) rows of heights over planes, per length square to a seam with these tangents."""
        across, along = (self.along, self.across)[axis], (self.across, self.along)[axis]
        length = (across * np.cross(normals, tangents)).sum(axis=1, keepdims=True)
        slant = (across * tangents).sum(axis=1, keepdims=True) / (along * tangents).sum(axis=1, keepdims=True)
        rows = (self.rates[axis] - slant * self.rates[1 - axis]) / length
        return np.asarray((rows[..., None] * normals[:, None]).reshape(len(rows), -1))


class _Squares:
    """Normal equations for moves of the poles of nets."""

    def __init__(self, nets: list[FloatArray], moves: _Moves, costs: FloatArray, wanted: FloatArray) -> None:
        self.nets, self.moves, self.matrix, self.wanted = nets, moves, np.diag(costs), wanted

    def add(self, weight: float, parts: Sequence[_Rows], target: FloatArray | float = 0.0) -> None:
        """Add the mean square, with a weight, of what sums of rows of some nets lack of a target."""
        columns = np.unique(np.concatenate([self.moves[p][0] for p, _ in parts]))
        lacks = np.zeros(len(parts[0][1])) + target
        total = np.zeros((len(lacks), len(columns)))
        for p, rows in parts:
            numbers, table = self.moves[p]
            lacks -= rows @ self.nets[p][..., :3].ravel()
            total[:, np.searchsorted(columns, numbers)] += rows @ table
        self.matrix[np.ix_(columns, columns)] += total.T @ total * (weight**2 / len(lacks))
        self.wanted[columns] += total.T @ lacks * (weight**2 / len(lacks))


def curve_pieces(
    nets: list[FloatArray], splines: tuple[Splines, Splines], edges: Sequence[tuple[CurvedEdge, CurvedEdge]]
) -> None:
    """Change r polar nets, each between two edges, and the r nets round the centre, so that they meet these edges.

    Edges, tangent planes along them and corners stay exactly as they are.
    """
    from scipy.linalg import cho_factor, cho_solve

    half = splines[0]
    kinds = [splines] * len(edges) + [(half, half)] * len(edges)
    moves, costs = _moves(nets, kinds)
    moved = np.zeros(len(costs))
    for _ in range(ROUNDS):
        squares = _Squares(nets, moves, costs, -costs * moved * (costs > 1))
        for p, (net, kind) in enumerate(zip(nets, kinds, strict=True)):
            _add_variation(squares, p, _Places(net, kind, grid(kind[0].fitted, kind[1].fitted)), kind)
        for k, pair in enumerate(edges):
            for end, edge in zip((0.0, 1.0), pair, strict=True):
                if edge.forms is not None:
                    places = _Places(nets[k], splines, grid(half.conditions, np.array([end])))
                    towards = unit(np.cross(edge.normals, places.along))
                    wanted = np.einsum("ni,nij,nj->n", towards, edge.forms, towards)
                    squares.add(BENDS, [(k, places.form(towards, towards))], wanted)
        for sides in _seams(half.conditions, len(edges)):
            (p, one, axis), (q, other, last) = ((p, _Places(nets[p], kinds[p], at), axis) for p, at, axis in sides)
            tangents, normals = unit((one.across, one.along)[axis]), one.normals + other.normals
            normals = unit(normals - (normals * tangents).sum(axis=1, keepdims=True) * tangents)
            towards = np.cross(normals, tangents)
            slopes = one.slopes(axis, tangents, normals), other.slopes(last, tangents, normals)
            squares.add(ANGLES, [(p, slopes[0]), (q, -slopes[1])])
            squares.add(JUMPS, [(p, one.form(towards, towards)), (q, -other.form(towards, towards))])
        squares.matrix[np.diag_indices_from(squares.matrix)] *= 1 + RIDGE
        try:
            step = cho_solve(cho_factor(squares.matrix), squares.wanted)
        except (np.linalg.LinAlgError, ValueError):
            raise DomainError("least squares of its curvature have no solution") from None
        moved += step
        for net, (numbers, table) in zip(nets, moves, strict=True):
            net[..., :3] += (table @ step[numbers]).reshape(net[..., :3].shape)
        if np.abs(step).max() < SMALL:
            break


def _add_variation(squares: _Squares, p: int, places: _Places, splines: tuple[Splines, Splines]) -> None:
    """Add the integral of the squared derivative of the second form, from differences of neighbouring places."""
    shape = len(splines[0].fitted), len(splines[1].fitted)
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    areas = np.linalg.norm(np.cross(places.along, places.across), axis=1)
    areas *= np.outer(*(np.gradient(each.fitted) for each in splines)).ravel()
    for axis in (0, 1):
        a, b = np.delete(numbers, -1, axis).ravel(), np.delete(numbers, 0, axis).ravel()
        e, f = _frames(unit(places.normals[a] + places.normals[b])).swapaxes(0, 1)
        scale = np.sqrt((areas[a] + areas[b]) / 2) / np.linalg.norm(places.points[a] - places.points[b], axis=1)
        if p < len(squares.nets) // 2:  # towards the pole forms may depend on the direction only
            s = np.repeat(splines[0].fitted, shape[1])
            scale *= np.minimum(s[a], s[b])
        for one, other, factor in ((e, e, 1.0), (e, f, np.sqrt(2)), (f, f, 1.0)):
            rows = places.form(one, other, b) - places.form(one, other, a)
            squares.add(np.sqrt(len(rows)), [(p, rows * (factor * scale)[:, None])])


def _seams(x: FloatArray, r: int) -> list[list[tuple[int, FloatArray, int]]]:
    """Return the two sides of each seam: nets, the same places in both, and axes across."""
    zero, one = np.zeros(1), np.ones(1)
    found = []
    for k in range(r):
        here, before = r + k, r + (k - 1) % r
        found.append([(k, grid(one, x / 2), 0), (here, grid(zero, x), 0)])
        found.append([(k, grid(one, 1 - x / 2), 0), (before, grid(x, zero), 1)])
        found.append([(here, grid(x, one), 1), (before, grid(one, x), 0)])
    return found


def _frames(normals: FloatArray) -> FloatArray:
    """Return (n, 2, 3) orthonormal vectors square to normals."""
    e = unit(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
    return np.stack([e, np.cross(normals, e)], axis=1)


def _moves(nets: list[FloatArray], kinds: list[tuple[Splines, Splines]]) -> tuple[_Moves, FloatArray]:
    """Return for each net the numbers of variables that move it, and (3 m, c) moves of its poles; and their costs.

    Each pole of a polar net that is neither at its corner or edges nor next to them has a variable along its normal;
    those next to these have two more. So has each pole inside the other nets, and of seams, which nets share.
    """
    from scipy.interpolate import BSpline

    half, whole = kinds[0]
    r, m, n = len(nets) // 2, len(half.greville), len(whole.greville)
    sizes = np.array([(m - 3) * (n - 4), n - 4, (m - 2) ** 2, m - 2])  # of polar nets, their seams, others, spokes
    ends = np.cumsum(sizes)
    halves = [
        half.curve(BSpline(whole.knots, np.eye(n), whole.degree)(x)[:, 2:-2])
        for x in (half.greville / 2, 1 - half.greville / 2)
    ]
    tables = [np.zeros((*net.shape[:2], r * ends[-1] + 1)) for net in nets]
    for k in range(r):
        inside, seam, middle, spoke = np.split(k * ends[-1] + np.arange(ends[-1]), ends[:-1])
        polar, here, before = tables[k], tables[r + k], tables[r + (k - 1) % r]
        i, j = np.indices((m - 3, n - 4))
        polar[i + 2, j + 2, inside.reshape(i.shape)] = 1
        polar[-1, 2:-2, seam] = np.eye(n - 4)
        i, j = np.indices((m - 2, m - 2))
        here[i + 1, j + 1, middle.reshape(i.shape)] = 1
        here[0][:, seam], before[:, 0][:, seam] = halves
        here[1:-1, -1, spoke] = before[-1, 1:-1, spoke] = np.eye(m - 2)
        here[-1, -1, -1] = 1
    towards = np.zeros((r * ends[-1] + 1, 3))
    slides = np.zeros(len(towards), dtype=bool)
    for p, (net, kind, table) in enumerate(zip(nets, kinds, tables, strict=True)):
        off_pole = grid(*(np.maximum(each.greville, 1e-3) for each in kind))
        rows, numbers = np.nonzero(table.reshape(-1, len(towards)) == 1)
        towards[numbers] = _Places(net, kind, off_pole).normals[rows]
        if p < r:
            slides |= (table[:, [2, -3]] == 1).any(axis=(0, 1))
    vectors = np.concatenate([towards[:, None], _frames(towards)], axis=1)
    free = np.stack([np.ones(len(towards), dtype=bool), slides, slides], axis=1)
    names = np.cumsum(free).reshape(free.shape) - 1
    found = []
    for table in (each.reshape(-1, len(towards)) for each in tables):
        columns = np.flatnonzero(table.any(axis=0))
        moves = np.einsum("mc,cdx->mxcd", table[:, columns], vectors[columns])
        found.append((names[columns][free[columns]], moves[:, :, free[columns]].reshape(3 * len(table), -1)))
    return found, np.where(np.arange(3) > 0, SLIDE**2, np.ones((len(free), 1)))[free]
