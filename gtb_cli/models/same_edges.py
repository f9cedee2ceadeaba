"""Which edges of a model are joined: they carry one curve, or a weld joins them, the nearest first."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import permutations, product

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.models.curve_matches import Match, beside, equal
from gtb_cli.models.joints import Joint, Joints
from gtb_cli.models.near_ends import touching
from gtb_cli.theory.edges import CURVE_TOLERANCE, Curve, edge_curves
from gtb_cli.theory.patch import Patch
from gtb_cli.values import grouped

ALMOST = 2e-2  # of the smaller edge's size: open edges nearer than this are reported
FAR_ROUNDING = 16 * EPS  # of the largest coordinate: far away, points computed in two ways are rounded in each


def find_joints(patches: Sequence[Patch], weld: float | None = None) -> Joints:
    """Find the edges of patches, all curves (joined at their ends) or all surfaces, that carry the same curve.

    Two boundary curves have the same points at the same fractions of the linear parametrisation, in either direction,
    if their control points agree, an affine map takes the knots of one edge to those of the other, and the weights c ω
    differ only by factors κ e^{σ a}, which change nothing. Edges with the same ends but different data, such as a
    higher degree, are the same curve if this is proved: see `gtb_cli.models.curve_matches.equal`.

    Edges of surfaces that are measured to be within the distance `weld` of each other, in model units, are joined as
    well, the nearest first: all edges that become one were within it. Edges up to this size count as points.
    """
    is_surface = patches[0].dimension == 2
    refs = [(p, e) for p, patch in enumerate(patches) for e in range(len(patch.domain.vertices))]
    points = np.concatenate([patch.control_points for patch in patches])
    size = float(np.ptp(points, axis=0).max()) or 1.0
    tolerance = max(CURVE_TOLERANCE * size, FAR_ROUNDING * float(np.abs(points).max()))  # of points that are one
    edges = _EdgeCurves(edge_curves(patches, refs), tolerance, weld or 0.0)
    near = edges.near if is_surface else {}
    followers = edges.followers(near)
    shared = tuple(
        Joint(refs[i], refs[j], turned, 0.0 if match.proved else match.distance, None if match.even else match)
        for i, others in followers.items()
        for j, turned, match in others
    )
    flipped, one_sided = _orientation(len(patches), shared if is_surface else ())
    alone = {i for i, others in followers.items() if not others}
    many = [(i, *(j for j, *_ in others)) for i, others in followers.items() if len(others) > 1]
    open_pairs = ((pair, match) for pair, match in near.items() if alone.issuperset(pair) and not edges.is_one(match))
    least = {i: ALMOST * edges.curves[i].size for i in alone}  # nearer, two were probably meant to be one
    almost = sorted((i, j) for (i, j), match in open_pairs if match.distance <= min(least[i], least[j]))
    return Joints(
        shared=shared,
        open=tuple(refs[i] for i in followers if i in alone),
        collapsed=tuple(refs[i] for i in edges.collapsed),
        crowded=tuple(tuple(refs[i] for i in group) for group in many) if is_surface else (),
        almost=tuple((refs[i], refs[j], near[i, j].distance) for i, j in almost),
        flipped=flipped,
        one_sided=one_sided,
    )


class _EdgeCurves:
    """The curves of all edges, and which of them are compared."""

    def __init__(self, curves: Sequence[Curve], tolerance: float, weld: float) -> None:
        self.curves, self.tolerance, self.weld = curves, tolerance, weld
        self.reach = max(tolerance, weld)
        self.collapsed = [i for i, curve in enumerate(curves) if len(curve.points) > 1 and curve.size <= self.reach]
        self.compared = cache(self._compared)

    @cached_property
    def same(self) -> dict[int, list[tuple[int, bool]]]:
        """For each edge with data of its own: the later edges with the same data, and whether each runs backwards."""
        found: dict[int, list[tuple[int, bool]]] = {}
        extended = sorted(set(range(len(self.curves))).difference(self.collapsed))
        pairs, _ = touching([self.curves[i] for i in extended], np.full(len(extended), self.tolerance))
        near = grouped((extended[other], extended[one]) for one, other in pairs.tolist())
        for i in extended:
            earlier = near.get(i, ())
            for turned, curve in ((False, self.curves[i]), (True, self.curves[i].reversed())) if earlier else ():
                firsts = (k for k in earlier if k in found and curve.same_as(self.curves[k], self.tolerance))
                if (first := next(firsts, None)) is not None:
                    found[first].append((i, turned))
                    break
            else:
                found[i] = []
        return found

    @cached_property
    def near(self) -> dict[tuple[int, int], Match]:
        """Matches of edges with different data, one of them open, whose ends are within reach, or within `ALMOST`.

        Pairs whose ends are beyond reach are compared in the order of their distance, and only while one of the two
        edges has no partner that is nearer.
        """
        firsts = list(self.same)
        sizes = np.array([self.curves[i].size for i in firsts])
        pairs, gaps = touching([self.curves[i] for i in firsts], np.maximum(ALMOST * sizes, self.reach))
        order = np.argsort(gaps, kind="stable")
        least, found = dict.fromkeys(firsts, np.inf), {}
        for (one, other), gap in zip(pairs[order].tolist(), gaps[order].tolist(), strict=True):
            i, j = firsts[one], firsts[other]
            if not (self.same[i] and self.same[j]) and (gap <= self.reach or gap < max(least[i], least[j])):
                found[i, j] = match = self.compared(i, j)
                least[i], least[j] = min(least[i], match.distance), min(least[j], match.distance)
        return found

    def followers(self, near: dict[tuple[int, int], Match]) -> dict[int, list[tuple[int, bool, Match]]]:
        """Join edges with the same data, then equal edges, then the nearest: the later edges, by the first one.

        For each, return whether it runs backwards, and how the two correspond. Each two that become one must be within
        the weld of each other: chains would move edges farther.
        """
        group = {i: [i] for i in self.same}
        for (i, j), match in sorted(near.items(), key=lambda pair: (not pair[1].proved, pair[1].distance)):
            one, other = sorted((group[i], group[j]), key=min)
            if one is other or not self.is_one(match):
                continue
            if match.proved or all(self.is_one(self.compared(*sorted(pair))) for pair in product(one, other)):
                one += other
                group.update(dict.fromkeys(other, one))
        found: dict[int, list[tuple[int, bool, Match]]] = {}
        for first in (i for i in self.same if i == min(group[i])):
            found[first] = [(j, turned, Match(0.0, True, True)) for j, turned in self.same[first]]
            for k in sorted(group[first])[1:]:
                match = self.compared(first, k)
                found[first] += [(j, turned ^ match.turned, match) for j, turned in ((k, False), *self.same[k])]
            found[first].sort(key=lambda follower: follower[0])
        return found

    def is_one(self, match: Match) -> bool:
        """Tell whether two edges are joined, by a proof or by the weld."""
        return match.proved or match.distance <= self.weld

    def _compared(self, i: int, j: int) -> Match:
        """Compare two curves in the directions in which their ends are near."""
        one, other = self.curves[i], self.curves[j]
        most, nearest = max(ALMOST * min(one.size, other.size), self.reach), Match(np.inf, False, True)
        for turned, curve in ((False, other), (True, other.reversed())):
            if np.abs(one.ends - curve.ends).max() > most:
                continue
            match = equal(one, curve, self.tolerance) or beside(one, curve, self.reach, most)
            if match.proved or match.distance < nearest.distance:
                nearest = replace(match, turned=turned)
            if match.proved:
                break
        return nearest


def _orientation(count: int, shared: Sequence[Joint]) -> tuple[tuple[bool, ...], tuple[Joint, ...]]:
    """Walk over the joints, and flip the smaller half of each connected component (the later half if equal)."""
    ways = ((joint, ends) for joint in shared for ends in permutations((joint.first[0], joint.second[0])))
    neighbours = grouped((a, (b, not joint.opposite)) for joint, (a, b) in ways)
    flipped: dict[int, bool] = {}
    for start in (k for k in range(count) if k not in flipped):
        flipped[start], part = False, [start]
        for a in part:
            for b, differs in neighbours.get(a, ()):
                if b not in flipped:
                    flipped[b] = flipped[a] != differs
                    part.append(b)
        if 2 * sum(flipped[a] for a in part) > len(part):
            flipped |= {a: not flipped[a] for a in part}
    wrong = tuple(j for j in shared if (flipped[j.first[0]] != flipped[j.second[0]]) == j.opposite)
    return tuple(flipped[k] for k in range(count)), wrong
