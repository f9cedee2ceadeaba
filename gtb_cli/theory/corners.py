"""Limits of normals and curvatures at a corner of Δ, in closed form, and the powers of the distance that rule them.

Let x = (x, y) be the heights of a knot over the edges before and ahead of the corner, in units of the next knots on the
edges, b the way to its control point from the corner's, and W = c ω. Near the corner, as s, t → 0,

    ``P − V = Σ W_a b_a m_a / Σ W_a m_a``    with    ``m = s^x t^y``,

and derivatives by log s and log t are, up to a factor that tends to 1,

    ``P_s × P_t = Σ_{j<k} W_j W_k m_j m_k det(x_j, x_k) b_j × b_k``,
    ``⟨P_s × P_t, P_vv⟩ = Σ_{j<k<l} W_j W_k W_l m_j m_k m_l det(b_j, b_k, b_l) det[x, y, ⟨x, v⟩²]``,

where the last determinant has a row for each of the knots j, k, l. These are sums of powers. On a way s = ρ^λ₁, t =
ρ^λ₂ a term with exponents E is ρ^⟨E, λ⟩. So Newton polygons decide: terms at the vertices are limits of normals, and
terms on a side of the polygon, which is orthogonal to one λ, lead from one limit to the next.

Let i and j be the knots that lead on a way, with ν₁ ≤ ν₂ for ⟨x, λ⟩, and v, w the directions dual to x_i, x_j, so that
P_v and P_w are of the orders ρ^ν₁ and ρ^ν₂. Curvature is bounded if the orders of ⟨P_s × P_t, P_vv⟩, P_vw and P_ww are
at least 3 ν₁ + ν₂, 2 ν₁ + 2 ν₂ and ν₁ + 3 ν₂, and terms with just these orders are its limits. Else it grows like a
power of ρ, which is the difference. While i and j lead, all orders are linear in λ: the ends of such a sector suffice.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, distinct, dot, rows_of, unit
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import PARALLEL_SINE
from gtb_cli.knots.domain import Domain
from gtb_cli.theory.corner_powers import (
    AXIS,
    PLACES,
    CornerKnots,
    Powers,
    alike,
    corner_knots,
    determinants,
    exponents_at,
    newton_polygon,
    orders_on,
    subsets,
    summed,
    turning_places,
)
from gtb_cli.theory.rational_basis import Blend
from gtb_cli.values import frozen

PLANE_DEGREES = 1e-4  # angle up to which limits of normals are one, as of control points with six decimals


@frozen
class CornerLimits:
    """A surface near a corner of Δ. Made by `corner_limits`.

    Attributes
    ----------
    normals : (k, 3) float
        Limits of unit normals on ways into the corner; none if all control points are on a line.
    normal_exponent : float
        The power of the distance, up to 1, with which normals tend to a single limit on the slowest way.
    curvature : float
        Largest principal curvature, in absolute value, to which a way leads: infinite if it grows; NaN if the control
        points of the knots that lead are in line with the corner, so that nothing is known.
    curvature_exponent : float
        0 where curvature is bounded, else the negative power of the distance with which it grows; −inf along an edge.
    gaussian, mean : float
        Limits of the curvatures; NaN where different ways lead to different ones.
    folds : bool
        True if the normal turns over between two ways, but for those in a strip along an edge of no visible width.
    """

    normals: FloatArray
    normal_exponent: float = math.nan
    curvature: float = math.nan
    curvature_exponent: float = math.nan
    gaussian: float = math.nan
    mean: float = math.nan
    folds: bool = False

    @property
    def angle(self) -> float:
        """Largest angle between two limits of normals, in degrees; NaN without any."""
        if not len(self.normals):
            return math.nan
        sines = np.linalg.norm(np.cross(self.normals[:, None], self.normals), axis=2)
        return float(np.degrees(np.arctan2(sines, self.normals @ self.normals.T)).max())

    @property
    def normal(self) -> FloatArray:
        """The limit of normals, (3,); NaN if there are several, with more than `PLANE_DEGREES` between them."""
        if not self.angle <= PLANE_DEGREES:
            return np.full(3, math.nan)
        return np.asarray(unit(self.normals.sum(axis=0, keepdims=True))[0])


class _Sector(NamedTuple):
    """Ways between two λ on which one knot leads, followed by another."""

    first: int
    second: int
    ends: tuple[FloatArray, FloatArray]


def corner_limits(patch: Blend, corner: int) -> CornerLimits:
    """Return the limits of normals and curvatures at a corner of a surface, and how fast they are reached.

    Parameters
    ----------
    patch : Patch
        A surface.
    corner : int
        0 … r − 1, counter-clockwise from the lowest, then leftmost, corner of Δ.

    Returns
    -------
    CornerLimits
        ``found.normal``, ``found.angle``, ``found.curvature``, ``found.curvature_exponent`` and others.

    Raises
    ------
    DomainError
        The patch is a curve, or has no such corner.

    Notes
    -----
    Nothing is sampled but, on ways on which one limit turns into another, the largest curvature: its relative error is
    below 1e-3. Heights of knots that differ by less than 1e-9 of the size of Δ are taken as equal. Terms that vanish to
    rounding are left out, as are those that do so up to the angle between limits that are one. Not in the paper.
    """
    shape = patch.rational_basis.domain
    if shape.dimension == 1 or not 0 <= corner < len(shape.vertices):
        raise DomainError(f"corner: expected 0 … {len(shape.vertices) - 1} of a surface, got {corner}")
    return limits_at(shape, patch.rational_basis.log_weights, patch.control_points, corner)


def limits_at(domain: Domain, log_weights: FloatArray, points: FloatArray, corner: int) -> CornerLimits:
    """Return the limits of a surface with (n, 3) control points at a corner of Δ."""
    knots, extent = corner_knots(domain, log_weights, points, corner)
    found, area, pairs, rays = _normals(knots)
    sectors = _sectors(knots, pairs, rays)
    return _with_curvature(found, knots, area, sectors, extent) if sectors else found


def limits_of_normals(patch: Blend, corner: int) -> CornerLimits:
    """Return what `corner_limits` finds, but for the curvature, which takes longer."""
    basis = patch.rational_basis
    return _normals(corner_knots(basis.domain, basis.log_weights, patch.control_points, corner)[0])[0]


def _normals(knots: CornerKnots) -> tuple[CornerLimits, Powers, IntArray, list[FloatArray]]:
    """Return the limits of normals, the terms of P_s × P_t, the two knots of each limit, and the rays between."""
    area, pairs = _areas(knots)
    chain = newton_polygon(area.x, knots.gaps)
    if not len(chain):
        return CornerLimits(np.empty((0, 3))), area, pairs[:0], []
    steps = np.diff(area.x[chain], axis=0) * [-1, 1]
    rays = [np.array([AXIS, 1.0]), *(steps[:, ::-1] / steps.max(axis=1, keepdims=True)), np.array([1.0, AXIS])]
    steepest = 2.5  # ν₂ / ν₁: a hundredth of the edge from its end such a strip is 1e-5 of the edge wide, and not seen
    vertices, folds = unit(area.factors[chain]), False
    normals = [vertices[:1]]
    for ray, number, vertex in zip(rays[1:], chain[1:], vertices[1:], strict=False):
        leading = area.of_order(float(area.x[number] @ ray), ray, 4 * knots.gaps)
        places = turning_places(ray, [leading])
        turn = unit(leading.at(places, leading.logarithms(places).max(axis=0)))
        first = (knots.x[knots.points.any(axis=1)] @ ray).min()
        if area.x[number] @ ray - first <= steepest * first:
            folds |= bool(dot(turn[1:], turn[:-1]).min() <= 0 or vertex @ normals[-1][-1] <= 0)
        normals += [turn[PLACES // 16 : -1 : PLACES // 16] if len(leading.logs) > 2 else turn[:0], vertex[None]]
    return CornerLimits(np.concatenate(normals), folds=folds), area, pairs[chain], rays


def _with_curvature(
    found: CornerLimits, knots: CornerKnots, area: Powers, sectors: Sequence[_Sector], extent: float
) -> CornerLimits:
    """Add the limits of curvature, and the power with which normals tend to a single one."""
    is_plane = found.angle <= PLANE_DEGREES
    flat = max(1e-9, math.radians(found.angle)) if is_plane else PARALLEL_SINE
    unsure = knots.rounding + flat * np.linalg.norm(knots.points, axis=1)
    off = np.abs(knots.points @ found.normal) > unsure  # none without a plane
    tilt, growth, limits = 1.0, 0.0, []
    for sector, forms in zip(sectors, _forms(knots, sectors, unsure), strict=True):
        i, j = knots.x[sector.first], knots.x[sector.second]
        apart = determinants(i, knots.x, knots.gaps) != 0
        tilt = min(tilt, _least_power(knots, sector, knots.x[off & apart] - j))
        for form, bound in zip(forms, _orders(i, j), strict=True):
            growth = min(growth, _least_power(knots, sector, form.x - bound))
        if is_plane and growth == 0:
            limits.append(_curvatures(knots, area, sector, forms))
    if not is_plane or growth < 0:
        return replace(found, normal_exponent=tilt, curvature=math.inf, curvature_exponent=growth)
    gaussian, mean = np.concatenate(limits, axis=1)
    largest = float((np.abs(mean) + np.sqrt(np.maximum(mean**2 - gaussian, 0.0))).max())
    pairs = (gaussian / extent, largest**2 / extent), (mean, largest)
    one, other = (float(v.mean()) / extent if np.ptp(v) <= 1e-6 * size else math.nan for v, size in pairs)
    return CornerLimits(found.normals, tilt, largest / extent, 0.0, one, other, found.folds)


def _orders(i: Any, j: Any) -> tuple[Any, Any, Any]:
    """Return the orders of ⟨P_s × P_t, P_vv⟩, P_vw and P_ww where curvature is bounded."""
    return 3 * i + j, 2 * i + 2 * j, i + 3 * j


def _areas(knots: CornerKnots) -> tuple[Powers, IntArray]:
    """Return the terms of P_s × P_t, and the (k, 2) knots of each, −1 if there are more.

    A knot with the corner's control point stands in for it where two others are in line with the corner.
    """
    enough = 20  # knots on the outermost polygons: the first two decide unless control points are special
    away = knots.points.any(axis=1)
    left, near, still = np.flatnonzero(away), np.empty(0, dtype=np.int64), np.flatnonzero(~away)
    while len(left) and len(near) < enough:
        chain = newton_polygon(knots.x[left], knots.gaps)
        near, left = np.concatenate([near, left[chain]]), np.delete(left, chain)
    pairs, still = near[subsets(len(near), 2)], still[newton_polygon(knots.x[still], knots.gaps)]
    vectors, lengths = cross(*knots.points[pairs].swapaxes(0, 1)), np.linalg.norm(knots.points[pairs], axis=2)
    unsure = PARALLEL_SINE * lengths.prod(axis=1) + 2 * knots.rounding * lengths.sum(axis=1)
    apart = np.linalg.norm(vectors, axis=1) > unsure
    pairs, vectors, unsure = pairs[apart], vectors[apart], unsure[apart]
    (j, k), parts = pairs.T, list[tuple[FloatArray | IntArray, ...]]()
    for origin, log in ((np.zeros(2), 0.0), *zip(knots.x[still], knots.logs[still], strict=True)):
        det = determinants(knots.x[j] - origin, knots.x[k] - origin, knots.gaps)
        x, logs = knots.x[pairs].sum(axis=1) + origin, knots.logs[pairs].sum(axis=1) + log
        members = np.full_like(pairs, -1) if parts else pairs
        columns = x, logs, det[:, None] * vectors, np.abs(det) * unsure, members
        parts.append(tuple(column[det != 0] for column in columns))
    x, logs, vectors, unsure, pairs = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    number = alike(x.T, 2 * knots.gaps)
    tops, sums = summed(number, logs, np.column_stack([vectors, unsure]))
    _, first, counts = np.unique(number, return_index=True, return_counts=True)
    there = np.linalg.norm(sums[:, :3], axis=1) > sums[:, 3]
    return rows_of(Powers(x[first], tops, sums[:, :3]), there), np.where(counts == 1, pairs[first].T, -1).T[there]


def _sectors(knots: CornerKnots, pairs: IntArray, rays: Sequence[FloatArray]) -> list[_Sector]:
    """Return the sectors in which two knots lead; none if knots that lead have points in line with the corner."""
    found, live = [], knots.points.any(axis=1)
    for (i, j), (start, end) in zip(pairs.tolist(), pairwise(rays), strict=True):
        if i < 0:
            return []
        step = knots.x[i] - knots.x[j]
        cuts = [start, end]
        if (step @ start) * (step @ end) < 0:  # on the way between, the other one leads
            cuts.insert(1, np.abs(step[::-1]) / np.abs(step).max())
        for ends in pairwise(cuts):
            first, second = (i, j) if step @ (ends[0] / ends[0].sum() + ends[1] / ends[1].sum()) < 0 else (j, i)
            for ray in ends:
                behind = orders_on(knots.x[live] - knots.x[first], ray, knots.gaps)
                apart = live & (determinants(knots.x[first], knots.x, knots.gaps) != 0)
                if min(behind.min(), orders_on(knots.x[apart] - knots.x[second], ray, knots.gaps).min()) < 0:
                    return []
            found.append(_Sector(first, second, ends))
    return found


def _least_power(knots: CornerKnots, sector: _Sector, exponents: FloatArray) -> float:
    """Return the least power of the distance that has (k, 2) exponents on a way of a sector."""
    edge = -1e-3 / AXIS  # powers below this grow from a strip of any width along the edge
    powers = [orders_on(exponents, ray, knots.gaps) / (knots.x[sector.first] @ ray) for ray in sector.ends]
    least = float(np.min(powers, initial=math.inf))
    return least if least > edge else -math.inf


def _forms(knots: CornerKnots, sectors: Sequence[_Sector], unsure: FloatArray) -> Iterator[list[Powers]]:
    """Yield ⟨P_s × P_t, P_vv⟩, P_vw and P_ww for the v and w dual to the exponents that lead in each sector.

    These are sums over sets of three knots: W_j W_k W_l det(b_j, b_k, b_l) times the minors of their exponents. Knots
    and sets are chosen that may count in a sector; points are known up to (n,) lengths.
    """
    most, steps = 48, 6  # knots; and knots of a layer, from the corner on, that count along an edge
    late, ways = np.full(len(knots.x), np.inf), []
    for sector in sectors:
        for ray in sector.ends:
            orders = np.sort(knots.x[[sector.first, sector.second]] @ ray)
            away = np.maximum(ray, orders[1] / steps) if ray.min() == AXIS else ray
            orders = np.sort(knots.x[[sector.first, sector.second]] @ away)
            late = np.minimum(late, knots.x @ away / (2 * orders[1]))
            ways.append(away / (orders[0] + 3 * orders[1]))
    most_late = 1 + 1e-6
    members = np.argsort(late, kind="stable")[:most]
    members = members[late[members] <= most_late]
    sets = members[subsets(len(members), 3)]
    sets = sets[(knots.x[sets].sum(axis=1) @ np.transpose(ways) <= most_late).any(axis=1)]
    b, x = knots.points[sets], knots.x[sets]
    volumes, lengths = dot(b[:, 0], cross(b[:, 1], b[:, 2])), np.linalg.norm(b, axis=2)
    unsure = (unsure[sets] * np.roll(lengths, 1, axis=1) * np.roll(lengths, -1, axis=1)).sum(axis=1)
    minors = determinants(np.roll(x, -1, axis=1), np.roll(x, -2, axis=1), knots.gaps)
    orders, logs = x.sum(axis=1), knots.logs[sets].sum(axis=1)
    number = alike(orders.T, 4 * knots.gaps)
    orders = orders[np.unique(number, return_index=True)[1]]
    for sector in sectors:
        xi, eta = _coordinates(knots.x, knots.gaps, sector[:2])
        found = []
        for square in (xi * (xi - 1), xi * eta, eta * (eta - 1)):
            terms = square[sets] * minors
            det = terms.sum(axis=1)
            det[np.abs(det) <= 1e-9 * np.abs(terms).sum(axis=1)] = 0.0
            tops, sums = summed(number, logs, np.stack([det * volumes, np.abs(det) * unsure], axis=1))
            found.append(rows_of(Powers(orders, tops, sums[:, :1]), np.abs(sums[:, 0]) > sums[:, 1]))
        yield found


def _coordinates(x: FloatArray, gaps: FloatArray, leading: IntArray | tuple[int, ...]) -> FloatArray:
    """Return (2, n) coordinates of exponents that are 1 and 0, or 0 and 1, for the two knots that lead."""
    inverse = np.linalg.inv(x[list(leading)])
    found = x @ inverse
    whole = np.clip(np.rint(found), 0, 1)
    return np.where(np.abs(found - whole) <= 2 * gaps @ np.abs(inverse), whole, found).T


def _curvatures(knots: CornerKnots, area: Powers, sector: _Sector, forms: Sequence[Powers]) -> FloatArray:
    """Return (2, p) Gaussian and mean curvatures on the way at the end of a sector, or inside the last sector."""
    start, end = sector.ends
    ray, gaps = start + end if end.min() == AXIS else end, 4 * knots.gaps
    live = np.flatnonzero(knots.points.any(axis=1))
    leading = []
    for k, rates in zip((sector.first, sector.second), _coordinates(knots.x, knots.gaps, sector[:2]), strict=True):
        every = Powers(knots.x[live], knots.logs[live], rates[live, None] * knots.points[live])
        leading.append(rows_of(every, orders_on(every.x - knots.x[k], ray, knots.gaps) == 0))
    i, j = knots.x[[sector.first, sector.second]] @ ray
    area = area.of_order(i + j, ray, gaps)
    limits = [form.of_order(order, ray, gaps) for form, order in zip(forms, _orders(i, j), strict=True)]
    places = turning_places(ray, [*leading, area, *limits])
    a, b = (sums.logarithms(places).max(axis=0) for sums in leading)
    first, second = (sums.at(places, shift) for sums, shift in zip(leading, (a, b), strict=True))
    length = np.linalg.norm(area.at(places, a + b), axis=1)
    xx, xy, yy = (form.at(places, shift)[:, 0] / length for form, shift in zip(limits, _orders(a, b), strict=True))
    det = (cross(first, second) ** 2).sum(axis=1)  # without cancellation
    mean = (2 * dot(first, second) * xy - dot(second, second) * xx - dot(first, first) * yy) / (2 * det)
    return np.stack([(xx * yy - xy**2) / det, mean])


class CornerLayer(NamedTuple):
    """The length of the shorter edge at a corner, and the second form II at p places near it: principal curvatures.

    `distances` are of the edge; along (p, 3) `normals`, `table` @ points is II_11, √2 II_12 and II_22, orthogonal axes.
    """

    edge: float
    distances: FloatArray
    curvatures: FloatArray
    normals: FloatArray
    table: FloatArray


@np.errstate(divide="ignore", over="ignore", invalid="ignore")  # at places without a normal
def corner_layer(
    domain: Domain, log_weights: FloatArray, points: FloatArray, corner: int, at: FloatArray, tables: bool = False
) -> CornerLayer:
    """Sample a surface with (n, 3) control points near a corner of Δ; NaN where these have fewer than two directions.

    There are layers that limits do not show. With v and w dual to the two knots that lead, sums of ``ξ (ξ − 1)``,
    ``ξ η`` and ``η (η − 1)`` give II without most of what is tangential: digits stay at all distances. Places are (2,
    …) rates q, of ways (1 / (1 + e^-q), 1 / (1 + e^q)), and logarithms of the largest term of P − V, of the edge.
    """
    (q, far), (x, gaps, own) = at, exponents_at(domain, corner)
    b, logs = points - points[own], log_weights - log_weights[own]
    ends = [np.where(x[:, 1 - k] <= gaps[1 - k], x[:, k], 0).argmax() for k in (0, 1)]
    edge = float(np.linalg.norm(b[ends], axis=1).min())
    others = np.delete(np.arange(len(x)), own)
    chain = others[newton_polygon(x[others], gaps)]
    chain = chain[b[chain].any(axis=1)]
    if len(chain) < 2 or edge == 0:
        none = np.full(q.size, math.nan)
        return CornerLayer(edge, none, none, b[:1], np.zeros((1, 3, len(b))))
    ways, leads = 1 / (1 + np.exp(q.reshape(-1, 1) * [-1, 1])), logs[chain] + np.log(np.linalg.norm(b[chain], axis=1))
    s = ((far.reshape(-1, 1) + math.log(edge) - leads) / (ways @ x[chain].T)).min(axis=1, keepdims=True) * ways
    s = np.maximum(s, -340 / np.where(x[chain] > gaps, x[chain], np.inf).min(axis=0))  # squares stay numbers
    order = np.argsort(-(s @ x[chain].T + leads), axis=1)[:, :2]
    terms = np.exp(s @ x.T + logs)
    parts, r = [], math.sqrt(2)
    for first, second in distinct(order).tolist():
        members = np.flatnonzero((order == (first, second)).all(axis=1))
        t = terms[members] / terms[members].sum(axis=1, keepdims=True)
        xi, eta = _coordinates(x, gaps, chain[[first, second]])
        factors = np.stack([xi, eta, xi * (xi - 1), xi * eta, eta * (eta - 1)], axis=1)
        place, means = t @ b, (t @ factors)[:, :, None]
        rates = (t @ (factors[:, :, None] * b[:, None]).reshape(len(b), 15)).reshape(-1, 5, 3) - means * place[:, None]
        rows = (factors.T - means) * t[:, None] if tables else np.zeros((len(t), 5, 0))
        turn = np.sign(determinants(x[chain[first]], x[chain[second]], gaps))  # of what v and w are dual to
        parts.append((members, place, rates, rows, np.full((len(t), 1), turn)))
    members, place, rates, rows, turns = (np.concatenate(each) for each in zip(*parts, strict=True))
    v, w, *_ = rates.swapaxes(0, 1)
    # In coordinates along P_v and across it, in which the metric is the identity, what is tangential goes
    normals, long = turns * unit(cross(v, w)), np.linalg.norm(v, axis=1)
    axes = np.stack([v, cross(normals, v)], axis=2) / long[:, None, None]
    shift, wide = (w[:, None] @ axes)[:, 0].T
    a, c, d, o = 1 / long, -shift / (long * wide), 1 / wide, np.zeros(len(v))
    turned = np.stack([a * a, o, o, r * a * c, r * a * d, o, c * c, 2 * c * d, d * d], axis=1).reshape(-1, 3, 3)
    forms = turned @ rates[:, 2:]
    xx, xy, yy = (forms @ normals[:, :, None])[:, :, 0].T
    along = np.stack([a, o, c, d], axis=1).reshape(-1, 2, 2) @ rows[:, :2]
    table = turned @ rows[:, 2:] - forms @ axes @ along
    found = np.linalg.norm(place, axis=1) / edge, np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy / r), normals, table
    places: Any = slice(None) if tables else members.argsort()  # pulls need none, and take half of each group
    return CornerLayer(edge, *(each[places] for each in found))
