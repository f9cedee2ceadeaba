"""Joints of a model: edges of patches that carry the same boundary curve, and their directions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.theory.edges import (
    CURVE_TOLERANCE,
    EDGE_SAMPLES,
    Curve,
    EdgeRef,
    correspondence,
    edge_curve,
    edge_curves,
)
from gtb_cli.theory.patch import Patch

FAR_ROUNDING = 16 * EPS  # of the largest coordinate: far away, points computed in two ways are rounded in each


SORTING_DIRECTION = np.array([1.0, 1.618033988749895, 2.414213562373095])  # different places hardly ever tie along it


class _Comparison(NamedTuple):
    """The distance of two curves, whether one is reversed, and `Joint.places` if equal fractions are too far apart."""

    distance: float
    turned: bool
    places: tuple[float, ...] = ()


@dataclass(frozen=True)
class Joint:
    """Two edges that carry the same curve; `opposite` if they traverse it in opposite directions.

    `distance` is the distance of welded curves, in model units; 0 for equal curves. `places` are the fractions of the
    second edge, ascending or descending, at `EDGE_SAMPLES` equal fractions of the first one; none if these are equal.
    """

    first: EdgeRef
    second: EdgeRef
    opposite: bool
    distance: float = 0.0
    places: tuple[float, ...] = field(default=(), repr=False)

    def across(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """(m,) fractions of the second edge at the points of (m,) fractions of the first one."""
        return self._carried(patches, fractions, 1)

    def back(self, patches: Sequence[Patch], fractions: FloatArray) -> FloatArray:
        """(m,) fractions of the first edge at the points of (m,) fractions of the second one."""
        return self._carried(patches, fractions, -1)

    def _carried(self, patches: Sequence[Patch], fractions: FloatArray, way: int) -> FloatArray:
        if not self.places:
            return 1 - fractions if self.opposite else fractions
        ours, theirs = (np.linspace(0.0, 1.0, EDGE_SAMPLES), np.array(self.places))[::way]
        one, other = (edge_curve(patches[p], edge) for p, edge in (self.first, self.second)[::way])
        if ours[0] > ours[-1]:
            ours, theirs = ours[::-1], theirs[::-1]
        result = np.asarray(np.interp(fractions, (0, 1), theirs[[0, -1]]))
        inside = (fractions > 0) & (fractions < 1)
        t = fractions[inside]
        after = np.searchsorted(ours, t, side="right")
        ends = theirs[np.maximum(after - 2, 0)], theirs[np.minimum(after + 1, EDGE_SAMPLES - 1)]
        start = np.interp(t, ours, theirs)
        result[inside] = other.nearest(one.points_at(t), start, np.minimum(*ends), np.maximum(*ends))[0]
        return result


@dataclass(frozen=True)
class Joints:
    """Joints, and other edges, of a model.

    Attributes
    ----------
    shared : tuple of Joint
        Pairs of an edge and the first edge with the same curve.
    open : tuple of EdgeRef
        Edges that do not share their curve.
    collapsed : tuple of EdgeRef
        Edges whose control points all coincide; they are not part of a boundary.
    crowded : tuple of tuple of EdgeRef
        Curves shared by more than two edges: there the model is not a manifold.
    almost : tuple of (EdgeRef, EdgeRef, float)
        Open edges nearer than a hundredth of the smaller one's size, with the largest distance of their curves, in
        model units.
    flipped : tuple of bool
        True for patches whose orientation must be reversed to agree with their neighbours'.
    one_sided : tuple of Joint
        Joints at which orientations disagree for every choice of `flipped`.
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
    """Find the edges of patches that carry the same curve.

    Two boundary curves have the same points at the same fractions of the linear parametrisation, in either direction,
    if their control points agree, an affine map takes the knots of one edge to those of the other, and the weights c ω
    differ only by factors κ e^{σ a}, which change nothing. Edges with the same ends but different data, such as a
    higher degree, are compared at `EDGE_SAMPLES` points: at equal fractions first, then wherever they are nearest.

    Parameters
    ----------
    patches : sequence of Patch
        All curves (whose ends are joined if they coincide) or all surfaces.
    weld : float, optional
        Edges of surfaces within this distance of each other, in model units, are joined as well, the nearest first;
        edges up to this size count as points.

    Notes
    -----
    O(n log n) for n edges, unless more than a few have the same ends.
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
    reach = max(tolerance, weld or 0.0)
    collapsed = [i for i, curve in enumerate(curves) if len(curve.points) > 1 and curve.size <= reach]
    groups = _same_data(curves, collapsed, tolerance)
    near = _near_curves(curves, groups.others, reach) if surfaces else {}
    distances = groups.weld(near, reach)

    def joint(i: int, j: int, turned: bool) -> Joint:
        distance = distances.get(j, 0.0)
        places: tuple[float, ...] = ()
        if i in groups.welded:
            found = near.get((i, j)) or _compared(curves[i], curves[j], reach, np.inf)
            places = found.places if found.turned == turned else ()
        return Joint(refs[i], refs[j], turned, distance if distance > tolerance else 0.0, places)

    shared = tuple(joint(i, j, turned) for i, others in groups.others.items() for j, turned in others)
    crowded = tuple((refs[i], *(refs[j] for j, _ in others)) for i, others in groups.others.items() if len(others) > 1)
    flipped, one_sided = _orientation(len(patches), shared if surfaces else ())
    single = {i for i, others in groups.others.items() if not others}
    apart = sorted((i, j, found.distance) for (i, j), found in near.items() if found.distance > reach)
    return Joints(
        shared=shared,
        open=tuple(refs[i] for i in groups.others if i in single),
        collapsed=tuple(refs[i] for i in collapsed),
        crowded=crowded if surfaces else (),
        almost=tuple((refs[i], refs[j], distance) for i, j, distance in apart if {i, j} <= single),
        flipped=flipped,
        one_sided=one_sided,
    )


class _Groups:
    """Edges that carry one curve, by the first of them.

    `others` has the later edges of each group, and whether they run in the opposite direction to the first; `welded`
    the first edges of groups that were put together.
    """

    def __init__(self) -> None:
        self.others: dict[int, list[tuple[int, bool]]] = {}
        self.welded: set[int] = set()

    def weld(self, near: Mapping[tuple[int, int], _Comparison], reach: float) -> dict[int, float]:
        """Put groups together that are near, the nearest first; return distances by the first edges of those moved."""
        group = {j: (i, turned) for i, others in self.others.items() for j, turned in ((i, False), *others)}
        distances: dict[int, float] = {}
        for (i, j), found in sorted(near.items(), key=lambda pair: pair[1].distance):
            (one, one_turned), (other, other_turned) = sorted((group[i], group[j]))
            if found.distance > reach or one == other:
                continue
            turned = found.turned ^ one_turned ^ other_turned
            moved = [(k, also ^ turned) for k, also in ((other, False), *self.others.pop(other))]
            self.others[one] = sorted(self.others[one] + moved)
            group.update((k, (one, also)) for k, also in moved)
            self.welded.add(one)
            distances[other] = found.distance
        return distances


def _same_data(curves: Sequence[Curve], collapsed: Sequence[int], tolerance: float) -> _Groups:
    """Group the edges whose curves have the same data."""
    groups = _Groups()
    heights = _heights(curves) / (2 * tolerance * SORTING_DIRECTION.sum())
    bins: dict[int, list[int]] = {}
    for i in sorted(set(range(len(curves))).difference(collapsed)):
        middle = int(np.floor(heights[i]))
        near = sorted(first for k in (middle - 1, middle, middle + 1) for first in bins.get(k, ()))
        for turned, curve in ((False, curves[i]), (True, curves[i].reversed())) if near else ():
            first = next((first for first in near if curve.same_as(curves[first], tolerance)), None)
            if first is not None:
                groups.others[first].append((i, turned))
                break
        else:
            groups.others[i] = []
            bins.setdefault(middle, []).append(i)
    return groups


def _near_curves(
    curves: Sequence[Curve], groups: Mapping[int, Sequence[object]], reach: float
) -> dict[tuple[int, int], _Comparison]:
    """Comparisons of pairs of groups' curves, one of them open, within a hundredth of their size or `reach`."""
    firsts, found = list(groups), {}
    reaches = np.maximum(1e-2 * np.array([curves[i].size for i in firsts]), reach)
    for one, other in touching([curves[i] for i in firsts], reaches):
        i, j, most = firsts[one], firsts[other], min(reaches[one], reaches[other])
        if not (groups[i] and groups[j]) and (near := _compared(curves[i], curves[j], reach, most)).distance <= most:
            found[i, j] = near
    return found


