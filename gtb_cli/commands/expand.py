"""`gtb expand`: a spec with everything carried out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gtb_cli.shell.options import spec_argument, spec_from_spec

if TYPE_CHECKING:
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


@click.command
@spec_argument
@spec_from_spec
def expand(spec: Patch | Model) -> Patch | Model:
    """\b
    Example: gtb expand specs/teapot.toml -o flat.toml

    Print a spec with everything carried out: numbers instead of names and expressions, patches instead of copies and
    included files. It describes the same patch or model, bit for bit.
    """
    return spec
