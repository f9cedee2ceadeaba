"""Files of surfaces in place of meshes: STEP, IGES and BREP, and curved cells for ParaView."""

from collections.abc import Sequence

import click

from gtb_cli.shell.folders import are_several
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.streams import Streams, is_folder, write_blocks
from gtb_cli.vocabulary import CAD_FORMATS, CAD_SUFFIXES, CELL_FORMATS, DEFAULT_UNIT, UNIT_FORMATS, suffix_of


def surface_format(format: str | None, output: str) -> str | None:
    """Return the surface format that -f or the suffix of the output names; None for meshes."""
    kinds = {name: name for name in (*CAD_FORMATS, *CELL_FORMATS)}
    return kinds.get(format) if format is not None else (kinds | CAD_SUFFIXES).get(suffix_of(output))


def write_surfaces(
    specs: Sequence[str], kind: str, options: MeshOptions, streams: Streams, manifest: str | None
) -> None:
    """Write the surfaces of one spec as STEP, IGES, BREP or VTU, and say what is exact."""
    if manifest is not None:
        raise click.UsageError(f"--manifest is for meshes, and {kind.upper()} holds surfaces")
    if are_several(specs) or is_folder(streams.output):
        raise click.UsageError(f"{kind.upper()} is written for one spec, to a file or standard output")
    names = ["normals", "uv", "ascii", "radius", "thickness", *([] if kind in CELL_FORMATS else ["attributes"])]
    options.refuse(f"is for meshes, and {kind.upper()} holds surfaces", *names)
    check_unit(options, kind)
    if kind in CELL_FORMATS:
        options.refuse(f"is for meshes, and cells of {kind.upper()} share no vertices", "require")
    from gtb_cli.cad.kinds_of_surfaces import encode_surfaces, with_y_up
    from gtb_cli.tessellation.curved_cells import encode_cells, unused

    recipe = options.recipe
    with streams.spec_of(specs[0]) as given:
        spec = with_y_up(given) if options.up == "y" else given
        if kind in CELL_FORMATS:
            data, size, warnings = encode_cells(spec, recipe)
        else:
            unit, tolerance = options.unit or DEFAULT_UNIT, recipe.tolerance_for(spec)
            data, size, warnings, _ = encode_surfaces(spec, kind, unit, tolerance, closed=bool(recipe.require))
            warnings += unused(recipe, "resolution")
    write_blocks(streams.output, [data])
    streams.console.report(streams.output, size, warnings)


def check_unit(options: MeshOptions, kind: str) -> None:
    """Refuse a unit of length for a format that has none."""
    if options.unit is not None and kind not in UNIT_FORMATS:
        having = ", ".join(name.upper() for name in UNIT_FORMATS[:-1])
        raise click.UsageError(f"--unit: {kind.upper()} has no unit of length; {having} and GLB have")
