"""`gtb diff`: two meshes, or two folders of meshes → whether they agree within a tolerance."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, NamedTuple

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.console import STANDARD, Console, complain, lines_about, printable
from gtb_cli.shell.differences import Bytes, limits, record, text_about
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
    from gtb_cli.meshes.difference import Aspect, Difference, Kind
    from gtb_cli.theory.parametrization import Parametrization

DIFFERENT, TROUBLE = 1, 2
"""Exit statuses, the same as those of diff(1)."""


class Source(NamedTuple):
    """One of the two inputs, and how to read it."""

    path: str
    recipe: Recipe
    spec_format: str | None


class Question(NamedTuple):
    """What is asked about two inputs."""

    tolerance: float | str | None
    kind: Kind
    ignore: tuple[Aspect, ...]


class Answer(NamedTuple):
    """What is found, by the names of the inputs, and what is to be said about it."""

    found: Difference | Bytes
    names: tuple[str, str]
    warnings: list[str]


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
    help="What is no difference between faces in the same place: orientation (turned over), connectivity (other holes "
    "or parts, vertices shared in another way, faces missing, there twice or without area), or both, with a comma.",
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

    In two folders, all files of the same name are compared: those that are no meshes, and no specs of folders without
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
    source, question = Source("", recipe, spec_format), Question(tolerance, kind, ignore)
    if os.path.isdir(a) and os.path.isdir(b):
        _diff_folders(a, b, source, question, as_json, output, console)
        return
    if os.path.isdir(a) and b != STANDARD:
        a = os.path.join(a, os.path.basename(b))
    elif os.path.isdir(b) and a != STANDARD:
        b = os.path.join(b, os.path.basename(a))
    try:
        answer = _compared(source._replace(path=a), source._replace(path=b), question, console)
    except GtbError as error:
        if as_json:
            write_text(output, json.dumps({"same": False, "errors": lines_about(error)}) + "\n")
        raise
    write_text(output, json.dumps(record(*answer)) + "\n" if as_json else text_about(*answer[:2]))
    if not answer.found.same:
        raise click.exceptions.Exit(DIFFERENT)


def _compared(first: Source, second: Source, question: Question, console: Console) -> Answer:
    """Read and compare two inputs, and say where the answer does not quite fit the question."""
    names = shown_input(first.path), shown_input(second.path)
    if _are_equal_meshes(first.path, second.path):
        return Answer(Bytes(True), names, [])
    from gtb_cli.distances.comparison import compared, made_with

    a, b = _read(first), _read(second)
    found = compared(a, b, *question)
    warnings, notes = limits(found), []
    if question.kind == "auto" and not found.same and a.spec is not None and b.spec is not None:
        other = compared(a, b, question.tolerance, "surface")
        did = "vertex by vertex" if found.method == "vertices" else "as surfaces"
        notes.append(
            f"their meshes were compared {did}; the surfaces themselves (--as surface) are {other.distance:.3g} apart"
        )
    if found.method == "surface" and question.kind == "auto" and found.same_kind and first.recipe.tolerance is None:
        made = made_with(a, b)
        if made not in (None, first.recipe.resolution):
            spec, mesh = names if a.spec is not None else names[::-1]
            notes.append(f"{mesh} has as many cells as {spec} has with -n {made}: -n {made} compares their vertices")
    for warning in warnings:
        console.warn(f"{', '.join(names)}: {warning}")
    for note in notes:
        console.note(f"{', '.join(names)}: {note}")
    return Answer(found, names, [*warnings, *notes])


def _are_equal_meshes(first: str, second: str) -> bool:
    """Tell whether two files have equal bytes and are meshes; specs with equal bytes may include other files."""
    from gtb_cli.formats.meshfiles import format_of, size_limit

    if suffix_of(first) in SPEC_FORMATS or not os.path.isfile(first) or not os.path.isfile(second):
        return False
    with opened(first) as file:
        start = file.read(1 << 16)
    is_mesh = format_of(start) is not None or size_limit(start, 0) == os.path.getsize(first)  # binary STL
    return is_mesh and _have_equal_bytes(first, second)


def _have_equal_bytes(first: str, second: str) -> bool:
    block = 1 << 20  # bytes compared at a time
    with opened(first) as file, opened(second) as other:
        if os.fstat(file.fileno()).st_size != os.fstat(other.fileno()).st_size:
            return False
        while (data := file.read(block)) == other.read(block):
            if not data:
                return True
        return False


def _read(source: Source) -> Operand:
    """Read a mesh file, or make the mesh of a spec."""
    from gtb_cli.distances.comparison import BEGINNING_BYTES, bytes_at_most, decoded
    from gtb_cli.formats.meshfiles import MAX_STREAM_BYTES

    path, recipe, spec_format = source
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


def _diff_folders(
    a: str, b: str, source: Source, question: Question, as_json: bool, output: str, console: Console
) -> None:
    found_pairs, errors = pairs(a, b)
    refuse_overwriting((path for pair in found_pairs for path in pair[1:] if path is not None), [output])
    specs = not any(suffix_of(path) in FORMATS for pair in found_pairs for path in pair[1:] if path is not None)
    results: list[tuple[str, Answer]] = []
    missing: list[str] = []
    extra: list[str] = []
    for name, first, second in found_pairs:
        if first is None or second is None:
            (missing if second is None else extra).append(name)
            continue
        try:
            for path in (first, second):
                if os.path.exists(path) and not os.path.isfile(path):  # reading a pipe would wait for its writer
                    raise GtbError(f"{path}: is not a file")
            suffixes = {suffix_of(first), suffix_of(second)}
            if suffixes <= FORMATS.keys() or (suffixes <= {*SPEC_FORMATS, *FORMATS} and (specs or len(suffixes) > 1)):
                sides = source._replace(path=first), source._replace(path=second)
                results.append((name, _compared(*sides, question, console)))
            else:
                results.append((name, Answer(Bytes(_have_equal_bytes(first, second)), (first, second), [])))
        except GtbError as error:
            errors[name] = "\n".join(lines_about(error))
    same = not missing and not extra and not errors and all(answer.found.same for _, answer in results)
    if as_json:
        files = [{"name": name, **record(*answer)} for name, answer in results]
        report = {"same": same, "files": files, "missing": missing, "extra": extra, "errors": errors}
        write_text(output, json.dumps(report) + "\n")
    else:
        lines = [f"missing: {os.path.join(a, name)} is not in {b}" for name in missing]
        lines += [f"extra: {os.path.join(b, name)} is not in {a}" for name in extra]
        text = "".join(text_about(*answer[:2]) for _, answer in results if not answer.found.same)
        text += "".join(f"{printable(line)}\n" for line in lines)
        number = sum(answer.found.same for _, answer in results)
        counts = [f"{number} same", f"{len(results) - number} different", f"{len(missing)} missing"]
        counts += [f"{len(extra)} extra"] + ([f"{len(errors)} unreadable"] if errors else [])
        write_text(output, f"{text}{', '.join(counts)}\n")
    for message in errors.values():
        for line in message.splitlines():
            complain(line)
    if not same:
        raise click.exceptions.Exit(TROUBLE if errors else DIFFERENT)
