"""Why a model is open, edge by edge, as `--require watertight` says it; welded seams; holes: `filling.holes`."""

from collections.abc import Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, grid_knots, merged
from gtb_cli.errors import one_of_alike
from gtb_cli.models.joints import Joints
from gtb_cli.models.model import Model, diagonal_of
from gtb_cli.models.near_ends import meeting, touching
from gtb_cli.models.rings_of_copies import crowds, missing_copies, wrong_rings
from gtb_cli.models.same_edges import find_joints
from gtb_cli.theory.edges import CURVE_TOLERANCE, Curve, EdgeRef, edge_curve, edge_curves, edge_name, patch_name
from gtb_cli.theory.patch import Patch
from gtb_cli.values import grouped

MAX_SHOWN = 8  # numbers of an edge, or nearly closed seams that a message shows
FAR_WELD = 0.01  # of an edge's size: welding over a larger distance is worth a remark

Miss: TypeAlias = tuple[EdgeRef, EdgeRef, str]  # two edges that are nearly joined, and how they differ


def obstacles(joints: Joints, patches: Sequence[Patch]) -> list[str]:
    """Say what keeps a model from being closed, a line for each pair of edges or open ring."""
    misses, name = near_misses(joints, patches), partial(edge_name, patches)
    told = {ref for miss in misses for ref in miss[:2]}
    lines = [f"{name(one)} is open: {why.format(name(other))}" for one, other, why in misses]
    rest = [ref for ref in joints.open if ref not in told]
    lines += missing_copies(joints, patches, len(patches)) or _rings(rest, patches)
    lines += [f"{', '.join(map(name, refs))} are one curve: more than two meet there" for refs in joints.crowded]
    pairs = [(name(joint.first), name(joint.second)) for joint in joints.one_sided]
    return lines + [f"{one} and {other} cannot be given the same orientation" for one, other in pairs]


def near_misses(joints: Joints, patches: Sequence[Patch]) -> list[Miss]:
    """Find pairs of open edges probably meant to be one, and say how they differ; {} is the name of the second."""
    if patches[0].dimension == 1:
        return []
    tolerance = CURVE_TOLERANCE * diagonal_of(patches)
    curves = dict(zip(joints.open, edge_curves(patches, joints.open), strict=True))
    found = [(one, two, str(_difference(curves[one], curves[two], tolerance, gap))) for one, two, gap in joints.almost]
    told = {ref for first, second, _ in found for ref in (first, second)}
    part = parts_of(joints, len(patches))
    left = [ref for ref in joints.open if ref not in told]
    for one, other in touching([curves[ref] for ref in left], np.full(len(left), tolerance))[0].tolist():
        first, second = left[one], left[other]
        if first in told or second in told:
            continue
        difference = _difference(curves[first], curves[second], tolerance, None)
        if difference or part[first[0]] != part[second[0]]:  # else such as the two halves of a round opening
            found.append((first, second, difference or "same ends as {}, and another curve between them"))
            told |= {first, second}
    found += _petals(joints, {ref: curves[ref] for ref in left if ref not in told}, found, patches)
    return sorted(found)


