"""Polar pieces changed so that they meet the curvature of a part's faces, and their own varies as little as it can.

Near a surface, the second fundamental form is linear in moves of its poles along normals, as metric and connection stay
as they are. So a few rounds of least squares bring the forms of near places together, and those at edges to the part's.
"""

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, unit
from gtb_cli.cad.spline_pieces import SplinePair, grid
from gtb_cli.errors import DomainError

ROUNDS, SETTLING = 6, 2  # of least squares; in the last ones poles move along normals only, as others waver
ANGLES = 1e6  # of planes at seams, beside the variation of forms: a tenth as much gives three times the angles, .0009°
JUMPS = 3e2  # of forms at seams, which are free: ten times as much costs angles at seams, up to .003°
BENDS = 1e3  # of forms at edges, which are given: a tenth as much leaves .4 % of the largest, and not .04 %
KEEP = 3e3  # cost of moves along normals: a tenth as much lets few spans leave the patch by 1 %, thrice costs angles
RIDGE, SLIDE, HOLD = 1e-11, 1e4, 1e14  # share of the diagonal, beyond rounding; costs of moves along the surface

# A weight, rows of some nets, and what the sum of these rows should be
_Condition: TypeAlias = tuple[float, list[tuple[int, FloatArray]], FloatArray | float]
_Edge: TypeAlias = tuple[FloatArray, FloatArray | None]  # its normals and, if they are given, its second forms


class _Places:
    """Places of a piece, at which derivatives and second forms are given by rows: linear in its poles."""

    def __init__(self, net: FloatArray, splines: SplinePair, places: FloatArray) -> None:
        s, t = ([each.values(x, order) for order in range(3)] for each, x in zip(splines, places.T, strict=True))
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
            a, b = self.shares(second @ poles)
            self.seconds.append(second - a * self.rates[0] - b * self.rates[1])

    def shares(self, vectors: FloatArray, chosen: IntArray | slice = slice(None)) -> FloatArray:
        """Return (2, n, 1) parts of vectors along both derivatives, at chosen places."""
        return np.asarray(np.einsum("nij,nj->in", self.parts[chosen], vectors)[..., None])

    def form(self, one: FloatArray, other: FloatArray, chosen: IntArray | slice = slice(None)) -> FloatArray:
        """Return (n, 3 m) rows of the second forms of pairs of (n, 3) tangent vectors at chosen places."""
        a, b = self.shares(one, chosen), self.shares(other, chosen)
        shares = a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]
        rows = np.sum([share * second[chosen] for share, second in zip(shares, self.seconds, strict=True)], axis=0)
        return np.asarray((rows[..., None] * self.normals[chosen, None]).reshape(len(rows), -1))

    def slopes(self, towards: FloatArray, normals: FloatArray) -> FloatArray:
        """Return (n, 3 m) rows of derivatives along (n, 3) tangent vectors, of heights along normals."""
        rows = (self.shares(towards) * self.rates).sum(axis=0)
        return np.asarray((rows[..., None] * normals[:, None]).reshape(len(rows), -1))


