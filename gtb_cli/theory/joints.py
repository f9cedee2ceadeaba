"""Joints of a model: edges of patches that carry the same boundary curve, and their directions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.theory.edges import CURVE_TOLERANCE, Curve, EdgeRef, edge_curves, edge_points
from gtb_cli.theory.patch import Patch

FAR_ROUNDING = 16 * EPS
"""The same of points, relative to the largest coordinate: far away, control points that were computed in two ways are
rounded in each, and so are the points of their curves."""

SEAM_GAP = 1e-2
"""Different edges are reported if their ends and curves are nearer than this fraction of the smaller edge's size."""

EDGE_SAMPLES = 33
"""Number of points on each of two curves for measuring their distance."""

SORTING_DIRECTION = np.array([1.0, 1.618033988749895, 2.414213562373095])
"""A direction along which different places hardly ever have the same coordinate."""


@dataclass(frozen=True)
class Joint:
    """Two edges that carry the same curve; `opposite` if they traverse it in opposite directions.

    `distance` is the distance of welded curves, in model units; 0 for equal curves.
    """

    first: EdgeRef
    second: EdgeRef
    opposite: bool
    distance: float = 0.0


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
        Open edges that nearly coincide (see `SEAM_GAP`), with the largest distance of their curves, in model units.
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

    Two boundary curves are the same if, in either direction, they have the same points at the same fractions of the
    linear parametrisation. This holds if their control points agree, an affine map takes the knots of one edge to those
    of the other, and the weights c ω differ only by factors κ e^{σ a}, which change nothing. Edges with the same ends
    but different data, such as a higher degree, are compared at `EDGE_SAMPLES` points.

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

    almost = []
    near = _near_curves(patches, refs, curves, followers, reach) if surfaces else []
    for i, j, distance, turned in sorted(near, key=lambda pair: pair[2]):
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
    almost.sort()
    shared = tuple(
        Joint(refs[i], refs[j], turned, distances.get(j, 0.0))
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
    patches: Sequence[Patch],
    refs: Sequence[EdgeRef],
    curves: Sequence[Curve],
    followers: Mapping[int, Sequence[object]],
    least_reach: float,
) -> list[tuple[int, int, float, bool]]:
    """Pairs of curves, one of them open, within `SEAM_GAP` or `least_reach`: distance, and whether one is reversed."""

    @cache
    def sampled(i: int) -> FloatArray:
        patch, edge = refs[i]
        return edge_points(patches[patch], edge, EDGE_SAMPLES)

    heads = list(followers)
    reach = np.maximum(SEAM_GAP * np.array([curves[i].size for i in heads]), least_reach)
    found = []
    for one, other in touching([curves[i] for i in heads], reach):
        i, j = heads[one], heads[other]
        if followers[i] and followers[j]:
            continue
        gaps = [float(np.linalg.norm(sampled(i) - side, axis=1).max()) for side in (sampled(j), sampled(j)[::-1])]
        if min(gaps) <= min(reach[one], reach[other]):
            found.append((i, j, min(gaps), gaps[1] < gaps[0]))
    return found


def touching(curves: Sequence[Curve], reach: FloatArray) -> list[tuple[int, int]]:
    """Pairs i < j of curves whose ends, in either order, differ by at most the smaller of their (n,) reaches."""
    ends = np.array([curve.ends for curve in curves]).reshape(-1, 2, 3)
    pairs = []
    for row, others in _within(_heights(curves), 2 * reach):
        straight, crossed = (np.abs(ends[others] - way).max(axis=(1, 2)) for way in (ends[row], ends[row][::-1]))
        near = np.minimum(straight, crossed) <= np.minimum(reach[others], reach[row])
        pairs += [(min(row, other), max(row, other)) for other in others[near].tolist()]
    return sorted(pairs)


def meeting(curves: Sequence[Curve], reach: float) -> list[list[int]]:
    """For each curve those, ascending, of which an end is within a distance along each axis of one of its ends."""
    places = np.array([curve.ends for curve in curves]).reshape(-1, 3)
    pairs: list[set[int]] = [set() for _ in curves]
    for row, others in _within((places - places[:1]) @ SORTING_DIRECTION, np.full(len(places), reach)):
        for other in (others[np.abs(places[others] - places[row]).max(axis=1) <= reach] // 2).tolist():
            pairs[row // 2].add(other)
            pairs[other].add(row // 2)
    return [sorted(others - {row}) for row, others in enumerate(pairs)]


def _within(heights: FloatArray, reach: FloatArray) -> Iterator[tuple[int, IntArray]]:
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
