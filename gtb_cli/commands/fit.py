"""`gtb fit`: points → a curve or surface through them, or near them."""

from itertools import islice

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.console import STANDARD
from gtb_cli.shell.options import INPUT, numbers_of, streams_options
from gtb_cli.shell.streams import Streams, about, number_rows, opened, shown_input, stem_of


@click.command
@click.argument("points", metavar="[POINTS]", default=STANDARD, type=INPUT)
@click.option(
    "--knots",
    callback=numbers_of,
    metavar="A,…",
    help="Ascending knots, one for each point. By default the length of the polygon up to the point.",
)
@click.option("--patch", metavar="SPEC", type=INPUT, help="Fit a surface with this one's knots and weights.")
@streams_options
def fit(points: str, knots: tuple[float, ...] | None, patch: str | None, streams: Streams) -> None:
    """\b
    Example: printf '0 0\\n1 2\\n3 1\\n4 3\\n' | gtb fit

    Print the spec of a curve through points, found by progressive iterative approximation, or of a surface.

    POINTS is a file, or standard input, with 2 to 100 points, one on each line: "x y" or "x y z", separated by blanks,
    tabs or a comma. Empty lines and what follows a # are skipped. The curve begins at the first point, ends at the
    last, and misses no point by more than 1e-12 of the largest coordinate.

    With --patch SPEC the result is a surface, and points are "x y z" or "u v x y z" with linear parameters. If there
    are as many points as SPEC has knots, in the same order, the surface passes through them, at the knots unless u v
    are given. Otherwise it passes near the points: least squares with a little thin-plate energy, where parameters
    that are not given are found by projection.
    """
    if patch is not None and knots is not None:
        raise click.UsageError("--knots is for curves; --patch has its own knots")
    if patch == points == STANDARD:
        raise click.UsageError("standard input can be read only once")
    from gtb_cli.fairing.fit import fit as fitted
    from gtb_cli.language.writer import dump

    surface = None if patch is None else streams.patch_of(patch)
    rows = _points(points, (2, 3) if surface is None else (3, 5))
    with about(shown_input(points)):
        parameters = [row[:2] for row in rows] if len(rows[0]) == 5 else None
        found = fitted([row[-3:] for row in rows], knots, patch=surface, parameters=parameters)
    streams.write(dump(found.patch.replace(name=stem_of(points)) if surface is None else found.patch))
    is_met = len(rows) == len(found.patch.knots)
    left = "left" if is_met else f"from the farthest point, root mean square {found.mean:.3g}"
    streams.console.note(f"{len(rows)} points, {found.rounds} rounds, {found.distance:.3g} {left}")


def _points(path: str, sizes: tuple[int, int]) -> list[list[float]]:
    max_points = 1_000_000
    with opened(path) as file:
        rows = [row for _, row in islice(number_rows(file, shown_input(path), sizes), max_points + 1)]
    if not 0 < len(rows) <= max_points:
        raise SpecError(f"{shown_input(path)}: has {f'more than {max_points}' if rows else 'no'} points")
    return rows
