"""Joints of a model: edges of patches that carry the same boundary curve, and their directions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

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

_Comparison = tuple[float, bool, tuple[float, ...]]


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
    """How the patches of a model are joined.

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
        Whether the orientation of each patch must be reversed to agree with its neighbours.
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
        """Whether exactly two patches share every edge, consistently oriented: the model bounds a volume."""
        return not (self.open or self.crowded or self.one_sided)


def diagonal_of(patches: Sequence[Patch]) -> float:
    """Diagonal of the bounding box of all control points, in model units."""
    points = np.concatenate([patch.control_points for patch in patches])
    return float(np.linalg.norm(np.ptp(points, axis=0)))


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
    followers = _same_data(curves, collapsed, tolerance)
    heads: dict[int, tuple[int, bool]] = {}
    distances: dict[int, float] = {}

    def head_of(i: int) -> tuple[int, bool]:
        turned = False
        while i in heads:
            i, also = heads[i]
            turned = turned != also
        return i, turned

    def places(i: int, j: int, turned: bool) -> tuple[float, ...]:
        _, way, places = near.get((i, j)) or _compared(curves[i], curves[j], reach, np.inf)
        return places if way == turned else ()

    almost, loose = [], set()
    near = _near_curves(curves, followers, reach) if surfaces else {}
    for (i, j), (distance, turned, _) in sorted(near.items(), key=lambda pair: pair[1][0]):
        if distance > reach:
            almost.append((i, j, distance))
            continue
        (one, one_turned), (other, other_turned) = sorted((head_of(i), head_of(j)))
        if one == other:
            continue
        turned = (turned != one_turned) != other_turned
        followers[one] += [(other, turned), *((k, turned != also) for k, also in followers.pop(other))]
        followers[one].sort()
        heads[other] = one, turned
        distances[other] = distance if distance > tolerance else 0.0
        loose.add(one)
    almost.sort()
    shared = tuple(
        Joint(refs[i], refs[j], turned, distances.get(j, 0.0), places(i, j, turned) if i in loose else ())
        for i, others in followers.items()
        for j, turned in others
    )
    crowded = tuple((refs[i], *(refs[j] for j, _ in others)) for i, others in followers.items() if len(others) > 1)
    flipped, one_sided = _orientation(len(patches), shared if surfaces else ())
    single = {i for i, others in followers.items() if not others}
    return Joints(
        shared=shared,
        open=tuple(refs[i] for i in followers if i in single),
        collapsed=tuple(refs[i] for i in collapsed),
        crowded=crowded if surfaces else (),
        almost=tuple((refs[i], refs[j], distance) for i, j, distance in almost if {i, j} <= single),
        flipped=flipped,
        one_sided=one_sided,
    )


def _same_data(
    curves: Sequence[Curve], collapsed: Sequence[int], tolerance: float
) -> dict[int, list[tuple[int, bool]]]:
    """For each first curve, the later ones with the same data, and whether they run in the opposite direction."""
    followers: dict[int, list[tuple[int, bool]]] = {}
    heights = _heights(curves) / (2 * tolerance * SORTING_DIRECTION.sum())
    shelves: dict[int, list[int]] = {}
    for i in sorted(set(range(len(curves))).difference(collapsed)):
        shelf = int(np.floor(heights[i]))
        near = sorted(head for k in (shelf - 1, shelf, shelf + 1) for head in shelves.get(k, ()))
        for turned, curve in ((False, curves[i]), (True, curves[i].reversed())) if near else ():
            head = next((head for head in near if curve.same_as(curves[head], tolerance)), None)
            if head is not None:
                followers[head].append((i, turned))
                break
        else:
            followers[i] = []
            shelves.setdefault(shelf, []).append(i)
    return followers


def _near_curves(
    curves: Sequence[Curve], followers: Mapping[int, Sequence[object]], reach: float
) -> dict[tuple[int, int], _Comparison]:
    """Comparisons of pairs of curves, one of them open, within a hundredth of their size or `reach`."""
    heads, found = list(followers), {}
    reaches = np.maximum(1e-2 * np.array([curves[i].size for i in heads]), reach)
    for one, other in touching([curves[i] for i in heads], reaches):
        i, j, most = heads[one], heads[other], min(reaches[one], reaches[other])
        if not (followers[i] and followers[j]) and (near := _compared(curves[i], curves[j], reach, most))[0] <= most:
            found[i, j] = near
    return found


def _compared(one: Curve, other: Curve, reach: float, most: float) -> _Comparison:
    """The distance of two curves, whether one is reversed, and `Joint.places` if equal fractions are beyond `reach`."""
    ways: list[_Comparison] = [
        (float(np.linalg.norm(one.samples - other.samples[::step], axis=1).max()), step < 0, ()) for step in (1, -1)
    ]
    if min(ways)[0] > reach:
        for step in (1, -1):
            meet = np.abs(one.ends - other.ends[::step]).max() <= most
            if meet and (match := correspondence(one, other, step < 0, most)) is not None:
                ways.append((match[0], step < 0, tuple(match[1].tolist())))
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
