"""`gtb eval`: parameters → points, or values of the basis."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, islice
from typing import IO, TYPE_CHECKING, NoReturn

import click

from gtb_cli.errors import DomainError, GtbError, SpecError, ToleranceError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.options import INPUT, WholeNumber, json_option, spec_argument, text_options
from gtb_cli.shell.streams import opened, read_patch, shown_input, write_blocks
from gtb_cli.vocabulary import MAX_FACES, PARAMETRIZATIONS

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray
    from gtb_cli.theory.parametrization import Parametrization
    from gtb_cli.theory.patch import Patch

# Lines that are evaluated together. The number does not depend on how a pipe delivers them, so the last digits do not
# either.
BATCH_LINES = 8192

MAX_LINE_BYTES = 10_000  # longest line, in bytes


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
@text_options
def evaluate(
    spec: str,
    params: str,
    basis: bool,
    grid: int | None,
    header: bool,
    parametrization: Parametrization,
    as_json: bool,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: echo 0.5 1.5 | gtb eval specs/pentagon.toml

    Evaluate points, or the basis, at given parameters.

    PARAMS is a file, or standard input: one parameter on each line, "t" for a curve and "u v" for a surface, separated
    by blanks, tabs or a comma. Empty lines and what follows a # are skipped. Each parameter gives one line, with the
    shortest digits that read back exactly. --json prints {"points": [...], "parameters": [...]}, or "basis". With
    --header each line begins with its parameters, below the names of the columns: "u v T0 T1 ..." with --basis.

    --grid reads nothing: its parameters cover the domain, corners and edges included, and each line is "u v x y z"
    (for a curve "t x y z"), which plotting programs read.
    """
    if grid is not None and params != STANDARD:
        raise click.UsageError(f"--grid makes parameters: {params} cannot be read as well")
    if header and as_json:
        raise click.UsageError("--header is for lines; --json already names its parts")
    if grid is None and spec == params == STANDARD:
        raise click.UsageError("spec and parameters cannot both be standard input")
    loaded = read_patch(spec, spec_format)
    evaluated = loaded.basis if basis else loaded.evaluate
    values = partial(evaluated, parametrization=parametrization)
    batches = _batches(loaded, params, values) if grid is None else _grid(loaded, grid, values)
    if as_json:
        write_blocks(output, _json(batches, "basis" if basis else "points"))
        return
    first = [" ".join(_columns(loaded, basis)).encode("ascii") + b"\n"] if header else []
    with_parameters = header or grid is not None
    write_blocks(output, chain(first, map(_rows_with_parameters if with_parameters else _rows, batches)))


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


def _rows_with_parameters(batch: tuple[FloatArray, FloatArray]) -> bytes:
    import numpy as np

    return _rows((batch[0], np.concatenate(batch, axis=1)))


def _batches(
    patch: Patch, params: str, values: Callable[[FloatArray], FloatArray]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield parameters and values, `BATCH_LINES` lines at a time."""
    import numpy as np

    source = shown_input(params)
    d = patch.dimension
    with opened(params) as file:
        for first, lines in _lines(file, source):
            plain = [line.partition(b"#")[0].replace(b",", b" ") for line in lines]
            fields = [line.split() for line in plain]
            counts = set(map(len, fields))
            if not counts <= {0, d}:
                _refuse(source, first, lines, fields, d)
            try:
                numbers = list(map(float, chain.from_iterable(fields)))
            except ValueError:
                _refuse(source, first, lines, fields, d)
            if not numbers:
                continue
            u = np.array(numbers).reshape(-1, d)
            try:
                result = values(u)
            except DomainError as error:
                raise _located(error, source, first, fields) from None
            yield u, result


def _lines(file: IO[bytes], source: str) -> Iterator[tuple[int, list[bytes]]]:
    """Yield batches of lines, each with the number of its first line, from 1; on a terminal every line at once."""
    first, size = 1, 1 if file.isatty() else BATCH_LINES
    rest = iter(partial(file.readline, MAX_LINE_BYTES + 1), b"")
    while lines := list(islice(rest, size)):
        for number, line in enumerate(lines, first):
            if len(line) > MAX_LINE_BYTES:
                raise SpecError(f"{source}:{number}: a line of more than {MAX_LINE_BYTES} characters")
        if first == 1:
            lines[0] = lines[0].removeprefix(codecs.BOM_UTF8)
        yield first, lines
        first += len(lines)


def _refuse(source: str, first: int, lines: list[bytes], fields: list[list[bytes]], d: int) -> NoReturn:
    """Raise the error that says which line is wrong."""
    for number, (line, words) in enumerate(zip(lines, fields, strict=True), first):
        for word in words:
            try:
                float(word)
            except ValueError:
                raise SpecError(f"{source}:{number}: {_shown(word)} is not a number") from None
        if words and len(words) != d:
            expected = "one number, t" if d == 1 else "two numbers, u v"
            raise SpecError(f"{source}:{number}: expected {expected}, got {_shown(line)}")
    raise AssertionError("no line is wrong")


def _shown(text: bytes) -> str:
    shown = text.strip().decode("utf-8", "backslashreplace")
    return repr(shown if len(shown) <= 60 else f"{shown[:60]}…")


def _located(error: DomainError, source: str, first: int, fields: list[list[bytes]]) -> GtbError:
    """Replace the index at the start of a message, which is that of a parameter, by the number of its line."""
    match = re.fullmatch(r"parameters\[(\d+)\]: (.*)", str(error), re.DOTALL)
    if match is None:
        return DomainError(f"{source}: {error}")
    numbers = [number for number, words in enumerate(fields, first) if words]
    return DomainError(f"{source}:{numbers[int(match[1])]}: {match[2]}")


def _rows(batch: tuple[FloatArray, FloatArray]) -> bytes:
    _, values = batch
    line = " ".join(["%r"] * values.shape[1]) + "\n"
    return (line * len(values) % tuple(values.ravel().tolist())).encode("ascii")


def _json(batches: Iterator[tuple[FloatArray, FloatArray]], key: str) -> Iterator[bytes]:
    """Yield the text of a JSON object, a line for each point."""
    parameters = []
    yield f'{{"{key}": ['.encode("ascii")
    separator = "\n"
    for u, values in batches:
        parameters.append(u)
        yield (separator + _json_rows(values)).encode("ascii")
        separator = ",\n"
    yield b'\n], "parameters": ['
    separator = "\n"
    for u in parameters:
        yield (separator + _json_rows(u)).encode("ascii")
        separator = ",\n"
    yield b"\n]}\n"


def _json_rows(values: FloatArray) -> str:
    row = "[" + ", ".join(["%r"] * values.shape[1]) + "]"
    return ",\n".join([row] * len(values)) % tuple(values.ravel().tolist())
