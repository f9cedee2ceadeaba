"""``copy``: patches of a model made from others, mirrored, scaled, rotated and moved, once or several times."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.language.document import shown
from gtb_cli.language.names import COUNTER
from gtb_cli.language.reader import COPY_KEYS
from gtb_cli.language.scanner import Path
from gtb_cli.language.values import (
    COORDINATE,
    MAX_SIZE,
    SCALE,
    Check,
    Table,
    Values,
    name_fault,
)
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

AXES = ("x", "y", "z")


@frozen
class Motion:
    """The motion of a copy, ``R (S b − about) + about + translation``; S has each coordinate's factor and sign."""

    factors: FloatArray
    rotation: FloatArray | None
    about: FloatArray
    translation: FloatArray

    def moved(self, points: FloatArray) -> FloatArray:
        """(n, 3) control points of the copy."""
        points = points * self.factors
        if self.rotation is not None:
            offsets = points - self.about
            x, y, z = (offsets[:, [k]] * self.rotation[:, k] for k in range(3))
            points = x + y + z + self.about
        return np.asarray(points + self.translation + 0.0)  # 0.0 in place of −0.0


@frozen
class Copy:
    """The copies that one table of a model with the key ``copy`` asks for.

    Attributes
    ----------
    path : tuple
        Key path of the table.
    original : str
        Name of the copied patch.
    names : tuple of str
        Names of the copies.
    motions : tuple of Motion
        One for each copy.
    is_mirrored : bool
    """

    path: Path
    original: str
    names: tuple[str, ...]
    motions: tuple[Motion, ...]
    is_mirrored: bool

    def of(self, original: Patch) -> list[Patch]:
        """Make the copies. They share Δ and the basis."""
        start = reflected(original) if self.is_mirrored else original
        return [
            start.replace(control_points=motion.moved(original.control_points), name=name)
            for name, motion in zip(self.names, self.motions, strict=True)
        ]


def reflected(patch: Patch) -> Patch:
    """Return the surface with Δ reflected, so that its normals point to the other side; a curve is not changed.

    The first coordinate u of the knots becomes min u + max u − u, or −u if that is not exact: rounding would move knots
    off the edges.
    """
    if patch.dimension == 1:
        return patch
    u, v = patch.knots.T
    total = u.min() + u.max()
    knots = np.column_stack([total - u if np.array_equal(total - (total - u), u) else -u, v])
    scale = np.asarray(patch.edge_scale)
    plain = patch.replace(knots=knots, edge_scale=1.0 if scale.ndim else patch.edge_scale)
    if not scale.ndim:
        return plain
    old = {frozenset(ends): number for number, ends in enumerate(_edge_ends(patch))}
    return plain.replace(edge_scale=scale[[old[frozenset(ends)] for ends in _edge_ends(plain)]])


def _edge_ends(patch: Patch) -> list[tuple[int, int]]:
    """The first knot at either end of each edge of Δ."""
    corners = [int(np.flatnonzero((patch.knots == corner).all(axis=1))[0]) for corner in patch.domain.vertices]
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def read_copy(entries: dict[str, Any], path: Path, values: Values, allowed: int) -> Copy | None:
    """Read a table with the key ``copy``; the model may have `allowed` more patches."""
    table = Table(entries, path, values)
    before = values.faults.count
    table.unknown_keys(COPY_KEYS)
    original = entries["copy"]
    if not isinstance(original, str):
        table.fault("copy", f"must be the name of a patch, got {shown(original)}")
        return None
    most = max(allowed, 1)
    whole: Check = (f"must be a whole number from 1 to {most}", lambda x: 1 <= x <= most and x == int(x))
    count = int(table.number("repeat", whole) or 1)
    name = table.name(None)
    names = (name,) if name and "repeat" not in entries else tuple(f"{name or original}-{k + 1}" for k in range(count))
    if fault := name_fault(names[-1]):
        table.fault("name", fault)
    mirror = table.choice("mirror", AXES)
    motions = []
    for k in range(1, count + 1):
        table.extra = {COUNTER: float(k)} if "repeat" in entries else {}
        motions.append(_motion(table, mirror))
        if values.faults.count > before:  # the others have them, too
            return None
    return Copy(path, original, names, tuple(motions), mirror is not None)


def _motion(table: Table, mirror: str | None) -> Motion:
    scale, factors = table.entries.get("scale"), None
    if not isinstance(scale, list):
        factors = np.full(3, table.number("scale", SCALE) or 1.0)
    elif len(scale) == 3:
        factors = table.numbers("scale", SCALE)
    else:
        table.fault("scale", f"must be one number or three, got a list of {len(scale)}")
    factors = np.ones(3) if factors is None else factors
    factors = factors * [-1.0 if axis == mirror else 1.0 for axis in AXES]
    rotation, about = _rotation(table) if "rotate" in table.entries else (None, np.zeros(3))
    return Motion(factors, rotation, about, _vector(table, "translate"))


