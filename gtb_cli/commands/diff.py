"""`gtb diff`: two meshes, or two folders of them → whether they are the same within a tolerance."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.console import STANDARD, Console, complain
from gtb_cli.shell.options import (
    INPUT,
    MAX_RESOLUTION,
    WholeNumber,
    console_option,
    json_option,
    output_option,
    parametrization_option,
    spec_format_option,
    tolerance_of,
)
from gtb_cli.shell.streams import about, is_regular, opened, refuse_overwriting, shown_input, write_text
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import FORMATS, MAX_FACES, RESOLUTION, SPEC_FORMATS

if TYPE_CHECKING:
    from gtb_cli.meshes.difference import Difference, Point
    from gtb_cli.meshes.known import KnownMesh
    from gtb_cli.theory.parametrization import Parametrization

BEGINNING = 1 << 16
"""Bytes by which a mesh is told from a spec."""

DIFFERENT, TROUBLE = 1, 2
"""Exit statuses, as those of diff(1)."""


class Side(NamedTuple):
    """One of the two things to compare: how to read it."""

    path: str
    recipe: Recipe
    spec_format: str | None


@click.command
@click.argument("a", metavar="A", type=INPUT)
@click.argument("b", metavar="B", type=INPUT)
@click.option(
    "--tolerance",
    callback=tolerance_of,
    metavar="T",
    help="Largest distance that counts as none, in model units, or as 1% of the size. 1e-9 of the size without it.",
)
@click.option(
    "-n",
    "--resolution",
    type=WholeNumber(1, MAX_RESOLUTION),
    metavar="N",
    help=f"Mesh a spec with N segments along each edge of the domain; {RESOLUTION} without this option.",
)
@click.option(
    "--mesh-tolerance",
    callback=tolerance_of,
    metavar="T",
    help="In place of -n: mesh a spec with this tolerance, as gtb mesh --tolerance does.",
)
@parametrization_option
@click.option(
    "--max-faces",
    type=WholeNumber(min=1),
    metavar="N",
    default=MAX_FACES,
    help=f"Refuse to make more faces than this of a spec; {MAX_FACES} without this option.",
)
@json_option
@output_option
@spec_format_option
@console_option
def diff(
    a: str,
    b: str,
    tolerance: float | str | None,
    resolution: int | None,
    mesh_tolerance: float | str | None,
    parametrization: Parametrization,
    max_faces: int,
    as_json: bool,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o x.obj && gtb diff x.obj specs/pentagon.toml

    Compare two meshes: OBJ, PLY, STL or GLB files, or specs, which are meshed.

    Meshes with the same faces are compared vertex by vertex, others as surfaces (or curves): the largest distance of
    a point of one from the other, both ways. Normals and texture coordinates do not count; where faces are the same but
    look to the other side, a warning says how many. In two folders, files of the same name are compared, and a missing
    or an extra file is a difference. The tolerance is never less than what the numbers in the files can hold; the size
    is the diagonal of the bounding box of the smaller mesh. The distance of surfaces is found to a tenth of the
    tolerance; of large meshes a warning, the report and "proved" in JSON say where that took too long. Exit status 0
    where all is the same within the tolerance, 1 where it is not, 2 where something cannot be read.
    """
    if a == b == STANDARD:
        raise click.UsageError("standard input can be read once only")
    if resolution is not None and mesh_tolerance is not None:
        raise click.UsageError("-n and --mesh-tolerance exclude each other")
    recipe = Recipe(resolution or RESOLUTION, mesh_tolerance, parametrization, max_faces=max_faces)
    for path in (a, b):
        if path != STANDARD and not os.path.exists(path):
            raise GtbError(f"{path}: No such file or directory")
    if os.path.isdir(a) and os.path.isdir(b):
        _diff_folders(a, b, Side("", recipe, spec_format), tolerance, as_json, output, console)
        return
    if os.path.isdir(a) and b != STANDARD:
        a = os.path.join(a, os.path.basename(b))
    elif os.path.isdir(b) and a != STANDARD:
        b = os.path.join(b, os.path.basename(a))
    found = _compared(Side(a, recipe, spec_format), Side(b, recipe, spec_format), tolerance)
    names = shown_input(a), shown_input(b)
    _say_limits(found, names, console)
    write_text(output, json.dumps(_data(found, names)) + "\n" if as_json else _text(found, names))
    if not found.same:
        raise click.exceptions.Exit(DIFFERENT)


def _compared(first: Side, second: Side, tolerance: float | str | None) -> Difference:
    from gtb_cli.meshes.difference import difference

    return difference(_load(first), _load(second), tolerance)


