"""`gtb help`: what a command does."""

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.options import console_option


@click.command("help")
@click.argument("command", metavar="[COMMAND]", required=False)
@console_option
def help_(command: str | None, console: Console) -> None:
    """\b
    Example: gtb help mesh

    Say what a command does, as its --help does, or list the commands.
    """
    above = click.get_current_context().parent
    assert above is not None
    if command is None:
        click.echo(above.get_help())
        return
    assert isinstance(above.command, click.Group)
    name, found, _ = above.command.resolve_command(above, [command])
    assert found is not None
    with click.Context(found, info_name=name, parent=above) as context:
        click.echo(found.get_help(context))
