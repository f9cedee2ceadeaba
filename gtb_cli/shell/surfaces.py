"""`gtb mesh` in formats of CAD or of curved cells, which hold surfaces instead of triangles."""

import os
from collections.abc import Sequence
from typing import Any

import click

from gtb_cli.errors import DomainError, RequirementError
from gtb_cli.shell.console import Console
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.streams import Spec, is_folder, spec_of, write_blocks
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES, CELL_FORMATS, suffix_of


def surface_format(format: str | None, output: str) -> str | None:
    """Return the surface format that -f or the suffix of the output names; None for meshes."""
    kinds = {name: name for name in (*CAD_FORMATS, *CELL_FORMATS)}
    return kinds.get(format) if format is not None else (kinds | CAD_SUFFIXES).get(suffix_of(output))


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

    A `RequirementError` says that a closed solid is required and the surfaces do not form one, a `DomainError` that the
    format holds only exact pieces and there are none.
    """
    if len(specs) > 1 or is_folder(output) or os.path.isdir(specs[0]):
        raise click.UsageError(f"{kind.upper()} is written for one spec, to a file or standard output")
    names = ("normals", "uv", "ascii", "certify", "radius", "thickness", "attributes")
    options.refuse(f"is for meshes, and {kind.upper()} holds surfaces", *names)
    if kind in CELL_FORMATS:
        options.refuse(f"is for meshes, and cells of {kind.upper()} share no vertices", "require")
    with spec_of(specs[0], spec_format) as spec:
        shape = _with_y_up(spec) if options.up == "y" else spec
        encoded = _cells(shape) if kind in CELL_FORMATS else _bodies(shape, kind, unit, options.recipe)
    data, size, warnings = encoded
    write_blocks(output, [data])
    console.report(output, size, warnings)


def _with_y_up(spec: Spec) -> Spec:
    """Turn surfaces as `Mesh.with_y_up` turns meshes: the point (x, y, z) becomes (x, z, −y)."""
    from gtb_cli.theory.model import Model

    def turned(patch: Any) -> Any:
        return patch.replace(control_points=patch.control_points[:, [0, 2, 1]] * [1, 1, -1] + 0.0)  # without -0

    patches = tuple(map(turned, spec.patches))
    return spec.replace(patches=patches) if isinstance(spec, Model) else patches[0]


def _cells(spec: Spec) -> tuple[bytes, str, list[str]]:
    from gtb_cli.formats.vtu import encode_vtu

    try:
        data, cells = encode_vtu(spec)
    except DomainError as fault:
        raise DomainError(f"{_short(str(fault))}. VTU files hold exact cells; PLY files, a mesh") from None
    return data, f"{cells} exact {'cell' if cells == 1 else 'cells'}", []


def _bodies(spec: Spec, kind: str, unit: str, recipe: Recipe) -> tuple[bytes, str, list[str]]:
    from gtb_cli.formats.cad import encode_cad
    from gtb_cli.formats.splines import spline_surfaces
    from gtb_cli.theory.model import Model

    found = spline_surfaces(spec, recipe.tolerance_for(spec))
    body = encode_cad(found.surfaces, kind, unit, spec.name or "patch")
    if recipe.require and body.shells:
        raise RequirementError(f"not watertight: {body.shells} of {body.shells + body.solids} shells are open")
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
    return body.data, ", ".join([f"{faces} faces", *parts]), warnings


def _short(reason: str) -> str:
    """Shorten the reason why there are no exact pieces by the advice to use other commands."""
    return reason.partition(". A mesh")[0].replace(" (`max_degree`)", "")
