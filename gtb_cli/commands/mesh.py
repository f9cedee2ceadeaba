"""`gtb mesh`: specs → mesh files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, NamedTuple, TypeAlias

import click

from gtb_cli.errors import ExportError, GtbError, RequirementError
from gtb_cli.shell.faults import in_options
from gtb_cli.shell.gathering import option
from gtb_cli.shell.meshing import MeshOptions, summary
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import INPUT, OUTPUT, check_outputs, mesh_options, output_option, reading_streams
from gtb_cli.shell.several import attempted, inputs_of
from gtb_cli.shell.streams import (
    Spec,
    Streams,
    about,
    file_stem,
    input_stem,
    is_device,
    is_folder,
    is_terminal,
    shown_input,
    write_blocks,
)
from gtb_cli.shell.surface_files import check_unit, surface_format, write_surfaces
from gtb_cli.shell.watching import watched
from gtb_cli.shell.workers import Workers, workers_option
from gtb_cli.values import grouped
from gtb_cli.vocabulary import CAD_FORMATS, CELL_FORMATS, DEFAULT_UNIT, FORMATS, UNITS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.shell.manifest import Manifest

Write: TypeAlias = Callable[[str, Iterable[bytes]], None]


class GroupedOptions(click.Command):
    """A command whose help lists its options in groups."""

    GROUPS: ClassVar = {
        "What is made": "let fills parametrization radius thickness rim weld normals uv attributes",
        "How fine": "resolution tolerance max_faces",
        "What must hold": "require",
        "Where it goes, and how it is written": "output watch format ascii up unit",
        "For CI": "manifest resume",
        "For many specs and machines": "jobs cluster",
    }

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the options in their groups, and the others last."""
        options = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        left = {option.name: record for option in options if (record := option.get_help_record(ctx))}
        groups = {title: [left.pop(name) for name in names.split()] for title, names in self.GROUPS.items()}
        for title, records in (groups | {"Others": list(left.values())}).items():
            with formatter.section(title):
                formatter.write_dl(records)


