"""`gtb coefficients`: a basis that adds up to 1."""

import click

from gtb_cli.errors import SpecError
from gtb_cli.shell.options import numbers_of, spec_argument, spec_from_spec
from gtb_cli.shell.streams import Spec, single


@click.command
@spec_argument
@click.option(
    "--at",
    callback=numbers_of,
    metavar="T,…",
    help="As many parameters as knots; for a surface u,v,u,v,… By default they are spread over the domain.",
)
@spec_from_spec
def coefficients(spec: Spec, at: tuple[float, ...] | None) -> Spec:
    """\b
    Example: gtb coefficients specs/bicubic.toml

    Print the spec with coefficients for which the GT-Bernstein basis adds up to 1 at some parameters.

    Such coefficients exist for distinct knots, but they need not be positive. If one is not, there is no such basis,
    and the error gives the values. For Bézier curves, triangles and tensor product patches they are those of the
    Bernstein basis, up to a factor, and the sum is 1 everywhere.
    """
    import numpy as np

    from gtb_cli.theory.basis import partition_of_unity_coefficients

    patch = single(spec)
    if at is not None and len(at) != patch.knots.size:
        raise SpecError(f"--at: expected {patch.knots.size} numbers, {len(patch.knots)} parameters, got {len(at)}")
    places = None if at is None else np.array(at).reshape(patch.knots.shape)
    with np.errstate(over="ignore", invalid="ignore"):  # the solution is judged afterwards
        return patch.replace(coefficients=partition_of_unity_coefficients(patch.domain, places))