def _petals(joints: Joints, curves: dict[EdgeRef, Curve], known: list[Miss], patches: Sequence[Patch]) -> list[Miss]:
    """Find pairs of open edges that have one end in common and open like petals, the narrowest first.

    They belong to two parts, of which no other pair is named, nor one that meets there. Or they belong to one, in which
    their patches share no edge (as peaks of a crown do), and open less than a quarter as wide as they are long.
    """
    narrow, tolerance, part = 0.25, CURVE_TOLERANCE * diagonal_of(patches), parts_of(joints, len(patches))
    neighbours = {frozenset((joint.first[0], joint.second[0])) for joint in joints.shared}
    refs, ends = list(curves), np.array([curve.ends for curve in curves.values()]).reshape(-1, 2, 3)
    near = meeting([*curves.values()], tolerance)
    found, later = [], [(row, other) for row, others in enumerate(near) for other in others if other > row]
    pairs = np.array(later, dtype=np.int64).reshape(-1, 2)
    one, other = ends[pairs.T]
    apart = np.linalg.norm(one[:, :, None] - other[:, None], axis=3).reshape(-1, 4)
    nearest = apart.argmin(axis=1)
    gaps = apart[np.arange(len(pairs)), 3 - nearest]  # between their other ends
    places = np.round(one[np.arange(len(pairs)), nearest // 2] / (4 * tolerance))
    told: set[object] = {np.sort(part[[one[0], other[0]]]).tobytes() for one, other, _ in known}
    for k in np.argsort(gaps, kind="stable").tolist():
        gap, first, second = gaps[k], *(refs[row] for row in pairs[k].tolist())
        parts = np.sort(part[[first[0], second[0]]])
        keys: set[object] = {parts.tobytes(), (*places[k].tolist(),)}
        if parts[0] == parts[1]:
            keys = {first, second}
            is_one = first[0] == second[0] or frozenset((first[0], second[0])) in neighbours
            if is_one or not gap < narrow * min(curves[first].size, curves[second].size):
                continue
        if gap > tolerance and told.isdisjoint(keys):
            told |= keys
            here, there = curves[first].points, curves[second].points
            knot = _outer_knot(patches, first, second)
            why = f"it meets {{}} at one end only, {gap:.3g} apart at the other{knot}"
            if len(here) == len(there) and np.abs(here[:, None] - there).max(axis=2).min(axis=1).max() <= tolerance:
                why = "same control points as {}, but in another order"
            found.append((first, second, why))
    return found


def _outer_knot(patches: Sequence[Patch], one: EdgeRef, other: EdgeRef) -> str:
    """Say which knot, a corner at one of two edges, makes them one if it moves inside the hull of the others.

    Patches with the same knots change together. It begins with a semicolon, for the end of a line; nothing without one.
    """
    pair = [patches[one[0]], patches[other[0]]]
    before = len(find_joints(pair).shared)
    for p, edge in (one, other):
        knots, corners = patches[p].knots, patches[p].domain.vertices
        alike = [np.array_equal(patch.knots, knots) for patch in pair]
        for corner in (edge, (edge + 1) % len(corners)) if len(corners) > 3 else ():
            is_moved = (knots == corners[corner]).all(axis=1)
            inside = np.where(is_moved[:, None], np.delete(corners, corner, axis=0).mean(axis=0), knots)
            moved = [patch.replace(knots=inside) if same else patch for patch, same in zip(pair, alike, strict=True)]
            if len(find_joints(moved).shared) > before:
                return f"; with knot {is_moved.argmax()}, now a corner, inside the hull of the others they are one"
    return ""


def other_grids(model: Model) -> list[str]:
    """Name patches whose knots are a grid, and which join more edges if it has as many rows as it has columns."""
    lines, surfaces = [], model.patches if model.dimension == 2 else ()
    for own in grouped((patch.knots.tobytes(), k) for k, patch in enumerate(surfaces)).values():
        knots = surfaces[own[0]].knots
        rows, columns = (round(float(x)) + 1 for x in knots.max(axis=0))
        is_loose = sum(ref[0] == own[0] for ref in model.joints.open) > 2
        if not is_loose or rows == columns or rows * columns != len(knots):  # also of knots that are far apart
            continue
        if not np.array_equal(knots, grid_knots(rows, columns)):
            continue
        order = np.arange(rows * columns).reshape(rows, columns).T.ravel()
        other, trial = grid_knots(columns, rows), [*surfaces]
        for k in own:
            trial[k] = trial[k].replace(knots=other, coefficients=trial[k].coefficients[order])
        if (more := len(find_joints(trial, model.weld).shared) - len(model.joints.shared)) > 0:
            cure = f"with knots grid {columns}x{rows}, not {rows}x{columns}, {more} more edges are joined"
            lines.append(f"{patch_name(surfaces[own[0]], own[0])} is open: {cure}")
    return lines


def parts_of(joints: Joints, count: int) -> IntArray:
    """(n,) the first patch of the part, joined by shared edges, to which each of n patches belongs."""
    pairs = [(joint.first[0], joint.second[0]) for joint in joints.shared]
    return merged(count, np.array(pairs, dtype=np.int64).reshape(-1, 2))


def _difference(one: Curve, other: Curve, tolerance: float, distance: float | None) -> str | None:
    """Say how two near curves differ or, without a distance, two with the same ends; return None if all differs."""
    turned = min((other, other.reversed()), key=lambda curve: float(np.abs(one.ends - curve.ends).max()))
    if not np.abs(one.ends - turned.ends).max() <= tolerance:
        return f"{distance or 0.0:.3g} from {{}}{_cure(one, distance or 0.0)}"
    count = len(one.points)
    if count == len(turned.points):
        if np.abs(one.points - turned.points).max() <= tolerance:
            same = "same ends and control points as {}, but "
            if np.abs(one.knots - turned.knots).max() > CURVE_TOLERANCE:
                return f"{same}knots at {_row(one.knots)} against {_row(turned.knots)} of the edge"
            if np.abs(one.log_weights - turned.log_weights[::-1]).max() <= CURVE_TOLERANCE:
                return f"{same}weights × coefficients in reversed order"
            weights = " against ".join(_row(np.exp(curve.log_weights)) for curve in (one, turned))
            return f"{same}weights × coefficients {weights}"
        if np.abs(one.points[1:-1] - turned.points[-2:0:-1]).max(initial=0) <= tolerance:
            return "same ends as {}, but the control points between them in reversed order"
    if distance is None:
        return None
    counts = "" if count == len(turned.points) else f" ({count} control points against {len(turned.points)})"
    return f"same ends as {{}}, but curves{counts} up to {distance:.3g} apart{_cure(one, distance)}"


def _cure(edge: Curve, distance: float) -> str:
    is_far = distance > 2 * FAR_WELD * edge.size
    return "" if is_far else f", `weld` {above(distance)} joins them, if `tolerance` is not below it"


def above(distance: float) -> str:
    """Write a round number above a distance."""
    exponent = np.floor(np.log10(distance)) if distance > 0 else -9
    return f"{np.ceil(1.05 * distance / 10.0**exponent) * 10.0**exponent:.1g}"


def _row(values: FloatArray) -> str:
    return " ".join(f"{value:.4g}" for value in values[:MAX_SHOWN]) + " ..." * (len(values) > MAX_SHOWN)


def _rings(refs: list[EdgeRef], patches: Sequence[Patch]) -> list[str]:
    """Write one line for each connected component of the open edges."""
    max_rings, max_names, few = 4, 5, 3  # lines, and edges in each; few of more: else they are a wall of names
    near = meeting(edge_curves(patches, refs), CURVE_TOLERANCE * diagonal_of(patches))
    seen, lines = set[int](), []
    for first in (row for row in range(len(refs)) if row not in seen):
        ring = [first]
        seen.add(first)
        for row in ring:
            new = [other for other in near[row] if other not in seen]
            ring += new
            seen.update(new)
        shown = ring[: max_names if len(ring) <= max_names else few]
        names = [edge_name(patches, refs[row]) for row in shown]
        rest = f" and {len(ring) - len(shown)} more" if len(ring) > len(shown) else ""
        is_hole = len(patches) > 1 and len(ring) > 2
        rest += "; `fills` EDGE=g0 can close it by a lid, without =g0 smoothly" if is_hole else ""
        lines.append(f"{names[0]} is open" + (f", in a ring with {', '.join(names[1:])}{rest}" if names[1:] else ""))
    if len(lines) > max_rings:
        lines[max_rings:] = [f"{len(lines) - max_rings} more rings of edges are open"]
    return lines


def seam_remarks(model: Model) -> list[str]:
    """Say how many seams of a model were welded, from how far apart, and which seams nearly close."""
    joints, patches, lines = model.joints, model.patches, []
    if welded := [joint for joint in joints.shared if joint.distance]:
        worst = max(welded, key=lambda joint: joint.distance)
        names = " and ".join(edge_name(patches, ref) for ref in (worst.first, worst.second))
        lines.append(f"{len(welded)} seams were welded, which were up to {worst.distance:.3g} apart ({names})")
        sizes = [min(edge_curve(patches[p], e).size for p, e in (joint.first, joint.second)) for joint in welded]
        if far := sum(joint.distance > FAR_WELD * size for joint, size in zip(welded, sizes, strict=True)):
            lines.append(f"{far} of them were farther apart than {FAR_WELD:.0%} of their edges")
    points = CURVE_TOLERANCE * diagonal_of(patches)
    shrunk = [(size, ref) for ref in joints.collapsed if (size := edge_curve(patches[ref[0]], ref[1]).size) > points]
    if shrunk:
        size, ref = max(shrunk)
        lines.append(f"{len(shrunk)} edges were welded into points, up to {size:.3g} long ({edge_name(patches, ref)})")
    many = one_of_alike((why.partition(",")[2], f"{edges}: {why}") for edges, why in crowds(joints, patches) if why)
    return lines + (gaps_of(model) or many)


def gaps_of(model: Model) -> list[str]:
    """Name the rings of copies that lack one, and the seams that nearly close."""
    return missing_copies(model.joints, model.patches) + unjoined_seams(model)


def unjoined_seams(model: Model, are_touching: bool = False) -> list[str]:
    """Name the seams of a model that nearly close, with what joins them, or only of parts that touch at their ends.

    Like seams share a line.
    """
    patches, part = model.patches, parts_of(model.joints, len(model.patches))
    if lines := other_grids(model) or wrong_rings(patches, model.weld):
        return lines
    misses = near_misses(model.joints, patches)
    if are_touching:
        tolerance = CURVE_TOLERANCE * diagonal_of(patches)
        apart = [miss for miss in misses if part[miss[0][0]] != part[miss[1][0]]]
        misses = [miss for miss in apart if meeting(edge_curves(patches, miss[:2]), tolerance)[0]]
    name = partial(edge_name, patches)
    lines = one_of_alike((why, f"{name(one)} is not joined: {why.format(name(other))}") for one, other, why in misses)
    if len(lines) > MAX_SHOWN:
        lines[MAX_SHOWN:] = [f"{len(lines) - MAX_SHOWN} more kinds of seams nearly close: gtb info lists them"]
    return lines
