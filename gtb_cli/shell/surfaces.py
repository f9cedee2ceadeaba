"""`gtb mesh` in formats of CAD or of curved cells, which hold surfaces instead of triangles."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import DomainError, RequirementError
from gtb_cli.shell.console import Console
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.streams import about, is_folder, read_spec, shown_input, write_blocks
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES, CELL_FORMATS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch


def surface_format(format: str | None, output: str) -> str | None:
    """Return the surface format that -f or the suffix of the output names; None for meshes."""
    exact_suffixes = CAD_SUFFIXES | {name: name for name in CELL_FORMATS}
    if format is not None:
        return format if format in (*CAD_FORMATS, *CELL_FORMATS) else None
    return exact_suffixes.get(suffix_of(output))


def _short(reason: str) -> str:
    """Shorten the reason why there are no exact pieces by the advice to use other commands."""
    return reason.partition(". A mesh")[0].replace(" (`max_degree`)", "")


def write_surfaces(
    specs: Sequence[str],
    kind: str,
    unit: str,
    options: MeshOptions,
    spec_format: str | None,
    output: str,
    console: Console,
) -> None:
    """Write the surfaces of one spec as STEP, IGES, BREP or VTU, and say what is exact.

    Raises
    ------
    RequirementError
        A closed solid is required, and the surfaces do not form one.
    DomainError
        The format holds only exact pieces, and there are none.
    """
    if len(specs) > 1 or is_folder(output) or os.path.isdir(specs[0]):
        raise click.UsageError(f"{kind.upper()} is written for one spec, to a file or standard output")
    names = ("normals", "uv", "ascii", "certify", "radius", "thickness", "attribute")
    options.refuse(f"is for meshes, and {kind.upper()} holds surfaces", *names)
    if kind in CELL_FORMATS:
        options.refuse(f"is for meshes, and cells of {kind.upper()} share no vertices", "require")
    spec = read_spec(specs[0], spec_format)
    if options.up == "y":
        spec = _with_y_up(spec)
    if kind in CELL_FORMATS:
        _write_cells(spec, specs[0], output, console)
    else:
        _write_cad(spec, specs[0], kind, unit, options, output, console)


def _with_y_up(spec: Patch | Model) -> Patch | Model:
    """Turn surfaces as `Mesh.with_y_up` turns meshes: the point (x, y, z) becomes (x, z, −y)."""
    import numpy as np

    from gtb_cli.theory.model import Model

    def turned(patch: Patch) -> Patch:
        x, y, z = patch.control_points.T
        return patch.replace(control_points=np.column_stack([x, z, 0.0 - y]))

    if isinstance(spec, Model):
        return spec.replace(patches=tuple(map(turned, spec.patches)))
    return turned(spec)


def _write_cells(spec: Patch | Model, path: str, output: str, console: Console) -> None:
    from gtb_cli.formats.vtu import encode_vtu

    with about(shown_input(path)):
        try:
            data, cells = encode_vtu(spec)
        except DomainError as fault:
            raise DomainError(f"{_short(str(fault))}. VTU files hold exact cells; PLY files, a mesh") from None
    write_blocks(output, [data])
    console.report(output, f"{cells} exact {'cell' if cells == 1 else 'cells'}")


def _write_cad(
    spec: Patch | Model, path: str, kind: str, unit: str, options: MeshOptions, output: str, console: Console
) -> None:
    from gtb_cli.formats.cad import encode_cad
    from gtb_cli.formats.splines import spline_surfaces
    from gtb_cli.theory.model import Model

    recipe = options.recipe
    with about(shown_input(path)):
        found = spline_surfaces(spec, recipe.tolerance_for(spec))
        body = encode_cad(found.surfaces, kind, unit, spec.name or "patch")
        if recipe.require and body.shells:
            raise RequirementError(f"not watertight: {body.shells} of {body.shells + body.solids} shells are open")
    write_blocks(output, [body.data])
    warnings = []
    if found.reasons:
        name, reason = found.reasons[0]
        others = f" (one of {len(found.reasons)} such patches)" if len(found.reasons) > 1 else ""
        who = f"{name}{others}: " if isinstance(spec, Model) else ""
        bend = f"inner seams bend by up to {found.bend:.3g} degrees"
        warnings.append(f"fitted within {found.error:.2g}, not exact, {bend}: {who}{_short(reason)}")
    counts = {"exact": body.faces - found.fitted, "fitted": found.fitted}
    faces = " and ".join(f"{count} {how}" for how, count in counts.items() if count)
    bodies = {"solid": body.solids, "open shell": body.shells}
    parts = [f"{count} {name}{'s' if count > 1 else ''}" for name, count in bodies.items() if count]
    console.report(output, ", ".join([f"{faces} faces", *parts]), warnings)
