"""`gtb fit`: a curve through points, or a surface near them."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.options import INPUT, console_option, numbers_of, output_option, spec_format_option
from gtb_cli.shell.streams import about, file_stem, read_bytes, read_patch, shown_input, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

MAX_POINT_FILE_BYTES = 1_000_000
"""Size of the largest file of points, in bytes; a hundred lines are far less."""


@click.command
@click.argument("points", metavar="[POINTS]", default=STANDARD, type=INPUT)
@click.option(
    "--knots",
    callback=numbers_of,
    metavar="A,…",
    help="An ascending knot for each point. Without it, the length of the polygon up to the point.",
)
@click.option("--patch", metavar="SPEC", type=INPUT, help="Fit the surface with this one's knots and weights.")
@output_option
@spec_format_option
@console_option
def fit(
    points: str,
    knots: tuple[float, ...] | None,
    patch: str | None,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: printf '0 0\\n1 2\\n3 1\\n4 3\\n' | gtb fit

    Print the spec of a curve through points, found by progressive iterative approximation.

    POINTS is a file, or standard input: on each line a point, "x y" or "x y z", separated by blanks, tabs or a comma,
    2 to 100 of them. Empty lines and what follows a # are skipped. The curve begins in the first point and ends in the
    last, and misses none by more than 1e-12 of the largest coordinate.

    With --patch SPEC it is the surface near the points, "x y z" or "u v x y z" with linear parameters: by least squares
    with a little of the thin-plate energy, and parameters, where they are not given, by projection.
    """
    if patch is not None:
        if knots is not None:
            raise click.UsageError("--knots is for curves, and --patch has its own")
        if patch == points == STANDARD:
            raise click.UsageError("standard input can be read once only")
        _fit_surface(points, patch, output, spec_format, console)
        return
    from gtb_cli.design.fit import fit as fitted

    places = _points(points)
    with about(shown_input(points)):
        found = fitted(places, knots)
    name = None if points == STANDARD else file_stem(os.path.splitext(os.path.basename(points))[0])
    from gtb_cli.spec.writer import dump

    write_text(output, dump(found.curve.replace(name=name)))
    console.note(f"{len(places)} points, {found.rounds} rounds, {found.distance:.2g} left")


def _fit_surface(points: str, patch: str, output: str, spec_format: str | None, console: Console) -> None:
    from gtb_cli.design.surface_fit import fit_surface
    from gtb_cli.spec.writer import dump

    surface = read_patch(patch, spec_format)
    rows = _points(points, (3, 5))
    with about(shown_input(points)):
        parameters = [row[:2] for row in rows] if len(rows[0]) == 5 else None
        found = fit_surface([row[-3:] for row in rows], surface, parameters)
    write_text(output, dump(found.patch))
    console.note(
        f"{len(rows)} points, {found.rounds} rounds, {found.distance:.3g} from the farthest, "
        f"{found.mean:.3g} in the root of the mean square"
    )


def _points(path: str, sizes: tuple[int, ...] = (2, 3)) -> Sequence[Sequence[float]]:
    """Read points, a line each."""
    source = shown_input(path)
    data = read_bytes(path, MAX_POINT_FILE_BYTES + 1)
    if len(data) > MAX_POINT_FILE_BYTES:
        raise SpecError(f"{source}: more than {MAX_POINT_FILE_BYTES} bytes")
    rows: list[list[float]] = []
    for number, line in enumerate(data.decode("utf-8-sig", "backslashreplace").splitlines(), 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        if len(words) not in sizes or (rows and len(words) != len(rows[0])):
            expected = ("two or three" if sizes == (2, 3) else "three or five") if not rows else str(len(rows[0]))
            raise SpecError(f"{source}:{number}: expected {expected} coordinates, got {len(words)}")
        row = []
        for word in words:
            try:
                row.append(float(word))
            except ValueError:
                raise SpecError(f"{source}:{number}: {word[:60]!r} is not a number") from None
        rows.append(row)
    if not rows:
        raise SpecError(f"{source}: has no points")
    return rows
