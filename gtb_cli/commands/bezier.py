"""`gtb bezier`: exact rational Bézier pieces."""

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.console import Console
from gtb_cli.shell.options import WholeNumber, numbers_of, spec_argument, text_options
from gtb_cli.shell.streams import spec_of, write_text

DEFAULT_DEGREE = 25  # default of --max-degree, the same as in `gtb_cli.bezier.pieces`


@click.command
@spec_argument
@click.option(
    "--split",
    callback=numbers_of,
    metavar="T",
    help="Split a curve at this parameter. By default where each T_i is the share of c_i ω_i in their sum.",
)
@click.option(
    "--max-degree",
    type=WholeNumber(1, 1000),  # binomial coefficients of higher degrees exceed the range of floats
    metavar="D",
    default=DEFAULT_DEGREE,
    help=f"Highest degree of a piece; {DEFAULT_DEGREE} without this option.",
)
@text_options
def bezier(
    spec: str,
    split: tuple[float, ...] | None,
    max_degree: int,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb bezier specs/example-4.1-integer.toml | gtb info -

    Print the exact rational Bézier pieces as a model: a rectangle for each corner of a surface, two curves for a curve.

    Such pieces exist if the distances of the knots from each edge are multiples of a common step, as they are for
    integers; otherwise the error says why not. The image is the same, all weights are positive, and if two patches
    share an edge, their pieces share it too.
    """
    from gtb_cli.bezier.pieces import bezier_pieces, split_curve
    from gtb_cli.language.writer import dump
    from gtb_cli.theory.model import Model

    if split is not None and len(split) != 1:
        raise click.UsageError(f"--split: expected one parameter, got {len(split)}")
    with spec_of(spec, spec_format) as loaded:
        if split is None:
            pieces = bezier_pieces(loaded, max_degree)
        elif isinstance(loaded, Model):
            raise SpecError(f"is a model of {len(loaded.patches)} patches, and --split is for one curve")
        else:
            pieces = split_curve(loaded, split[0], max_degree)
        text = dump(pieces)
    write_text(output, text)
    if isinstance(loaded, Model) and loaded.dimension == 2:
        opened = len(pieces.joints.open) - 2 * len(loaded.joints.open)
        if opened > 0:
            console.warn(f"{opened} edges of pieces are open where patches are joined: they are divided elsewhere")
