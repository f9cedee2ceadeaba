"""`gtb eval`: parameters → points, or values of the basis."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, islice
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import DomainError, Fault, ToleranceError
from gtb_cli.shell.console import STANDARD
from gtb_cli.shell.options import INPUT, WholeNumber, json_option, spec_argument, streams_options
from gtb_cli.shell.streams import Streams, number_rows, opened, shown_input, write_blocks, write_json
from gtb_cli.vocabulary import MAX_FACES, PARAMETRIZATIONS

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray
    from gtb_cli.theory.parametrization import Parametrization
    from gtb_cli.theory.patch import Patch

BATCH_LINES = 8192  # lines evaluated together, however a pipe delivers them: last digits depend on the number


@click.command("eval")
@spec_argument
@click.argument("params", metavar="[PARAMS]", default=STANDARD, type=INPUT)
@click.option("--basis", is_flag=True, help="Print the values T_i of the rational basis instead of points.")
@click.option(
    "--grid",
    type=WholeNumber(1, 10**6),  # segments; the cells are counted before the grid is made
    metavar="N",
    help="Instead of PARAMS, use the parameters of the vertices of gtb mesh -n N; each line begins with them.",
)
@click.option("--header", is_flag=True, help="Print the names of the columns first, and parameters before each line.")
@click.option(
    "--parametrization",
    type=click.Choice(PARAMETRIZATIONS),
    default="toric",
    help="What parameters mean: toric, as in the paper (the default); or linear, so that "
    "the patch has linear precision, as in gtb mesh.",
)
@json_option
@streams_options
def evaluate(
    spec: str,
    params: str,
    basis: bool,
    grid: int | None,
    header: bool,
    parametrization: Parametrization,
    as_json: bool,
    streams: Streams,
) -> None:
    """\b
    Example: echo 0.5 1.5 | gtb eval specs/pentagon.toml

    Evaluate points, or the basis, at given parameters.

    PARAMS is a file, or standard input: one parameter on each line, "t" for a curve and "u v" for a surface, separated
    by blanks, tabs or a comma. Empty lines and what follows a # are skipped. Each parameter gives one line, with the
    shortest digits that read back exactly. --json prints {"schema": 1, "points": [...], "parameters": [...]}, or
    "basis". With --header each line begins with its parameters, below the names of the columns: "u v T0 T1 ..." with
    --basis.

    --grid reads nothing: its parameters cover the domain, corners and edges included, and each line is "u v x y z"
    (for a curve "t x y z"), which plotting programs read.
    """
    if grid is not None and params != STANDARD:
        raise click.UsageError(f"--grid makes parameters: {params} cannot be read as well")
    if header and as_json:
        raise click.UsageError("--header is for lines; --json already names its parts")
    if grid is None and spec == params == STANDARD:
        raise click.UsageError("spec and parameters cannot both be standard input")
    loaded = streams.patch_of(spec)
    evaluated = loaded.basis if basis else loaded.evaluate
    values = partial(evaluated, parametrization=parametrization)
    batches = _batches(loaded, params, values) if grid is None else _grid(loaded, grid, values)
    if as_json:
        found = list(batches)
        points, parameters = ([row for pair in found for row in pair[part].tolist()] for part in (1, 0))
        data = {"basis" if basis else "points": points, "parameters": parameters}
        return write_json(streams.output, data, by_row=True)
    first = [" ".join(_columns(loaded, basis)).encode("ascii") + b"\n"] if header else []
    rows = map(_with_parameters, batches) if header or grid is not None else (_rows(found) for _, found in batches)
    write_blocks(streams.output, chain(first, rows))


def _columns(patch: Patch, basis: bool) -> list[str]:
    """Name the columns of lines that begin with their parameters."""
    values = [f"T{i}" for i in range(len(patch.knots))] if basis else ["x", "y", "z"]
    return [*(["t"] if patch.dimension == 1 else ["u", "v"]), *values]


def _grid(
    patch: Patch, resolution: int, values: Callable[[FloatArray], FloatArray]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield parameters that cover Δ, and their values."""
    from gtb_cli.knots.triangulation import cell_count, triangulation

    count = cell_count(patch.domain, resolution)
    if count > MAX_FACES:
        raise ToleranceError(f"--grid {resolution} has {count} cells, more than {MAX_FACES}: take fewer")
    u = triangulation(patch.domain, resolution).parameters
    for start in range(0, len(u), BATCH_LINES):
        block = u[start : start + BATCH_LINES]
        yield block, values(block)


def _batches(
    patch: Patch, params: str, values: Callable[[FloatArray], FloatArray]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield parameters and values, `BATCH_LINES` lines at a time; on a terminal every line at once."""
    import numpy as np

    with opened(params) as file:
        rows = number_rows(file, shown_input(params), [patch.dimension])
        while batch := list(islice(rows, 1 if file.isatty() else BATCH_LINES)):
            u = np.array([row for _, row in batch])
            try:
                yield u, values(u)
            except DomainError as error:
                # The index at the start of the message, which is that of a parameter, becomes the number of its line.
                match = re.fullmatch(r"parameters\[(\d+)\]: (.*)", str(error), re.DOTALL)
                line, text = (batch[int(match[1])][0], match[2]) if match else (None, str(error))
                raise DomainError(Fault(text, shown_input(params), line)) from None


def _with_parameters(batch: tuple[FloatArray, FloatArray]) -> bytes:
    import numpy as np

    return _rows(np.concatenate(batch, axis=1))


def _rows(values: FloatArray) -> bytes:
    line = " ".join(["%r"] * values.shape[1]) + "\n"
    return (line * len(values) % tuple(values.ravel().tolist())).encode("ascii")
