"""Holes with concave corners, cut into parts: one patch each, with exact tangent planes along the cuts.

A cut is a cubic curve from a concave corner to another corner (or to a point of a side), which leaves both in their
tangent planes. Along it there is one cubic field of directions, from which the planes of both parts are made: that
nearest to the field that turns with the curve (its rotation-minimising frame), and evenly from one end's plane to the
other's. So the parts have the same curve and planes there.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import itemgetter
from typing import Any, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, point_text, unit
from gtb_cli.errors import DomainError
from gtb_cli.fairing.descent import together
from gtb_cli.filling.certificate import SPIKE, Filling
from gtb_cli.filling.hole_corners import Corner, between_stations, corners
from gtb_cli.filling.sides import HoleSide, bernstein, points_and_tangents, stations
from gtb_cli.models.model import Model

MAX_CUTS = 6
Parts: TypeAlias = tuple[list[Filling], list[str]]  # fillings of the parts of a hole, and where it is cut
# How bad a curve between two corners is, the loops left and right of it, and where it is
_Cut: TypeAlias = tuple[float, list[HoleSide], list[HoleSide], str]


def fill_parts(
    sides: Sequence[HoleSide], fill: Callable[[Sequence[HoleSide]], Filling], cut_sides: bool
) -> Filling | None:
    """Fill a closed loop with one patch or, if it has concave corners, cut it into parts; None if that has faults.

    That of several has the sides and measurements of all. `cut_sides` allows cuts that end inside a side.
    """
    extent = float(np.ptp([side.ends[0] for side in sides], axis=0).max())
    if not 1e-100 < extent < 1e100:  # squares of lengths would not be numbers
        return None
    straight, hopeless = 185.0, 200.0  # degrees at a corner: with more, one patch is not fair, or not tried
    trials = iter(range(12))  # of fillings, in all

    def one_part(sides: Sequence[HoleSide]) -> Parts | None:
        """Fill a loop with one patch, unless that has a fault or a spike, or too much has been tried."""
        with suppress(DomainError):  # too many sides, or planes that no field follows
            if next(trials, None) is not None and not ((one := fill(sides)).fault or one.sharpness > SPIKE):
                return [one], []
        return None

    def divided(sides: Sequence[HoleSide], cuts: int) -> Parts | None:
        """Fill a loop, or the parts into which at most `cuts` cuts divide it; None if all that is tried has a fault."""
        concave = [corner.angle for corner in corners(sides) if corner.concave]
        widest = max(concave, default=0)
        if widest < straight and (one := one_part(sides)):
            return one
        candidates = sorted(_cuts(sides, cut_sides, cuts), key=itemgetter(0)) if concave and cuts else []
        for _, before, after, remark in candidates[:3]:
            left = divided(before, cuts - 1)
            right = left and divided(after, cuts - len(left[0]))
            if left and right:
                return left[0] + right[0], [remark, *left[1], *right[1]]
        return one_part(sides) if straight <= widest < hopeless else None

    found = divided(sides, MAX_CUTS) or _star(sides, fill)
    if found is None or len(found[0]) == 1:
        return found and found[0][0]
    parts, remarks = found
    remarks += [f"part {k}: {remark}" for k, part in enumerate(parts) for remark in part.remarks]
    names = "sides", "contacts", "corners", "corner_curvatures", "corner_forced", "raises"
    lists: dict[str, Any] = {name: tuple(each for part in parts for each in getattr(part, name)) for name in names}
    return replace(
        parts[0],
        bending=together([part.bending for part in parts]),
        bending_nearer=together([part.bending_nearer for part in parts]),
        bending_errors=np.max([part.bending_errors for part in parts], axis=0),
        corner_angles=np.concatenate([part.corner_angles for part in parts]),
        sharp_turns=sum(part.sharp_turns for part in parts),
        remarks=tuple(remarks),
        model=Model(part.patch for part in parts),
        parts=tuple(parts),
        **lists,
    )


def _star(sides: Sequence[HoleSide], fill: Callable[[Sequence[HoleSide]], Filling]) -> Parts | None:
    """Fill a hole in a plane, beside no planes, by triangles round its middle; None if one of them has a fault."""
    rim = np.concatenate([points_and_tangents(side.curve, np.linspace(0, 1, 32, endpoint=False))[0] for side in sides])
    middle, flat = rim.mean(axis=0), 1e-9  # of the size
    extents = np.linalg.svd(rim - middle, compute_uv=False)
    if extents[2] > flat * extents[0] or any(side.across is not None for side in sides):
        return None
    rays = [HoleSide("cut", np.column_stack([[middle, side.ends[0]], [1, 1]]), None) for side in sides]
    back = [ray.reversed() for ray in (*rays[1:], rays[0])]
    parts = [fill(part) for part in zip(rays, sides, back, strict=True)]
    text = f"the hole is cut from its corners to its middle {point_text(middle, rim)}"
    return None if any(part.fault for part in parts) else (parts, [text])


def _cuts(sides: Sequence[HoleSide], cut_sides: bool, number: int) -> Iterator[_Cut]:
    """Make the curves from concave corners to all other corners and, if sides may be cut, to points of sides."""
    found, count = corners(sides), len(sides)
    name = f"cut {MAX_CUTS - number}"
    places = np.array([corner.place for corner in found])
    for i, start in enumerate(found):
        if not start.concave:
            continue
        for j, end in enumerate(found):
            if (j - i) % count not in (0, 1, count - 1) and not (end.concave and j < i):
                yield from _cut(sides, i, j, start, end, name, f"to {point_text(end.place, places)}")
        for j, side in enumerate(sides if cut_sides else ()):
            if j in (i, (i - 1) % count):
                continue
            t = np.linspace(0.2, 0.8, 61)  # not near the ends
            nearest = np.linalg.norm(points_and_tangents(side.curve, t)[0] - start.place, axis=1).argmin()
            loop = [*sides[:j], *_halves(side, float(t[nearest])), *sides[j + 1 :]]
            first = i if i <= j else i + 1
            end = corners(loop)[j + 1]
            text = f"to {point_text(end.place, places)}, which cuts {side.name} in two"
            for cost, left, right, remark in _cut(loop, first, j + 1, start, end, name, text):
                yield cost + 1.0, left, right, remark


def _halves(side: HoleSide, t: float) -> list[HoleSide]:
    """Cut a side in two, exactly (de Casteljau), with weights 1 at the ends of both."""
    table, left, right = side.curve, [side.curve[0]], [side.curve[-1]]
    while len(table) > 1:
        table = (1 - t) * table[:-1] + t * table[1:]
        left.append(table[0])
        right.append(table[-1])
    found = []
    for k, curve in enumerate((np.array(left), np.array(right[::-1]))):
        curve = curve / curve[0, 3]
        factor = curve[-1, 3] ** (-1 / side.degree)  # as if u : 1 − u were multiplied by it
        curve = curve * factor ** np.arange(len(curve))[:, None]
        share = factor * stations() / (factor * stations() + 1 - stations())
        at = t * share if k == 0 else t + (1 - t) * share
        across = None if side.across is None else between_stations(side.across, at)
        found.append(HoleSide(f"{side.name} half {k}", curve, across))
    return found


def _cut(sides: Sequence[HoleSide], i: int, j: int, start: Corner, end: Corner, name: str, to: str) -> Iterator[_Cut]:
    """Make the curve from corner i to corner j of a loop, unless it comes too near to the boundary."""
    least_clearance = 0.1  # distance from the boundary, of the distance from the nearer end
    least_angle, most_angle = 40.0, 175.0  # degrees at a corner: beyond them a part is worse to fill
    chord = end.place - start.place
    length = float(np.linalg.norm(chord))
    leave, arrive = _direction(start, chord / length), -_direction(end, -chord / length)
    handles = [2 * length / (3 * (1 + max(0.0, float(way @ chord) / length))) for way in (leave, arrive)]  # of an arc
    curve = np.array([start.place, start.place + handles[0] * leave, end.place - handles[1] * arrive, end.place])
    t = np.linspace(0, 1, 33)
    boundary = np.concatenate([points_and_tangents(side.curve, t)[0] for side in sides])
    inside = bernstein(3, t[1:-1]) @ curve
    apart = np.linalg.norm(inside[:, None] - boundary, axis=2).min(axis=1)
    near = np.minimum(*(np.linalg.norm(inside - place, axis=1) for place in (start.place, end.place)))
    clearance = float((apart / near).min())
    if clearance < least_clearance:
        return
    angles = []
    for corner, way in ((start, leave), (end, -arrive)):
        first = math.degrees(math.atan2(np.cross(corner.ahead, way) @ corner.normal, corner.ahead @ way)) % 360
        angles += [first, corner.angle - first]
    left_open = sum(max(0.0, angle - most_angle) for angle in angles) / 90
    sharp = sum(max(0.0, least_angle - angle) for angle in angles) / least_angle
    bend = sum(math.acos(min(1.0, float(way @ chord) / length)) for way in (leave, arrive))
    size = float(np.ptp(boundary, axis=0).max())
    across, around = _field(curve, start, end, leave, arrive), [*sides, *sides]
    cut = HoleSide(name, np.column_stack([curve, np.ones(4)]), across)
    back = replace(cut.reversed(), across=-across[::-1])
    places = np.array([side.ends[0] for side in sides])
    yield (
        4 * left_open + sharp + bend + length / size + 0.1 / clearance,
        [*around[i : j if j > i else j + len(sides)], back],
        [*around[j : i if i > j else i + len(sides)], cut],
        f"the hole is cut from its concave corner {point_text(start.place, places)} {to}",
    )


def _direction(corner: Corner, towards: FloatArray) -> FloatArray:
    """Return the direction in a corner's plane nearest to another that divides its angle well."""
    least_share, most = 0.25, 160.0  # of the angle on either side, and degrees if they can be had
    left = np.cross(corner.normal, corner.ahead)
    angle = math.degrees(math.atan2(towards @ left, towards @ corner.ahead)) % 360
    if angle > corner.angle:
        angle = 0.0 if 360 - angle < angle - corner.angle else corner.angle
    low = min(max(least_share * corner.angle, corner.angle - most), corner.angle / 2)
    turn = math.radians(min(max(angle, low), corner.angle - low))
    return np.asarray(math.cos(turn) * corner.ahead + math.sin(turn) * left)


def _field(curve: FloatArray, start: Corner, end: Corner, leave: FloatArray, arrive: FloatArray) -> FloatArray:
    """Return (96, 3) directions to the left of a cubic, polynomials of degree 3 with the planes of its ends."""
    t = np.concatenate([[0.0], stations(), [1.0]])
    tangents = unit(bernstein(2, t) @ np.diff(curve, axis=0))
    frame = [np.cross(start.normal, leave)]
    for tangent in tangents[1:]:
        frame.append(frame[-1] - (frame[-1] @ tangent) * tangent)
    last, wanted = frame[-1], np.cross(end.normal, arrive)
    twist = math.atan2(float(np.cross(last, wanted) @ tangents[-1]), float(last @ wanted))
    sides = unit(np.array(frame))
    turn = (twist * t)[:, None]
    directions = np.cos(turn) * sides + np.sin(turn) * np.cross(tangents, sides)
    values = bernstein(3, t)
    rest = directions - values[:, :1] * directions[0] - values[:, 3:] * directions[-1]
    inner = np.linalg.lstsq(values[:, 1:3], rest, rcond=None)[0]
    return np.asarray(values[1:-1] @ np.vstack([directions[:1], inner, directions[-1:]]))