@click.command(cls=GroupedOptions)
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True, type=INPUT)
@output_option
@mesh_options(*CAD_FORMATS, *CELL_FORMATS)
@workers_option
@option("--manifest FILE", OUTPUT)(
    help="Write a JSON object with the versions and options used, and for each mesh file its name, sha256, bytes, "
    "vertices, faces, area, volume (null where open) and bounds. With -, to standard output."
)
@option("--resume", bool)(
    help="Make only files that the old manifest does not show to be up to date. Each then appears when made, and "
    "an interrupted run can be resumed."
)
@option("--unit", (*UNITS,))(
    help=f"Unit of length of STEP, IGES and 3MF files, {DEFAULT_UNIT} without this option; GLB files, which are "
    "in metres, are scaled from it."
)
@reading_streams
@watched
def mesh(
    specs: tuple[str, ...], options: MeshOptions, workers: Workers, manifest: str | None, resume: bool, streams: Streams
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o pentagon.obj

    Turn curves, patches and models into meshes: OBJ, PLY, STL, GLB or 3MF.

    A curve becomes a polyline. For several specs, OUT is a folder, made if missing, and each file in it is named after
    its spec file; a folder stands for the specs in it. A spec with an error is reported and left out, and the exit
    status is 2; it is 1 if only what --require asks for is missing.

    To print, -o x.stl or x.3mf, with --thickness, which makes a solid of a surface, and --require solid. For Blender,
    -o x.glb: one thing that stands upright, with a part, name and colour for each patch, smooth where the surface is.
    Its importer of OBJ files takes y for the vertical axis, which --up y makes of z.

    STEP, IGES and BREP files (extra gtb-cli[cad]) hold surfaces: exact rational Bézier pieces, or pieces fitted within
    --tolerance, sewn. VTU files, for ParaView, hold such pieces as curved cells.
    """
    output, console, reading = streams.output, streams.console, streams.reading
    if (surfaces := surface_format(options.format, output)) is not None:
        return write_surfaces(specs, surfaces, options, streams, manifest)
    paths = inputs_of(specs, output)
    folder = output if _is_for_folder(specs, paths, output) else None
    if resume and (manifest is None or manifest == STANDARD or is_device(manifest)):
        raise click.UsageError("--resume needs --manifest FILE, which shows what is up to date")
    place = output if folder is None else os.path.join(folder, "")
    kind = options.format_for(place)
    check_unit(options, kind)
    book = None
    if manifest is not None:
        from gtb_cli.shell.manifest import Manifest

        read: dict[str, object] = {"spec_format": reading.spec_format, "set": dict(reading.let)}
        read |= {"fill": reading.fills} if reading.fills else {}
        book = Manifest(manifest, replace(options, format=kind).settings | read, place, resume=resume)

    planner = partial(_planned, place=place, options=options, kind=kind, streams=streams, book=book)
    with console.clock("mesh") if len(paths) == 1 else nullcontext():  # fills are made now
        planned = [attempted(path, planner) for path in paths]
    errors = [error for error in planned if isinstance(error, GtbError)]  # of specs: none stops the others
    plan = [task for task in planned if isinstance(task, Task)]
    if folder is not None:
        sources = grouped((task.output, task.path) for task in plan)
        for target, (first, *others) in sources.items():
            if others:
                raise click.UsageError(f"{first} and {others[0]} would both be written to {os.path.basename(target)}")
        check_outputs(*sources)
    if book is not None:
        book.expect([task.output for task in plan])

    work = [task for task in plan if task.kept is None]
    made = partial(_made, options=options, kind=kind)
    found = workers.results(partial(made, whole=True), work, partial(made, whole=False), console.warn)
    written: list[tuple[str, Made]] = []
    shown = console.clock("mesh") if len(work) == 1 else console.counter(len(work))
    with closing(found), _files(output, folder, book, resume) as write, shown as begin:
        for task in plan:
            if task.kept is None:
                begin(task.path)
            file = task.kept or _written(task, next(found), write, book)
            errors.append(file) if isinstance(file, GtbError) else written.append((task.output, file))
        if not written:  # then a folder made for them is also removed
            raise _joined(errors)
    for target, file in written:
        console.report(target, f"{file.size}, with {reading}" if str(reading) else file.size, file.warnings)
    if errors:
        raise _joined(errors)


class Made(NamedTuple):
    """A mesh file that has not been written yet, or is up to date; `facts` are for the manifest, `lines` of a text."""

    size: str
    warnings: list[str]
    blocks: Iterable[bytes] = ()
    facts: Mapping[str, object] = MappingProxyType({})
    lines: int = 0


class Task(NamedTuple):
    """A mesh to make, with checksums of the files of its spec for a manifest; or one that is kept."""

    output: str
    path: str
    spec: Spec | None = None
    sums: dict[str, str] | None = None
    kept: Made | None = None


def _is_for_folder(given: Sequence[str], paths: Sequence[str], output: str) -> bool:
    """Tell whether the output is a folder, or refuse one that cannot hold so many meshes."""
    is_file = output == STANDARD or suffix_of(output) in FORMATS
    if is_folder(output) or (not is_file and any(map(os.path.isdir, given))):
        return True
    mesh = next((path for path in given if suffix_of(path) in FORMATS), None)
    if len(paths) > 1 and mesh:
        raise click.UsageError(f"{mesh} is named like a mesh, and specs are expected: -o {mesh} writes it")
    if len(paths) > 1 and is_file and (missing := [path for path in paths if not os.path.lexists(path)]):
        raise click.UsageError(f"{missing[0]}: no such spec; names with blanks stand in quotes, such as 'wall edge 1'")
    if len(paths) > 1 and is_file:
        raise click.UsageError(f"{len(paths)} specs need a folder for their meshes: -o FOLDER")
    return len(paths) > 1


def _joined(errors: list[GtbError]) -> GtbError:
    kind = RequirementError if all(isinstance(error, RequirementError) for error in errors) else GtbError
    return kind(*(arg for error in errors for arg in error.args))


def _planned(path: str, place: str, options: MeshOptions, kind: str, streams: Streams, book: Manifest | None) -> Task:
    """Read a spec, unless its mesh is up to date according to the manifest."""
    sums = None
    if book is not None:
        from gtb_cli.shell.manifest import input_sums

        output = _output(place, kind, input_stem(path))
        if path != STANDARD and (entry := book.kept(output, path)) is not None:
            cells = "segments" if "segments" in entry else "faces"
            size = f"{entry['vertices']} vertices, {entry[cells]} {cells}, up to date"
            return Task(output, path, kept=Made(size, entry["warnings"]))
        sums = input_sums(path, streams.reading.spec_format)  # before the spec is read: it may change meanwhile
    with streams.spec_of(path) as spec:
        options.recipe.check_size(spec)
    return Task(_output(place, kind, input_stem(path) or file_stem(spec.name)), path, spec, sums)


def _output(place: str, kind: str, stem: str | None) -> str:
    """Name the mesh of a spec: the place itself, or a file in it."""
    return place if os.path.basename(place) else os.path.join(place, f"{stem}.{kind}")


def _made(task: Task, options: MeshOptions, kind: str, whole: bool) -> Made | GtbError:
    """Make a mesh and the bytes of its file; these as one block, which a process can send to another, if `whole`."""

    def made(path: str) -> Made:
        from gtb_cli.formats.export import held, standing

        spec = task.spec
        assert spec is not None
        with about(shown_input(path)):
            mesh, remarks = options.made(spec, kind)
            blocks = options.encoded(mesh, kind)
        warnings = [in_options(text) for text in (*remarks, *options.warnings(mesh, kind))]
        assurance, kept = options.recipe.assurance(spec), {"certified": "everywhere", "sampled": "where measured"}
        facts: dict[str, object] = {}
        if task.sums is not None:
            from gtb_cli.meshes.measures import measure
            from gtb_cli.process.versions import versions

            measures = measure(standing(mesh, kind, options.up)).record()
            asked = {"tolerance": options.recipe.tolerance_for(spec), "assurance": assurance} if assurance else {}
            facts = {**asked, **measures, "inputs": task.sums, "warnings": warnings}
            facts["versions"] = versions()  # here, which may be another machine than that of the manifest
        is_open = options.recipe.leaves_open(spec)
        turned = standing(mesh, kind, options.up) if FORMATS[kind].up == "z" else mesh  # readers turn y up back
        stored = None if is_open else held(turned, kind, options.ascii)[0]
        unit = options.unit or (DEFAULT_UNIT if kind == "3mf" else None)
        size = summary(mesh, stored, remarks, unit) + (f", within the tolerance {kept[assurance]}" if assurance else "")
        size += options.recipe.direction(spec, turned if kind in ("stl", "3mf") else mesh)  # slicers take z for up
        if kind in ("stl", "3mf") and options.recipe.thickness is not None:
            from gtb_cli.meshes.measures import in_unit
            from gtb_cli.solids.printability import printability

            found = printability(turned, "z", 0)
            area, square = in_unit(found["bed_area"], 2, unit)
            small = found["bed_area"] < 0.01 * found["size"][0] * found["size"][1]  # as at rounded feet
            size += f", only area {area:.3g}{square} on the bed" * small
        if kind in ("stl", "3mf") and is_open:
            from gtb_cli.filling.holes import model_rings
            from gtb_cli.models.model import Model

            refused = ", which slicers do not read" if kind == "3mf" else ""
            way = f"open{refused}: --thickness D makes a solid"
            if isinstance(spec, Model) and len(rings := model_rings(spec)) == 1:
                way += f', and --fill "{rings[0].names[0]}=g0" a lid'
            size += ", not closed: more than two faces meet at edges" if len(mesh.crowded_sides) else f", {way}"
        lines = len(mesh.vertices) + len(mesh.cells) if kind == "obj" or options.ascii else 0
        return Made(size, warnings, [b"".join(blocks)] if whole else blocks, facts, lines)

    return attempted(task.path, made)


@contextmanager
def _files(output: str, folder: str | None, book: Manifest | None, resume: bool) -> Iterator[Write]:
    """Give the function that writes a file; all appear at the end, with the manifest, or with --resume each at once."""
    if folder is not None and book is not None and resume:
        try:
            yield book.write_one
        finally:
            if os.path.isdir(folder):  # otherwise nothing was made
                book.write()
        return
    together = book is not None and not (book.is_direct or output == STANDARD or is_device(output))
    if folder is None and not together:
        yield write_blocks
    else:
        from gtb_cli.files import StagedFiles

        with StagedFiles(folder or os.curdir) as files:
            yield files.add
            if book is not None and together:
                files.add(book.path, book.blocks())
    if book is not None and not together:
        book.write()


def _written(task: Task, made: Made | GtbError, write: Write, book: Manifest | None) -> Made | GtbError:
    """Write a file, or return the error in its spec; an error in writing is raised."""
    if isinstance(made, GtbError):
        return made
    if is_terminal(task.output) and made.lines > 1000:
        raise ExportError(f"the mesh has {made.lines} lines, and standard output is a terminal: give -o FILE")

    # Blocks are made as they are written: what is not an error in writing is this spec's.
    blocks = made.blocks if book is None else book.recorded(task.output, made.facts, made.blocks)
    return attempted(task.path, lambda _: write(task.output, blocks), GtbError, OSError) or made
