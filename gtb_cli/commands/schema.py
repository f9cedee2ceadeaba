"""`gtb schema`: the JSON Schema of a spec."""

import json

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import console_option, output_option
from gtb_cli.shell.streams import write_text


@click.command
@output_option
@console_option
def schema(output: str, console: Console) -> None:
    """\b
    Example: gtb schema -o spec-schema.json

    Print the JSON Schema of a spec, TOML or JSON, for editors and for programs that write specs.
    """
    from gtb_cli.language import schema as room

    write_text(output, json.dumps(room.schema(), indent=2) + "\n")
