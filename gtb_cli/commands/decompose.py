"""`gtb decompose`: the regular decomposition of the knots."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.commands.console import Console, read_spec, shown_input, write_text
from gtb_cli.commands.meshing import about
from gtb_cli.commands.options import (
    console_option,
    json_option,
    lifting_option,
    output_option,
    spec_argument,
    spec_format_option,
)
from gtb_cli.errors import SpecError

if TYPE_CHECKING:
    from gtb_cli.lifting import RegularDecomposition
    from gtb_cli.patch import Patch


@click.command
@spec_argument
@lifting_option
@json_option
@output_option
@spec_format_option
@console_option
def decompose(
    spec: str,
    lifting: tuple[float, ...] | None,
    as_json: bool,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb decompose specs/pentagon.toml

    Print the regular decomposition that a lifting induces: the cells, and the knots that are in none.

    Knots are lifted by their lifting values; each upper face of their hull is a cell. Knots are written by index from
    0. With --json: {"cells": [[...]], "absent": [...]}, and for a model a list of these, as "patches".
    """
    from gtb_cli.patch import Model

    loaded = read_spec(spec, spec_format)
    with about(shown_input(spec)):
        if isinstance(loaded, Model):
            if lifting is not None:
                raise click.UsageError("--lifting is for a single patch, and this is a model")
            parts = [_decomposition(patch, None, f"patches[{i}]: ") for i, patch in enumerate(loaded.patches)]
            found: dict[str, Any] = {"patches": [_data(part) for part in parts]}
        else:
            parts = [_decomposition(loaded, lifting, "")]
            found = _data(parts[0])
    write_text(output, json.dumps(found) + "\n" if as_json else "\n".join(map(_text, parts)))


def _decomposition(patch: Patch, lifting: tuple[float, ...] | None, place: str) -> RegularDecomposition:
    from gtb_cli.lifting import regular_decomposition

    values = patch.lifting if lifting is None else lifting
    if values is None:
        raise SpecError(f"{place}has no lifting: write one into the spec, or give --lifting")
    return regular_decomposition(patch.knots, values)


def _data(found: RegularDecomposition) -> dict[str, Any]:
    return {"cells": [list(cell) for cell in found.cells], "absent": list(found.absent)}


def _text(found: RegularDecomposition) -> str:
    lines = [f"cell {index}: {' '.join(map(str, cell))}\n" for index, cell in enumerate(found.cells)]
    return "".join([*lines, f"absent: {' '.join(map(str, found.absent)) or 'none'}\n"])
