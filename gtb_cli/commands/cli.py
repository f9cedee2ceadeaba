"""The `gtb` command: the list of its commands, and where errors become messages and the exit status 0, 1 or 2.

Signals, such as Ctrl-C, get their exit statuses in `gtb_cli.__main__`.
"""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module

import click

from gtb_cli.errors import Fault, RequirementError
from gtb_cli.shell.allowances import bound, bytes_from, seconds_from
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import FORMS, STANDARD, abandon, begin, finish, say, tell
from gtb_cli.version import __version__
from gtb_cli.vocabulary import COMPLETION_VARIABLE, TEMPLATES, printable

# Exit statuses; a comparison that says no raises `click.exceptions.Exit`, a requirement raises its own error.
DONE, REFUSED, FAILED = 0, 1, 2

# Groups of commands, each with its summary in one line
GROUPS = {
    "Make": {
        "mesh": "Make meshes: OBJ, PLY, STL, GLB or 3MF.",
        "degenerate": "Mesh a toric degeneration and its limit.",
        "knot-limit": "Mesh a patch whose knots move to others, and the limit.",
        "new": "Print a starter spec with comments.",
        "fit": "Find a curve through points.",
        "fill": "Fill a hole with three or more sides and exact tangent planes.",
        "fair": "Choose inner control points that make a surface fair.",
    },
    "Look and compare": {
        "info": "Say what a spec describes, or what a mesh measures.",
        "view": "Make a page to look at surfaces in a browser.",
        "plot": "Draw a figure for print, or a film of a sequence.",
        "check": "Measure the properties of a patch that the paper proves.",
        "diff": "Compare meshes, or folders of them, with a tolerance.",
        "approve": "Take new meshes over as those to compare with.",
    },
    "Bring in and out": {
        "import": "Turn files of other programs into specs.",
        "expand": "Print a spec with names, copies and included files carried out.",
        "bezier": "Divide patches and curves into exact rational Bézier pieces.",
        "schema": "Print the JSON Schema of a spec, for editors and programs.",
    },
    "Mathematics": {
        "eval": "Evaluate points, or the basis, at given parameters.",
        "decompose": "Print the regular decomposition of a lifting, or all.",
        "elevate": "Elevate the degree: more control points for the same image.",
        "boundary": "Print the curves along the edges of a surface.",
        "coefficients": "Make the basis add up to 1, where possible.",
    },
    "Help": {
        "help": "Say what a command does, or explain every key of a spec.",
        "completion": "Print a script for completion by the shell.",
    },
}
COMMANDS = {name: summary for group in GROUPS.values() for name, summary in group.items()}

# Modules of the commands that have none of their own name
ROOMS = {
    "evaluate": "eval",
    "guides": "completion help schema",
    "imports": "import",
    "respec": "bezier boundary coefficients elevate expand fair",
    "sequences": "degenerate knot-limit",
}


class LazyGroup(click.Group):
    """A group that knows its commands by name and imports only the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the names in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in COMMANDS:
            return None
        room = next((room for room, names in ROOMS.items() if cmd_name in names.split()), cmd_name)
        found = vars(import_module(f"gtb_cli.commands.{room}")).values()
        command = next(each for each in found if isinstance(each, click.Command) and each.name == cmd_name)
        command.short_help = COMMANDS[cmd_name]
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that the arguments name, or suggest the one that was meant."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            from difflib import get_close_matches

            others = {"plot": "render draw", "view": "show open", "mesh": "export build"}
            likely = [command for command, words in others.items() if name in words.split()]
            likely = likely or get_close_matches(name, COMMANDS, n=1)
            if name.endswith((".toml", ".json")) or name in TEMPLATES:
                likely = [f"{'new' if name in TEMPLATES else 'mesh'} {name}"]
            suggestion = f" Did you mean {likely[0]}?" if likely else ""
            raise click.UsageError(f"No such command: {name or repr(name)}.{suggestion}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by groups, without importing them."""
        width = max(map(len, COMMANDS))  # so that the summaries of all groups are in line
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), summary) for name, summary in commands.items()])


