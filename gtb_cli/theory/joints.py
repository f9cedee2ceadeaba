"""Where the patches of a model meet: edges that carry the same boundary curve, and which way round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.theory.linear import LinearParametrization
from gtb_cli.theory.patch import Patch

EdgeRef = tuple[int, int]
"""(patch, edge): edge j of the hull of a patch's knots; for a curve, end j."""

SAME = 1e-9
"""Largest difference of control points (of the model's size), knots (of the edge's length) and logarithms of weights
between edges that carry the same curve: rounding of data typed or computed twice, far below what is visible."""

ALMOST = 1e-2
"""Edges whose ends and curves are nearer than this fraction of the model's size, but not the same, are reported."""

SAMPLES = 33
"""Points on each of two curves between which their distance is measured."""


@dataclass(frozen=True)
class Joint:
    """Two edges that carry the same curve; `opposite` if they run through it in opposite directions."""

    first: EdgeRef
    second: EdgeRef
    opposite: bool


@dataclass(frozen=True)
class Joints:
    """How the patches of a model are joined.

    Attributes
    ----------
    shared : tuple of Joint
        Each edge with the first one that carries the same curve.
    open : tuple of EdgeRef
        Edges with a curve of their own.
    collapsed : tuple of EdgeRef
        Edges whose control points all coincide; they are no part of a boundary.
    crowded : tuple of tuple of EdgeRef
        Curves shared by more than two edges: there the model is no manifold.
    almost : tuple of (EdgeRef, EdgeRef, float)
        Open edges that nearly coincide, with the largest distance between their curves, in model units.
    flipped : tuple of bool
        For each patch, whether its orientation must be reversed to agree with its neighbours'.
    one_sided : tuple of Joint
        Joints at which no choice of `flipped` makes the orientations agree.
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
        """Whether every edge is shared by exactly two, consistently oriented: the model bounds a volume."""
        return not (self.open or self.crowded or self.one_sided)


@dataclass(frozen=True, eq=False)
class _Curve:
    """What an edge's curve depends on: knots on [0, 1], log weights up to what leaves it unchanged, points."""

    knots: FloatArray
    log_weights: FloatArray
    points: FloatArray

    def reversed(self) -> _Curve:
        return _Curve(1 - self.knots[::-1], self.log_weights[::-1], self.points[::-1])

    def same_as(self, other: _Curve, tolerance: float) -> bool:
        return (
            len(self.knots) == len(other.knots)
            and bool(np.abs(self.points - other.points).max() <= tolerance)
            and bool(np.abs(self.knots - other.knots).max() <= SAME)
            and bool(np.abs(self.log_weights - other.log_weights).max() <= SAME)
        )


def find_joints(patches: Sequence[Patch]) -> Joints:
    """Find the edges of patches that carry the same curve.

    Two boundary curves are the same if their control points are, either way round, if an affine map takes
    the knots of one edge to those of the other, and if the weights c ω differ by a factor κ e^{σ a} only: such factors
    leave the curve and its linear parametrisation unchanged.

    Parameters
    ----------
    patches : sequence of Patch
        All curves (whose ends are joined where they coincide) or all surfaces.

    Returns
    -------
    Joints
    """
    dimension = {patch.dimension for patch in patches}
    if len(dimension) != 1:
        raise DomainError("patches: curves and surfaces cannot be joined")
    points = np.concatenate([patch.control_points for patch in patches])
    size = float(np.ptp(points, axis=0).max()) or 1.0
    refs = [(p, e) for p, patch in enumerate(patches) for e in range(len(patch.domain.vertices))]
    curves = [_edge_curve(patches[p], e) for p, e in refs]
    is_collapsed = [
        len(curve.points) > 1 and bool(np.ptp(curve.points, axis=0).max() <= SAME * size) for curve in curves
    ]
    ends = np.array([[curve.points[0], curve.points[-1]] for curve in curves])
    leader: dict[int, list[tuple[int, bool]]] = {}
    for i, curve in enumerate(curves):
        if is_collapsed[i]:
            continue
        heads = np.fromiter(leader, dtype=np.int64, count=len(leader))
        near = heads[:0]
        if len(heads):
            straight = np.abs(ends[heads] - ends[i]).max(axis=(1, 2)) <= SAME * size
            crossed = np.abs(ends[heads] - ends[i][::-1]).max(axis=(1, 2)) <= SAME * size
            near = heads[straight | crossed]
        for head in near.tolist():
            if curve.same_as(curves[head], SAME * size):
                leader[head].append((i, False))
                break
            if curve.reversed().same_as(curves[head], SAME * size):
                leader[head].append((i, True))
                break
        else:
            leader[i] = []
    shared = tuple(Joint(refs[head], refs[i], turned) for head, others in leader.items() for i, turned in others)
    single = [head for head, others in leader.items() if not others]
    crowded = tuple((refs[head], *(refs[i] for i, _ in others)) for head, others in leader.items() if len(others) > 1)
    flipped, one_sided = _orientation(len(patches), shared if dimension == {2} else ())
    return Joints(
        shared=shared,
        open=tuple(refs[i] for i in single),
        collapsed=tuple(ref for ref, flat in zip(refs, is_collapsed, strict=True) if flat),
        crowded=crowded if dimension == {2} else (),
        almost=_almost(patches, [refs[i] for i in single], ends[single], size) if dimension == {2} else (),
        flipped=flipped,
        one_sided=one_sided,
    )


