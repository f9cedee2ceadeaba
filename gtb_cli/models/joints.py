"""Joints of a model: edges of patches that carry the same boundary curve, and their directions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.models.curve_equality import Match, beside, equal
from gtb_cli.theory.edges import CURVE_TOLERANCE, Curve, EdgeRef, edge_curve, edge_curves
from gtb_cli.theory.patch import Patch

ALMOST = 1e-2  # of the smaller edge's size: open edges nearer than this are reported

FAR_ROUNDING = 16 * EPS  # of the largest coordinate: far away, points computed in two ways are rounded in each


SORTING_DIRECTION = np.array([1.0, 1.618033988749895, 2.414213562373095])  # different places hardly ever tie along it


@dataclass(frozen=True)
class Joint:
    """Two edges that carry the same curve; `opposite` if they traverse it in opposite directions.

    `distance` is the distance of welded curves, measured, in model units; 0 for equal curves. `match` has corresponding
    fractions of the first edge and, in its direction, of the second one; None if these are equal.
    """

    first: EdgeRef
    second: EdgeRef
    opposite: bool
    distance: float = 0.0
    match: Match | None = field(default=None, repr=False)

    def across(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """(m,) fractions of the second edge at the points of (m,) fractions of the first one."""
        found = fractions if self.match is None else self.match.carried(*self._curves(patches), fractions)
        return 1 - found if self.opposite else found

    def back(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """(m,) fractions of the first edge at the points of (m,) fractions of the second one."""
        found = 1 - fractions if self.opposite else fractions
        return found if self.match is None else self.match.carried(*self._curves(patches), found, back=True)

    def _curves(self, patches: Sequence[Patch]) -> tuple[Curve, Curve]:
        one, other = (edge_curve(patches[p], edge) for p, edge in (self.first, self.second))
        return one, other.reversed() if self.opposite else other


@dataclass(frozen=True)
class Joints:
    """Joints, and other edges, of a model.

    `shared` are pairs of an edge and the first edge with the same curve, `open` edges do not share their curve, all
    control points of `collapsed` edges coincide, and `crowded` are curves of more than two edges, where the model is no
    manifold. `almost` are open edges nearer than a hundredth of the smaller one's size, each with those nearest to it,
    and the largest distance of their curves that was measured, in model units. `flipped` says of which patches the
    orientation must be reversed to agree with their neighbours'; at `one_sided` joints it disagrees for every choice.
    """

    shared: tuple[Joint, ...]
    open: tuple[EdgeRef, ...]
    collapsed: tuple[EdgeRef, ...]
    crowded: tuple[tuple[EdgeRef, ...], ...]
    almost: tuple[tuple[EdgeRef, EdgeRef, float], ...]
    flipped: tuple[bool, ...]
    one_sided: tuple[Joint, ...]

    @property
    def closed(self) -> bool:
        """True if exactly two patches share every edge, consistently oriented: the model bounds a volume."""
        return not (self.open or self.crowded or self.one_sided)


def find_joints(patches: Sequence[Patch], weld: float | None = None) -> Joints:
    """Find the edges of patches, all curves (joined at their ends) or all surfaces, that carry the same curve.

    Two boundary curves have the same points at the same fractions of the linear parametrisation, in either direction,
    if their control points agree, an affine map takes the knots of one edge to those of the other, and the weights c ω
    differ only by factors κ e^{σ a}, which change nothing. Edges with the same ends but different data, such as a
    higher degree, are the same curve if this is proved: see `gtb_cli.models.curve_equality.equal`.

    Edges of surfaces that are measured to be within the distance `weld` of each other, in model units, are joined as
    well, the nearest first: all edges that become one were within it. Edges up to this size count as points.
    """
    dimensions = {patch.dimension for patch in patches}
    if len(dimensions) != 1:
        raise DomainError("patches: curves and surfaces cannot be joined")
    surfaces = dimensions == {2}
    points = np.concatenate([patch.control_points for patch in patches])
    tolerance = CURVE_TOLERANCE * (float(np.ptp(points, axis=0).max()) or 1.0)
    tolerance = max(tolerance, FAR_ROUNDING * float(np.abs(points).max()))
    refs = [(p, e) for p, patch in enumerate(patches) for e in range(len(patch.domain.vertices))]
    curves = edge_curves(patches, refs)
    point = max(tolerance, weld or 0.0)
    collapsed = [i for i, curve in enumerate(curves) if len(curve.points) > 1 and curve.size <= point]
    same = _same_data(curves, collapsed, tolerance)
    compare = cache(lambda i, j: _compared(curves[i], curves[j], tolerance, weld or 0.0))
    near = _near(curves, same, compare, point) if surfaces else {}
    groups = _welded(same, near, compare, weld or 0.0)

    def joint(i: int, j: int, turned: bool, match: Match | None) -> Joint:
        if match is None:
            return Joint(refs[i], refs[j], turned)
        return Joint(refs[i], refs[j], turned, 0.0 if match.proved else match.distance, None if match.even else match)

    shared = tuple(joint(i, *other) for i, others in groups.items() for other in others)
    crowded = tuple((refs[i], *(refs[j] for j, *_ in others)) for i, others in groups.items() if len(others) > 1)
    flipped, one_sided = _orientation(len(patches), shared if surfaces else ())
    single = {i for i, others in groups.items() if not others}
    apart = sorted((*pair, match.distance) for pair, match in near.items() if not _is_within(match, weld or 0.0))
    return Joints(
        shared=shared,
        open=tuple(refs[i] for i in groups if i in single),
        collapsed=tuple(refs[i] for i in collapsed),
        crowded=crowded if surfaces else (),
        almost=tuple(
            (refs[i], refs[j], distance)
            for i, j, distance in apart
            if {i, j} <= single and distance <= ALMOST * min(curves[i].size, curves[j].size)
        ),
        flipped=flipped,
        one_sided=one_sided,
    )


def _is_within(match: Match, weld: float) -> bool:
    return match.proved or match.distance <= weld


def _same_data(
    curves: Sequence[Curve], collapsed: Sequence[int], tolerance: float
) -> dict[int, list[tuple[int, bool]]]:
    """Edges with the data of earlier ones, by the first of these, and whether they run in the opposite direction."""
    found: dict[int, list[tuple[int, bool]]] = {}
    heights = _heights(curves) / (2 * tolerance * SORTING_DIRECTION.sum())
    bins: dict[int, list[int]] = {}
    for i in sorted(set(range(len(curves))).difference(collapsed)):
        middle = int(np.floor(heights[i]))
        near = sorted(first for k in (middle - 1, middle, middle + 1) for first in bins.get(k, ()))
        for turned, curve in ((False, curves[i]), (True, curves[i].reversed())) if near else ():
            first = next((first for first in near if curve.same_as(curves[first], tolerance)), None)
            if first is not None:
                found[first].append((i, turned))
                break
        else:
            found[i] = []
            bins.setdefault(middle, []).append(i)
    return found


def _welded(
    same: Mapping[int, Sequence[tuple[int, bool]]],
    near: Mapping[tuple[int, int], Match],
    compare: Callable[[int, int], Match],
    weld: float,
) -> dict[int, list[tuple[int, bool, Match | None]]]:
    """Put groups of edges with the same data together, first those that are equal, then the nearest.

    Each two that become one must be within the distance of each other: chains would move edges farther. Returned are
    the later edges by the first one, whether they run in the opposite direction, and matches where data differ.
    """
    groups, group = {i: [i] for i in same}, {i: i for i in same}
    for (i, j), match in sorted(near.items(), key=lambda pair: (not pair[1].proved, pair[1].distance)):
        one, other = sorted((group[i], group[j]))
        if one == other or not _is_within(match, weld):
            continue
        pairs = [] if match.proved else [sorted(pair) for pair in product(groups[one], groups[other])]
        if all(_is_within(compare(*pair), weld) for pair in pairs):
            groups[one] += groups.pop(other)
            group.update(dict.fromkeys(groups[one], one))
    found: dict[int, list[tuple[int, bool, Match | None]]] = {}
    for one, members in groups.items():
        found[one] = [(j, turned, None) for j, turned in same[one]]
        for k in sorted(members)[1:]:
            match = compare(one, k)
            found[one] += [(j, also ^ match.turned, match) for j, also in ((k, False), *same[k])]
        found[one].sort(key=lambda other: other[0])
    return found


def _near(
    curves: Sequence[Curve],
    same: Mapping[int, Sequence[object]],
    compare: Callable[[int, int], Match],
    reach: float,
) -> dict[tuple[int, int], Match]:
    """Compare edges, one of them open, whose ends are within a distance, or within `ALMOST` of their size.

    Beyond that distance, each is compared until one is found that is nearer than the others' ends are.
    """
    firsts = list(same)
    least, found = dict.fromkeys(firsts, np.inf), {}
    pairs, gaps = touching([curves[i] for i in firsts], np.maximum([ALMOST * curves[i].size for i in firsts], reach))
    order = np.argsort(gaps, kind="stable")
    for (one, other), gap in zip(pairs[order].tolist(), gaps[order].tolist(), strict=True):
        i, j = firsts[one], firsts[other]
        if not (same[i] and same[j]) and (gap <= reach or gap < max(least[i], least[j])):
            found[i, j] = compare(i, j)
            distance = found[i, j].distance
            least[i], least[j] = min(least[i], distance), min(least[j], distance)
    return found


def _compared(one: Curve, other: Curve, tolerance: float, weld: float) -> Match:
    """Compare two curves in the directions in which their ends are near."""
    most, nearest = max(ALMOST * min(one.size, other.size), tolerance, weld), Match(np.inf, False, True)
    for turned, curve in ((False, other), (True, other.reversed())):
        if np.abs(one.ends - curve.ends).max() > most:
            continue
        match = equal(one, curve, tolerance)
        if match is None:
            match = beside(one, curve, max(tolerance, weld), most)
        if match.proved or match.distance < nearest.distance:
            nearest = replace(match, turned=turned)
        if match.proved:
            break
    return nearest


def touching(curves: Sequence[Curve], reach: FloatArray) -> tuple[IntArray, FloatArray]:
    """(m, 2) pairs i < j of curves whose ends, in either order, differ by at most the smaller of their (n,) reaches.

    With them come (m,) largest differences of the ends' coordinates.
    """
    ends = np.array([curve.ends for curve in curves]).reshape(-1, 2, 3)
    pairs, gaps = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    for row, others in within(_heights(curves), 2 * reach):
        straight, crossed = (np.abs(ends[others] - way).max(axis=(1, 2)) for way in (ends[row], ends[row][::-1]))
        gap = np.minimum(straight, crossed)
        near = np.flatnonzero(gap <= np.minimum(reach[others], reach[row]))
        if len(near):
            pairs.append(np.column_stack([others[near], np.full(len(near), row)]))
            gaps.append(gap[near])
    found = np.sort(np.concatenate(pairs), axis=1)
    order = np.lexsort(found.T[::-1])
    return found[order], np.concatenate(gaps)[order]


def within(heights: FloatArray, reach: FloatArray) -> Iterator[tuple[int, IntArray]]:
    """Each row and those after it, by (n,) heights of places, that may be within its reach along each axis."""
    order = np.argsort(heights, kind="stable")
    beyond = np.searchsorted(heights[order], (heights + SORTING_DIRECTION.sum() * reach)[order], side="right")
    for k in np.flatnonzero(beyond > np.arange(len(order)) + 1).tolist():
        yield int(order[k]), order[k + 1 : beyond[k]]


def _heights(curves: Sequence[Curve]) -> FloatArray:
    """(n,) sums of the coordinates of curves' ends along `SORTING_DIRECTION`: equal for curves with the same ends."""
    ends = np.array([curve.ends for curve in curves]).reshape(-1, 2, 3)
    return np.asarray((ends - ends[:1, :1]).sum(axis=1) @ SORTING_DIRECTION)


def _orientation(count: int, shared: Sequence[Joint]) -> tuple[tuple[bool, ...], tuple[Joint, ...]]:
    """Walk over the joints, and flip the smaller half of each connected component (the later half if equal)."""
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in range(count)]
    for joint in shared:
        (a, _), (b, _) = joint.first, joint.second
        neighbours[a].append((b, not joint.opposite))
        neighbours[b].append((a, not joint.opposite))
    flipped: list[bool | None] = [None] * count
    for start in range(count):
        if flipped[start] is not None:
            continue
        flipped[start], part = False, [start]
        for a in part:
            for b, differs in neighbours[a]:
                if flipped[b] is None:
                    flipped[b] = bool(flipped[a]) != differs
                    part.append(b)
        if 2 * sum(bool(flipped[a]) for a in part) > len(part):
            for a in part:
                flipped[a] = not flipped[a]
    final = tuple(bool(flip) for flip in flipped)
    wrong = tuple(j for j in shared if (final[j.first[0]] != final[j.second[0]]) == j.opposite)
    return final, wrong
