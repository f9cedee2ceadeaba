"""`gtb fill`: an n-sided hole, filled with one patch."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import RequirementError
from gtb_cli.shell.console import Console
from gtb_cli.shell.options import INPUT, WholeNumber, length_of, text_options
from gtb_cli.shell.streams import about, read_bytes, shown_input, stem_of, write_text

if TYPE_CHECKING:
    from gtb_cli.design.fill import Filling
    from gtb_cli.language.scanner import Format


@click.command
@click.argument("loop", metavar="LOOP", type=INPUT)
@click.option("--hole", metavar="EDGE", help='In a model, fill the ring with this edge, such as "wall-0 edge 2".')
@click.option(
    "--inner",
    type=click.Choice(["fair", "flat"]),
    default="fair",
    help="Make the inside fair (least thin-plate energy), the default, or flat like a soap film.",
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
@text_options
def fill(
    loop: str,
    hole: str | None,
    inner: str,
    fullness: float | None,
    raises: int | None,
    output: str,
    spec_format: Format | None,
    console: Console,
) -> None:
    """\b
    Example: gtb boundary specs/nonagon.toml | gtb fill - | gtb mesh - -o filled.obj

    Print the spec of one patch that fills a hole with three or more sides.

    LOOP is a spec whose patches are the sides, in any order: rational Bézier curves, each with a "ribbon" if the patch
    is to touch tangent planes along it (the second row of control points, as many as in the first). It may also be a
    .gbp or .lop file, or a model of surfaces, which is printed with the patch that fills its open ring.

    Along each side with a ribbon the tangent planes are exact up to rounding; the largest angle is printed. A patch
    that folds or is turned over is not written, and the exit status is 1.
    """
    from gtb_cli.design.filling import filled
    from gtb_cli.design.loops import read_loop
    from gtb_cli.language.writer import dump
    from gtb_cli.theory.model import Model

    source = shown_input(loop)
    found = read_loop(read_bytes(loop), source, spec_format)
    with about(source):
        name = None if isinstance(found, Model) else stem_of(loop)
        filling = filled(found, hole, name, inner=inner, fullness=fullness or 1.0, raises=raises)
        if filling.fault:
            raise RequirementError(f"{filling.fault}; it is not written")
    write_text(output, dump(filling.model or filling.patch))
    _report(filling, console)


def _report(filling: Filling, console: Console) -> None:
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
    angle = "" if math.isnan(filling.angle) else f", largest angle to the given planes {filling.angle:.2g} degrees"
    knots = len(filling.patch.knots)
    console.note(f"{sides} sides, {knots} knots, energy {filling.energy:.6g}{angle}")
