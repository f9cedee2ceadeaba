"""What was done to a mesh, in the words of the person who did it: moved, enlarged, turned, mirrored."""

import math
from itertools import permutations

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.vocabulary import UNITS


def told_motion(
    points: FloatArray, others: FloatArray, tolerance: float, in_units: bool = True, may_mirror: bool = True
) -> tuple[str, ...]:
    """Name the similarity that takes (m, 3) points within the tolerance to others, simple ones first; () if none does.

    What is flat may be mirrored or turned. Least squares of a turn, a scale, a shift: Umeyama, IEEE PAMI 13 (1991),
    376. The tolerance grows with the points.
    """
    middle, other_middle = points.mean(axis=0), others.mean(axis=0)
    size = float(np.abs(points - middle).max(initial=0.0))
    with np.errstate(all="ignore"):
        here, there = (points - middle) / size, (others - other_middle) / size
    if not np.isfinite([here, there]).all():
        return ()
    left, _, right = np.linalg.svd(there.T @ here)
    proper = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    flips = [np.diag([-1.0 if axis == flipped else 1.0 for axis in range(3)]) for flipped in range(3)]
    for turn in (np.eye(3), *flips, left @ proper @ right, left @ -proper @ np.diag([-1, -1, 1]) @ right):
        if not may_mirror and np.linalg.det(turn) < 0:
            continue
        scale = float(np.sum(there * (here @ turn.T)) / np.sum(here**2))
        scale = 1.0 if abs(scale - 1) * size <= tolerance else scale
        if scale > 0 and np.abs(there - scale * here @ turn.T).max() * size <= tolerance * max(1.0, scale):
            shift = other_middle - scale * turn @ middle
            is_moved_only = scale == 1 and np.array_equal(turn, np.eye(3))
            lever = 1.0 if is_moved_only else 1.0 + float(np.abs(middle).max()) / size  # by which a turn's error grows
            shift[np.abs(shift) <= tolerance * max(1.0, scale) * lever] = 0.0
            return _words(turn, scale, shift, tolerance / size, in_units)
    return ()


def _words(turn: FloatArray, scale: float, shift: FloatArray, least: float, in_units: bool) -> tuple[str, ...]:
    words = []
    is_mirrored = np.linalg.det(turn) < 0
    axis, degrees = _axis(-turn if is_mirrored else turn)
    if is_mirrored and np.abs(turn + np.eye(3)).max() < 1e-9:
        words.append("mirrored in a point")
    elif is_mirrored:
        words.append(f"mirrored in {axis}")
        degrees -= math.copysign(180, degrees)
    if scale != 1:
        exchanged = [(u, v) for u, v in permutations(UNITS, 2) if abs(UNITS[u] / UNITS[v] / scale - 1) < 1e-6]
        units = "".join(f" (1 {u} for 1 {v})" for u, v in exchanged[:1]) if in_units else " in numbers"
        words.append(f"{next(t for d in (6, 9, 12, 17) if (t := f'{scale:.{d}g}') != '1')} times as large{units}")
    if abs(math.radians(degrees)) > least:
        words.append(f"turned by {degrees:.6g}° about {axis}")
    if shift.any():
        words.append(f"moved by ({', '.join(f'{x:.6g}' for x in shift)})")
    return tuple(words)


def _axis(turn: FloatArray) -> tuple[str, float]:
    """The axis of a rotation, by its letter if it has one, and the angle in degrees, counter-clockwise."""
    axis = np.linalg.eigh(turn + turn.T)[1][:, -1]
    around = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    twice_sine = float(np.linalg.norm(around))
    degrees = math.degrees(math.atan2(twice_sine, np.trace(turn) - 1))
    axis = around / twice_sine if 0 < degrees < 90 else axis * math.copysign(1.0, axis @ around)
    if degrees > 180 - 1e-6:  # then both directions are right
        axis = axis * np.sign(axis[np.abs(axis).argmax()])
    axis = np.where(np.abs(axis) < 1e-12, 0.0, axis)
    for letter, along in zip("xyz", axis, strict=True):
        if abs(along) > 1 - 1e-12:
            return letter, degrees if along > 0 else -degrees
    return f"({', '.join(f'{x:.6g}' for x in axis)})", degrees
