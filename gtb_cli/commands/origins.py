"""`gtb new`, `fit`, `fill` and `import`: specs made of a template, points, a hole, or a file of another program."""

from __future__ import annotations

import math
import os
import re
from itertools import islice
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.errors import RequirementError, SpecError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.options import (
    INPUT,
    WholeNumber,
    json_option,
    length_of,
    numbers_of,
    output_options,
    streams_options,
)
from gtb_cli.shell.streams import Streams, about, number_rows, opened, read_bytes, shown_input, stem_of, write_json
from gtb_cli.vocabulary import CONTINUITIES, IMPORTS, TEMPLATES

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray
    from gtb_cli.design.fill import Filling


@click.command
@click.argument("template", metavar="TEMPLATE", type=click.Choice(list(TEMPLATES)))
@click.argument("sides", metavar="[N]", type=WholeNumber(), required=False)
@output_options
def new(template: str, sides: int | None, streams: Streams) -> None:
    """\b
    Example: gtb new pentagon -o mine.toml

    Print a spec with comments, to start from; it can be meshed as it is.

    TEMPLATE is curve, triangle, rectangle, pentagon, n-gon with the number N of its sides, or model (a closed body of
    several patches). Things to hold, in millimetres, are bowl and shade, with N sides, joint, for N rods, and handle:
    their numbers stand first, to be changed. An existing file is not overwritten.
    """
    from gtb_cli.language.starter import template as text_of

    text, output = text_of(template, sides), streams.output
    if output != STANDARD and os.path.isfile(output):
        raise click.UsageError(f"{output} already exists and would be overwritten")
    streams.write(text)
    stem, options = os.path.splitext(output)[0], re.search(r"gtb mesh \S+( .*)? -o \S+(\.\w+)$", text, re.MULTILINE)
    assert options is not None
    streams.console.report(output, f"gtb mesh {output}{options[1] or ''} -o {stem}{options[2]} meshes it")


@click.command
@click.argument("points", metavar="[POINTS]", default=STANDARD, type=INPUT)
@click.option(
    "--knots",
    callback=numbers_of,
    metavar="A,…",
    help="Ascending knots, one for each point. By default the length of the polygon up to the point.",
)
@click.option("--patch", metavar="SPEC", type=INPUT, help="Fit a surface with this one's knots and weights.")
@streams_options
def fit(points: str, knots: tuple[float, ...] | None, patch: str | None, streams: Streams) -> None:
    """\b
    Example: printf '0 0\\n1 2\\n3 1\\n4 3\\n' | gtb fit

    Print the spec of a curve through points, found by progressive iterative approximation, or of a surface.

    POINTS is a file, or standard input, with 2 to 100 points, one on each line: "x y" or "x y z", separated by blanks,
    tabs or a comma. Empty lines and what follows a # are skipped. The curve begins at the first point, ends at the
    last, and misses no point by more than 1e-12 of the largest coordinate.

    With --patch SPEC the result is a surface, and points are "x y z" or "u v x y z" with linear parameters. If there
    are as many points as SPEC has knots, in the same order, the surface passes through them, at the knots unless u v
    are given. Otherwise it passes near the points: least squares with a little thin-plate energy, where parameters
    that are not given are found by projection.
    """
    if patch is not None and knots is not None:
        raise click.UsageError("--knots is for curves; --patch has its own knots")
    if patch == points == STANDARD:
        raise click.UsageError("standard input can be read only once")
    from gtb_cli.design.fit import fit as fitted
    from gtb_cli.language.writer import dump

    surface = None if patch is None else streams.patch_of(patch)
    rows = _points(points, (2, 3) if surface is None else (3, 5))
    with about(shown_input(points)):
        parameters = [row[:2] for row in rows] if len(rows[0]) == 5 else None
        found = fitted([row[-3:] for row in rows], knots, patch=surface, parameters=parameters)
    streams.write(dump(found.patch.replace(name=stem_of(points)) if surface is None else found.patch))
    is_met = len(rows) == len(found.patch.knots)
    left = "left" if is_met else f"from the farthest point, root mean square {found.mean:.3g}"
    streams.console.note(f"{len(rows)} points, {found.rounds} rounds, {found.distance:.3g} {left}")