def edge_name(patches: Sequence[Patch], ref: EdgeRef) -> str:
    """Name an edge for people, as ``lid edge 2``."""
    index, edge = ref
    return f"{patches[index].name or f'patches[{index}]'} edge {edge}"


def obstacles(joints: Joints, patches: Sequence[Patch]) -> list[str]:
    """Say, edge by edge, what keeps a model from being closed; empty where it is."""
    near: dict[EdgeRef, list[str]] = {}
    for first, second, distance in joints.almost:
        for one, other in ((first, second), (second, first)):
            near.setdefault(one, []).append(f"{distance:.3g} from {edge_name(patches, other)}")
    lines = []
    for ref in joints.open:
        hint = f" (but only {', '.join(near[ref])})" if ref in near else ""
        lines.append(f"{edge_name(patches, ref)} is open{hint}")
    for refs in joints.crowded:
        lines.append(f"{', '.join(edge_name(patches, ref) for ref in refs)} are one curve: more than two meet there")
    for joint in joints.one_sided:
        ends = " and ".join(edge_name(patches, ref) for ref in (joint.first, joint.second))
        lines.append(f"{ends} cannot be given the same orientation")
    return lines


def _edge_curve(patch: Patch, edge: int) -> _Curve:
    members = patch.domain.edge_knots(edge)
    weights, points = patch.log_products[members], patch.control_points[members]
    if patch.dimension == 1:
        knots = np.zeros(len(members))
    else:
        knots = patch.domain.along(edge, patch.knots[members])
        knots = knots / knots[-1]
    # Copies of a knot act as one (Thm 4.1).
    first = np.flatnonzero(np.diff(knots, prepend=-1.0) > SAME)
    if len(first) < len(knots):
        share = np.exp(
            weights
            - np.maximum.reduceat(weights, first)[np.repeat(np.arange(len(first)), np.diff(first, append=len(knots)))]
        )
        total = np.add.reduceat(share, first)
        points = np.add.reduceat(share[:, None] * points, first) / total[:, None]
        weights, knots = np.maximum.reduceat(weights, first) + np.log(total), knots[first]
    return _Curve(knots, weights - (1 - knots) * weights[0] - knots * weights[-1], points)


def _orientation(count: int, shared: Sequence[Joint]) -> tuple[tuple[bool, ...], tuple[Joint, ...]]:
    """Walk over the joints; of each connected part, the smaller half is flipped (the later one where equal)."""
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


def _almost(
    patches: Sequence[Patch], refs: Sequence[EdgeRef], ends: FloatArray, size: float
) -> tuple[tuple[EdgeRef, EdgeRef, float], ...]:
    found = []
    for i, ref in enumerate(refs):
        gap = np.minimum(
            np.abs(ends[i + 1 :] - ends[i]).max(axis=(1, 2)), np.abs(ends[i + 1 :] - ends[i][::-1]).max(axis=(1, 2))
        )
        for k in (np.flatnonzero(gap <= ALMOST * size) + i + 1).tolist():
            mine, theirs = (edge_points(patches[p], e, SAMPLES) for p, e in (ref, refs[k]))
            distance = min(float(np.linalg.norm(mine - side, axis=1).max()) for side in (theirs, theirs[::-1]))
            if distance <= ALMOST * size:
                found.append((ref, refs[k], distance))
    return tuple(found)


def edge_points(patch: Patch, edge: int, count: int) -> FloatArray:
    """(count, 3) points of a surface's edge at equal fractions of its knots' hull, by the edge's own data."""
    v = patch.domain.vertices
    t = np.linspace(0.0, 1.0, count)[:, None]
    faces = np.full(count, 1 + edge)
    faces[[0, -1]] = 1 + len(v) + np.array([edge, (edge + 1) % len(v)])
    p = v[edge] + t * (v[(edge + 1) % len(v)] - v[edge])
    where = LinearParametrization(patch.domain, patch.log_products).locations(p, faces)
    return patch.points_at(where, count)
