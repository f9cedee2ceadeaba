"""Patches that are proved to be one surface, or curve, in other words: other axes, degrees, knots or weights."""

from collections.abc import Sequence
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, bounds_of
from gtb_cli.models.rational_equality import Rational, corners_of, least_difference
from gtb_cli.theory.patch import Patch


class Pair(NamedTuple):
    """Patches of two lists that are one surface, or curve."""

    first: int
    second: int
    distance: float  # between corresponding points, at most
    is_mirrored: bool  # whether normals look to the other side


def partners(
    a: Sequence[Patch], b: Sequence[Patch], tolerance: float
) -> tuple[list[Pair], list[list[int]], list[dict[int, int]]]:
    """Pair patches of two lists that are proved to have the same points, within a distance.

    As many as can be are paired, by equal names if that can be. Also return those of each list that are in no other,
    and, by those that are there again within rounding or a millionth of their size, the first ones.
    Patches P and Q with Q(M s + β) = P(s), as after a change of degree, of axes, of weights by κ e^{<σ, a>} or of knots
    by an affine map, are recognised by their `difference`, so that no place is missed, however narrow; the terms that
    they begin with at a corner give M and β. Others that are one surface, such as parts of one that is cut, are not,
    nor are patches all of whose corners are on edges that are points.
    """
    from scipy.sparse import csgraph, csr_array
    from scipy.spatial import cKDTree

    rounding = 64 * EPS * max(float(np.abs(patch.control_points).max()) for patch in a)
    tolerance = max(tolerance, rounding)
    corners = [[patch.evaluate(patch.domain.vertices) for patch in each] for each in (a, b)]
    boxes = [cKDTree([np.concatenate(bounds_of(points)) for points in each]) for each in corners]
    near = set[tuple[int, int]]()  # within a wide tolerance, those about as near as the nearest
    for way, (here, there) in enumerate((boxes, boxes[::-1])):
        reach = np.minimum(2 * there.query(here.data, p=np.inf)[0] + rounding, tolerance)
        for k, others in enumerate(there.query_ball_point(here.data, reach, p=np.inf)):
            near |= {(k, other) if way == 0 else (other, k) for other in others}
    found, met = list[Pair](), (set[int](), set[int]())  # by the same name: two that have met others do not meet
    for p, q in sorted(near, key=lambda pair: (a[pair[0]].name != b[pair[1]].name, abs(pair[0] - pair[1]), pair)):
        if not (p in met[0] and q in met[1]) and (same := _same(a[p], b[q], tolerance, rounding)):
            found.append(Pair(p, q, *same))
            if a[p].name == b[q].name and same[0] <= 2 * rounding and p not in met[0] and q not in met[1]:
                met[0].add(p)
                met[1].add(q)
    # All distances together cost less than another name does, all names less than a patch that is left alone.
    most = 2 * len(a) * max((pair.distance for pair in found), default=0.0) or 1.0
    costs = [(p, q, 1 + (a[p].name != b[q].name) + apart / most) for p, q, apart, _ in found]
    costs += [(k, len(b) + k, 3.0 * len(a) + 3) for k in range(len(a))]
    rows, columns, values = zip(*costs, strict=True)
    partner = csgraph.min_weight_full_bipartite_matching(csr_array((values, (rows, columns))))[1]
    pairs = [pair for pair in sorted(found) if pair.second == partner[pair.first]]
    lone = [sorted({*range(len(each))} - {pair[way] for pair in found}) for way, each in enumerate((a, b))]
    copies = [dict[int, int](), dict[int, int]()]
    firsts: dict[tuple[int, int, bool], int] = {}
    for p, q, apart, is_mirrored in sorted(found):
        size = float(np.ptp(a[p].control_points, axis=0).max())
        for way, own, other in ((0, p, q), (1, q, p)) if apart <= rounding + 1e-6 * size else ():
            if (one := firsts.setdefault((way, other, is_mirrored), own)) < own:
                copies[way][own] = one
    return pairs, lone, copies


def _same(a: Patch, b: Patch, tolerance: float, rounding: float) -> tuple[float, bool] | None:
    """Return the least distance of corresponding points, at most, and if sides are exchanged; None without proof."""
    if a.replace(name=None) == b.replace(name=None):
        return 0.0, False
    if a.dimension != b.dimension:
        return None
    one, other = map(_rational, (a, b))
    nearest = np.inf, False
    for least in (tolerance, rounding):
        ends = product(corners_of(one, least), corners_of(other, least), permutations(range(a.dimension)))
        for here, there, order in ends:
            if np.linalg.norm(here.point - there.point) <= tolerance:
                found, _ = least_difference(one, other, *here.carried(there, order), rounding)
                if found <= rounding and order[0] == 0:
                    return found + rounding / 4, False
                nearest = min(nearest, (found + rounding / 4, order[0] == 1))
    return nearest if nearest[0] <= tolerance + rounding / 4 else None


def _rational(patch: Patch) -> Rational:
    heights = patch.domain.heights / patch.domain.normal_lengths
    return Rational(patch.knots - patch.domain.center, patch.log_products, patch.control_points, heights)