def _compared(one: Curve, other: Curve, reach: float, most: float) -> _Comparison:
    """Compare two curves at equal fractions and, if these are farther apart than `reach`, wherever they are nearest."""
    ways = [
        _Comparison(float(np.linalg.norm(one.samples - other.samples[::step], axis=1).max()), step < 0)
        for step in (1, -1)
    ]
    if min(ways).distance > reach:
        for step in (1, -1):
            meet = np.abs(one.ends - other.ends[::step]).max() <= most
            if meet and (match := correspondence(one, other, step < 0, most)) is not None:
                ways.append(_Comparison(match[0], step < 0, tuple(match[1].tolist())))
    return min(ways)


def touching(curves: Sequence[Curve], reach: FloatArray) -> list[tuple[int, int]]:
    """Pairs i < j of curves whose ends, in either order, differ by at most the smaller of their (n,) reaches."""
    ends = np.array([curve.ends for curve in curves]).reshape(-1, 2, 3)
    pairs = []
    for row, others in within(_heights(curves), 2 * reach):
        straight, crossed = (np.abs(ends[others] - way).max(axis=(1, 2)) for way in (ends[row], ends[row][::-1]))
        near = np.minimum(straight, crossed) <= np.minimum(reach[others], reach[row])
        pairs += [(min(row, other), max(row, other)) for other in others[near].tolist()]
    return sorted(pairs)


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
