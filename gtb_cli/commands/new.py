"""`gtb new`: a template → a spec with comments."""

import os
import re

import click

from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import WholeNumber, output_options
from gtb_cli.shell.streams import Streams
from gtb_cli.vocabulary import TEMPLATES


@click.command
@click.argument("template", metavar="TEMPLATE", type=click.Choice(list(TEMPLATES)))
@click.argument("sides", metavar="[N]", type=WholeNumber(), required=False)
@output_options
def new(template: str, sides: int | None, streams: Streams) -> None:
    """\b
    Example: gtb new pentagon -o mine.toml

    Print a spec with comments, to start from; it can be meshed as it is.

    TEMPLATE is curve, triangle, rectangle, pentagon, n-gon with the number N of its sides, or model; or, to hold, in
    millimetres, bowl, ring (of arcs) and shade, with N sides, joint, for N rods, and handle. No file is overwritten.
    """
    from gtb_cli.language.starter import template as text_of

    text, output = text_of(template, sides), streams.output
    if output != STANDARD and os.path.isfile(output):
        raise click.UsageError(f"{output} already exists, and is not overwritten: choose another name")
    streams.write(text)
    stem, options = os.path.splitext(output)[0], re.search(r"gtb mesh \S+( .*)? -o \S+(\.\w+)$", text, re.MULTILINE)
    assert options is not None
    streams.console.report(output, f"gtb mesh {output}{options[1] or ''} -o {stem}{options[2]} meshes it")
