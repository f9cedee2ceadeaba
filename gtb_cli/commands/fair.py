"""`gtb fair`: the same patch with fair inner control points."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import spec_argument, text_options
from gtb_cli.shell.streams import spec_of, write_text

if TYPE_CHECKING:
    from gtb_cli.fairing.energy import Energy
    from gtb_cli.fairing.fair import Keep


@click.command
@spec_argument
@click.option(
    "--energy",
    type=click.Choice(["thin-plate", "dirichlet"]),
    default="thin-plate",
    help="What is made small: bending, the default, or stretching.",
)
@click.option(
    "--keep",
    type=click.Choice(["boundary", "tangents"]),
    default="boundary",
    help="What stays: the boundary, the default, or also the tangent planes along it.",
)
@text_options
def fair(spec: str, energy: Energy, keep: Keep, output: str, spec_format: str | None, console: Console) -> None:
    """\b
    Example: gtb fair specs/hexagon.toml --keep tangents | gtb mesh - -o fair.obj

    Print the spec of the same patch with inner control points that make it fair.

    Knots and weights stay. The energy is an integral in the linear parametrization over the domain without its
    outermost thousandth, where bending may be infinite. Each patch of a model is made fair separately.
    """
    from gtb_cli.fairing.fair import fair as made_fair
    from gtb_cli.language.writer import dump
    from gtb_cli.theory.model import Model

    with spec_of(spec, spec_format) as loaded:
        found = [made_fair(patch, energy, keep) for patch in loaded.patches]
        model = isinstance(loaded, Model)
        text = dump(Model(tuple(part.patch for part in found), loaded.name) if model else found[0].patch)
    write_text(output, text)
    for index, part in enumerate(found):
        name = f"{part.patch.name or f'patches[{index}]'}: " if model else ""
        if not part.free:
            console.warn(f"{name}no control point is free: all stay")
        if part.folds:
            console.warn(f"{name}the patch folds at {part.folds} of some thousand places")
        digits = 6 if part.error <= 1e-6 else max(1, int(-math.log10(part.error)))
        before, after = (f"{value:.{digits}g}" for value in (part.before, part.after))
        console.note(f"{name}{part.free} free control points, energy {before} before, {after} now")
