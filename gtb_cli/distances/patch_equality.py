"""Patches that are proved to be one surface, or curve, in other words: other axes, degrees, knots or weights."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, planar_cross
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.models.curve_equality import equal
from gtb_cli.theory.corner_powers import alike, summed
from gtb_cli.theory.edges import Curve, edge_curves, whole_curve
from gtb_cli.theory.patch import Patch


class Pair(NamedTuple):
    """Patches of two lists that are one surface, or curve."""

    first: int
    second: int
    distance: float  # between corresponding points, at most
    is_mirrored: bool  # whether normals look to the other side


class Partners(NamedTuple):
    """Which patches of two lists are one surface, or curve, each in one pair."""

    pairs: list[Pair]  # of equal names, if they can be
    lone: list[list[int]]  # patches of each list that are no patch of the other
    spare: list[int]  # how many of each list are there more often than in the other


class _Edges(NamedTuple):
    """Edges of a patch in order around it, or a whole curve as the only one."""

    curves: list[Curve]
    steps: FloatArray  # (r, d) from corner to corner
    rises: FloatArray  # (r,) by which the logarithm of the weight grows, where those of equal knots are added

    def turned(self) -> "_Edges":
        """Return them the other way round."""
        return _Edges([curve.reversed() for curve in self.curves[::-1]], -self.steps[::-1], -self.rises[::-1])

    def after(self, count: int) -> "_Edges":
        """Return them from another one on."""
        curves = [*self.curves[count:], *self.curves[:count]]
        return _Edges(curves, np.roll(self.steps, -count, axis=0), np.roll(self.rises, -count))


def partners(a: Sequence[Patch], b: Sequence[Patch], tolerance: float) -> Partners:
    """Pair patches of two lists that are proved to have the same points, within a distance.

    Patches P and Q with Q(M s + β) = P(s), as after a change of degree, of axes, of weights by κ e^{<σ, a>} or of knots
    by an affine map, are recognised, M and β by the curves of two edges. As between curves, the difference is itself
    rational: its knots are a_i + Mᵀ b_j, its weights w_i v_j e^{<β, b_j>}, its control points p_i − q_j, those of equal
    knots act as one (Thm 4.1), and it is nowhere longer than the longest of them. No place is missed, however narrow.
    Not recognised are others that are one surface, such as the parts of one that is cut.
    """
    from scipy.spatial import cKDTree

    old, new = ([_edges(patch, tolerance) for patch in patches] for patches in (a, b))
    middles = [[np.mean([curve.ends for curve in edges.curves], axis=(0, 1)) for edges in each] for each in (old, new)]
    near = cKDTree(middles[0]).query_ball_tree(cKDTree(middles[1]), tolerance)
    found = []
    for first, second in ((first, second) for first, there in enumerate(near) for second in there):
        if (same := _same(a[first], b[second], old[first], new[second], tolerance)) is not None:
            found.append(Pair(first, second, *same))
    pairs = list[Pair]()
    for pair in sorted(found, key=lambda pair: (a[pair.first].name != b[pair.second].name, pair.distance, pair)):
        if all(pair.first != each.first and pair.second != each.second for each in pairs):
            pairs.append(pair)
    lone = [sorted({*range(len(each))} - {pair[way] for pair in found}) for way, each in enumerate((a, b))]
    return Partners(
        pairs, lone, [len(each) - len(alone) - len(pairs) for each, alone in zip((a, b), lone, strict=True)]
    )


def _edges(patch: Patch, tolerance: float) -> _Edges:
    """Return the edges of a patch, but for those that are points where three are not."""
    if patch.dimension == 1:
        return _Edges([whole_curve(patch)], np.diff(patch.domain.vertices, axis=0), np.zeros(1))
    corners, incidence = patch.domain.vertices, patch.domain.incidence
    curves = edge_curves([patch], [(0, edge) for edge in range(len(corners))])
    logs = np.array([np.logaddexp.reduce(patch.log_products[at]) for at in (incidence & np.roll(incidence, 1, 1)).T])
    long = [edge for edge, curve in enumerate(curves) if curve.size > tolerance]
    kept = long if len(long) > 2 else [*range(len(curves))]
    steps, rises = (np.roll(values, -1, axis=0) - values for values in (corners, logs))
    return _Edges([curves[edge] for edge in kept], steps[kept], rises[kept])


def _same(a: Patch, b: Patch, one: _Edges, other: _Edges, tolerance: float) -> tuple[float, bool] | None:
    """Return the distance of corresponding points, at most, and whether the sides are exchanged; None without proof."""
    if a.replace(name=None) == b.replace(name=None):
        return 0.0, False
    count = len(one.curves)
    for is_mirrored, way in ((False, other), (True, other.turned())) if count == len(other.curves) else ():
        for there in map(way.after, range(count)):
            pairs = [*zip(one.curves, there.curves, strict=True)]
            if max(float(np.linalg.norm(p.ends - q.ends, axis=1).max()) for p, q in pairs) > tolerance:
                continue
            matches = [equal(p, q, tolerance) for p, q in pairs]
            if any(not match and max(p.size, q.size) > tolerance for match, (p, q) in zip(matches, pairs, strict=True)):
                continue
            if a.dimension == 1 and matches[0]:
                return matches[0].distance, False
            tori = [None if match is None else match.torus for match in matches]
            if a.dimension == 2 and (found := _longest(a, b, *_carried(one, there, tori))) <= tolerance:
                return found, is_mirrored
    return None


def _carried(one: _Edges, other: _Edges, tori: Sequence[FloatArray | None]) -> tuple[FloatArray, FloatArray]:
    """Return Mᵀ and β with which torus coordinates M s + β of one patch correspond to s of the other."""

    def fitness(pair: tuple[int, int]) -> tuple[bool, int, float]:
        sine = abs(float(planar_cross(*directions[[*pair]])))
        return sine > 1e-6, sum(tori[edge] is not None for edge in pair), sine

    directions = other.steps / np.linalg.norm(other.steps, axis=1, keepdims=True)
    pair = [*max(combinations(range(len(tori)), 2), key=fitness)]
    scales, shifts = np.array([(1.0, 0.0) if torus is None else torus for torus in (tori[edge] for edge in pair)]).T
    # The torus coordinate along an edge is <step, s> + rise: that of the other one is α times it and β.
    turn = np.linalg.solve(other.steps[pair], scales[:, None] * one.steps[pair])
    return turn, np.linalg.solve(other.steps[pair], scales * one.rises[pair] + shifts - other.rises[pair])


def _longest(one: Patch, other: Patch, turn: FloatArray, shift: FloatArray) -> float:
    """Bound ``P(s) − Q(M s + β)``, with M = `turn` transposed and β = `shift`; infinite if there are too many terms."""
    most = 1_000_000  # terms, which need some 100 MB
    if len(one.knots) * len(other.knots) > most:
        return np.inf
    moved = other.knots - other.domain.center
    knots = ((one.knots - one.domain.center)[:, None] + moved @ turn).reshape(-1, 2)
    logs = one.log_products[:, None] + other.log_products + moved @ shift
    apart = (one.control_points[:, None] - other.control_points).reshape(-1, 3)
    number = alike(knots.T, [knot_tolerance(knots)] * 2)
    sums = summed(number, logs.ravel(), np.column_stack([np.ones(len(apart)), apart]))[1]
    longest = np.linalg.norm(sums[:, 1:] / sums[:, :1], axis=1).max()
    # Knots that were merged over a gap: a share grows by e^{|s| gap}, which does not count where all shares but those
    # on an edge are below a rounding.
    first = np.unique(number, return_index=True)[1][number]
    heights = [patch.domain.heights for patch in (one, other)]
    layers = max(float((h.max(axis=0) / np.where(h > 0, h, np.inf).min(axis=0)).max()) for h in heights)
    width = (heights[0].max(axis=0) / one.domain.normal_lengths).min()
    gap = np.abs(knots - knots[first]).max() / width
    growth = np.expm1(min(gap * layers * (np.ptp(logs) - np.log(EPS)), 1.0))
    farthest = np.linalg.norm(apart, axis=1).max()
    return float(longest + growth * farthest + 16 * EPS * np.abs(one.control_points).max())