def _print_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if not value or ctx.resilient_parsing:
        return
    if ctx.params.get("json"):  # an eager option, which is read first
        from gtb_cli.process.versions import package_version, versions
        from gtb_cli.shell.streams import write_json

        write_json(STANDARD, versions() | {"click": package_version("click")})
    else:
        click.echo(f"gtb {__version__}")
    ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@option("--json", bool, is_eager=True)(
    help="Print errors and warnings, and the version, as JSON objects. A command's own --json also does the former."
)
@option("--errors", FORMS, expose_value=False)(
    help="Print errors and warnings as lines of text, as one JSON object at the end, or as annotations of GitHub."
)
@option("--version", bool, expose_value=False, callback=_print_version)(
    help="Print the version; with --json, also those of Python and the packages."
)
@option("--max-seconds S", seconds_from)(
    help="Stop a command that takes longer, with exit status 2 and nothing left behind; it has a second more to end."
)
@option("--max-memory SIZE", bytes_from)(
    help="Memory that the command may use, such as 500M or 2G, counted in addresses as by ulimit -v; with -j all "
    "processes share it, and there are fewer of them where each would have less than 1G."
)
def gtb(json: bool, max_seconds: float | None, max_memory: int | None) -> None:
    """\b
    Example: gtb mesh specs/pentagon.toml -o pentagon.obj

    Generalized toric-Bézier patches: from a short text description to a mesh.

    A SPEC is a TOML or JSON file, or - for standard input. Data go to standard output unless -o names a file;
    messages go to standard error. Exit status: 0 done, 1 a comparison, check or requirement says no, 2 an error, 130
    after Ctrl-C.
    """


def run(arguments: Sequence[str], alone: bool = False) -> int:
    """Run one command line and return its exit status.

    The process is `alone` if it does nothing else: only then may --max-seconds and --max-memory copy it.

    Each error is a line on standard error, or as --errors says. A closed pipe is not an error: its reader has read what
    it wanted.
    """
    begin(_form(arguments), [*arguments, *map(printable, arguments)])
    status, errors = _done(arguments, alone)
    for name in arguments:
        if "\n" in name and all(error.file is None for error in errors):  # it must not begin another line
            text = "\n".join(map(str, errors)).replace(name, printable(name))
            errors = [Fault(line) for line in text.split("\n") if line]
    for error in errors:
        tell(error, "error")
    finish(status)
    return status


def _form(arguments: Sequence[str]) -> str:
    """Find the form of errors in the arguments, which may have errors themselves."""
    for place, word in enumerate(arguments):
        name, _, value = word.partition("=")
        value = value or "".join(arguments[place + 1 : place + 2])
        if name == "--errors" and value in FORMS:
            return value
    return "json" if "--json" in arguments else FORMS[0]


def _done(arguments: Sequence[str], alone: bool) -> tuple[int, list[Fault]]:
    """Run a command line; return its exit status and the errors."""
    try:
        if os.environ.get(COMPLETION_VARIABLE):
            _complete(arguments)
        with gtb.make_context("gtb", list(arguments)) as context:
            limits = context.params["max_seconds"], context.params["max_memory"]
            if limits != (None, None):
                if not alone:
                    raise click.UsageError("--max-seconds and --max-memory need a process of their own")
                bound(*limits)
            from gtb_cli.process.memory import prepare_for_limit  # --help and --version do not need it

            prepare_for_limit()
            gtb.invoke(context)
        if sys.stdout is not None:
            sys.stdout.flush()
        return DONE, []
    except click.exceptions.Exit as end:
        return end.exit_code, []
    except click.exceptions.NoArgsIsHelpError as error:
        say(error.format_message())
        return FAILED, []
    except click.UsageError as error:
        return FAILED, [Fault(_usage_text(error))]
    except BrokenPipeError:
        abandon(sys.stdout)
        return DONE, []
    except Exception as error:  # noqa: BLE001 -- the last resort: whatever it is, a person gets a message
        if isinstance(error, OSError):
            abandon(sys.stdout)
        return REFUSED if isinstance(error, RequirementError) else FAILED, faults_about(error)


def _complete(arguments: Sequence[str]) -> None:
    """Answer the shell, which asks through environment variables."""
    with suppress(KeyError, ValueError):
        try:
            gtb.main(list(arguments), prog_name="gtb", complete_var=COMPLETION_VARIABLE, standalone_mode=False)
        except SystemExit as end:
            if not end.code:
                raise
    raise click.UsageError(f"{COMPLETION_VARIABLE} is for shells, which also set COMP_WORDS and COMP_CWORD")


def _usage_text(error: click.UsageError) -> str:
    if isinstance(error, click.NoSuchOption) and error.ctx is not None:
        from difflib import get_close_matches

        elsewhere = {"--wall": "--thickness", "--shell": "--thickness", "--offset": "--thickness", "-D": "--set"}
        name, known = error.option_name, [name for param in error.ctx.command.params for name in param.opts]
        meant = [other for other in known if other.startswith((name, f"-{name}")) or other == elsewhere.get(name)]
        meant = meant or get_close_matches(name, known, n=1)
        text = f"No such option '{name}'."  # in these words with any version of click
        if meant:
            return f"{text} Did you mean {' or '.join(meant)}?"
    else:
        text = " ".join(error.format_message().split())
    if text.endswith("?") or error.ctx is None:
        return text
    return f"{text.rstrip('.')}. Try '{error.ctx.command_path} --help'."
