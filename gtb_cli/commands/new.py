"""`gtb new`: a template → a spec with comments."""

import os
import re

import click

from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import WholeNumber, output_options
from gtb_cli.shell.streams import Streams
from gtb_cli.vocabulary import FORMATS, TEMPLATES, suffix_of


@click.command
@click.argument("template", metavar="TEMPLATE", type=click.Choice(list(TEMPLATES)))
@click.argument("sides", metavar="[N]", type=WholeNumber(), required=False)
@output_options
def new(template: str, sides: int | None, streams: Streams) -> None:
    """\b
    Example: gtb new bowl 5 -o bowl.toml

    Print a spec with comments, to start from; it can be meshed as it is, and names the command that does so.

    TEMPLATE is a thing to print, in millimetres: a bowl, a ring (of arcs, as a vase or pot) or a shade with N sides, a
    joint for N rods, or a handle. Or it shows the keys: curve, triangle, rectangle, pentagon, n-gon with N sides, and
    model. No file is overwritten.
    """
    from gtb_cli.language.starter import template as text_of

    text, output = text_of(template, sides), streams.output
    if output != STANDARD and os.path.isfile(output):
        raise click.UsageError(f"{output} already exists, and is not overwritten: choose another name")
    if suffix_of(output) in (*FORMATS, "json"):
        raise click.UsageError(f"-o: {output}: a spec with comments is TOML, and its name ends in .toml")
    streams.write(text)
    stem, options = os.path.splitext(output)[0], re.search(r"gtb mesh \S+( .*)? -o \S+(\.\w+)$", text, re.MULTILINE)
    assert options is not None
    streams.console.report(output, f"gtb mesh {output}{options[1] or ''} -o {stem}{options[2]} meshes it")
