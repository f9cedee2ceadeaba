"""`gtb fit`: points → a curve through them."""

from itertools import islice

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import INPUT, numbers_of, output_options
from gtb_cli.shell.streams import Streams, about, input_stem, numbered_rows, opened, shown_input


@click.command
@click.argument("points", metavar="[POINTS]", default=STANDARD, type=INPUT)
@option("--knots A,…", numbers_of)(
    help="Ascending knots, one for each point. By default the length of the polygon up to the point."
)
@output_options
def fit(points: str, knots: tuple[float, ...] | None, streams: Streams) -> None:
    """\b
    Example: printf '0 0\\n1 2\\n3 1\\n4 3\\n' | gtb fit

    Print the spec of a curve through points, found by progressive iterative approximation.

    POINTS is a file, or standard input, with 2 to 100 points, one on each line: "x y" or "x y z". The curve begins at
    the first point, ends at the last, and misses no point by more than 1e-12 of the largest coordinate.
    """
    from gtb_cli.fairing.fit import fit as fitted

    max_points = 1_000_000
    with opened(points) as file:
        rows = [row for _, row in islice(numbered_rows(file, shown_input(points), (2, 3)), max_points + 1)]
    if not 0 < len(rows) <= max_points:
        raise SpecError(f"{shown_input(points)}: has {f'more than {max_points}' if rows else 'no'} points")
    with about(shown_input(points)):
        found = fitted(rows, knots)
    streams.write_spec(found.curve.replace(name=input_stem(points)), shown_input(points))
    streams.console.note(f"{len(rows)} points, {found.rounds} rounds, {found.distance:.3g} left")
