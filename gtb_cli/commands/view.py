"""`gtb view`: specs and meshes → a page that a browser shows."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import ToleranceError
from gtb_cli.language.reading import Numbers, Reading
from gtb_cli.shell.faults import in_options
from gtb_cli.shell.gathering import gathered, option
from gtb_cli.shell.limit_options import limit_options
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.messages import STANDARD, Console
from gtb_cli.shell.options import (
    INPUT,
    WholeNumber,
    console_option,
    filling_option,
    output_to,
    recipe_of,
    resolution_up_to,
    solid_options,
    tolerance_option,
    weld_option,
)
from gtb_cli.shell.streams import about, is_device, single, spec_of, write_text
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import DEFAULT_UNIT, FORMATS, RESOLUTION, SEQUENCE_RECORD, UNITS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.pages.page_scene import Content
    from gtb_cli.plots.panels import Approach


def _recipe(**values: Any) -> Recipe | None:
    """Return what is asked for; None if nothing is, for a mesh as fine as a screen shows."""
    recipe = recipe_of(**values)
    return recipe if values["resolution"] is not None or recipe != Recipe() else None


@click.command
@click.argument("paths", metavar="SPEC|MESH|FOLDER...", nargs=-1, required=True, type=INPUT)
@output_to("-o, --output PAGE.html")(
    help="Write the page to this file; by default to a temporary file, which the browser opens."
)
@gathered(
    "recipe",
    _recipe,
    resolution_up_to(WholeNumber(1, 10_000))(
        help=f"Segments along each edge of the domain. By default as many as a screen shows; {RESOLUTION} for a solid."
    ),
    tolerance_option,
    *solid_options,
    weld_option,
    takes=Recipe,
)
@option("--unit", (*UNITS,))(
    help="Unit of length: mm, as slicers take it, for a solid by --thickness or --radius and for STL files, otherwise "
    "none. Areas and volumes of mm are in cm² and cm³ from 1 on."
)
@option("--no-open", bool)(help="Do not open a browser; say where the page is.")
@option("--watch", bool)(help="Serve the page on this machine only, and follow the files until Ctrl-C.")
@option("--port N", WholeNumber(0, 65535), default=0)(help="Port of --watch; by default any free one.")
@limit_options
@filling_option
@console_option
def view(
    paths: tuple[str, ...], output: str | None, limit: Approach, reading: Reading, console: Console, **asked: Any
) -> None:
    """\b
    Example: gtb view specs/bicubic.toml -o bicubic.html

    Make a page that shows specs, meshes, or the FOLDER of a sequence in a browser. It needs no network.

    With --thickness or --radius it shows the solid that gtb mesh writes with the same options. The page of what is
    closed has its volume, colours walls (of up to 200 000 triangles) and overhangs, and fills the face of a section.
    The address holds how it looks, so that a link shows the same, such as page.html#mode=zebra&section=x.

    Control net, knots, open edges, folds, curvature, zebra stripes and isophotes can be switched on; normals are the
    surface's own at the vertices of a mesh, which -n or --tolerance makes finer. Two points can be measured.

    A sequence has a slider and plays: a FOLDER's, a degeneration (-x, --lifting) or a knot limit (--merge, --steps).

    With --watch the page follows the files: it shows edits within a second, or an error with its line; it has a slider
    for each number of a spec's let that depends on no other; a range in the comment on its line, such as 10 … 80, is
    the slider's. The page never writes the file: it shows the --set options, or the lines, that make what is seen.
    """
    pictures = ("png", "svg", "pdf", "jpg", "jpeg", "gif")
    if output is not None and (suffix := suffix_of(output)) not in ("", "html", "htm") and not is_device(output):
        other = " (gtb plot draws pictures, and a page saves what it shows as PNG)" if suffix in pictures else ""
        raise click.UsageError(f"-o: {output}: a page is HTML, and its name ends in .html{other}")

    recipe, unit = asked["recipe"], asked["unit"]
    is_printed = recipe is not None and (recipe.thickness or recipe.radius) is not None
    if is_printed or all(suffix_of(path) == "stl" for path in paths):
        unit = unit or DEFAULT_UNIT

    def see(numbers: Numbers, quick: bool = False) -> Content:
        return replace(content_of_paths(paths, recipe, reading._replace(let=numbers), limit, quick), unit=unit)

    if asked["watch"]:
        if output is not None or STANDARD in paths:
            raise click.UsageError("--watch serves a page made from files: it takes neither -o nor standard input")
        from gtb_cli.shell.view_server import Pages, serve

        return serve(Pages(paths, reading, see), paths, asked["port"], console, opens=not asked["no_open"])
    from gtb_cli.pages.page import page_of

    content = see(reading.let)
    page = page_of(content)
    if output is not None:
        write_text(output, page)
        return console.report(output, f"{len(page) / 1000:.0f} kB", content.remarks)
    for remark in content.remarks:
        console.warn(remark)
    import tempfile
    import webbrowser
    from pathlib import Path

    place = os.path.join(tempfile.mkdtemp(prefix="gtb-"), "page.html")
    write_text(place, page)
    console.note(f"the page is {place}")
    if not asked["no_open"] and not webbrowser.open(Path(place).as_uri()):
        console.warn("no browser could be opened")


def content_of_paths(
    paths: tuple[str, ...], recipe: Recipe | None, reading: Reading, limit: Approach, quick: bool = False
) -> Content:
    """Return what a page shows of files and folders, or of the way to a limit; quickly surfaces with their holes."""
    from gtb_cli.pages.page_scene import joined

    whole = reading._replace(fills=()) if quick else reading  # a fill takes a second
    content = joined([_content(path, recipe, whole, limit, quick) for path in paths])
    lack = ", without fills" if content.quick and reading.fills else ""
    return replace(content, remarks=tuple(map(in_options, content.remarks)), quick=content.quick + lack)


def _content(path: str, recipe: Recipe | None, reading: Reading, limit: Approach, quick: bool) -> Content:
    sequence_resolution = 20  # segments of each edge of each cell in a sequence
    from gtb_cli.pages.page_scene import content_of, content_of_frames, content_of_mesh

    stem = os.path.splitext(os.path.basename(os.path.abspath(path)))[0]
    is_sequence, is_mesh = os.path.isdir(path) or os.path.basename(path) == SEQUENCE_RECORD, suffix_of(path) in FORMATS
    if is_sequence or is_mesh:
        why = f"is for specs, and {path} is not a spec"
        if limit.given:
            raise click.UsageError(f"{in_options(f'`{limit.given[0]}`')} {why}")
        _refuse_solid(recipe, why)
    if is_sequence:
        from gtb_cli.plots.panels import read_frames

        frames = read_frames(path)
        with about(path):
            return content_of_frames(frames, stem if os.path.isdir(path) else "sequence")
    if is_mesh:
        from gtb_cli.formats.meshfiles import read_mesh

        mesh = read_mesh(path)
        with about(path):
            _refuse_too_many(len(mesh.cells))
            return content_of_mesh(mesh, stem)
    doubts: list[str] = []
    with spec_of(path, reading, doubts.append, doubts.append) as spec:
        if recipe is not None and recipe.tolerance is None:
            _refuse_too_many(recipe.faces(spec))
        name = (spec.name or "patch") if path == STANDARD else stem
        if limit.given:
            _refuse_solid(recipe, in_options(f"shows one mesh, and `{limit.given[0]}` a sequence"))
            fine = sequence_resolution if recipe is None else recipe.resolution
            # By default; the slider interpolates linearly between them
            x, steps = (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), (0.0, 0.3, 0.6, 0.8, 0.9, 0.97)
            frames = limit.frames(single(spec), fine, x=x, steps=steps, distances=False)
            _refuse_too_many(len(frames.meshes[0].cells))
            return content_of_frames(frames, name)
        content = content_of(spec, recipe, name, quick=quick)
        _refuse_too_many(len(content.cells))
        return replace(content, remarks=(*doubts, *content.remarks))


def _refuse_solid(recipe: Recipe | None, reason: str) -> None:
    """Refuse options of the mesh of a spec, but its resolution."""
    MeshOptions(recipe or Recipe()).refuse(reason, "tolerance", "radius", "thickness", "weld")


def _refuse_too_many(faces: int) -> None:
    from gtb_cli.pages.page_scene import MAX_PAGE_FACES

    if faces > MAX_PAGE_FACES:
        raise ToleranceError(f"{faces} faces, and a page has room for {MAX_PAGE_FACES}: make a coarser mesh")
