"""`gtb degenerate`: meshes of a toric degeneration and of its limit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from gtb_cli.shell.limits import heights_of, lifting_of, x_of
from gtb_cli.shell.options import WholeNumber, spec_argument
from gtb_cli.shell.sequences import NAME_DIGITS, SequenceOutput, sequence_options
from gtb_cli.shell.streams import shown_input, single, spec_of

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray
    from gtb_cli.theory.patch import Patch


@click.command
@spec_argument
@click.option(
    "-x",
    "--x",
    "values",
    callback=x_of,
    multiple=True,
    metavar="X",
    help="Write the mesh of the patch with the weights x^λ ω. May be given several times; inf is the limit.",
)
@click.option("--from", "first", callback=x_of, metavar="X", help="Sweep: the first x.")
@click.option("--to", "last", callback=x_of, metavar="X", help="Sweep: the last x.")
@click.option(
    "--count",
    type=WholeNumber(2, 10_000),
    metavar="N",
    help="Sweep: the number of x from --from to --to, in equal ratios, rounded to six digits.",
)
@click.option(
    "--lifting",
    callback=lifting_of,
    metavar="L,…",
    help="A lifting value λ for each knot, instead of the spec's; or knot:K: only the weight of knot K grows.",
)
@sequence_options("Print the spec with the weights of one -x; -o may then be left out.")
def degenerate(
    spec: str,
    values: tuple[float, ...],
    first: float | None,
    last: float | None,
    count: int | None,
    lifting: tuple[float, ...] | int | None,
    spec_format: str | None,
    out: SequenceOutput,
) -> None:
    """\b
    Example: gtb degenerate specs/example-4.4.toml -x 5 -x 100 -x 600 -o out/

    Let the weights x^λ ω grow: write a mesh for each x, and the limit, which is the regular control curve or surface.

    All meshes have the same faces, so that they can be compared or morphed vertex by vertex; edges of the cells of the
    regular decomposition are edges of the meshes. If x falls from 1 to 0, the limit is that of -λ. sequence.json lists
    the files with their distances from the limit.

    -o FILE.glb writes one file instead, which Blender and other programs can play: its mesh is the first one, the
    others are morph targets, and an animation shows them one after the other, a second each.
    """
    xs = (*values, *_sweep(first, last, count))
    if out.emits_spec and len(set(xs)) != 1:
        raise click.UsageError(f"--emit-spec prints the spec of one x: expected a single -x, got {len(set(xs))}")
    out.check_length(xs)
    from gtb_cli.sequences.sequence import degeneration_sequence

    with spec_of(spec, spec_format) as loaded:
        patch = single(loaded)
        heights = heights_of(patch, lifting)
        sequence = out.made(degeneration_sequence, patch, xs, heights)
        text = _spec(patch, xs[0], heights) if out.emits_spec else ""
    # A file that cannot be written is not the spec's fault.
    out.write(sequence, "x", shown_input(spec), text)


def _spec(patch: Patch, x: float, heights: FloatArray) -> str:
    """Return the spec of the patch with the weights x^λ ω, or of its limit."""
    from gtb_cli.language.writer import dump
    from gtb_cli.theory.degeneration import degenerate, regular_control_surface

    if 0 < x < math.inf:
        return dump(degenerate(patch, x, heights))
    return dump(regular_control_surface(patch, heights if x else -heights))


def _sweep(first: float | None, last: float | None, count: int | None) -> list[float]:
    """Return x in equal ratios, rounded so that file names can hold every digit; the two ends are not rounded."""
    if first is None and last is None and count is None:
        return []
    if first is None or last is None or count is None:
        raise click.UsageError("a sweep needs all of --from, --to and --count")
    if not (0 < first < math.inf and 0 < last < math.inf):
        raise click.UsageError("--from and --to must be positive and finite")
    low, high = math.log(first), math.log(last)
    inner = [math.exp(low + (high - low) * (k / (count - 1))) for k in range(1, count - 1)]
    xs = [first, *(float(f"{x:.{NAME_DIGITS}g}") for x in inner), last]
    if len(set(xs)) < count:
        raise click.UsageError(
            f"--from {first:g} and --to {last:g} are too near each other for {count} values of six digits"
        )
    return xs
