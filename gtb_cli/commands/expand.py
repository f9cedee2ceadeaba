"""`gtb expand`: a spec with everything carried out."""

import click

from gtb_cli.shell.options import spec_argument, spec_from_spec
from gtb_cli.shell.streams import Spec


@click.command
@spec_argument
@spec_from_spec
def expand(spec: Spec) -> Spec:
    """\b
    Example: gtb expand specs/teapot.toml -o flat.toml

    Print a spec with everything carried out: numbers instead of names and expressions, patches instead of copies and
    included files. It describes the same patch or model, bit for bit.
    """
    return spec
