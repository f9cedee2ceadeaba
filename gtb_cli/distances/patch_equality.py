"""Patches that are proved to be one surface, or curve, in other words: other axes, degrees, knots or weights."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, bounds_of
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.theory.corner_powers import alike, summed
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


class _Corner(NamedTuple):
    """The terms that a patch begins with at a corner: the first other control point along each of its edges."""

    point: FloatArray  # (3,)
    steps: FloatArray  # (d, d) from the knots at the corner
    logs: FloatArray  # (d,) logarithms of weights times distances, relative to the corner's weight


def partners(a: Sequence[Patch], b: Sequence[Patch], tolerance: float) -> Partners:
    """Pair patches of two lists that are proved to have the same points, within a distance.

    Patches P and Q with Q(M s + β) = P(s), as after a change of degree, of axes, of weights by κ e^{<σ, a>} or of knots
    by an affine map, are recognised: the terms that they begin with at a corner give M and β. The difference is itself
    rational: its knots are a_i + Mᵀ b_j, its weights w_i v_j e^{<β, b_j>}, its control points p_i − q_j, those of equal
    knots act as one (Thm 4.1), and it is nowhere longer than the longest of them. No place is missed, however narrow.
    Others that are one surface, such as parts of one that is cut, are not recognised, nor a patch all of whose corners
    are on edges that are points.
    """
    from scipy.spatial import cKDTree

    corners = [[patch.evaluate(patch.domain.vertices) for patch in each] for each in (a, b)]
    boxes = [cKDTree([np.concatenate(bounds_of(points)) for points in each]) for each in corners]
    near = boxes[0].query_ball_tree(boxes[1], tolerance, p=np.inf)
    tried = ((first, second, _same(a[first], b[second], tolerance)) for first, k in enumerate(near) for second in k)
    found = [Pair(first, second, *same) for first, second, same in tried if same]
    pairs = list[Pair]()
    for pair in sorted(found, key=lambda pair: (a[pair.first].name != b[pair.second].name, pair.distance, pair)):
        if all(pair.first != each.first and pair.second != each.second for each in pairs):
            pairs.append(pair)
    lone = [sorted({*range(len(each))} - {pair[way] for pair in found}) for way, each in enumerate((a, b))]
    counts = [len(each) - len(alone) for each, alone in zip((a, b), lone, strict=True)]
    return Partners(pairs, lone, [count - len(pairs) for count in counts])


def _same(a: Patch, b: Patch, tolerance: float) -> tuple[float, bool] | None:
    """Return the distance of corresponding points, at most, and whether the sides are exchanged; None without proof."""
    if a.replace(name=None) == b.replace(name=None):
        return 0.0, False
    if a.dimension != b.dimension:
        return None
    orders = [[0], [0]] if a.dimension == 1 else [[0, 1], [1, 0]]
    for least in (tolerance, 64 * EPS * float(np.abs(a.control_points).max())):
        corners, others = (_corners(patch, least) for patch in (a, b))
        for one, other, order in product(corners, others, orders[: a.dimension]):
            if np.linalg.norm(one.point - other.point) <= tolerance:
                there = _Corner(other.point, other.steps[order], other.logs[order])
                if (found := _longest(a, b, one, there)) <= tolerance:
                    return found, order[0] == 1
    return None


def _corners(patch: Patch, least: float) -> list[_Corner]:
    """Return the corners, in order, along whose edges control points differ by more than a distance."""
    place = alike(patch.knots.T, [knot_tolerance(patch.knots)] * patch.dimension)  # copies act as one
    tops, sums = summed(place, patch.log_products, np.column_stack([np.ones(len(place)), patch.control_points]))
    first = np.unique(place, return_index=True)[1]
    knots, logs, points = patch.knots[first], tops + np.log(sums[:, 0]), sums[:, 1:] / sums[:, :1]
    on = patch.domain.incidence[first].T
    found = []
    for index in range(len(on)):
        edges = [on[index], on[index - 1]] if patch.dimension == 2 else [np.ones(len(knots), dtype=bool)]
        corner = int((on[index] & edges[-1]).argmax())
        steps, apart = knots - knots[corner], np.linalg.norm(points - points[corner], axis=1)
        length = np.where(apart > least, np.linalg.norm(steps, axis=1), np.inf)
        rows = [int(np.where(edge, length, np.inf).argmin()) for edge in edges]
        if np.isfinite(length[rows]).all() and all(edge[row] for edge, row in zip(edges, rows, strict=True)):
            found.append(_Corner(points[corner], steps[rows], logs[rows] - logs[corner] + np.log(apart[rows])))
    return found


def _longest(one: Patch, other: Patch, here: _Corner, there: _Corner) -> float:
    """Bound ``P(s) − Q(M s + β)`` where corners correspond; infinite if there are too many terms."""
    most = 1_000_000  # terms, which need some 100 MB
    if len(one.knots) * len(other.knots) > most:
        return np.inf
    moved = other.knots - other.domain.center
    turned = moved @ np.linalg.solve(there.steps, here.steps)  # Mᵀ b_j
    knots = ((one.knots - one.domain.center)[:, None] + turned).reshape(-1, one.dimension)
    rises = moved @ np.linalg.solve(there.steps, here.logs - there.logs)
    logs = one.log_products[:, None] + other.log_products + rises
    apart = (one.control_points[:, None] - other.control_points).reshape(-1, 3)
    number = alike(knots.T, [knot_tolerance(knots)] * one.dimension)
    sums = summed(number, logs.ravel(), np.column_stack([np.ones(len(apart)), apart]))[1]
    longest = np.linalg.norm(sums[:, 1:] / sums[:, :1], axis=1).max()
    # Knots that were merged over a gap: a share grows by e^{|s| gap}, which does not count where all shares but those
    # on an edge are below a rounding.
    gap = np.abs(knots - knots[np.unique(number, return_index=True)[1]][number]).max()
    heights = [patch.domain.heights for patch in (one, other)]
    layers = max(float((h.max(axis=0) / np.where(h > 0, h, np.inf).min(axis=0)).max()) for h in heights)
    width = (heights[0].max(axis=0) / one.domain.normal_lengths).min()
    growth = np.expm1(min(gap / width * layers * (np.ptp(logs) - np.log(EPS)), 1.0))
    farthest = np.linalg.norm(apart, axis=1).max()
    return float(longest + growth * farthest + 16 * EPS * np.abs(one.control_points).max())
