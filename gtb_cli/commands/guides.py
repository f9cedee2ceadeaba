"""`gtb schema`, `help` and `completion`: what the program says of itself."""

import click

from gtb_cli.shell.console import STANDARD
from gtb_cli.shell.gathering import gathered
from gtb_cli.shell.options import OUTPUT, console_option, output_options
from gtb_cli.shell.streams import Streams
from gtb_cli.vocabulary import COMPLETION_VARIABLE, OUTPUTS, SHELLS


@click.command
@click.option(
    "--output",
    "name",
    type=click.Choice(OUTPUTS),
    metavar="NAME",
    help=f"Instead of a spec's: the schema of JSON that is printed or written: {', '.join(OUTPUTS)}.",
)
@gathered(
    "streams",
    Streams,
    click.option(
        "-o",
        "--file",  # not --output, which names a schema
        "output",
        metavar="OUT",
        default=STANDARD,
        type=OUTPUT,
        help="Write to this file; by default, or with -, to standard output.",
    ),
    console_option,
)
def schema(name: str | None, streams: Streams) -> None:
    """\b
    Example: gtb schema -o spec-schema.json

    Print the JSON Schema of a spec, TOML or JSON, for editors and for programs that write specs.

    --output NAME prints that of what a command writes, for programs that read it: gtb schema --output diff.
    """
    import json

    if name is None:
        from gtb_cli.language.schema import schema as schema_of_spec

        found = schema_of_spec()
    else:
        from gtb_cli.language.outputs import schema_of

        found = schema_of(name)
    streams.write(json.dumps(found, indent=2) + "\n")


@click.command("help")
@click.argument("command", metavar="[COMMAND]", required=False)
@click.option("-q", "--quiet", is_flag=True, expose_value=False, help="Print only errors.")
def help_(command: str | None) -> None:
    """\b
    Example: gtb help mesh

    Say what a command does, as its --help does, or list the commands. gtb help spec explains every key of a spec.
    """
    if command == "spec":
        from gtb_cli.language.schema import page

        return click.echo(page(), nl=False)
    above = click.get_current_context().parent
    assert above is not None
    if command is None:
        return click.echo(above.get_help())
    assert isinstance(above.command, click.Group)
    name, found, _ = above.command.resolve_command(above, [command])
    assert found is not None
    with click.Context(found, info_name=name, parent=above) as context:
        click.echo(found.get_help(context))


@click.command
@click.argument("shell", metavar="SHELL", type=click.Choice((*SHELLS, "man")))
@output_options
def completion(shell: str, streams: Streams) -> None:
    """\b
    Example: gtb completion bash

    Print a script that makes a shell complete commands, options and file names after gtb. SHELL is bash, zsh or fish,
    or man, which prints the manual page.

    \b
    For every new shell:
      bash   echo 'eval "$(gtb completion bash)"' >> ~/.bashrc
      zsh    echo 'eval "$(gtb completion zsh)"' >> ~/.zshrc
      fish   gtb completion fish > ~/.config/fish/completions/gtb.fish
      man    gtb completion man > ~/.local/share/man/man1/gtb.1
    """
    from click.shell_completion import get_completion_class

    from gtb_cli.commands.cli import gtb

    if shell == "man":
        return streams.write(manual(gtb))
    kind = get_completion_class(shell)
    assert kind is not None
    script = kind(gtb, {}, "gtb", COMPLETION_VARIABLE)
    # The method source() would first run the shell to ask for its version.
    streams.write(script.source_template % script.source_vars())


def manual(group: click.Group) -> str:
    """Write all help texts unchanged as one page for man(1)."""
    page_columns = 78  # columns of the page, whatever the terminal has, so that the bytes are the same everywhere
    context = click.Context(group, info_name="gtb", terminal_width=page_columns)
    lines = [
        '.TH GTB 1 "" "" "gtb"',
        ".SH NAME",
        r"gtb \- generalized toric\-Bézier patches, from a short text description to a mesh",
        ".SH DESCRIPTION",
        *_as_it_stands(group.get_help(context)),
        ".SH COMMANDS",
    ]
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        lines.append(f".SS {_escaped('gtb ' + name)}")
        lines += _as_it_stands(
            command.get_help(click.Context(command, info_name=name, parent=context, terminal_width=page_columns))
        )
    return "\n".join(lines) + "\n"


def _as_it_stands(text: str) -> list[str]:
    return [".nf", *map(_escaped, text.splitlines()), ".fi"]


def _escaped(line: str) -> str:
    """Escape a line so that troff reads it only as text."""
    line = line.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{line}" if line.startswith((".", "'")) else line
