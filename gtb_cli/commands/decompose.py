"""`gtb decompose`: the regular decomposition of the knots, or all of them."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.shell.messages import Console
from gtb_cli.shell.options import WholeNumber, json_option, lifting_option, spec_argument, streams_options
from gtb_cli.shell.streams import Streams, about, single, write_json

if TYPE_CHECKING:
    from gtb_cli.knots.all_decompositions import LiftingCone
    from gtb_cli.knots.decomposition import RegularDecomposition
    from gtb_cli.theory.patch import Patch


@click.command
@spec_argument
@lifting_option
@json_option
@click.option("--all", "every", is_flag=True, help="Print every regular decomposition of the knots, by any lifting.")
@click.option("--triangulations", is_flag=True, help="With --all: only the finest.")
@click.option("--max", "most", type=WholeNumber(1), metavar="N", help="With --all: stop at this many.")
@streams_options
def decompose(
    spec: str,
    lifting: tuple[float, ...] | None,
    as_json: bool,
    every: bool,
    triangulations: bool,
    most: int | None,
    streams: Streams,
) -> None:
    """\b
    Example: gtb decompose specs/pentagon.toml

    Print the regular decomposition that a lifting induces: the cells, and the knots that no cell contains.

    Knots are lifted by their lifting values; each upper face of their hull is a cell. Knots are numbered from 0.
    --json prints "cells", "polygons" (corners counter-clockwise) and "absent"; of a model, a list of these, "patches".

    --all prints every decomposition that some lifting induces, numbered from 0 in lexicographic order of the cells; as
    JSON with a lifting that induces it, the dimension of the cone of these, and the number of knots that cells use.
    """
    from gtb_cli.knots.decomposition import regular_decomposition
    from gtb_cli.limits.degeneration import lifting_of
    from gtb_cli.models.model import Model

    if every:
        if lifting is not None:
            raise click.UsageError("--all tries every lifting: leave out --lifting")
        with streams.spec_of(spec) as loaded:
            cones = _every_one(single(loaded), triangulations, most, streams.console)
        _write_all(cones, as_json, streams)
        return None
    if triangulations or most is not None:
        raise click.UsageError(f"{'--triangulations' if triangulations else '--max'} is for --all")
    with streams.spec_of(spec) as loaded:
        is_model = isinstance(loaded, Model)
        if is_model and lifting is not None:
            raise click.UsageError("--lifting is for a single patch, and this is a model")
        parts = []
        for index, patch in enumerate(loaded.patches):
            with about(f"patches[{index}]") if is_model else nullcontext():
                parts.append(regular_decomposition(patch.knots, lifting_of(patch, lifting)))
    if as_json:
        records = [_data(part) for part in parts]
        return write_json(streams.output, {"patches": records} if is_model else records[0])
    streams.write("\n".join(map(_text, parts)))


def _every_one(patch: Patch, triangulations: bool, most: int | None, console: Console) -> list[LiftingCone]:
    """Return all regular decompositions of a patch's knots, or as many as are asked for, lexicographic by cells."""
    from gtb_cli.knots.all_decompositions import regular_decompositions

    found: list[LiftingCone] = []
    with console.counter(None) as begin:
        for cone in regular_decompositions(patch.knots, triangulations):
            if len(found) == most:
                console.warn(f"there are more than these {most}")
                break
            begin("regular decompositions")
            found.append(cone)
    return sorted(found, key=lambda cone: cone.cells)


def _data(found: RegularDecomposition) -> dict[str, Any]:
    return {"cells": [*map(list, found.cells)], "polygons": [*map(list, found.polygons)], "absent": [*found.absent]}


def _text(found: RegularDecomposition) -> str:
    lines = [f"cell {index}: {' '.join(map(str, cell))}\n" for index, cell in enumerate(found.cells)]
    return "".join([*lines, f"absent: {' '.join(map(str, found.absent)) or 'none'}\n"])


def _write_all(cones: list[LiftingCone], as_json: bool, streams: Streams) -> None:
    records, lines = list[dict[str, Any]](), list[str]()
    for number, cone in enumerate(cones):
        record = {"cells": cone.cells, "absent": cone.absent, "lifting": cone.lifting.tolist()}
        records.append(record | {"dimension": cone.dimension, "used": cone.used})
        rest = f"; absent {' '.join(map(str, cone.absent))}" if cone.absent else ""
        lines.append(f"{number}: {', '.join(' '.join(map(str, cell)) for cell in cone.cells)}{rest}\n")
    if as_json:
        write_json(streams.output, {"decompositions": records}, by_row=True)
    else:
        streams.write("".join(lines))
    streams.console.report(streams.output, f"{len(cones)} regular decompositions")
