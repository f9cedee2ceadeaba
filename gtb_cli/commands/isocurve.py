"""`gtb isocurve`: curves on a surface along which a parameter keeps its value."""

import click

from gtb_cli.shell.console import Console
from gtb_cli.shell.meshing import MeshOptions, format_of_lines
from gtb_cli.shell.options import WholeNumber, numbers_of, spec_argument, text_options
from gtb_cli.shell.streams import single, spec_of, write_text
from gtb_cli.tessellation.recipe import Recipe


@click.command
@spec_argument
@click.option("--u", "u", callback=numbers_of, metavar="V", help="Keep the first parameter at this value.")
@click.option("--v", "v", callback=numbers_of, metavar="V", help="Keep the second parameter at this value.")
@click.option(
    "--polyline",
    type=WholeNumber(1, 1_000_000),
    metavar="N",
    help="Write N segments instead of a spec, on any surface, as OBJ, PLY or GLB by the suffix of the output; their "
    "parameters are evenly spread.",
)
@text_options
def isocurve(
    spec: str,
    u: tuple[float, ...] | None,
    v: tuple[float, ...] | None,
    polyline: int | None,
    output: str,
    spec_format: str | None,
    console: Console,
) -> None:
    """\b
    Example: gtb isocurve specs/bicubic.toml --u 3/2

    Print the spec of the curve on a surface along which one (toric) parameter keeps its value.

    If the domain is a rectangle along the axes, it is exactly a GT-Bézier curve. On other domains it is not, in
    general: the error says so, and --polyline prints points on it.
    """
    import numpy as np

    from gtb_cli.design.isocurve import isocurve as curve_of
    from gtb_cli.design.isocurve import isoparametric_points
    from gtb_cli.language.writer import dump
    from gtb_cli.meshes.mesh import Mesh

    given = [(axis, value) for axis, value in enumerate((u, v)) if value is not None]
    if len(given) != 1 or len(given[0][1]) != 1:
        raise click.UsageError("expected one of --u V and --v V")
    axis, (value,) = given[0]
    kind = format_of_lines(output, "--polyline") if polyline is not None else ""
    with spec_of(spec, spec_format) as loaded:
        patch = single(loaded)
        if polyline is None:
            return write_text(output, dump(curve_of(patch, axis, value)))
        points = isoparametric_points(patch, axis, value, polyline + 1)[1]
        segments = np.stack([np.arange(polyline), np.arange(1, polyline + 1)], axis=1)
        mesh = Mesh(points, segments, name=patch.name or "patch")
        MeshOptions(Recipe()).write(output, kind, mesh, console)
