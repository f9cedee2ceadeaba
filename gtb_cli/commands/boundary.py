"""`gtb boundary`: the curves along the edges of a surface."""

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.options import WholeNumber, spec_argument, spec_from_spec
from gtb_cli.shell.streams import Spec, single


@click.command
@spec_argument
@click.argument("edge", metavar="[EDGE]", type=WholeNumber(), required=False)
@spec_from_spec
def boundary(spec: Spec, edge: int | None) -> Spec:
    """\b
    Example: gtb boundary specs/pentagon.toml 0

    Print the spec of the curve along an edge of a surface, or a model of all these curves.

    Edges are counted from 0, counter-clockwise from the lowest, then leftmost, corner of the domain; gtb info lists
    their knots. The curve's knots are measured along the edge, from its first corner.
    """
    from gtb_cli.theory.model import Model

    patch = single(spec)
    if patch.dimension == 1:
        raise SpecError("is a curve, and has no boundary curves")
    if edge is not None:
        return patch.boundary(edge)
    return Model(tuple(map(patch.boundary, range(len(patch.domain.vertices)))), patch.name)
