"""`gtb boundary`: the curves along the edges of a surface."""

from __future__ import annotations

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.console import Console
from gtb_cli.shell.options import WholeNumber, console_option, output_option, spec_argument, spec_format_option
from gtb_cli.shell.streams import about, read_patch, shown_input, write_text


@click.command
@spec_argument
@click.argument("edge", metavar="[EDGE]", type=WholeNumber(), required=False)
@output_option
@spec_format_option
@console_option
def boundary(spec: str, edge: int | None, output: str, spec_format: str | None, console: Console) -> None:
    """\b
    Example: gtb boundary specs/pentagon.toml 0

    Print the spec of the curve along an edge of a surface, or a model of all these curves.

    Edges are counted from 0, counter-clockwise from the lowest, then leftmost, corner of the domain; gtb info lists
    their knots. The curve's knots are measured along the edge, from its first corner.
    """
    from gtb_cli.spec.writer import dump
    from gtb_cli.theory.model import Model

    loaded = read_patch(spec, spec_format)
    with about(shown_input(spec)):
        if loaded.dimension == 1:
            raise SpecError("is a curve, and has no boundary curves")
        if edge is None:
            edges = range(len(loaded.domain.vertices))
            text = dump(Model(tuple(loaded.boundary(index) for index in edges), name=loaded.name))
        else:
            text = dump(loaded.boundary(edge))
    write_text(output, text)
