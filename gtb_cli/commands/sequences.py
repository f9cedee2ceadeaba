"""`gtb degenerate` and `gtb knot-limit`: meshes on the way to a limit, and of the limit."""

import math

import click

from gtb_cli.shell.limit_options import heights_option, merge_option, steps_option, x_option
from gtb_cli.shell.options import spec_argument
from gtb_cli.shell.sequence_folder import SequenceOutput, sequence_options
from gtb_cli.shell.streams import single


@click.command
@spec_argument
@x_option(
    "xs", help="Write the mesh of the patch with the weights x^λ ω. May be given several times; inf is the limit."
)
@heights_option(
    help="A lifting value λ for each knot, instead of the spec's; or knot:K: only the weight of knot K grows."
)
@sequence_options("Print the spec with the weights of one -x; -o may then be left out.")
def degenerate(spec: str, xs: tuple[float, ...], lifting: tuple[float, ...] | int | None, out: SequenceOutput) -> None:
    """\b
    Example: gtb degenerate specs/example-4.4.toml -x 5 -x 100 -x 600 -o out/

    Let the weights x^λ ω grow: write a mesh for each x, and the limit, which is the regular control curve or surface.

    All meshes have the same faces. If x falls from 1 to 0, the limit is that of -λ. sequence.json lists the files with
    their distances from the limit, and how fast these fall; gtb view shows them with a slider.
    """
    if out.emits_spec and len(set(xs)) != 1:
        raise click.UsageError(f"--emit-spec prints the spec of one x: expected a single -x, got {len(set(xs))}")
    from gtb_cli.language.writer import dump
    from gtb_cli.limits.degeneration import degenerate as weighted, heights_of, regular_control_surface
    from gtb_cli.sequences.sequence import degeneration

    with out.streams.spec_of(spec) as loaded:
        patch = single(loaded)
        heights = heights_of(patch, lifting)
        sequence = out.made(degeneration, patch, xs, heights)
        text = ""
        if out.emits_spec and 0 < xs[0] < math.inf:
            text = dump(weighted(patch, xs[0], heights))
        elif out.emits_spec:
            text = dump(regular_control_surface(patch, heights if xs[0] else -heights))
    # A file that cannot be written is not the spec's fault.
    out.write(sequence, spec, text)


@click.command("knot-limit")
@spec_argument
@merge_option(
    "moves",
    required=True,
    help="Move knot K to the place of knot Q. May be given several times; chains such as 1:2 and 2:3 end at 3.",
)
@steps_option(
    default="0,0.4,0.8", show_default=True, help="Write a mesh for each of these fractions of the way."
)  # of Example 4.2
@sequence_options("Print the spec of the merged patch; -o may then be left out.")
def knot_limit(spec: str, moves: dict[int, int], steps: tuple[float, ...], out: SequenceOutput) -> None:
    """\b
    Example: gtb knot-limit specs/example-4.2.toml --merge 3:1 -o out/

    Move knots to the places of others: write a mesh for each step of the way, and the limit, which is the merged patch.

    Knots are numbered from 0. All meshes have the same faces, and sequence.json their distances from the limit. If a
    knot moves to an end, an edge or a corner, the limit holds only inside, and as a set it also includes a film.
    """
    from gtb_cli.language.writer import dump
    from gtb_cli.limits.knot_limit import knot_limit as limit_of
    from gtb_cli.sequences.sequence import knot_sequence

    with out.streams.spec_of(spec) as loaded:
        patch = single(loaded)
        limit = limit_of(patch, moves)
        sequence = out.made(knot_sequence, patch, moves, steps)
        text = dump(limit.merged) if out.emits_spec else ""
    # A file that cannot be written is not the spec's fault.
    why = "the boundary there stays what it was, and as a set the limit is the merged patch with a film between the two"
    shape = limit.patch.domain
    for k, face in limit.arrivals.items():
        place = f"edge {face - 1}"
        if shape.dimension == 1 or face > len(shape.vertices):
            corner = ", ".join(f"{x:.6g}" for x in shape.vertices[(face - 1) % len(shape.vertices)])
            place = f"the {'end' if shape.dimension == 1 else 'corner'} ({corner})"
        out.streams.console.warn(f"knot {k} comes to {place}, where the limit is pointwise only: {why}")
    out.write(sequence, spec, text)
