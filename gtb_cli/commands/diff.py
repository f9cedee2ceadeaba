"""`gtb diff`: two meshes, or two folders of meshes → whether they agree within a tolerance."""

from __future__ import annotations

import filecmp
import json
import os
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.console import STANDARD, Console, complain, lines_about, printable
from gtb_cli.shell.differences import Answer, limits, record, text_about
from gtb_cli.shell.folders import pairs
from gtb_cli.shell.options import (
    INPUT,
    json_option,
    max_faces_option,
    parametrization_option,
    resolution_option,
    text_options,
    tolerance_of,
)
from gtb_cli.shell.streams import is_regular, opened, refuse_overwriting, shown_input, write_text
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import FORMATS, RESOLUTION, SPEC_FORMATS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.distances.comparison import Operand
    from gtb_cli.meshes.difference import Aspect, Kind
    from gtb_cli.theory.parametrization import Parametrization

Compare: TypeAlias = Callable[[str, str], Answer]


def _tolerance_or_none(ctx: click.Context, param: click.Parameter, value: str | None) -> float | str | None:
    """Read a tolerance as `tolerance_of` does, but allow 0."""
    return 0.0 if value is not None and value.strip() in ("0", "0%", "0.0") else tolerance_of(ctx, param, value)


def _aspects(_ctx: click.Context, _param: click.Parameter, value: str | None) -> tuple[Aspect, ...]:
    aspects: tuple[Aspect, ...] = ("orientation", "connectivity")
    words = [word.strip() for word in value.split(",")] if value is not None else []
    if wrong := [word for word in words if word not in aspects]:
        raise click.BadParameter(f"expected {' or '.join(aspects)}, or both with a comma, got {wrong[0]!r}")
    return tuple(aspect for aspect in aspects if aspect in words)


