"""`gtb completion`: names and options completed by the shell, and the manual page made from the help."""

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import console_option, output_option
from gtb_cli.shell.streams import write_text
from gtb_cli.vocabulary import COMPLETION_VARIABLE, SHELLS

MANUAL = "man"  # argument that asks for the manual page instead of a script for a shell


@click.command
@click.argument("shell", metavar="SHELL", type=click.Choice((*SHELLS, MANUAL)))
@output_option
@console_option
def completion(shell: str, output: str, console: Console) -> None:
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

    if shell == MANUAL:
        return write_text(output, manual(gtb))
    kind = get_completion_class(shell)
    assert kind is not None
    script = kind(gtb, {}, "gtb", COMPLETION_VARIABLE)
    # The method source() would first run the shell to ask for its version.
    write_text(output, script.source_template % script.source_vars())


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
