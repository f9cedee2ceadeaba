"""`gtb eval`: parameters → points, or values of the basis."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, combinations_with_replacement, islice
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from gtb_cli.errors import DomainError, Fault
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import INPUT, json_option, spec_argument, streams_options
from gtb_cli.shell.streams import Streams, numbered_rows, opened, shown_input, single, write_blocks, write_json
from gtb_cli.vocabulary import PARAMETRIZATIONS, Parametrization

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray
    from gtb_cli.theory.patch import Patch

BATCH_LINES = 8192  # lines evaluated together, however a pipe delivers them: last digits depend on the number


@click.command("eval")
@spec_argument
@click.argument("params", metavar="[PARAMS]", default=STANDARD, type=INPUT)
@option("--basis", bool)(help="Print the values T_i of the rational basis instead of points.")
@option("--normals", bool)(help="Also print unit normals of a surface; nan where it has none.")
@option("--curvature", bool)(
    help="Also print Gaussian and mean curvature of a surface, with respect to its normals; nan without a limit."
)
@option("--derivatives", ("1", "2"))(
    help="Also print first derivatives of what is printed, or first and second ones; inf without a finite limit."
)
@option("--header", bool)(help="Print the names of the columns first, and parameters before each line.")
@option("--parametrization", PARAMETRIZATIONS, default="toric")(
    help="What parameters mean: toric, as in the paper (the default); or linear, so that "
    "the patch has linear precision, as in gtb mesh."
)
@json_option
@streams_options
def evaluate(spec: str, params: str, header: bool, as_json: bool, streams: Streams, **asked: Any) -> None:
    """\b
    Example: echo 0.5 1.5 | gtb eval specs/pentagon.toml

    Evaluate points, or the basis, at given parameters, with derivatives, normals and curvature on request.

    PARAMS is a file, or standard input: one parameter on each line, "t" for a curve and "u v" for a surface. Each gives
    one line, with the shortest digits that read back exactly. --json prints "points" or "basis", "derivatives",
    "second_derivatives" (uu, uv, vv), "normals", "curvature" and "parameters", with null for nan and inf. With --header
    each line begins with its parameters, below the names of the columns.

    A parameter within rounding of an edge lies on it. If the next knots are near to that edge (0.01, say), no toric
    parameter stands for the points between: --parametrization linear reaches them.
    """
    if header and as_json:
        raise click.UsageError("--header is for lines; --json already names its parts")
    if spec == params == STANDARD:
        raise click.UsageError("spec and parameters cannot both be standard input")
    with streams.spec_of(spec) as read:
        loaded = single(read)
    if loaded.dimension == 1 and (asked["normals"] or asked["curvature"]):
        raise click.UsageError(f"--normals and --curvature are for surfaces: {shown_input(spec)} is a curve")
    parts = _parts(loaded, **asked)

    batches = _batches(loaded, params, parts)
    if as_json:
        found = list(batches)
        data = {part.key: [row for _, arrays in found for row in _plain(arrays[k])] for k, part in enumerate(parts)}
        data["parameters"] = [row for u, _ in found for row in u.tolist()]
        return write_json(streams.output, data, by_row=True)
    first = [" ".join([*_axes(loaded), *(name for part in parts for name in part.columns)]).encode() + b"\n"]
    rows = (_rows([u, *arrays] if header else arrays) for u, arrays in batches)
    write_blocks(streams.output, chain(first if header else (), rows))


class _Part(NamedTuple):
    """A key of JSON, the columns of lines, and the function of (m, d) parameters whose (m, …) values stand there."""

    key: str
    columns: list[str]
    of: Callable[[FloatArray], FloatArray]


def _parts(
    patch: Patch, basis: bool, derivatives: str | None, normals: bool, curvature: bool, parametrization: Parametrization
) -> list[_Part]:
    import numpy as np

    names = [f"T{i}" for i in range(len(patch.knots))] if basis else ["x", "y", "z"]
    evaluated, differentiated = (patch.basis, patch.basis_derivatives) if basis else (patch.evaluate, patch.derivatives)

    def along(order: Any, ways: list[Any], u: FloatArray) -> FloatArray:
        """Return the derivatives of an order along some ways, of axes, one way after another: (m, ways, k)."""
        found = differentiated(u, order, parametrization)
        return np.stack([found[..., *way] for way in ways], axis=1)

    parts = [_Part("basis" if basis else "points", names, lambda u: evaluated(u, parametrization))]
    for order, key in ((1, "derivatives"), (2, "second_derivatives"))[: int(derivatives or 0)]:
        ways = list(combinations_with_replacement(range(patch.dimension), order))
        columns = [f"{name}_{''.join(_axes(patch)[axis] for axis in way)}" for way in ways for name in names]
        parts.append(_Part(key, columns, partial(along, order, ways)))
    if normals:
        parts.append(_Part("normals", ["n_x", "n_y", "n_z"], lambda u: patch.normals(u, parametrization)))
    if curvature:
        columns = ["gaussian_curvature", "mean_curvature"]
        parts.append(_Part("curvature", columns, lambda u: np.column_stack(patch.curvature(u, parametrization)) + 0.0))
    return parts


def _axes(patch: Patch) -> list[str]:
    return ["t"] if patch.dimension == 1 else ["u", "v"]


def _batches(patch: Patch, params: str, parts: list[_Part]) -> Iterator[tuple[FloatArray, list[FloatArray]]]:
    """Yield parameters and values, `BATCH_LINES` lines at a time; on a terminal every line at once."""
    import numpy as np

    with opened(params) as file:
        rows = numbered_rows(file, shown_input(params), [patch.dimension])
        while batch := list(islice(rows, 1 if file.isatty() else BATCH_LINES)):
            u = np.array([row for _, row in batch])
            try:
                yield u, [part.of(u) for part in parts]
            except DomainError as error:
                # The parameter's index at the start of the message becomes the number of its line.
                match = re.fullmatch(r"parameters\[(\d+)\]: (.*)", str(error), re.DOTALL)
                line, text = (batch[int(match[1])][0], match[2]) if match else (None, str(error))
                raise DomainError(Fault(text, shown_input(params), line)) from None


def _plain(values: FloatArray) -> list[Any]:
    """Return rows for JSON, which has no numbers that are not finite."""
    import numpy as np

    return list(np.where(np.isfinite(values), values.astype(object), np.array(None)).tolist())


def _rows(arrays: list[FloatArray]) -> bytes:
    import numpy as np

    from gtb_cli.formats.numbers_written import text_rows

    values = np.concatenate([array.reshape(len(array), -1) for array in arrays], axis=1)
    return b"".join(text_rows(" ".join(["%r"] * values.shape[1]) + "\n", values))
