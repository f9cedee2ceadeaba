"""The manual page, made from the help of the commands."""

import click


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
