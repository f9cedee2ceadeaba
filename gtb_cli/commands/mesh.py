"""`gtb mesh`: specs → mesh files."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import click

from gtb_cli.errors import ExportError, GtbError, RequirementError
from gtb_cli.shell.console import STANDARD, Console, lines_about
from gtb_cli.shell.meshing import MeshOptions, expected_bytes, summary
from gtb_cli.shell.options import (
    INPUT,
    OUTPUT,
    WholeNumber,
    check_outputs,
    console_option,
    mesh_options,
    output_option,
    spec_format_option,
)
from gtb_cli.shell.processes import MAX_JOBS, in_processes
from gtb_cli.shell.streams import about, file_stem, is_folder, is_terminal, read_spec, shown_input, write_blocks
from gtb_cli.vocabulary import FORMATS

if TYPE_CHECKING:
    from gtb_cli.meshes.measures import Measures
    from gtb_cli.shell.manifest import Manifest
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


SCREEN = 1000
"""Most lines of a mesh that go to a terminal."""


@click.command
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True, type=INPUT)
@output_option
@mesh_options
@click.option(
    "-j",
    "--jobs",
    type=WholeNumber(1, MAX_JOBS),
    metavar="JOBS",
    default=1,
    help="Processes that share the work on several specs; 1 without this option. Any number makes the same files.",
)
@click.option(
    "--manifest",
    metavar="FILE",
    type=OUTPUT,
    help="Write a JSON object with the versions and options used, and for each mesh file its name, sha256, bytes, "
    "vertices, faces, area, volume (null where open) and bounds. With -, to standard output.",
)
@spec_format_option
@console_option
def mesh(
    specs: tuple[str, ...],
    output: str,
    options: MeshOptions,
    jobs: int,
    manifest: str | None,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o pentagon.obj

    Turn curves, patches and models into meshes.

    A curve becomes a polyline. For several specs, OUT is a folder, made if missing, and each file in it is named after
    its spec file. A spec with an error is reported and left out, and the exit status is 2.
    """
    if specs.count(STANDARD) > 1:
        raise click.UsageError("standard input can be read once only")
    into_folder = is_folder(output)
    if len(specs) > 1 and not into_folder:
        if output == STANDARD:
            raise click.UsageError(f"{len(specs)} specs need a folder for their meshes: -o FOLDER")
        if os.path.splitext(output)[1][1:].lower() in FORMATS:
            raise click.UsageError(f"{len(specs)} specs need a folder for their meshes, and {output} names a file")
        into_folder = True
    book = None
    if manifest is not None:
        from gtb_cli.shell.manifest import Manifest

        place = os.path.join(output, "") if into_folder else output
        settings = replace(options, format=options.format_for(place)).settings
        book = Manifest(manifest, settings, place)
    if into_folder:
        _write_folder(specs, spec_format, output, options, jobs, console, book)
    else:
        spec, kind = read_spec(specs[0], spec_format), options.format_for(output)
        _write_file(Task(spec, specs[0], options, kind, book is not None), output, console, book)


def _write_file(task: Task, output: str, console: Console, manifest: Manifest | None) -> None:
    """Write one mesh to a file or to standard output."""
    faces = task.options.recipe.faces(task.spec)
    with console.progress(2 * faces) as progress:
        progress.label = shown_input(task.path)
        with about(progress.label):
            task.options.recipe.check_size(task.spec)
        made = _encoded(task)
        progress.advance(faces)
        if is_terminal(output) and made.lines > SCREEN:
            raise ExportError(f"the mesh has {made.lines} lines, and standard output is a terminal: give -o FILE")
        blocks: Iterable[bytes] = progress.over(made.blocks, faces, made.expected_bytes)
        if manifest is None or made.measures is None:
            write_blocks(output, blocks)
        else:
            blocks = manifest.recorded(output, made.measures, task.options.settings_for(task.spec), blocks)
            manifest.write_with(output, blocks)
    console.report(output, made.size, made.warnings)