def curve_pieces(nets: list[FloatArray], splines: SplinePair, edges: Sequence[_Edge]) -> float:
    """Change r polar nets and the r nets round the centre, so that the former meet both their edges.

    Along each edge, where its conditions are, (n, 3) unit normals, which the nets have already, and (n, 3, 3) forms, if
    any, are given. Edges, tangent planes along them and corners stay exactly as they are. Return what is missed
    of curvatures across edges, as a share of the largest or of 1 / size.
    """
    from scipy.linalg import cho_factor, cho_solve

    kinds = [splines] * (len(nets) // 2) + [splines[:1] * 2] * (len(nets) // 2)
    moves, costs = _moves(nets, kinds)
    moved, missed, largest = np.zeros(len(costs)), np.inf, 1.0
    for number in range(ROUNDS):
        held = HOLD * (costs > KEEP) * (number >= ROUNDS - SETTLING)
        matrix, wanted, missed, largest = np.diag(costs + held), -costs * moved, 0.0, 1.0
        for weight, parts, target in _conditions(nets, kinds, edges):
            lacks = target - np.sum([rows @ nets[p][..., :3].ravel() for p, rows in parts], axis=0)
            if weight == BENDS:
                missed, largest = (max(a, float(np.abs(b).max())) for a, b in ((missed, lacks), (largest, target)))
            total = np.sum([rows @ moves[p] for p, rows in parts], axis=0)
            columns = np.flatnonzero(total.any(axis=0))
            total = total[:, columns]
            matrix[np.ix_(columns, columns)] += total.T @ total * (weight**2 / len(total))
            wanted[columns] += total.T @ lacks * (weight**2 / len(total))
        matrix[np.diag_indices_from(matrix)] *= 1 + RIDGE
        try:
            step = cho_solve(cho_factor(matrix), wanted)
        except (np.linalg.LinAlgError, ValueError):
            raise DomainError("least squares of its curvature have no solution") from None
        moved += step
        for net, table in zip(nets, moves, strict=True):
            net[..., :3] += (table @ step).reshape(net[..., :3].shape)
    return missed / largest


def _conditions(nets: list[FloatArray], kinds: list[SplinePair], edges: Sequence[_Edge]) -> Iterator[_Condition]:
    """Yield conditions of forms inside, which vary little, at edges, and of slopes and forms at seams."""
    half = kinds[0][0]
    for p, (net, kind) in enumerate(zip(nets, kinds, strict=True)):
        yield from _variation(p, _Places(net, kind, grid(kind[0].fitted, kind[1].fitted)), kind, p < len(nets) // 2)
    for number, (normals, forms) in enumerate(edges):
        if forms is not None:
            k, end = divmod(number, 2)
            places = _Places(nets[k], kinds[k], grid(half.conditions, np.array([float(end)])))
            towards = unit(np.cross(normals, places.along))
            yield BENDS, [(k, places.form(towards, towards))], np.einsum("ni,nij,nj->n", towards, forms, towards)
    for (p, at), (q, at_other) in _seams(np.concatenate([[0.0], half.conditions, [1.0]]), len(nets) // 2):
        one, other = _Places(nets[p], kinds[p], at), _Places(nets[q], kinds[q], at_other)
        towards = unit(np.cross(one.normals + other.normals, one.across))
        normals = unit(np.cross(one.across, towards))
        yield ANGLES, [(p, one.slopes(towards, normals)), (q, -other.slopes(towards, normals))], 0.0
        yield JUMPS, [(p, one.form(towards, towards)), (q, -other.form(towards, towards))], 0.0


def _variation(p: int, places: _Places, splines: SplinePair, is_polar: bool) -> Iterator[_Condition]:
    """Yield the integral of the squared derivative of the second form, from differences of neighbouring places."""
    shape = len(splines[0].fitted), len(splines[1].fitted)
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    areas = np.linalg.norm(np.cross(places.along, places.across), axis=1)
    areas *= np.outer(*(np.gradient(each.fitted) for each in splines)).ravel()
    for axis in (0, 1):
        a, b = np.delete(numbers, -1, axis).ravel(), np.delete(numbers, 0, axis).ravel()
        e, f = _frames(unit(places.normals[a] + places.normals[b])).swapaxes(0, 1)
        scale = np.sqrt((areas[a] + areas[b]) / 2) / np.linalg.norm(places.points[a] - places.points[b], axis=1)
        if is_polar:  # towards the pole forms may depend on the direction only
            s = np.repeat(splines[0].fitted, shape[1])
            scale *= np.minimum(s[a], s[b])
        for one, other, factor in ((e, e, 1.0), (e, f, np.sqrt(2)), (f, f, 1.0)):
            rows = places.form(one, other, b) - places.form(one, other, a)
            yield np.sqrt(len(rows)), [(p, rows * (factor * scale)[:, None])], 0.0


def _seams(x: FloatArray, r: int) -> Iterator[list[tuple[int, FloatArray]]]:
    """Yield the two sides of each seam: nets, and the same places in both, in the first with s = 1."""
    zero, one = np.zeros(1), np.ones(1)
    for k in range(r):
        here, before = r + k, r + (k - 1) % r
        yield [(k, grid(one, x / 2)), (here, grid(zero, x))]
        yield [(k, grid(one, 1 - x / 2)), (before, grid(x, zero))]
        yield [(before, grid(one, x)), (here, grid(x, one))]


def _frames(normals: FloatArray) -> FloatArray:
    """Return (n, 2, 3) orthonormal vectors square to normals."""
    e = unit(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
    return np.stack([e, np.cross(normals, e)], axis=1)


def _moves(nets: list[FloatArray], kinds: list[SplinePair]) -> tuple[list[Any], FloatArray]:
    """Return for each net sparse (3 m, n) moves of its poles with n variables of all nets, and the costs of these.

    Each pole of a polar net that is neither at its corner or edges nor next to them has a variable along its normal;
    those next to these have two more. So has each pole inside the other nets, and of seams, which nets share.
    """
    from scipy.sparse import csr_array

    half, whole = kinds[0]
    r, m, n = len(nets) // 2, len(half.greville), len(whole.greville)
    halves = [half.curve(whole.values(x)) for x in (half.greville / 2, 1 - half.greville / 2)]
    outer, inner = np.eye((m - 2) * (n - 4)).reshape(m - 2, n - 4, -1), np.eye((m - 2) * (m - 1))
    ends = np.cumsum([0, *(r * [outer.shape[2], len(inner)]), 1])
    tables = [np.zeros((*net.shape[:2], ends[-1])) for net in nets]
    for k in range(r):
        polar, here, before = tables[k], tables[r + k], tables[r + (k - 1) % r]
        polar[2:, 2:-2, ends[2 * k] : ends[2 * k + 1]] = outer
        here[1:-1, 1:, ends[2 * k + 1] : ends[2 * k + 2]] = inner.reshape(m - 2, m - 1, -1)
        before[-1, 1:-1] = here[1:-1, -1]
        here[0], before[:, 0] = (table @ polar[-1] for table in halves)
        here[-1, -1, -1] = 1
    towards = np.zeros((ends[-1], 3))
    slides = np.any([(table[:, [2, -3]] == 1).any(axis=(0, 1)) for table in tables[:r]], axis=0)
    for net, kind, table in zip(nets, kinds, tables, strict=True):
        off_pole = grid(*(np.maximum(each.greville, 1e-3) for each in kind))
        rows, numbers = np.nonzero(table.reshape(-1, ends[-1]) == 1)
        towards[numbers] = _Places(net, kind, off_pole).normals[rows]
    vectors = np.concatenate([towards[:, None], _frames(towards)], axis=1)
    free = np.stack([np.ones(ends[-1], dtype=bool), slides, slides], axis=1)
    found = [np.einsum("stc,cdx->stxcd", table, vectors)[..., free] for table in tables]
    costs = np.where(np.arange(3) > 0, SLIDE, KEEP * np.ones((ends[-1], 1)))[free]
    return [csr_array(each.reshape(-1, len(costs))) for each in found], costs
