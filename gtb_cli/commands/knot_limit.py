"""`gtb knot-limit`: meshes of a patch whose knots move to others, and of the patch with these knots merged."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gtb_cli.shell.limits import moves_of
from gtb_cli.shell.options import numbers_of, spec_argument
from gtb_cli.shell.sequences import SequenceOutput, sequence_options
from gtb_cli.shell.streams import shown_input, single, spec_of

if TYPE_CHECKING:
    from gtb_cli.theory.knot_limit import KnotLimit


@click.command("knot-limit")
@spec_argument
@click.option(
    "--merge",
    "moves",
    callback=moves_of,
    multiple=True,
    required=True,
    metavar="K:Q",
    help="Move knot K to the place of knot Q. May be given several times; chains such as 1:2 and 2:3 end at 3.",
)
@click.option(
    "--steps",
    callback=numbers_of,
    default="0,0.4,0.8",  # those of Example 4.2 of the paper
    show_default=True,
    metavar="S,…",
    help="Write a mesh for each of these fractions of the way.",
)
@sequence_options("Print the spec of the merged patch; -o may then be left out.")
def knot_limit(
    spec: str,
    moves: dict[int, int],
    steps: tuple[float, ...],
    spec_format: str | None,
    out: SequenceOutput,
) -> None:
    """\b
    Example: gtb knot-limit specs/example-4.2.toml --merge 3:1 -o out/

    Move knots to the places of others: write a mesh for each step of the way, and the limit, which is the merged patch.

    Knots are numbered from 0. All meshes have the same faces. sequence.json lists the files with their distances from
    the limit. If a knot moves to an end, an edge or a corner, the limit holds only inside, and as a set it also
    includes a film: a message says so, and sequence.json has the distances from both.

    -o FILE.glb writes one file instead, an animation; see gtb degenerate --help.
    """
    out.check_length(steps)
    from gtb_cli.language.writer import dump
    from gtb_cli.sequences.sequence import knot_sequence
    from gtb_cli.theory.knot_limit import knot_limit as limit_of

    with spec_of(spec, spec_format) as loaded:
        patch = single(loaded)
        limit = limit_of(patch, moves)
        sequence = out.made(knot_sequence, patch, moves, steps)
        text = dump(limit.merged) if out.emits_spec else ""
    # A file that cannot be written is not the spec's fault.
    for message in _pointwise(limit):
        out.console.warn(message)
    out.write(sequence, "step", shown_input(spec), text)


def _pointwise(limit: KnotLimit) -> list[str]:
    """Return the messages that explain where the limit holds only at inner points."""
    shape = limit.patch.domain
    r = len(shape.vertices)
    messages = []
    for k, face in limit.arrivals.items():
        if shape.dimension == 1 or face > r:
            corner = shape.vertices[(face - 1) % r]
            place = f"the {'end' if shape.dimension == 1 else 'corner'} ({', '.join(f'{x:.6g}' for x in corner)})"
        else:
            place = f"edge {face - 1}"
        messages.append(
            f"knot {k} comes to {place}, where the limit is pointwise only: the boundary there stays what it was, and "
            "as a set the limit is the merged patch with a film between the two"
        )
    return messages
