"""`gtb elevate`: the same patch with a higher degree."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gtb_cli.shell.options import WholeNumber, spec_argument, spec_from_spec

if TYPE_CHECKING:
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


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
def elevate(spec: Patch | Model, by: int) -> Patch | Model:
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
