"""`gtb mesh`: specs → mesh files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from gtb_cli.errors import ExportError, GtbError, RequirementError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.meshing import MeshOptions, expected_bytes, summary
from gtb_cli.shell.options import (
    OUTPUT,
    check_outputs,
    console_option,
    mesh_options,
    named_files,
    output_option,
    spec_format_option,
    specs_argument,
)
from gtb_cli.shell.several import attempted, fault, inputs_of
from gtb_cli.shell.streams import (
    about,
    file_stem,
    is_device,
    is_folder,
    is_terminal,
    read_spec,
    shown_input,
    stem_of,
    write_blocks,
    write_text,
)
from gtb_cli.shell.surfaces import surface_format, write_surfaces
from gtb_cli.shell.workers import Workers, workers_option
from gtb_cli.vocabulary import CAD_FORMATS, CELL_FORMATS, FORMATS, UNITS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.meshes.measures import Measures
    from gtb_cli.shell.manifest import Entry, Manifest, OneByOne
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


@click.command
@specs_argument
@output_option
@mesh_options(*CAD_FORMATS, *CELL_FORMATS)
@workers_option
@click.option(
    "--manifest",
    metavar="FILE",
    type=OUTPUT,
    help="Write a JSON object with the versions and options used, and for each mesh file its name, sha256, bytes, "
    "vertices, faces, area, volume (null where open) and bounds. With -, to standard output.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Make only files that the old manifest does not show to be up to date. Each then appears when made, and "
    "an interrupted run can be resumed.",
)
@click.option(
    "--deps",
    metavar="FILE",
    type=OUTPUT,
    help="Write rules for make: each mesh depends on its spec and the files that the spec includes.",
)
@click.option(
    "--unit",
    type=click.Choice(UNITS),
    default=UNITS[0],
    help=f"Unit of length in STEP and IGES files; {UNITS[0]} without this option.",
)
@spec_format_option
@console_option
def mesh(
    specs: tuple[str, ...],
    output: str,
    options: MeshOptions,
    unit: str,
    workers: Workers,
    manifest: str | None,
    resume: bool,
    deps: str | None,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o pentagon.obj

    Turn curves, patches and models into meshes.

    A curve becomes a polyline. For several specs, OUT is a folder, made if missing, and each file in it is named after
    its spec file; a folder stands for the specs in it. A spec with an error is reported and left out, and the exit
    status is 2; it is 1 if only what --require asks for is missing.

    STEP, IGES and BREP files (extra gtb-cli[cad]) hold surfaces: the exact rational Bézier pieces of each patch that
    has them, or pieces fitted within --tolerance. They are sewn, and are a solid if closed. VTU files hold exact curved
    cells for ParaView, or are refused.
    """
    if (surfaces := surface_format(options.format, output)) is not None:
        if manifest is not None or deps is not None:
            raise click.UsageError(f"--manifest and --deps are for meshes, and {surfaces.upper()} holds surfaces")
        write_surfaces(specs, surfaces, unit, options, spec_format, output, console)
        return
    into_folder = is_folder(output) or (output != STANDARD and any(map(os.path.isdir, specs)))
    specs = inputs_of(specs, output)
    if len(specs) > 1 and not into_folder:
        if output == STANDARD:
            raise click.UsageError(f"{len(specs)} specs need a folder for their meshes: -o FOLDER")
        if suffix_of(output) in FORMATS:
            raise click.UsageError(f"{len(specs)} specs need a folder for their meshes, and {output} names a file")
        into_folder = True
    if deps is not None and (output == STANDARD or STANDARD in specs):
        raise click.UsageError("--deps: make knows files only, and not standard input or output")
    book = None
    if resume and (manifest is None or manifest == STANDARD or is_device(manifest)):
        raise click.UsageError("--resume needs --manifest FILE, which shows what is up to date")
    if manifest is not None:
        from gtb_cli.shell.manifest import Manifest

        place = os.path.join(output, "") if into_folder else output
        settings = replace(options, format=options.format_for(place)).settings
        limits = {"max_faces": options.recipe.max_faces, "require": options.recipe.require, "spec_format": spec_format}
        book = Manifest(manifest, settings | limits, place, resume=resume)
    if into_folder:
        _write_folder(specs, spec_format, output, options, workers, console, book, deps, resume)
    elif book is not None and (entry := book.kept(output, specs[0])) is not None:
        book.replace()
        _write_rules(deps, [(output, specs[0])], spec_format)
        console.report(output, _size_of(entry), entry["warnings"])
    else:
        kind, sums = options.format_for(output), _sums(book, specs[0], spec_format)
        task = Task(read_spec(specs[0], spec_format), specs[0], options, kind, sums)
        _write_file(task, output, console, book, workers)
        _write_rules(deps, [(output, specs[0])], spec_format)


