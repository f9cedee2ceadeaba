"""`gtb expand`: a spec with everything carried out."""

from __future__ import annotations

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import console_option, output_option, spec_argument, spec_format_option
from gtb_cli.shell.streams import read_spec, write_text


@click.command
@spec_argument
@output_option
@spec_format_option
@console_option
def expand(spec: str, output: str, spec_format: str | None, console: Console) -> None:
    """\b
    Example: gtb expand specs/teapot.toml -o flat.toml

    Print a spec with everything carried out: numbers instead of names and expressions, patches instead of copies and
    included files. It describes the same patch or model, bit for bit.
    """
    from gtb_cli.spec.writer import dump

    write_text(output, dump(read_spec(spec, spec_format)))