def _write_folder(
    specs: tuple[str, ...],
    spec_format: str | None,
    folder: str,
    options: MeshOptions,
    jobs: int,
    console: Console,
    manifest: Manifest | None,
) -> None:
    """Write one mesh for each spec; what is wrong with some of them is raised when the others are written."""
    from gtb_cli.files import StagedFiles

    kind = options.format_for(os.path.join(folder, ""))
    tasks: list[Task] = []
    errors: list[GtbError] = []
    for path in specs:
        try:
            spec = read_spec(path, spec_format)
            with about(shown_input(path)):
                options.recipe.check_size(spec)
            tasks.append(Task(spec, path, options, kind, manifest is not None))
        except Exception as error:  # noqa: BLE001 -- what is wrong with one spec does not take the others along
            errors.append(_fault(path, error))
    if not tasks:
        raise _joined(errors)
    names = _file_names(tasks)
    check_outputs(*(os.path.join(folder, name) for name in names))
    jobs = min(jobs, len(tasks))
    reports = []
    with ExitStack() as stack:
        files = stack.enter_context(StagedFiles(folder))
        encoded: Generator[Encoded | GtbError] = (_attempted(task) for task in tasks)
        if jobs > 1:
            encoded = in_processes(_attempted_whole, tasks, jobs)
        stack.enter_context(closing(encoded))
        sizes = [options.recipe.faces(task.spec) for task in tasks]
        progress = stack.enter_context(console.progress(2 * sum(sizes)))
        for name, task, faces in zip(names, tasks, sizes, strict=True):
            progress.label = task.path
            result = next(encoded)
            progress.advance(faces)
            if isinstance(result, GtbError):
                errors.append(result)
                continue
            blocks: Iterable[bytes] = progress.over(result.blocks, faces, result.expected_bytes)
            target = os.path.join(folder, name)
            if manifest is not None and result.measures is not None:
                blocks = manifest.recorded(target, result.measures, options.settings_for(task.spec), blocks)
            try:
                files.add(name, blocks)
            except (GtbError, OSError):
                raise
            except Exception as error:  # noqa: BLE001 -- likewise
                errors.append(_fault(task.path, error))
                continue
            reports.append((target, result.size, result.warnings))
        if not reports:  # then a folder made for them goes, too
            raise _joined(errors)
        if manifest is not None:
            manifest.stage(files)
    if manifest is not None:
        manifest.finish()
    for output, size, warnings in reports:
        console.report(output, size, warnings)
    if errors:
        raise _joined(errors)


def _joined(errors: list[GtbError]) -> GtbError:
    text = "\n".join(map(str, errors))
    return RequirementError(text) if all(isinstance(error, RequirementError) for error in errors) else GtbError(text)


class Task(NamedTuple):
    """A mesh to make."""

    spec: Patch | Model
    path: str
    options: MeshOptions
    kind: str
    measured: bool


class Encoded(NamedTuple):
    """A mesh file that is not written yet."""

    blocks: Iterable[bytes]
    size: str
    warnings: list[str]
    expected_bytes: float
    measures: Measures | None
    lines: int


def _encoded(task: Task) -> Encoded:
    """Make a mesh, and the bytes of its file."""
    spec, path, options, kind, measured = task
    with about(shown_input(path)):
        mesh, remarks = options.recipe.mesh(spec)
        blocks = options.encoded(mesh, kind)
    measures = None
    if measured:
        from gtb_cli.meshes.measures import measure

        measures = measure(mesh)
    lines = len(mesh.vertices) + len(mesh.cells) if kind == "obj" or options.ascii else 0
    warnings = [*remarks, *options.warnings(mesh, kind)]
    assurance = options.recipe.assurance(spec)
    size = summary(mesh) + (f", tolerance {assurance}" if assurance else "")
    return Encoded(blocks, size, warnings, expected_bytes(mesh), measures, lines)


def _attempted(task: Task) -> Encoded | GtbError:
    """The same, or what is wrong with it."""
    try:
        return _encoded(task)
    except Exception as error:  # noqa: BLE001 -- likewise
        return _fault(task.path, error)


def _attempted_whole(task: Task) -> Encoded | GtbError:
    try:
        encoded = _encoded(task)
        return encoded._replace(blocks=[b"".join(encoded.blocks)])
    except Exception as error:  # noqa: BLE001 -- likewise
        return _fault(task.path, error)


def _fault(path: str, error: Exception) -> GtbError:
    """What went wrong with one of several specs, with its name."""
    if isinstance(error, GtbError):
        return error
    return GtbError("\n".join(f"{shown_input(path)}: {line}" for line in lines_about(error)))


def _file_names(tasks: list[Task]) -> list[str]:
    """Name the files after the spec files; what comes from standard input, after the spec's own name."""
    sources: dict[str, str] = {}
    for spec, path, _, kind, _ in tasks:
        stem = spec.name if path == STANDARD else os.path.splitext(os.path.basename(path))[0]
        name = f"{file_stem(stem)}.{kind}"
        if name in sources:
            raise click.UsageError(f"{sources[name]} and {path} would both be written to {name}")
        sources[name] = path
    return list(sources)
