"""`gtb elevate`: the same patch with a higher degree."""

from __future__ import annotations

from dataclasses import replace

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import WholeNumber, console_option, output_option, spec_argument, spec_format_option
from gtb_cli.shell.streams import about, read_spec, shown_input, write_text

MAX_TIMES = 1000
"""Largest number of elevations."""


@click.command
@spec_argument
@click.option(
    "--by",
    type=WholeNumber(0, MAX_TIMES),
    metavar="D",
    default=1,
    help="Number of elevations, which for a Bézier patch is the number of degrees; 1 without this option.",
)
@output_option
@spec_format_option
@console_option
def elevate(spec: str, by: int, output: str, spec_format: str | None, console: Console) -> None:
    """\b
    Example: gtb elevate specs/cubic-bezier.toml | gtb info -

    Print the spec of the same curve or surface with more knots, weights and control points to work with.

    For Bézier curves, triangles and tensor product patches this is classical degree elevation. A lifting is left out.
    Each patch of a model is elevated.
    """
    from gtb_cli.bezier.elevation import elevate as elevated
    from gtb_cli.spec.writer import dump
    from gtb_cli.theory.model import Model

    loaded = read_spec(spec, spec_format)
    with about(shown_input(spec)):
        if isinstance(loaded, Model):
            text = dump(replace(loaded, patches=tuple(elevated(patch, by) for patch in loaded.patches)))
        else:
            text = dump(elevated(loaded, by))
    write_text(output, text)
