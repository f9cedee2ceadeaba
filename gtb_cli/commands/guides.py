"""`gtb schema`, `help` and `completion`: what the program says of itself."""

from difflib import get_close_matches

import click

from gtb_cli.shell.gathering import option
from gtb_cli.shell.options import output_options
from gtb_cli.shell.streams import Streams
from gtb_cli.vocabulary import COMPLETION_VARIABLE, SHELLS


@click.command
@output_options
def schema(streams: Streams) -> None:
    """\b
    Example: gtb schema -o spec-schema.json

    Print the JSON Schema of a spec, TOML or JSON, for editors and for programs that write specs.
    """
    import json

    from gtb_cli.language.schema import schema as schema_of_spec

    streams.write(json.dumps(schema_of_spec(), indent=2) + "\n")


@click.command("help")
@click.argument("command", metavar="[COMMAND|OPTION]", required=False)
@option("-q, --quiet", bool, expose_value=False)(help="Print only errors.")
def help_(command: str | None) -> None:
    """\b
    Example: gtb help mesh

    Say what a command does, as its --help does, or list the commands. gtb help spec explains every key of a spec, and
    gtb help thickness says which commands have such an option.
    """
    if command == "spec":
        from gtb_cli.language.schema import page

        return click.echo(page(), nl=False)
    above = click.get_current_context().parent
    assert above is not None
    if command is None:
        return click.echo(above.get_help())
    group = above.command
    assert isinstance(group, click.Group)
    if command not in (names := group.list_commands(above)):
        params = [(each, param) for each in names for param in vars(group.get_command(above, each))["params"]]
        having = [(each, param.help) for each, param in params if f"--{command}" in param.opts]
        texts = {text: ", ".join(each for each, own in having if own == text) for _, text in having}
        if texts:
            rows = (f"{commands}:\n{click.wrap_text(text, 76, '    ', '    ')}" for text, commands in texts.items())
            return click.echo("\n".join(f"gtb {each}" for each in rows))
        long = {name.removeprefix("--") for _, param in params for name in param.opts}
        if (likely := get_close_matches(command, [*names, *sorted(long)], 1)) and likely[0] not in names:
            raise click.UsageError(f"No such command or option: {command}. Did you mean {likely[0]}?")
    name, found, _ = group.resolve_command(above, [command])
    assert found is not None
    with click.Context(found, info_name=name, parent=above) as context:
        click.echo(found.get_help(context))


@click.command
@click.argument("shell", metavar="SHELL", type=click.Choice(SHELLS))
@output_options
def completion(shell: str, streams: Streams) -> None:
    """\b
    Example: gtb completion bash

    Print a script that makes a shell complete commands, options and file names after gtb. SHELL is bash, zsh or fish.

    \b
    For every new shell:
      bash   echo 'eval "$(gtb completion bash)"' >> ~/.bashrc
      zsh    echo 'eval "$(gtb completion zsh)"' >> ~/.zshrc
      fish   gtb completion fish > ~/.config/fish/completions/gtb.fish
    """
    from click.shell_completion import get_completion_class

    from gtb_cli.commands.cli import gtb

    kind = get_completion_class(shell)
    assert kind is not None
    script = kind(gtb, {}, "gtb", COMPLETION_VARIABLE)
    # The method source() would first run the shell to ask for its version.
    streams.write(script.source_template % script.source_vars())
