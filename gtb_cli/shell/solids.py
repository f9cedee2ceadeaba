"""`gtb mesh` where the format is one of CAD: surfaces instead of triangles."""

from __future__ import annotations

import os
from collections.abc import Sequence

import click

from gtb_cli.errors import RequirementError
from gtb_cli.shell.console import STANDARD, Console
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.streams import about, is_folder, read_spec, shown_input, write_blocks
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES


def cad_format(format: str | None, output: str) -> str | None:
    """Format of CAD that -f names, or the suffix of the output; None for meshes."""
    if format is not None:
        return format if format in CAD_FORMATS else None
    return CAD_SUFFIXES.get(os.path.splitext(output)[1][1:].lower())


def _short(reason: str) -> str:
    """Why there are no exact pieces, without what other commands offer."""
    return reason.partition(". What")[0].replace(" (--max-degree)", "")


def write_cad(
    specs: Sequence[str],
    kind: str,
    unit: str,
    options: MeshOptions,
    spec_format: str | None,
    output: str,
    console: Console,
) -> None:
    """Write the surfaces of one spec as STEP, IGES or BREP, and say what is exact.

    Raises
    ------
    RequirementError
        A closed solid is required, and does not come of it.
    """
    from gtb_cli.formats.cad import encode_cad
    from gtb_cli.formats.sheets import sheets_of

    recipe = options.recipe
    if len(specs) > 1 or is_folder(output) or os.path.isdir(specs[0]):
        raise click.UsageError(f"{kind.upper()} is written of one spec, to a file or standard output")
    given = {
        "--normals": recipe.normals,
        "--uv": options.uv,
        "--ascii": options.ascii,
        "--radius": recipe.radius,
        "--thickness": recipe.thickness,
        "--attribute": recipe.attributes,
    }
    for name, value in given.items():
        if value:
            raise click.UsageError(f"{name} is for meshes, and {kind.upper()} holds surfaces")
    spec = read_spec(specs[0], spec_format)
    with about(shown_input(specs[0])):
        found = sheets_of(spec, recipe.tolerance_for(spec))
        body = encode_cad(found.sheets, kind, unit, spec.name or "patch")
        if recipe.require and body.shells:
            raise RequirementError(f"not watertight: {body.shells} of {body.shells + body.solids} shells are open")
    write_blocks(output, [body.data])
    prefix = "" if output == STANDARD else f"{output}: "
    if found.reason:
        console.warn(f"{prefix}fitted within {found.error:.2g}, not exact: {_short(found.reason)}")
    exact = "fitted" if found.reason else "exact"
    console.note(f"{prefix}{body.faces} {exact} faces, {body.solids} solids, {body.shells} open shells")
