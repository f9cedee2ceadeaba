"""``copy`` and ``include``: patches made from others, mirrored, scaled, rotated and moved, once or several times."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.language.document import shown
from gtb_cli.language.expression import COUNTER, factor_of_radians
from gtb_cli.language.keys_and_values import COORDINATE, MAX_SIZE, SCALE, Table, Values, name_fault, suggestion
from gtb_cli.language.patch_reader import AT_THE_TOP, COPY_KEYS, PATCH_KEYS
from gtb_cli.language.scanner import Path
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

AXES = ("x", "y", "z")


@frozen
class Moves:
    """Moves of (n, 3) points, one for each copy that is made; none if one of them is wrong."""

    moves: tuple[Callable[[FloatArray], FloatArray], ...]
    is_mirrored: bool

    def made(self, patch: Patch, names: Sequence[str | None], values: Values, path: Path) -> list[Patch]:
        """Make the copies of a patch, with these names; none, and a fault, if they are too many or too large."""
        if not values.takes_points(len(self.moves) * len(patch.knots), path):
            return []
        with np.errstate(over="ignore"):
            points = [move(patch.control_points) for move in self.moves]
        if not max((np.abs(moved).max() for moved in points), default=0.0) <= MAX_SIZE:
            values.faults.add(path, f"has control points beyond {MAX_SIZE:g} in size")
            return []
        start = reflected(patch) if self.is_mirrored else patch
        return [start.replace(control_points=moved, name=name) for moved, name in zip(points, names, strict=True)]


@frozen
class Copy:
    """Copies of a patch of a model, each with a name."""

    path: Path
    original: str
    names: tuple[str, ...]
    moves: Moves


def reflected(patch: Patch) -> Patch:
    """Return the surface with Δ reflected, so that its normals point to the other side; a curve is not changed.

    The first coordinate u of the knots becomes min u + max u − u, or −u where rounding would move knots off the edges.
    """
    if patch.dimension == 1:
        return patch
    u, v = patch.knots.T
    total = u.min() + u.max()
    knots = np.column_stack([total - u if np.array_equal(total - (total - u), u) else -u, v])
    scale = np.asarray(patch.edge_scale)
    if not scale.ndim:
        return patch.replace(knots=knots)
    plain = patch.replace(knots=knots, edge_scale=1.0)
    common = plain.domain.incidence.T.astype(np.int64) @ patch.domain.incidence  # number of knots on both edges
    return plain.replace(edge_scale=scale[common.argmax(axis=1)])


def read_copy(entries: dict[str, Any], path: Path, values: Values, allowed: int) -> Copy | None:
    """Read a table with the key ``copy``; the model may have `allowed` more patches."""
    table = Table(entries, path, values)
    table.unknown_keys(COPY_KEYS, dict.fromkeys(PATCH_KEYS, "is that of the patch that is copied") | AT_THE_TOP)
    original = entries["copy"]
    if not isinstance(original, str):
        table.fault("copy", f"must be the name of a patch, or a list of names, got {shown(original)}")
        return None
    count = table.count("repeat", max(allowed, 1))
    if count is None:  # others may copy a copy that is not among these
        return None
    name = table.name(None)
    names = (name,) if name and "repeat" not in entries else tuple(f"{name or original}-{k + 1}" for k in range(count))
    if fault := name_fault(names[-1]):
        table.fault("name", fault)
    if not entries.keys() & {"mirror", "scale", "rotate", "translate"} and not values.faults.doubt:
        values.faults.doubt = (*path, "copy"), "stays in its place: `mirror`, `scale`, `rotate` or `translate` moves it"
    return Copy(path, original, names, read_moves(table, count))


def included_copies(patches: Sequence[Patch], table: Table, allowed: int) -> list[Patch]:
    """Make the copies of all patches of an included file that its table asks for, at most `allowed`."""
    count = table.count("repeat", max(allowed // max(len(patches), 1), 1))
    prefix = f"{name}-" if (name := table.name(None)) else ""
    if count is None:
        return []
    moves = read_moves(table, count)
    made: list[list[Patch]] = []
    for patch in patches:
        endings = [f"-{k + 1}" if "repeat" in table.entries else "" for k in range(len(moves.moves))]
        names = [None if patch.name is None else f"{prefix}{patch.name}{ending}" for ending in endings]
        if fault := next((name_fault(name) for name in names[-1:] if name), None):
            table.fault("name", fault)
            break
        if not (copies := moves.made(patch, names, table.values, table.path)):
            break
        made.append(copies)
    return [patch for several in zip(*made, strict=True) for patch in several]


def read_moves(table: Table, count: int) -> Moves:
    """Read the moves of so many copies."""
    entries, values, before = table.entries, table.values, table.values.faults.count
    mirror = table.choice("mirror", AXES)
    moves = []
    for k in range(1, count + 1):
        if "repeat" in entries or "repeat" in table.meant:
            table = Table(entries, table.path, values.of_copy(k))
        moves.append(_move(table, mirror))
        if values.faults.count > before:  # the others have them, too
            return Moves((), mirror is not None)
    turns = str([entries.get(key) for key in ("scale", "rotate", "translate")])
    if count > 1 and not re.search(rf"\b{COUNTER}\b", turns) and not values.faults.doubt:
        values.faults.doubt = (*table.path, "repeat"), f'{count} copies at one place: the move lacks k, as in "72*k"'
    return Moves(tuple(moves), mirror is not None)


def _move(table: Table, mirror: str | None) -> Callable[[FloatArray], FloatArray]:
    """Return the move of points b to ``R (S b − about) + about + translation``; S has their factors and signs."""
    is_list = isinstance(table.entries.get("scale"), list)
    scale = table.coordinates("scale", (3,), SCALE) if is_list else table.number("scale", SCALE)
    factors = np.array([-1.0 if axis == mirror else 1.0 for axis in AXES]) * (1.0 if scale is None else scale)
    rotation, about = _rotation(table) if "rotate" in table.entries else (None, np.zeros(3))
    translation = _vector(table, "translate")

    def moved(points: FloatArray) -> FloatArray:
        points = points * factors
        if rotation is not None:
            offsets = points - about
            x, y, z = (offsets[:, [k]] * rotation[:, k] for k in range(3))
            points = x + y + z + about
        return np.asarray(points + translation + 0.0)  # 0.0 in place of −0.0

    return moved


def _vector(table: Table, key: str) -> FloatArray:
    """Read two or three coordinates; missing ones are 0."""
    found = table.coordinates(key, (2, 3), COORDINATE)
    return np.zeros(3) if found is None else np.append(found, 0.0)[:3]


def _rotation(outer: Table) -> tuple[FloatArray | None, FloatArray]:
    """Read ``rotate``: its matrix, None if it is wrong, and the fixed point."""
    entries = outer.entries["rotate"]
    if not isinstance(entries, dict):
        outer.fault("rotate", f'must be a table such as {{axis = "z", degrees = 72}}, got {shown(entries)}')
        return None, np.zeros(3)
    table = Table(entries, (*outer.path, "rotate"), outer.values)
    table.unknown_keys(frozenset(("axis", "degrees", "about")))
    for key in ("axis", "degrees"):
        if key not in entries and key not in table.meant:
            table.fault(key, "is missing")
    about, degrees = _vector(table, "about"), table.number("degrees", COORDINATE)
    turn = math.degrees(degrees or 0.0)
    radians = 0 < abs(turn) < 400 and abs(math.remainder(turn, 0.5)) < 1e-9 * abs(turn)
    doubt = f"{degrees:g} is {turn:g} degrees in radians" if radians else ""
    doubt = {"deg": "leave deg out", "pi": "write 180 for pi"}.get(factor_of_radians(entries.get("degrees")), doubt)
    if doubt and outer.values.faults.doubt is None:
        outer.values.faults.doubt = (*table.path, "degrees"), f"takes degrees: {doubt}"
    if isinstance(entries.get("axis"), list):
        given = table.coordinates("axis", (2, 3), COORDINATE)
        direction = np.zeros(3) if given is None else np.append(given, 0.0)[:3]
        if given is not None and not given.any():
            table.fault("axis", "must not be 0")
    else:
        letter = table.choice("axis", AXES, "a direction of 3 coordinates, ")
        direction = np.array([float(letter == name) for name in AXES])
    if degrees is None or not direction.any():
        return None, about
    return rotation_matrix(direction / np.abs(direction).max(), degrees), about


def rotation_matrix(axis: FloatArray, degrees: float) -> FloatArray:
    """Return the (3, 3) rotation about a direction, counter-clockwise seen from its tip; right angles are exact."""
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
    copies: Mapping[int, Copy], named: Mapping[str, Patch | None], several: Mapping[str, Path], values: Values
) -> dict[int, list[Patch]]:
    """Make all copies, each after the one that it copies, and note those that cannot be made.

    `named` are the patches that are not copies, None if wrong, and `several` the names that more than one of them has.
    """
    from graphlib import CycleError, TopologicalSorter

    faults = values.faults
    source: dict[str, int] = {}
    for number, copy in copies.items():
        if taken := next((name for name in copy.names if name in named or name in source), None):
            faults.add(copy.path, f"makes a patch {shown(taken)}, and there is one of this name")
        source |= dict.fromkeys(copy.names, number)
    for copy in copies.values():
        if copy.original in several:
            faults.add(several[copy.original], f"{shown(copy.original)} is copied, and the name of two patches")
        elif copy.original not in named and copy.original not in source:
            beside = [name for name in (*named, *source) if name not in copy.names]
            others = [name for name in beside if not name.startswith(f"{copy.original}-")][:1000]
            hint = suggestion(copy.original, others) if faults.count < faults.SHOWN else ""
            hint = hint or (others and f", there are {', '.join(map(shown, others[:10]))}") or ""
            faults.add((*copy.path, "copy"), f"there is no patch {shown(copy.original)}{hint}")
    source = {name: number for name, number in source.items() if name not in named}
    needs = {n: [source[copy.original]] if copy.original in source else [] for n, copy in copies.items()}
    try:
        order = list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        circle = [copies[number] for number in reversed(error.args[1])]
        faults.add((*circle[0].path, "copy"), f"copies itself: {' -> '.join(copy.original for copy in circle[:9])}")
        return {}
    found = dict(named)
    made: dict[int, list[Patch]] = {}
    for number in order:
        copy, original = copies[number], found.get(copies[number].original)
        if original is not None and copy.moves.moves:
            made[number] = copy.moves.made(original, copy.names, values, copy.path)
            found |= zip(copy.names, made[number], strict=False)  # of all copies, or of none
    return made
