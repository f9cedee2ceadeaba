"""`gtb mesh`: specs → mesh files."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import click

from gtb_cli.commands.console import STANDARD, Console
from gtb_cli.commands.meshing import MeshOptions, expected_bytes, summary
from gtb_cli.commands.options import console_option, file_names, mesh_options, output_option, spec_format_option
from gtb_cli.commands.processes import MAX_JOBS, in_processes
from gtb_cli.commands.streams import about, file_stem, is_folder, read_spec, shown_input
from gtb_cli.errors import GtbError, RequirementError
from gtb_cli.vocabulary import FORMATS

if TYPE_CHECKING:
    from gtb_cli.commands.manifest import Manifest
    from gtb_cli.meshes.measures import Measures
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


@click.command
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True, shell_complete=file_names)
@output_option
@mesh_options
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1, MAX_JOBS),
    metavar="JOBS",
    default=1,
    help="Processes that share the work on several specs; 1 without this option. Any number makes the same files.",
)
@click.option(
    "--manifest",
    metavar="FILE",
    shell_complete=file_names,
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

    A curve becomes a polyline. Of several specs, OUT is a folder, made if missing, and each file in it is named after
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
    if not into_folder and specs[0] != STANDARD and os.path.exists(output) and os.path.samefile(specs[0], output):
        raise click.UsageError(f"{output} is the spec, and would be overwritten")
    book = None
    if manifest is not None:
        from gtb_cli.commands.manifest import Manifest

        place = os.path.join(output, "") if into_folder else output
        settings = replace(options, format=options.format_for(place)).settings
        book = Manifest(manifest, settings, place, specs)
    if into_folder:
        _write_folder(specs, spec_format, output, options, jobs, console, book)
    else:
        options.write(read_spec(specs[0], spec_format), shown_input(specs[0]), output, console, book)


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
        except GtbError as error:
            errors.append(error)
    if not tasks:
        raise _joined(errors)
    names = _file_names(tasks)
    jobs = min(jobs, len(tasks))
    reports = []
    with ExitStack() as stack:
        files = stack.enter_context(StagedFiles(folder))
        encoded: Generator[Encoded | GtbError] = (_encoded(task) for task in tasks)
        if jobs > 1:
            encoded = in_processes(_encoded_whole, tasks, jobs)
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
            files.add(name, blocks)
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


def _encoded(task: Task) -> Encoded | GtbError:
    spec, path, options, kind, measured = task
    measures = None
    try:
        with about(shown_input(path)):
            mesh, remarks = options.recipe.mesh(spec)
            blocks = options.encoded(mesh, kind)
            if measured:
                from gtb_cli.meshes.measures import measure

                measures = measure(mesh)
    except GtbError as error:
        return error
    warnings = [*remarks, *options.warnings(mesh, kind)]
    return Encoded(blocks, summary(mesh), warnings, expected_bytes(mesh), measures)


def _encoded_whole(task: Task) -> Encoded | GtbError:
    encoded = _encoded(task)
    return encoded if isinstance(encoded, GtbError) else encoded._replace(blocks=[b"".join(encoded.blocks)])


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
