"""`gtb diff`: two meshes, or two folders of meshes → whether they agree within a tolerance."""

import os
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import click

from gtb_cli.errors import GtbError
from gtb_cli.shell.folders import pairs
from gtb_cli.shell.gathering import gathered, option
from gtb_cli.shell.messages import STANDARD, Console, tell
from gtb_cli.shell.options import (
    INPUT,
    difference_option,
    ignore_option,
    json_option,
    max_faces_option,
    parametrization_option,
    recipe_of,
    resolution_option,
    streams_options,
)
from gtb_cli.shell.streams import Streams, refuse_overwriting, refuse_reports, shown_input, write_json
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict, Verdicts
from gtb_cli.vocabulary import suffix_of


def _reports(paths: tuple[str, ...]) -> tuple[str, ...]:
    if wrong := [path for path in paths if suffix_of(path) not in ("html", "md")]:
        raise ValueError(f"expected a name that ends in .html or .md, got {wrong[0]!r}")
    return paths


@click.command
@click.argument("a", metavar="A", type=INPUT)
@click.argument("b", metavar="B", type=INPUT)
@gathered(
    "comparing",
    Comparing,
    difference_option,
    option("--as", ("auto", "vertices", "surface"), into="kind", default="auto")(
        help="Compare vertex by vertex if the faces are the same, else as surfaces (auto); only vertex by vertex; or "
        "only as surfaces. Two specs are compared themselves, whatever their parameters; with vertices, their meshes "
        "are."
    ),
    ignore_option,
)
@option("--report PAGE", _reports, into="reports", multiple=True)(
    help="Also write a report on all that differs: PAGE.html, to look at old and new side by side, offline; or "
    "PAGE.md, a table of the numbers. May be repeated."
)
@gathered("recipe", recipe_of, resolution_option, parametrization_option, max_faces_option, takes=Recipe)
@json_option
@streams_options
def diff(
    a: str, b: str, comparing: Comparing, reports: tuple[str, ...], recipe: Recipe, as_json: bool, streams: Streams
) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o x.obj && gtb diff x.obj specs/pentagon.toml

    Compare two meshes: OBJ, PLY, STL, GLB or 3MF files, or specs, which are meshed with -n and the options below it.

    Meshes with the same faces, in any order, are compared vertex by vertex, others as surfaces (or curves): the largest
    distance of a point of either from the other. Two specs are compared as the points that they describe: a patch that
    is another one in other words (axes, degree, knots, weights) is proved to be, for others a search tells, which
    proves nothing; in sides of patches; in how often they are there, which areas tell where patches are cut otherwise;
    in open edges, as one that meets two shorter ones is; and in names of patches that are not cut otherwise. Faces that
    are turned over, missing, there twice or without area, other holes or parts, and vertices that are shared in another
    way (in OBJ and PLY) are differences, too, unless --ignore says otherwise; so are other normals, texture
    coordinates, attributes, groups and colours. Polygons count as triangles, concave ones as such that do not overlap;
    comments, titles, the name of a whole mesh and vertices that no face uses do not count, nor if OBJ has o for g. The
    first words say what was done: moved, mirrored in y, 25.4 times as large (1 in for 1 mm), 1 face is missing.

    The tolerance is never less than what the numbers in the files can hold; the size is the diagonal of the smaller
    bounding box. Where a distance of surfaces is not proved within it, a warning, the report and "proved" say so.

    In two folders, all files of the same name are compared, others than meshes by their bytes, sequence.json but for
    last digits. A missing or an extra file is a difference. Hidden files and manifests do not count.

    Exit status 0 if everything agrees within the tolerance, 1 if not, 2 if something cannot be read.
    """
    if a == b == STANDARD:
        raise click.UsageError("standard input can be read only once")
    for path in (a, b):
        if path != STANDARD and not os.path.exists(path):
            is_new = path == a != "" and os.path.isdir(b) and "*" not in a and not suffix_of(a)
            takes = f": gtb approve {a} {b} makes it from {b}" if is_new else ""
            raise GtbError(f"{shown_input(path)}: No such file or directory{takes}")
    of_folders = os.path.isdir(a) and os.path.isdir(b)
    if not of_folders and os.path.isdir(a) and b != STANDARD:  # its file with the name of the other one
        a = os.path.join(a, os.path.basename(b))
    elif not of_folders and os.path.isdir(b) and a != STANDARD:
        b = os.path.join(b, os.path.basename(a))
    inputs = [path for pair in pairs(a, b)[0].values() for path in pair if path] if of_folders else [a, b]
    refuse_overwriting(inputs, [streams.output, *reports])
    refuse_reports(reports, (a, b) if of_folders else ())
    comparing = replace(comparing, recipe=recipe, reading=streams.reading)
    verdicts: list[Verdict] = []
    each = _told(comparing.each(a, b), verdicts, streams.console)
    if reports:
        from gtb_cli.review.reports import reviewed, write_reports

        review = reviewed((shown_input(a), shown_input(b)), each, comparing)
    deque(each, maxlen=0)
    found = Verdicts(tuple(verdicts), of_folders)
    if as_json:
        write_json(streams.output, found.record)
    else:
        streams.write(found.text)
    for error in (error for verdict in verdicts for error in verdict.errors):
        tell(error, "error")
    if reports:
        write_reports(review, reports)
    if found.status:
        raise click.exceptions.Exit(found.status)


def _told(verdicts: Iterable[Verdict], kept: list[Verdict], console: Console) -> Iterator[Verdict]:
    """Yield verdicts, print what is to be said of each, and keep all without their meshes."""
    for verdict in verdicts:
        for message in verdict.warnings:
            console.warn(f"{', '.join(verdict.paths)}: {message}")
        kept.append(replace(verdict, meshes=(None, None)))
        yield verdict