def _vector(table: Table, key: str) -> FloatArray:
    """Read two or three coordinates; missing ones are 0."""
    vector = np.zeros(3)
    entries = table.entries.get(key, [0, 0])
    if not isinstance(entries, list) or len(entries) not in (2, 3):
        table.fault(key, f"must be a list of 2 or 3 coordinates, got {shown(entries)}")
    elif key in table.entries and (found := table.numbers(key, COORDINATE)) is not None:
        vector[: len(found)] = found
    return vector


def _rotation(outer: Table) -> tuple[FloatArray | None, FloatArray]:
    """Read ``rotate``: its matrix, None if it is wrong, and the fixed point."""
    nothing = None, np.zeros(3)
    entries = outer.entries["rotate"]
    if not isinstance(entries, dict):
        outer.fault("rotate", f'must be a table such as {{axis = "z", degrees = 72}}, got {shown(entries)}')
        return nothing
    table = Table(entries, (*outer.path, "rotate"), outer.values, outer.extra)
    table.unknown_keys(frozenset(("axis", "degrees", "about")))
    missing = [key for key in ("axis", "degrees") if key not in entries]
    for key in missing:
        table.fault(key, "is missing")
    if missing:
        return nothing
    about = _vector(table, "about")
    degrees = table.number("degrees", COORDINATE)
    axis = entries["axis"]
    if not isinstance(axis, list):
        letter = table.choice("axis", AXES, "a direction of 3 coordinates, ")
        direction = np.array([float(letter == name) for name in AXES])
    else:
        direction = _vector(table, "axis")
        if not direction.any():
            table.fault("axis", "must not be 0")
    if not direction.any():
        return nothing
    return rotation_matrix(direction / np.abs(direction).max(), degrees or 0.0), about


def rotation_matrix(axis: FloatArray, degrees: float) -> FloatArray:
    """(3, 3) rotation about a direction, counter-clockwise seen from its tip; right angles are exact."""
    turn = math.fmod(degrees, 360.0)
    quarters, rest = divmod(turn, 90.0)
    cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][int(quarters) % 4]
    if rest:
        cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    x, y, z = axis / np.linalg.norm(axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer([x, y, z], [x, y, z])
    return np.asarray(along + cos * (np.eye(3) - along) + sin * across)


def carried_out(
    copies: Mapping[int, Copy], named: Mapping[str, Patch | None], values: Values
) -> dict[int, list[Patch] | None]:
    """Make all copies, in the order in which they depend on each other.

    Parameters
    ----------
    copies : mapping of int to Copy
        The copies, under numbers of the caller's choice.
    named : mapping of str to Patch or None
        The patches that are not copies; None if a patch is wrong, or two have this name.
    values : Values
        Takes the faults.

    Returns
    -------
    dict
        The copies under each number, or None if they cannot be made.
    """
    source = {name: (number, k) for number, copy in copies.items() for k, name in enumerate(copy.names)}
    made: dict[int, list[Patch] | None] = {}
    left = 2_000_000  # control points of all copies together: about 200 MB by the time they are meshed
    for number in copies:
        chain: dict[int, None] = {}  # copies, each made from one of the next
        while number not in made and number not in chain:
            chain[number] = None
            original = copies[number].original
            if original in named or original not in source:
                break
            number = source[original][0]
        else:
            if number not in made:
                links = list(chain)
                circle = [copies[link].original for link in links[links.index(number) :]]
                text = " -> ".join([*circle, circle[0]][:8])
                values.faults.add((*copies[number].path, "copy"), f"copies itself: {text}")
                made.update(dict.fromkeys(chain))
        for link in reversed(chain):
            if link in made:
                continue
            copy = copies[link]
            found = _original(copy, named, source, made)
            if found is not None and len(copy.names) * len(found.knots) > left:
                fault = "makes more than 2000000 control points, together with the copies before"
                values.faults.add(copy.path, fault)
                found = None
            if found is not None:
                left -= len(copy.names) * len(found.knots)
            made[link] = None if found is None else _checked(copy, found, values)
    return made


def _original(
    copy: Copy,
    named: Mapping[str, Patch | None],
    source: Mapping[str, tuple[int, int]],
    made: Mapping[int, list[Patch] | None],
) -> Patch | None:
    """Return the patch that is copied, or None where it, or the copy of it, is wrong."""
    if copy.original in named or copy.original not in source:
        return named.get(copy.original)
    number, k = source[copy.original]
    originals = made[number]
    return None if originals is None else originals[k]


def _checked(copy: Copy, original: Patch, values: Values) -> list[Patch] | None:
    with np.errstate(over="ignore"):
        reach = max(float(np.abs(motion.moved(original.control_points)).max()) for motion in copy.motions)
    if not reach <= MAX_SIZE:
        values.faults.add(copy.path, f"has control points beyond {MAX_SIZE:g} in size")
        return None
    return copy.of(original)
