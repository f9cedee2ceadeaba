"""`gtb decompose`: the regular decomposition of the knots."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.meshing import MeshOptions, format_of_lines
from gtb_cli.shell.options import json_option, lifting_option, spec_argument, text_options
from gtb_cli.shell.streams import about, spec_of, write_text
from gtb_cli.tessellation.recipe import Recipe

if TYPE_CHECKING:
    from gtb_cli.knots.decomposition import RegularDecomposition
    from gtb_cli.theory.patch import Patch


@click.command
@spec_argument
@lifting_option
@json_option
@click.option("--net", is_flag=True, help="Write the control net that the lifting induces, as lines of a mesh.")
@text_options
def decompose(
    spec: str,
    lifting: tuple[float, ...] | None,
    as_json: bool,
    net: bool,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb decompose specs/pentagon.toml

    Print the regular decomposition that a lifting induces: the cells, and the knots that no cell contains.

    Knots are lifted by their lifting values; each upper face of their hull is a cell. Knots are numbered from 0.
    --json prints {"cells": [[...]], "polygons": [[...]], "absent": [...]}, where a polygon lists the corners of a cell
    counter-clockwise; for a model it prints a list of these as "patches".

    --net writes the control net instead: lines between the control points of knots that are neighbours on the border
    of a cell, as OBJ, PLY or GLB, by the suffix of the output. Curves and Bézier patches need no lifting for it:
    without one they get the usual net.
    """
    from gtb_cli.theory.model import Model

    if net and as_json:
        raise click.UsageError("--net writes a mesh and --json writes text: give one of them")
    kind = format_of_lines(output, "--net") if net else ""
    with spec_of(spec, spec_format) as loaded:
        if isinstance(loaded, Model):
            if lifting is not None:
                raise click.UsageError("--lifting is for a single patch, and this is a model")
            parts = []
            for index, patch in enumerate(loaded):
                with about(f"patches[{index}]"):
                    parts.append(_decomposition(patch, None, net))
            found: dict[str, Any] = {"patches": [_data(part) for part in parts]}
        else:
            parts = [_decomposition(loaded, lifting, net)]
            found = _data(parts[0])
        if net:
            from gtb_cli.pictures.nets import mesh_of_nets

            mesh = mesh_of_nets(loaded.patches, parts, loaded.name)
            return MeshOptions(Recipe()).write(output, kind, mesh, console)
    write_text(output, json.dumps(found) + "\n" if as_json else "\n".join(map(_text, parts)))


def _decomposition(patch: Patch, lifting: tuple[float, ...] | None, net: bool) -> RegularDecomposition:
    """Return the decomposition by a lifting, or the spec's own; for the usual net of a Bézier patch without one."""
    from gtb_cli.knots.decomposition import regular_decomposition
    from gtb_cli.knots.lattice import lattice_of
    from gtb_cli.pictures.nets import bowl
    from gtb_cli.theory.degeneration import lifting_of

    has_usual_net = patch.dimension == 1 or lattice_of(patch.domain) is not None
    if net and lifting is None and patch.lifting is None and has_usual_net:
        return regular_decomposition(patch.knots, bowl(patch.domain))
    return regular_decomposition(patch.knots, lifting_of(patch, lifting))


def _data(found: RegularDecomposition) -> dict[str, Any]:
    return {
        "cells": [list(cell) for cell in found.cells],
        "polygons": [list(polygon) for polygon in found.polygons],
        "absent": list(found.absent),
    }


def _text(found: RegularDecomposition) -> str:
    lines = [f"cell {index}: {' '.join(map(str, cell))}\n" for index, cell in enumerate(found.cells)]
    return "".join([*lines, f"absent: {' '.join(map(str, found.absent)) or 'none'}\n"])