def _write_rules(deps: str | None, targets: list[tuple[str, str]], spec_format: str | None) -> None:
    """Write rules for make, if --deps asks for them."""
    if deps is not None:
        from gtb_cli.shell.upkeep import rules

        write_text(deps, rules(targets, spec_format))


def _sums(manifest: Manifest | None, path: str, spec_format: str | None) -> dict[str, str] | None:
    """Return checksums of the files that a spec is read from, before it is read; None without a manifest."""
    if manifest is None:
        return None
    from gtb_cli.shell.upkeep import input_sums

    return input_sums(path, spec_format)


def _size_of(entry: Mapping[str, Any]) -> str:
    cells = "segments" if "segments" in entry else "faces"
    return f"{entry['vertices']} vertices, {entry[cells]} {cells}, up to date"


def _write_file(task: Task, output: str, console: Console, manifest: Manifest | None, workers: Workers) -> None:
    """Write one mesh to a file or to standard output."""
    max_terminal_lines = 1000  # largest number of lines of a mesh that may go to a terminal
    faces = task.options.recipe.faces(task.spec)
    with console.progress(2 * faces) as progress:
        progress.label = shown_input(task.path)
        with about(progress.label):
            task.options.recipe.check_size(task.spec)
        made = next(workers.results(partial(_attempted, encode=_encoded_whole), [task], _encoded))
        if isinstance(made, GtbError):
            raise made
        progress.advance(faces)
        if is_terminal(output) and made.lines > max_terminal_lines:
            raise ExportError(f"the mesh has {made.lines} lines, and standard output is a terminal: give -o FILE")
        blocks: Iterable[bytes] = progress.over(made.blocks, faces, made.expected_bytes)
        if manifest is None or made.measures is None:
            write_blocks(output, blocks)
        else:
            manifest.write_with(output, manifest.recorded(output, partial(_entry, task, made), blocks))
    console.report(output, made.size, made.warnings)


def _write_folder(
    specs: tuple[str, ...],
    spec_format: str | None,
    folder: str,
    options: MeshOptions,
    workers: Workers,
    console: Console,
    manifest: Manifest | None,
    deps: str | None,
    resume: bool,
) -> None:
    """Write one mesh for each spec; errors in some are raised after the others have been written."""
    from gtb_cli.files import StagedFiles

    kind = options.format_for(os.path.join(folder, ""))
    planned: list[Task | Kept] = []
    errors: list[GtbError] = []
    plan = partial(_planned, spec_format=spec_format, folder=folder, kind=kind, options=options, manifest=manifest)
    for path in specs:
        found = attempted(path, plan, path)
        if isinstance(found, GtbError):
            errors.append(found)
        else:
            planned.append(found)
    if not planned:
        raise _joined(errors)
    names = _file_names(planned, kind)
    check_outputs(*named_files(OUTPUT), *(os.path.join(folder, name) for name in names))
    tasks = [task for task in planned if isinstance(task, Task)]
    reports = []
    with ExitStack() as stack:
        files: StagedFiles | OneByOne
        if manifest is not None and resume:
            from gtb_cli.shell.manifest import OneByOne

            files = stack.enter_context(OneByOne(folder, manifest, [os.path.join(folder, name) for name in names]))
        else:
            files = stack.enter_context(StagedFiles(folder))
        encoded = workers.results(partial(_attempted, encode=_encoded_whole), tasks, _attempted)
        stack.enter_context(closing(encoded))
        sizes = [options.recipe.faces(task.spec) if isinstance(task, Task) else 0 for task in planned]
        progress = stack.enter_context(console.progress(2 * sum(sizes)))
        for name, task, faces in zip(names, planned, sizes, strict=True):
            target = os.path.join(folder, name)
            if isinstance(task, Kept):
                reports.append((target, task.path, _size_of(task.entry), task.entry["warnings"]))
                continue
            progress.label = task.path
            result = next(encoded)
            progress.advance(faces)
            if isinstance(result, GtbError):
                errors.append(result)
                continue
            blocks: Iterable[bytes] = progress.over(result.blocks, faces, result.expected_bytes)
            if manifest is not None and result.measures is not None:
                blocks = manifest.recorded(target, partial(_entry, task, result), blocks)
            try:
                files.add(name, blocks)
            except (GtbError, OSError):
                raise
            except Exception as error:  # noqa: BLE001 -- blocks are made as they are written: it is this spec's error
                errors.append(fault(task.path, error))
                continue
            reports.append((target, task.path, result.size, result.warnings))
        if not reports:  # then a folder made for them is also removed
            raise _joined(errors)
        if manifest is not None and isinstance(files, StagedFiles):
            manifest.stage(files)
    if manifest is not None:
        manifest.finish()
    _write_rules(deps, [(output, path) for output, path, _, _ in reports], spec_format)
    for output, _, size, warnings in reports:
        console.report(output, size, warnings)
    if errors:
        raise _joined(errors)