def _points(path: str, sizes: tuple[int, int]) -> list[list[float]]:
    """Read points, one on each line."""
    max_points = 1_000_000
    with opened(path) as file:
        rows = [row for _, row in islice(number_rows(file, shown_input(path), sizes), max_points + 1)]
    if not 0 < len(rows) <= max_points:
        raise SpecError(f"{shown_input(path)}: has {f'more than {max_points}' if rows else 'no'} points")
    return rows


@click.command
@click.argument("loop", metavar="LOOP", type=INPUT)
@click.option("--hole", metavar="EDGE", help='In a model, fill the ring with this edge, such as "wall-0 edge 2".')
@click.option(
    "--continuity",
    type=click.Choice(CONTINUITIES),
    default=CONTINUITIES[0],
    help="With g1, the default, the patch touches the given tangent planes; with g0 it only meets the curves, and is a "
    "plane lid or floor where they lie in a plane.",
)
@click.option(
    "--inner",
    type=click.Choice(["fair", "flat"]),
    default="fair",
    help="Make the inside fair (curvature varies little), the default, or flat like a soap film.",
)
@click.option(
    "--fullness",
    callback=length_of,
    metavar="F",
    help="Continue along the given tangent planes F times as far as is fair.",
)
@click.option(
    "--elevate",
    "raises",
    type=WholeNumber(0, 6),
    metavar="D",
    help="Raise the degree of edges by at least D: more knots, a fairer patch. By default D suits the hole.",
)
@json_option
@streams_options
def fill(
    loop: str,
    hole: str | None,
    continuity: str,
    inner: str,
    fullness: float | None,
    raises: int | None,
    as_json: bool,
    streams: Streams,
) -> None:
    """\b
    Example: gtb boundary specs/nonagon.toml | gtb fill - | gtb mesh - -o filled.obj

    Print the spec of one patch that fills a hole with three or more sides.

    LOOP is a spec whose patches are the sides, in any order: rational Bézier curves, each with a "ribbon" if the patch
    is to touch tangent planes along it (the second row of control points, as many as in the first). It may also be a
    .gbp or .lop file, or a model of surfaces, which is printed with the patch that fills its open ring.

    Along each side with a ribbon the tangent planes are exact up to rounding. A certificate says what was measured: for
    each side the largest angle between normals, away from corners, and, in a model, the largest difference between
    curvatures across; ∫ κ₁² + κ₂² (bending), area · ∫ |∇H|² (its variation) and the largest curvature of the patch
    without its outermost hundredth; folds among some thousand places. With --json it is printed as data in place of the
    spec, which -o writes. A patch that folds or is turned over is not written, and the exit status is 1.
    """
    from gtb_cli.design.filling import filled
    from gtb_cli.design.loops import read_loop
    from gtb_cli.language.writer import dump
    from gtb_cli.theory.model import Model

    source = shown_input(loop)
    found = read_loop(read_bytes(loop), source, streams.spec_format)  # type: ignore[arg-type]
    with about(source):
        name = None if isinstance(found, Model) else stem_of(loop)
        filling = filled(found, hole, name, continuity=continuity, inner=inner, fullness=fullness or 1.0, raises=raises)
    if not filling.fault and not (as_json and streams.output == STANDARD):
        streams.write(dump(filling.model or filling.patch))  # before its certificate: it may be impossible
    if as_json:
        write_json(STANDARD, _certificate(filling))
    if filling.fault:
        raise RequirementError(f"{filling.fault}; it is not written").within(source)
    _report(filling, streams.console)


def _certificate(filling: Filling) -> dict[str, Any]:
    """Return what was measured as plain data; None stands for what is not known."""

    def known(value: float) -> float | None:
        return value if math.isfinite(value) else None

    sides = [
        {
            "name": side.name,
            "angle": known(contact.angle),
            "place": None if math.isnan(contact.angle) else contact.place.tolist(),
            "curvature_difference": known(contact.bend),
            "curvature_place": None if math.isnan(contact.bend) else contact.bend_place.tolist(),
        }
        for side, contact in zip(filling.sides, filling.contacts, strict=True)
    ]
    return {
        "name": filling.patch.name,
        "sides": sides,
        "corner_angles": [known(angle) for angle in filling.corner_angles.tolist()],
        "area": filling.bending.area,
        "bending": filling.bending.energy,
        "variation": filling.bending.variation,
        "curvature": filling.bending.curvature,
        "folds": filling.folds,
        "sharp_turns": filling.sharp_turns,
        "knots": len(filling.patch.knots),
        "remarks": list(filling.remarks),
        "fault": filling.fault,
    }