def _load(side: Side) -> KnownMesh:
    """Read a mesh file, or make the mesh of a spec: what the content says, else the suffix."""
    from gtb_cli.formats.meshfiles import MAX_STREAM, decode_mesh, format_of, size_limit
    from gtb_cli.meshes.known import known_exactly
    from gtb_cli.spec.document import MAX_BYTES as MAX_SPEC_BYTES
    from gtb_cli.spec.loading import parse

    path, recipe, spec_format = side
    shown, suffix = shown_input(path), os.path.splitext(path)[1][1:].lower()
    with opened(path) as file:
        start = file.read(BEGINNING)
        limit = MAX_SPEC_BYTES if suffix in SPEC_FORMATS else size_limit(start, MAX_SPEC_BYTES)
        stream = not is_regular(file)
        if stream:
            limit = min(limit, MAX_STREAM)
        if file.seekable():  # so that a large file is in memory once and not twice
            file.seek(-len(start), os.SEEK_CUR)
            start = b""
        data = start + file.read(limit + 1 - len(start))
    if stream and len(data) > MAX_STREAM:
        raise GtbError(f"{shown}: does not end within {MAX_STREAM >> 20} MB, and more is read from files only")
    kind = None if suffix in SPEC_FORMATS else format_of(data) or (suffix if suffix in FORMATS else None)
    if kind is not None:
        return decode_mesh(data, shown, kind)
    if b"\0" in data[:BEGINNING] and not spec_format:
        raise GtbError(f"{shown}: is neither a mesh nor a spec")
    spec = parse(data, shown, spec_format or (suffix if suffix in SPEC_FORMATS else None))  # type: ignore[arg-type]
    with about(shown):
        recipe.check_size(spec)
        return known_exactly(recipe.mesh(spec)[0])


# --- folders


class Pair(NamedTuple):
    """Files of two folders that belong together; None where there is none."""

    name: str
    first: str | None
    second: str | None


def _diff_folders(
    a: str, b: str, side: Side, tolerance: float | str | None, as_json: bool, output: str, console: Console
) -> None:
    pairs = _pairs(a, b)
    refuse_overwriting((path for pair in pairs for path in pair[1:] if path is not None), [output])
    results: list[tuple[str, tuple[str, str], Difference]] = []
    missing: list[str] = []
    extra: list[str] = []
    errors: dict[str, str] = {}
    for name, first, second in pairs:
        if first is None or second is None:
            (missing if second is None else extra).append(name)
            continue
        try:
            found = _compared(side._replace(path=first), side._replace(path=second), tolerance)
        except GtbError as error:
            errors[name] = str(error)
            continue
        results.append((name, (first, second), found))
        _say_limits(found, (first, second), console)
    same = not missing and not extra and not errors and all(found.same for _, _, found in results)
    if as_json:
        files = [{"name": name, **_data(found, names)} for name, names, found in results]
        report = {"same": same, "files": files, "missing": missing, "extra": extra, "errors": errors}
        write_text(output, json.dumps(report) + "\n")
    else:
        text = "".join(_text(found, names) for _, names, found in results if not found.same)
        text += "".join(f"missing: {os.path.join(a, name)} is not in {b}\n" for name in missing)
        text += "".join(f"extra: {os.path.join(b, name)} is not in {a}\n" for name in extra)
        number = sum(found.same for _, _, found in results)
        counts = [f"{number} same", f"{len(results) - number} different", f"{len(missing)} missing"]
        counts += [f"{len(extra)} extra"] + ([f"{len(errors)} unreadable"] if errors else [])
        write_text(output, f"{text}{', '.join(counts)}\n")
    for message in errors.values():
        for line in message.splitlines():
            complain(line)
    if not same:
        raise click.exceptions.Exit(TROUBLE if errors else DIFFERENT)


def _pairs(a: str, b: str) -> list[Pair]:
    """Match the files of two folders by name; specs and meshes, by name without suffix."""
    first, second = _files(a), _files(b)
    if not first:
        raise GtbError(f"{a}: has no meshes and no specs to compare with")
    if _hold_specs(first) != _hold_specs(second) and second:
        first, second = _by_stem(first), _by_stem(second)
    return [Pair(name, first.get(name), second.get(name)) for name in sorted({*first, *second})]


def _files(folder: str) -> dict[str, str]:
    """Paths of the meshes in a folder, and in folders within, by name; if there are none, of the specs."""
    found: dict[str, str] = {}
    for name in _names(folder):
        found[name] = os.path.join(folder, name)
    meshes = {name: path for name, path in found.items() if _suffix(name) in FORMATS}
    return meshes or {name: path for name, path in found.items() if _suffix(name) in SPEC_FORMATS}