def _planned(
    path: str, spec_format: str | None, folder: str, kind: str, options: MeshOptions, manifest: Manifest | None
) -> Task | Kept:
    """Read a spec, unless its mesh in the folder is up to date according to the manifest."""
    if manifest is not None and path != STANDARD:
        entry = manifest.kept(os.path.join(folder, _file_name(path, kind)), path)
        if entry is not None:
            return Kept(path, entry)
    sums = _sums(manifest, path, spec_format)
    spec = read_spec(path, spec_format)
    with about(shown_input(path)):
        options.recipe.check_size(spec)
    return Task(spec, path, options, kind, sums)


def _joined(errors: list[GtbError]) -> GtbError:
    text = "\n".join(map(str, errors))
    return RequirementError(text) if all(isinstance(error, RequirementError) for error in errors) else GtbError(text)


class Kept(NamedTuple):
    """A mesh that is up to date according to the manifest."""

    path: str
    entry: Mapping[str, Any]


class Task(NamedTuple):
    """A mesh to make, with checksums of the files that its spec is read from if there is a manifest."""

    spec: Patch | Model
    path: str
    options: MeshOptions
    kind: str
    sums: dict[str, str] | None


class Encoded(NamedTuple):
    """A mesh file that has not been written yet."""

    blocks: Iterable[bytes]
    size: str
    warnings: list[str]
    expected_bytes: float
    measures: Measures | None
    lines: int


def _encoded(task: Task) -> Encoded:
    """Make a mesh and the bytes of its file."""
    spec, path, options, kind, sums = task
    with about(shown_input(path)):
        mesh, remarks = options.recipe.mesh(spec)
        blocks = options.encoded(mesh, kind)
    measures = None
    if sums is not None:
        from gtb_cli.formats.export import standing
        from gtb_cli.meshes.measures import measure

        measures = measure(standing(mesh, kind, options.up))
    lines = len(mesh.vertices) + len(mesh.cells) if kind == "obj" or options.ascii else 0
    warnings = [*remarks, *options.warnings(mesh, kind)]
    assurance = options.recipe.assurance(spec)
    size = summary(mesh) + (f", tolerance {assurance}" if assurance else "")
    if kind == "stl" and options.recipe.leaves_open(spec):
        size += ", open: --thickness D makes a solid"
    return Encoded(blocks, size, warnings, expected_bytes(mesh), measures, lines)


def _encoded_whole(task: Task) -> Encoded:
    """Make the same as a single block, which a process can send to another."""
    made = _encoded(task)
    return made._replace(blocks=[b"".join(made.blocks)])


def _entry(task: Task, made: Encoded, name: str) -> Entry:
    """Return the entry of a mesh file in the manifest."""
    from gtb_cli.shell.manifest import Entry

    assert made.measures is not None
    settings = task.options.settings_for(task.spec)
    return Entry(name, settings, made.measures, task.sums or {}, made.warnings)


def _attempted(task: Task, encode: Callable[[Task], Encoded] = _encoded) -> Encoded | GtbError:
    return attempted(task.path, encode, task)


def _file_name(path: str, kind: str) -> str:
    """Name a file after the spec file."""
    return f"{stem_of(path)}.{kind}"


def _file_names(planned: list[Task | Kept], kind: str) -> list[str]:
    """Name the files after the spec files; that of standard input, after the spec's own name."""
    sources: dict[str, str] = {}
    for task in planned:
        path = task.path
        name = _file_name(path, kind)
        if path == STANDARD and isinstance(task, Task):
            name = f"{file_stem(task.spec.name)}.{kind}"
        if name in sources:
            raise click.UsageError(f"{sources[name]} and {path} would both be written to {name}")
        sources[name] = path
    return list(sources)