def _report(filling: Filling, console: Console) -> None:
    from gtb_cli.arrays import point_text

    # Angle in degrees between the tangent planes of two sides at their corner, above which a warning says so
    corner_angle = 0.1
    for remark in filling.remarks:
        console.note(remark)
    sides = len(filling.sides)
    for corner, angle in enumerate(filling.corner_angles.tolist()):
        if angle > corner_angle:
            names = f"{filling.sides[corner - 1].name} and {filling.sides[corner].name}"
            console.warn(f"the tangent planes of {names} differ by {angle:.2g} degrees at their corner")
    if filling.sharp_turns:
        console.warn(
            f"the patch turns sharply at {filling.sharp_turns} of some thousand places: coarse meshes fold there"
        )

    def near(place: FloatArray) -> str:
        return f"near {point_text(place, filling.patch.control_points)}"

    for side, contact in zip(filling.sides, filling.contacts, strict=True):
        if math.isnan(contact.angle):
            continue  # of a side without tangent planes nothing is measured
        bent = ""
        if not math.isnan(contact.bend):
            bent = f", curvatures across differ by up to {contact.bend:.2g} {near(contact.bend_place)}"
        console.note(f"{side.name}: angle to its planes up to {contact.angle:.2g} degrees {near(contact.place)}{bent}")
    bending, knots = filling.bending, len(filling.patch.knots)
    angle = "" if math.isnan(filling.angle) else f", largest angle to the given planes {filling.angle:.2g} degrees"
    console.note(f"{sides} sides, {knots} knots, no folds at some thousand places{angle}")
    bent, varied = (f"{round(value, 12):.3g}" for value in (bending.energy, bending.variation))  # 0 of planes
    curvature = f"largest curvature {bending.curvature:.3g}"
    console.note(f"but for the outermost hundredth: bending {bent}, variation {varied}, {curvature}")


@click.command("import")
@click.argument("file", metavar="FILE", default=STANDARD, type=INPUT)
@click.option(
    "--from",
    "format",
    type=click.Choice(IMPORTS),
    help="Read FILE in this format. By default the content or the suffix of the file decides.",
)
@output_options
def import_(file: str, format: str | None, streams: Streams) -> None:
    """\b
    Example: printf '1 1  0 0 0  0 1 0  1 0 0  1 1 1' | gtb import --from bzr

    Print a file of another program as a spec: a patch, or a model of several.

    Formats: toric patches (.trp), BezierView (.bv), Bézier nets (.bpt, .bzr), and, exactly, span by span, B-splines and
    NURBS from IGES (.igs, .iges: entities 126 and 128), from Rhino (.3dm, with the extra gtb-cli[rhino]) and from
    geomdl (.json). A message names what a patch cannot hold, such as trimming and units. Boundaries of holes (.gbp,
    .lop) are filled as gtb fill does.
    """
    from gtb_cli.design.fill import fill_loop
    from gtb_cli.design.loops import SUFFIXES, loop_from_text
    from gtb_cli.imports.readers import import_data
    from gtb_cli.language.writer import dump

    source = shown_input(file)
    data = read_bytes(file)
    if format is None and os.path.splitext(source)[1].lower() in SUFFIXES:
        sides = loop_from_text(data, source)
        with about(source):
            filling = fill_loop(sides, name=stem_of(file))
            if filling.fault:
                raise RequirementError(f"{filling.fault}; it is not written")
            text = dump(filling.patch)
        remarks = (
            *filling.remarks,
            "edges and ribbons are kept; the inside is made fair and is not that of the file's scheme",
        )
    else:
        found = import_data(source, data, format)
        remarks = found.remarks
        with about(source):
            text = dump(found.shape)
    streams.write(text)
    for remark in remarks:
        streams.console.note(f"{source}: {remark}")