@click.command
@click.argument("a", metavar="A", type=INPUT)
@click.argument("b", metavar="B", type=INPUT)
@click.option(
    "--tolerance",
    callback=_tolerance_or_none,
    metavar="T",
    help="Largest distance that is not a difference, in model units or such as 1% of the size; 1e-9 of the size "
    "by default. 0 means what the numbers in the files can hold.",
)
@click.option(
    "--as",
    "kind",
    type=click.Choice(["auto", "vertices", "surface"]),
    default="auto",
    help="Compare vertex by vertex if the faces are the same, else as surfaces (auto); only vertex by vertex; or only "
    "as surfaces. Two specs are then compared themselves, whatever their parameters, and not their meshes.",
)
@click.option(
    "--ignore",
    callback=_aspects,
    metavar="WHAT",
    help="What is not a difference between faces in the same place: orientation (turned over), connectivity (other "
    "holes or parts, vertices shared in another way, faces missing, there twice or without area), or both.",
)
@resolution_option
@click.option(
    "--mesh-tolerance",
    callback=tolerance_of,
    metavar="T",
    help="Instead of -n: mesh a spec with this tolerance, as gtb mesh --tolerance does.",
)
@parametrization_option
@max_faces_option
@json_option
@text_options
def diff(
    a: str,
    b: str,
    tolerance: float | str | None,
    kind: Kind,
    ignore: tuple[Aspect, ...],
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

    Compare two meshes: OBJ, PLY, STL or GLB files, or specs, which are meshed with -n and the options below it.

    Meshes with the same faces, in any order, are compared vertex by vertex, others as surfaces (or curves): the largest
    distance of a point of either from the other. With --as surface, two specs are compared as what they describe, to
    three digits, by a search that proves nothing. Faces that are turned over, missing, there twice or without area,
    other holes or parts, and vertices that are shared in another way are differences, too, unless --ignore says
    otherwise; normals and texture coordinates are none. The tolerance is never less than what the numbers in the files
    can hold; the size is the diagonal of the bounding box of the smaller mesh; vertices that no face uses do not count.
    The distance of surfaces is found to a tenth of the tolerance; if that takes too long for large meshes, a warning,
    the report and "proved" in JSON say so.

    In two folders, all files of the same name are compared: those that are not meshes, nor specs of folders without
    meshes, by their bytes. A missing or an extra file is a difference. Hidden files and manifests do not count.

    Exit status 0 if everything agrees within the tolerance, 1 if not, 2 if something cannot be read.
    """
    if a == b == STANDARD:
        raise click.UsageError("standard input can be read only once")
    if resolution is not None and mesh_tolerance is not None:
        raise click.UsageError("-n and --mesh-tolerance exclude each other")
    recipe = Recipe(resolution or RESOLUTION, mesh_tolerance, parametrization, max_faces=max_faces)
    for path in (a, b):
        if path != STANDARD and not os.path.exists(path):
            raise GtbError(f"{path}: No such file or directory")
    question = tolerance, kind, ignore
    compare = partial(_compared, recipe=recipe, spec_format=spec_format, question=question, console=console)
    if os.path.isdir(a) and os.path.isdir(b):
        return _diff_folders(a, b, compare, as_json, output)
    if os.path.isdir(a) and b != STANDARD:
        a = os.path.join(a, os.path.basename(b))
    elif os.path.isdir(b) and a != STANDARD:
        b = os.path.join(b, os.path.basename(a))
    try:
        answer = compare(a, b)
    except GtbError as error:
        if as_json:
            write_text(output, json.dumps({"same": False, "errors": lines_about(error)}) + "\n")
        raise
    write_text(output, json.dumps(record(answer)) + "\n" if as_json else text_about(answer))
    if not answer.same:
        raise click.exceptions.Exit(1)


def _compared(
    first: str,
    second: str,
    recipe: Recipe,
    spec_format: str | None,
    question: tuple[float | str | None, Kind, tuple[Aspect, ...]],
    console: Console,
) -> Answer:
    """Read and compare two inputs, and say where the answer does not quite fit the question."""
    names = shown_input(first), shown_input(second)
    if _are_equal_meshes(first, second):
        return Answer(names, True)
    from gtb_cli.distances.comparison import compared, made_with

    a, b = _read(first, recipe, spec_format), _read(second, recipe, spec_format)
    found = compared(a, b, *question)
    warnings, notes = limits(found), []
    tolerance, kind, _ = question
    if kind == "auto" and not found.same and a.spec is not None and b.spec is not None:
        other = compared(a, b, tolerance, "surface")
        did = "vertex by vertex" if found.method == "vertices" else "as surfaces"
        notes.append(
            f"their meshes were compared {did}; the surfaces themselves (--as surface) are {other.distance:.3g} apart"
        )
    if kind == "auto" and found.method == "surface" and found.same_kind and recipe.tolerance is None:
        made = made_with(a, b)
        if made not in (None, recipe.resolution):
            spec, mesh = names if a.spec is not None else names[::-1]
            notes.append(f"{mesh} has as many cells as {spec} has with -n {made}: -n {made} compares their vertices")
    for say, messages in ((console.warn, warnings), (console.note, notes)):
        for message in messages:
            say(f"{', '.join(names)}: {message}")
    return Answer(names, found.same, found, (*warnings, *notes))


def _are_equal_meshes(first: str, second: str) -> bool:
    """Tell whether two files have equal bytes and are meshes; specs with equal bytes may include other files."""
    from gtb_cli.formats.meshfiles import format_of, size_limit

    if suffix_of(first) in SPEC_FORMATS or not os.path.isfile(first) or not os.path.isfile(second):
        return False
    with opened(first) as file:
        start = file.read(1 << 16)
    is_mesh = format_of(start) is not None or size_limit(start, 0) == os.path.getsize(first)  # binary STL
    return is_mesh and filecmp.cmp(first, second, shallow=False)


def _read(path: str, recipe: Recipe, spec_format: str | None) -> Operand:
    """Read a mesh file, or make the mesh of a spec."""
    from gtb_cli.distances.comparison import BEGINNING_BYTES, bytes_at_most, decoded
    from gtb_cli.formats.meshfiles import MAX_STREAM_BYTES

    shown = shown_input(path)
    with opened(path) as file:
        start = file.read(BEGINNING_BYTES)
        limit = bytes_at_most(path, start)
        stream = not is_regular(file)
        if stream:
            limit = min(limit, MAX_STREAM_BYTES)
        if file.seekable():  # so that a large file is in memory only once
            file.seek(-len(start), os.SEEK_CUR)
            start = b""
        data = start + file.read(limit + 1 - len(start))
    if stream and len(data) > MAX_STREAM_BYTES:
        raise GtbError(f"{shown}: does not end within {MAX_STREAM_BYTES >> 20} MB; more is read only from files")
    return decoded(data, shown, recipe, spec_format)  # type: ignore[arg-type]


def _diff_folders(a: str, b: str, compare: Compare, as_json: bool, output: str) -> None:
    """Compare all files of two folders, and end with the worst status."""
    matched, errors = pairs(a, b)
    paths = [path for pair in matched for path in pair[1:] if path is not None]
    refuse_overwriting(paths, [output])
    has_meshes = any(suffix_of(path) in FORMATS for path in paths)
    answers: dict[str, Answer] = {}
    for name, first, second in matched:
        if first is None or second is None:
            continue
        try:
            for path in (first, second):
                if os.path.exists(path) and not os.path.isfile(path):  # reading a pipe would wait for its writer
                    raise GtbError(f"{path}: is not a file")
            suffixes = {suffix_of(first), suffix_of(second)}
            specs_count = not has_meshes or len(suffixes) > 1
            if suffixes <= FORMATS.keys() or (suffixes <= {*SPEC_FORMATS, *FORMATS} and specs_count):
                answers[name] = compare(first, second)
            else:
                answers[name] = Answer((first, second), filecmp.cmp(first, second, shallow=False))
        except (GtbError, OSError) as error:
            errors[name] = "\n".join(lines_about(error))
    missing = [name for name, _, second in matched if second is None]
    extra = [name for name, first, _ in matched if first is None]
    different = [answer for answer in answers.values() if not answer.same]
    same = not (missing or extra or errors or different)
    if as_json:
        files = [{"name": name, **record(answer)} for name, answer in answers.items()]
        report = {"same": same, "files": files, "missing": missing, "extra": extra, "errors": errors}
        write_text(output, json.dumps(report) + "\n")
    else:
        text = "".join(map(text_about, different))
        text += "".join(f"{printable(f'missing: {os.path.join(a, name)} is not in {b}')}\n" for name in missing)
        text += "".join(f"{printable(f'extra: {os.path.join(b, name)} is not in {a}')}\n" for name in extra)
        counts = f"{len(answers) - len(different)} same, {len(different)} different"
        counts += f", {len(missing)} missing, {len(extra)} extra" + (f", {len(errors)} unreadable" if errors else "")
        write_text(output, f"{text}{counts}\n")
    for message in errors.values():
        for line in message.splitlines():
            complain(line)
    if not same:
        raise click.exceptions.Exit(2 if errors else 1)
