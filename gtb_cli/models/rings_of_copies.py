"""Rings of copies that do not close: turned by a wrong angle or about a wrong axis, or a copy too few or too many."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, count, takewhile

import numpy as np

from gtb_cli.errors import one_of_alike
from gtb_cli.models.joints import Joints
from gtb_cli.models.same_edges import find_joints
from gtb_cli.theory.edges import CURVE_TOLERANCE, edge_curve, edge_name
from gtb_cli.theory.patch import Patch

SAME_ANGLE = 1e-6  # degrees within which two angles are one


def missing_copies(joints: Joints, patches: Sequence[Patch], most: int = 1) -> list[str]:
    """Name the rings of a patch and its copies that one more copy would close, or at most so many."""
    pairs, free, lines = [(joint.first, joint.second) for joint in joints.shared], set(joints.open), []
    for ring, degrees in _rings_of_copies(patches):
        more = round(360 / degrees) - len(ring)
        if not 0 < more <= most or abs(360 / (len(ring) + more) - degrees) > SAME_ANGLE:
            continue
        for (p, end), (q, start) in (*pairs, *(pair[::-1] for pair in pairs)):
            ends = (ring[0], start), (ring[-1], end)
            if [p, q] == ring[:2] and free.issuperset(ends):
                names = " and ".join(edge_name(patches, ref) for ref in ends)
                copies, close = (f"{more} more copies", "close") if more > 1 else ("one more copy", "closes")
                cure = f"{copies}, turned by {degrees:.4g} degrees, {close} the ring"
                lines.append((cure, f"{names} are open: {cure}"))
    return one_of_alike(lines)


def wrong_rings(patches: Sequence[Patch], weld: float | None) -> list[str]:
    """Name copies after a whole turn, and turns by which copies that are not joined would close a ring."""

    def are_joined(three: Sequence[Patch], weld: float | None = None) -> bool:
        found = find_joints(three, weld)
        pairs = {(joint.first[0], joint.second[0]) for joint in found.shared}
        return {(0, 1), (1, 2)} <= pairs and not found.crowded

    lines = []
    for ring, degrees in _rings_of_copies(patches):
        first, *others = (patches[k] for k in ring)
        parts, closed = round(360 / degrees), 360 / len(ring)
        if parts < len(ring) and abs(360 / parts - degrees) < SAME_ANGLE and _are_one(first, others[parts - 1]):
            cure = f"{parts - 1} copies close the ring"
            lines.append((cure, f"{others[parts - 1].name} lies where {first.name} is: {cure}"))
        is_ring = len(ring) > 2 and abs(_turn(*others[:2]) - degrees) <= SAME_ANGLE
        angles = np.radians([0.0, closed, 2 * closed])
        for axis, name in enumerate("xyz" if is_ring and not are_joined([first, *others[:2]], weld) else ""):
            turns = [np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]]) for a in angles]
            points = [first.control_points @ np.roll(turn, (axis, axis), (0, 1)) for turn in turns]
            if are_joined([first.replace(control_points=each) for each in points]):
                cure = f"turned about the {name} axis, they close a ring"
                if abs(closed - degrees) > SAME_ANGLE:
                    digits = next(few for few in (4, 6, 10) if f"{closed:.{few}g}" != f"{degrees:.{few}g}")
                    turn = f"{closed:.{digits}g} degrees (360/{len(ring)}) about the {name} axis"
                    cure = f"a turn of {turn}, not {degrees:.{digits}g}, closes the ring"
                lines.append((cure, f"{first.name} and {len(others)} copies are not joined: {cure}"))
    return one_of_alike(lines)


def crowds(joints: Joints, patches: Sequence[Patch]) -> list[tuple[str, str]]:
    """Name the edges that are one curve with more than one other, and say why, or nothing where it is not known."""
    found, few = [], 9  # patches that are compared
    for refs in joints.crowded:
        why = ""
        for p, edge in refs:
            places, curve = patches[p].control_points, edge_curve(patches[p], edge)
            apart = np.abs(places[:, None] - curve.points).max(axis=2).min(axis=1).max()
            if sum(ref[0] == p for ref in refs) > 1 and apart <= CURVE_TOLERANCE * curve.size:
                why = f"all control points of {patches[p].name} are those of one edge: is its height 0?"
        for one, other in combinations([*{ref[0]: patches[ref[0]] for ref in refs}.values()][:few], 2):
            why = f"{other.name} lies where {one.name} is" if _are_one(one, other) else why
        found.append((f"{', '.join(edge_name(patches, ref) for ref in refs)} are one curve", why))
    return found


def _are_one(one: Patch, other: Patch) -> bool:
    """Tell whether two patches are in one place, to a part of their size."""
    here, there, alike = one.control_points, other.control_points, 1e-9
    return here.shape == there.shape and bool(np.abs(there - here).max() < alike * np.ptp([here, there]))


def _rings_of_copies(patches: Sequence[Patch]) -> Iterator[tuple[list[int], float]]:
    """Yield the numbers of a patch and its copies, as ``repeat`` names them, and the degrees by which one is turned."""
    numbers = {patch.name: number for number, patch in enumerate(patches) if patch.name}
    for name, first in numbers.items():
        copies = takewhile(numbers.__contains__, (f"{name}-{k}" for k in count(1)))
        ring = [first, *(numbers[copy] for copy in copies)]
        if len(ring) > 1 and (degrees := _turn(patches[first], patches[ring[1]])):
            yield ring, degrees


def _turn(one: Patch, other: Patch) -> float:
    """Return the degrees, up to 180, by which a patch is another one turned about an axis; 0 if it is not."""
    if one.knots.shape != other.knots.shape:
        return 0.0
    here, there = one.control_points, other.control_points
    shift = there.mean(axis=0) - here.mean(axis=0)
    here, there = here - here.mean(axis=0), there - there.mean(axis=0)
    left, _, right = np.linalg.svd(there.T @ here)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    around = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = float(np.linalg.norm(around)) / 2
    near = CURVE_TOLERANCE * float(np.abs([here, there]).max() + np.abs(shift).max())
    if np.abs(there - here @ turn.T).max() > near or abs(shift @ around) > 2 * sine * near:
        return 0.0
    return math.degrees(math.atan2(sine, (np.trace(turn) - 1) / 2))