def _names(folder: str) -> Iterator[str]:
    def refuse(error: OSError) -> None:
        raise GtbError(f"{error.filename}: {error.strerror}") from error

    above: dict[str, tuple[str, ...]] = {}
    for place, folders, files in os.walk(folder, onerror=refuse, followlinks=True):
        here, outer = os.path.realpath(place), above.get(os.path.dirname(place), ())
        above[place] = (*outer, here)
        if here in outer:  # a link to a folder that it is in
            folders.clear()
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in files:
            if not name.startswith("."):
                yield os.path.relpath(os.path.join(place, name), folder)


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1][1:].lower()


def _hold_specs(files: dict[str, str]) -> bool:
    return any(_suffix(name) in SPEC_FORMATS for name in files)


def _by_stem(files: dict[str, str]) -> dict[str, str]:
    stems: dict[str, str] = {}
    for name, path in files.items():
        stem = os.path.splitext(name)[0]
        if stem in stems:
            raise GtbError(f"{stems[stem]} and {path}: only one of them can be compared with a spec or mesh {stem}")
        stems[stem] = path
    return stems


# --- reports


def _say_limits(found: Difference, names: tuple[str, str], console: Console) -> None:
    """Say where the answer is not quite to the question."""
    if found.asked is not None and found.asked < found.tolerance:
        console.note(
            f"{names[0]}, {names[1]}: tolerance {found.tolerance:.3g} in place of {found.asked:.3g}: "
            "the numbers in the files hold no less at this size"
        )
    if found.turned:
        console.warn(f"{names[0]}, {names[1]}: {found.turned} faces are turned: they look to the other side")
    if not found.is_proved:
        console.warn(
            f"{names[0]}, {names[1]}: nothing farther apart than {found.distance:.3g} was found, but it is not proved: "
            f"between samples it could be {found.bound:.3g}"
        )


def _data(found: Difference, names: tuple[str, str]) -> dict[str, Any]:
    report: dict[str, Any] = {
        "same": found.same,
        "distance": found.distance,
        "tolerance": found.tolerance,
        "method": found.method,
        "bound": found.bound,
        "proved": found.is_proved,
        "mean": found.mean,
        "asked_tolerance": found.asked,
        "resolution": found.resolution,
        "diagonal": found.diagonal,
        "turned_faces": found.turned if found.method == "vertices" else None,
        "vertices": None if found.vertex is None else [found.vertex, found.other_vertex],
        "group": found.group or None,
        "a_to_b": {"distance": found.forward.distance, "at": list(found.forward.at)},
        "b_to_a": {"distance": found.backward.distance, "at": list(found.backward.at)},
    }
    for key, name, measures in (("a", names[0], found.first), ("b", names[1], found.second)):
        report[key] = {"file": name, **(measures.record() if measures else {})}
    return report


def _text(found: Difference, names: tuple[str, str]) -> str:
    verdict = "same" if found.same else "different"
    head = f"{verdict}: {names[0]} and {names[1]}"
    if found.method == "vertices":
        text = f"{head}: the same faces, vertices up to {found.distance:.3g} apart"
        text += f" (mean {found.mean:.3g}), tolerance {found.tolerance:.3g}\n"
        if found.same:
            return text
        where = f" of {found.group}" if found.group else ""
        return f"{text}  most at vertex {found.vertex}{where}: {_at(found.forward.at)} and {_at(found.backward.at)}\n"
    at_most = "" if found.bound <= found.distance * 1.01 or not found.same else f" (at most {found.bound:.3g})"
    if not found.is_proved:
        at_most = f" where they were looked at (not proved: at most {found.bound:.3g})"
    what = "surfaces" if found.same_kind else "a curve and a surface,"
    text = f"{head}: other faces, {what} {found.distance:.3g} apart{at_most}, tolerance {found.tolerance:.3g}\n"
    for way, farthest in (("A from B", found.forward), ("B from A", found.backward)):
        text += f"  {way:24}{farthest.distance:.3g} at {_at(farthest.at)}\n"
    if found.first is None or found.second is None:
        return text
    rows = [measures.record() for measures in (found.first, found.second)]
    for key in dict.fromkeys([*rows[0], *rows[1]]):
        values = [row.get(key) for row in rows]
        if key != "bounds":
            equal = "" if values[0] == values[1] else "  *"
            text += f"  {key.replace('_', ' '):24}{_number(values[0]):>16}{_number(values[1]):>16}{equal}\n"
    return text


def _number(value: float | int | None) -> str:
    return "–" if value is None else f"{value:.9g}"


def _at(point: Point) -> str:
    return f"({' '.join(f'{x:.9g}' for x in point)})"
