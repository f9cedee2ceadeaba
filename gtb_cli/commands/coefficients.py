"""`gtb coefficients`: a basis that adds up to 1."""

from __future__ import annotations

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.console import Console
from gtb_cli.shell.options import (
    console_option,
    numbers_of,
    output_option,
    spec_argument,
    spec_format_option,
)
from gtb_cli.shell.streams import about, read_patch, shown_input, write_text


@click.command
@spec_argument
@click.option(
    "--at",
    callback=numbers_of,
    metavar="T,…",
    help="As many parameters as knots; for a surface u,v,u,v,… By default they are spread over the domain.",
)
@output_option
@spec_format_option
@console_option
def coefficients(
    spec: str, at: tuple[float, ...] | None, output: str, spec_format: str | None, console: Console
) -> None:
    """\b
    Example: gtb coefficients specs/bicubic.toml

    Print the spec with coefficients for which the GT-Bernstein basis adds up to 1 at some parameters.

    Such coefficients exist for distinct knots, but they need not be positive. If one is not, there is no such basis,
    and the error gives the values. For Bézier curves, triangles and tensor product patches they are those of the
    Bernstein basis, up to a factor, and the sum is 1 everywhere.
    """
    import numpy as np

    from gtb_cli.spec.writer import dump
    from gtb_cli.theory.basis import partition_of_unity_coefficients

    loaded = read_patch(spec, spec_format)
    with about(shown_input(spec)):
        if at is not None and len(at) != loaded.knots.size:
            raise SpecError(
                f"--at: expected {loaded.knots.size} numbers, {len(loaded.knots)} parameters, got {len(at)}"
            )
        places = None if at is None else np.array(at).reshape(loaded.knots.shape)
        with np.errstate(over="ignore", invalid="ignore"):  # the solution is judged afterwards
            c = partition_of_unity_coefficients(loaded.domain, places)
        text = dump(loaded.replace(coefficients=c))
    write_text(output, text)
