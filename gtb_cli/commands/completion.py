"""`gtb completion`: names and options completed by the shell."""

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
        from gtb_cli.commands.manual import manual

        write_text(output, manual(gtb))
        return
    kind = get_completion_class(shell)
    assert kind is not None
    script = kind(gtb, {}, "gtb", COMPLETION_VARIABLE)
    # The method source() would first run the shell to ask for its version.
    write_text(output, script.source_template % script.source_vars())
