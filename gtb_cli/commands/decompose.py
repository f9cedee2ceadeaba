"""`gtb decompose`: the regular decomposition of the knots, or all of them."""

from contextlib import nullcontext
from typing import Any

import click

from gtb_cli.shell.gathering import option
from gtb_cli.shell.options import WholeNumber, json_option, lifting_option, spec_argument, streams_options
from gtb_cli.shell.streams import Streams, about, single, write_json


@click.command
@spec_argument
@lifting_option
@json_option
@option("--all", bool, into="every")(help="Print every regular decomposition of the knots, by any lifting.")
@option("--triangulations", bool)(help="With --all: only the finest.")
@option("--max N", WholeNumber(1), into="most")(help="With --all: stop at this many.")
@streams_options
def decompose(
    spec: str, lifting: tuple[float, ...] | None, every: bool, as_json: bool, streams: Streams, **limits: Any
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
        return _print_all(spec, as_json, streams, **limits)
    if limits["triangulations"] or limits["most"] is not None:
        raise click.UsageError(f"{'--triangulations' if limits['triangulations'] else '--max'} is for --all")
    with streams.spec_of(spec) as loaded:
        is_model = isinstance(loaded, Model)
        if is_model and lifting is not None:
            raise click.UsageError("--lifting is for a single patch, and this is a model")
        parts = []
        for index, patch in enumerate(loaded.patches):
            with about(f"patches[{index}]") if is_model else nullcontext():
                parts.append(regular_decomposition(patch.knots, lifting_of(patch, lifting)))
    if as_json:
        records = [{"cells": part.cells, "polygons": part.polygons, "absent": part.absent} for part in parts]
        return write_json(streams.output, {"patches": records} if is_model else records[0])
    texts = []
    for part in parts:
        lines = [f"cell {index}: {' '.join(map(str, cell))}\n" for index, cell in enumerate(part.cells)]
        texts.append("".join([*lines, f"absent: {' '.join(map(str, part.absent)) or 'none'}\n"]))
    streams.write("\n".join(texts))


def _print_all(spec: str, as_json: bool, streams: Streams, triangulations: bool, most: int | None) -> None:
    """Print all regular decompositions of a patch's knots, or as many as are asked for, lexicographic by cells."""
    from gtb_cli.knots.all_decompositions import regular_decompositions

    found = list[Any]()
    with streams.spec_of(spec) as loaded, streams.console.counter(None) as begin:
        for cone in regular_decompositions(single(loaded).knots, triangulations):
            if len(found) == most:
                streams.console.warn(f"there are more than these {most}")
                break
            begin("regular decompositions")
            found.append(cone)
    records, lines = list[dict[str, Any]](), list[str]()
    for number, cone in enumerate(sorted(found, key=lambda cone: cone.cells)):
        record = {"cells": cone.cells, "absent": cone.absent, "lifting": cone.lifting.tolist()}
        records.append(record | {"dimension": cone.dimension, "used": cone.used})
        rest = f"; absent {' '.join(map(str, cone.absent))}" if cone.absent else ""
        lines.append(f"{number}: {', '.join(' '.join(map(str, cell)) for cell in cone.cells)}{rest}\n")
    if as_json:
        write_json(streams.output, {"decompositions": records}, by_row=True)
    else:
        streams.write("".join(lines))
    streams.console.report(streams.output, f"{len(found)} regular decompositions")
