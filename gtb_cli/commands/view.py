"""`gtb view`: specs and meshes → a page that shows them in a browser."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import ToleranceError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.options import INPUT, OUTPUT, WholeNumber, console_option, spec_format_option
from gtb_cli.shell.streams import about, read_spec, shown_input, write_text
from gtb_cli.tessellation.recipe import Recipe

if TYPE_CHECKING:
    from gtb_cli.pictures.sight import Sight

MESHES = (".obj", ".ply", ".stl", ".glb")

MAX_PAGE_FACES = 1_000_000
"""Largest number of triangles of a page, which takes about 40 bytes for each."""


@click.command
@click.argument("paths", metavar="SPEC|MESH|FOLDER...", nargs=-1, required=True, type=INPUT)
@click.option(
    "-o",
    "--output",
    metavar="PAGE.html",
    type=OUTPUT,
    help="Write the page to this file. Without it to a temporary file, which the browser opens.",
)
@click.option("-n", "--resolution", type=WholeNumber(1, 1000), metavar="N", help="Segments along each edge.")
@click.option("--no-open", is_flag=True, help="Open no browser; say where the page is.")
@click.option("--watch", is_flag=True, help="Serve the page on this machine only, and follow the files until Ctrl-C.")
@click.option("--port", type=WholeNumber(0, 65535), default=0, help="That of --watch; else any that is free.")
@spec_format_option
@console_option
def view(
    paths: tuple[str, ...],
    output: str | None,
    resolution: int | None,
    no_open: bool,
    watch: bool,
    port: int,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb view specs/bicubic.toml -o bicubic.html

    Make one page, which needs no network, and look at specs, meshes, or the FOLDER of a sequence in a browser.

    Turn, move and zoom with mouse, keys or fingers. Patch colours, control net, knots, edges of patches, open edges,
    folds (where a patch turns back by more than 90 degrees between two triangles) and axes go on and off; shading may
    be curvature with its scale, zebra stripes or isophotes. Normals and curvature of a spec are exact at the vertices
    of its mesh and interpolated at each pixel between them; -n makes that finer. A mesh file's normals are not read:
    means of its triangles' take their place. Names appear under the pointer; a sequence has a slider and plays.

    With --watch the page follows the files: an edit is there within a second, an error is shown with its line, and
    what was good last stays. A page's address may say how it looks: page.html#mode=zebra&azimuth=30&net=true.
    """
    if watch:
        if output is not None or STANDARD in paths:
            raise click.UsageError("--watch serves a page of files: it has no -o, and follows no standard input")
        from gtb_cli.shell.watching import serve

        serve(paths, lambda: sight_of_paths(paths, resolution, spec_format), port, console, opens=not no_open)
        return
    sight = sight_of_paths(paths, resolution, spec_format)
    from gtb_cli.pictures.page import page_of

    page = page_of(sight)
    if output is not None:
        write_text(output, page)
        if output != STANDARD:
            console.note(f"{output}: {len(page) / 1000:.0f} kB")
        return
    _show(page, console, opens=not no_open)


def sight_of_paths(paths: tuple[str, ...], resolution: int | None, spec_format: str | None) -> Sight:
    """What there is to see in files and folders."""
    from gtb_cli.pictures.sight import joined

    return joined([_sight(path, resolution, spec_format) for path in paths])


def _sight(path: str, resolution: int | None, spec_format: str | None) -> Sight:
    from gtb_cli.pictures.sight import sight_of, sight_of_frames, sight_of_mesh

    stem = os.path.splitext(os.path.basename(os.path.abspath(path)))[0]
    if os.path.isdir(path) or os.path.basename(path) == "sequence.json":
        from gtb_cli.pictures.record import read_frames

        frames = read_frames(path)
        with about(path):
            return sight_of_frames(frames, stem if os.path.isdir(path) else "sequence")
    if os.path.splitext(path)[1].lower() in MESHES:
        from gtb_cli.formats.meshfiles import read_mesh

        mesh = read_mesh(path)
        with about(path):
            _refuse_too_many(len(mesh.cells))
            return sight_of_mesh(mesh, stem)
    spec = read_spec(path, spec_format)
    with about(shown_input(path)):
        if resolution is not None:
            _refuse_too_many(Recipe(resolution).faces(spec))
        return sight_of(spec, resolution, spec.name if path == STANDARD else stem)


def _refuse_too_many(faces: int) -> None:
    if faces > MAX_PAGE_FACES:
        raise ToleranceError(
            f"{faces} faces, and a page has room for {MAX_PAGE_FACES}: take a smaller -n, or a coarser mesh"
        )


def _show(page: str, console: Console, *, opens: bool) -> None:
    """Write a page to a temporary file and open it."""
    import tempfile
    import webbrowser
    from pathlib import Path

    folder = tempfile.mkdtemp(prefix="gtb-")
    place = os.path.join(folder, "page.html")
    write_text(place, page)
    console.note(f"the page is {place}")
    if opens and not webbrowser.open(Path(place).as_uri()):
        console.warn("no browser could be opened")
