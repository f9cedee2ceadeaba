"""`gtb new`: a starter spec."""

import os

import click

from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.options import WholeNumber, console_option, output_option
from gtb_cli.shell.streams import write_text
from gtb_cli.vocabulary import TEMPLATES


@click.command
@click.argument("template", metavar="TEMPLATE", type=click.Choice(TEMPLATES))
@click.argument("sides", metavar="[N]", type=WholeNumber(), required=False)
@output_option
@console_option
def new(template: str, sides: int | None, output: str, console: Console) -> None:
    """\b
    Example: gtb new pentagon -o mine.toml

    Print a spec with comments, to start from; it can be meshed as it is.

    TEMPLATE is curve, triangle, rectangle, pentagon, n-gon with the number N of its sides, or model (a closed body of
    several patches). An existing file is not overwritten.
    """
    from gtb_cli.language.starter import template as text_of

    text = text_of(template, sides)
    if output != STANDARD and os.path.isfile(output):
        raise click.UsageError(f"{output} already exists and would be overwritten")
    write_text(output, text)
    if output != STANDARD:
        console.note(f"{output}: gtb mesh {output} -o {os.path.splitext(output)[0]}.obj meshes it")
