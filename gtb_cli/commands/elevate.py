"""`gtb elevate`: the same patch with a higher degree."""

import click

from gtb_cli.shell.options import WholeNumber, spec_argument, spec_from_spec
from gtb_cli.shell.streams import Spec


@click.command
@spec_argument
@click.option(
    "--by",
    type=WholeNumber(0, 1000),
    metavar="D",
    default=1,
    help="Number of elevations, which for a Bézier patch is the number of degrees; 1 without this option.",
)
@spec_from_spec
def elevate(spec: Spec, by: int) -> Spec:
    """\b
    Example: gtb elevate specs/cubic-bezier.toml | gtb info -

    Print the spec of the same curve or surface with more knots, weights and control points to work with.

    For Bézier curves, triangles and tensor product patches this is classical degree elevation. A lifting is left out.
    Each patch of a model is elevated.
    """
    from gtb_cli.bezier.elevation import elevate as elevated
    from gtb_cli.theory.model import Model

    if isinstance(spec, Model):
        return spec.replace(patches=tuple(elevated(patch, by) for patch in spec))
    return elevated(spec, by)
