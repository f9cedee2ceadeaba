"""`gtb plot`: specs → figures."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gtb_cli.shell.faults import in_options
from gtb_cli.shell.gathering import option
from gtb_cli.shell.limit_options import limit_options
from gtb_cli.shell.messages import STANDARD
from gtb_cli.shell.options import (
    WholeNumber,
    numbers_of,
    output_to,
    reading_streams,
    resolution_up_to,
    solid_option,
    spec_argument,
)
from gtb_cli.shell.streams import Spec, Streams, output_format, refuse_terminal, write_blocks
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import CAMERA_LIMITS, COLOUR_MAPS, PLOT_KINDS, RESOLUTION, SIZE_LIMITS, STRETCH_LIMITS

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.plots.panels import Approach

FIGURE_FORMATS = ("png", "svg", "pdf")  # the default first
ANIMATION_FORMAT = "gif"


def within(name: str, limits: Sequence[tuple[float, float]]) -> Callable[[str], tuple[float, ...]]:
    """Return the function that reads as many numbers as there are limits, each within its own."""

    def read(text: str) -> tuple[float, ...]:
        from gtb_cli.plots.look import numbers_in

        return numbers_in(name, numbers_of(text), limits)

    return read


def variation_of(text: str) -> tuple[str, int, tuple[float, ...], tuple[str, ...]]:
    """Read the number that varies, its values, and their texts."""
    match = re.fullmatch(r"\s*(knots|weights|coefficients)\[(\d{1,6})\]\s*=(.*)", text, re.ASCII | re.DOTALL)
    if match is None:
        raise ValueError(f"{text!r}: expected KEY[I]=V,…, such as weights[2]=1,5,25")
    return match[1], int(match[2]), numbers_of(match[3]), tuple(part.strip() for part in match[3].split(","))


@click.command
@spec_argument
@output_to("-o, --output FIG", default=[STANDARD])(
    help="Write to this file: PNG, SVG, PDF or a film, by its suffix. Without it, or with -, to standard output."
)
@option("--what", PLOT_KINDS)(help="What to draw; by default a curve, a surface or a sequence.")
@option("-f, --format", (*FIGURE_FORMATS, ANIMATION_FORMAT))(
    help="Format, whatever FIG is called; png on standard output."
)
@option("--size W,H", within("size", SIZE_LIMITS), default="6,4.5", show_default=True)(
    help="Width and height in inches."
)
@option("--dpi N", WholeNumber(20, 1200), default=150, show_default=True)(help="Pixels per inch.")
@option("--camera AZ,EL", within("camera", CAMERA_LIMITS), default="-60,30", show_default=True)(
    help="Where the eye is: degrees around the z axis, and above the xy plane."
)
@option("--stretch X,Y,Z", within("stretch", STRETCH_LIMITS), default="1,1,1", show_default=True)(
    help="Factors along the axes, for shapes that are too long or too flat to be seen."
)
@option("--labels/--no-labels", bool, default=None)(help="Number points, knots and edges; by default if they are few.")
@option("--net/--no-net", bool, default=None)(help="Draw control points and net; by default for a single patch.")
@option("--curvature", ("gaussian", "mean"))(help="Colour a surface by its curvature.")
@option("--colours", COLOUR_MAPS)(help="Map of numbers to colours.")
@option("--index I", WholeNumber(0), multiple=True)(help="Draw only this basis function. May be repeated.")
@option("--unnormalised", bool)(help="Draw the basis β_i instead of the rational one, T_i.")
@option("--lifted", bool)(help="Draw lifted knots and their upper hull above the decomposition.")
@option("--vary KEY[I]=V,…", variation_of)(
    help="Draw a curve, a surface or its basis for several values of a weight, a coefficient, or a knot of a curve."
)
@resolution_up_to(WholeNumber(1, 1000))(
    help="Segments along each edge of the domain; by default as fine as the figure can show."
)
@solid_option
@limit_options
@reading_streams
def plot(spec: str, format: str | None, solid: Recipe | None, limit: Approach, streams: Streams, **looks: Any) -> None:
    """\b
    Example: gtb plot specs/pentagon.toml -o pentagon.png

    Draw a spec, or the way to a limit, as a figure: PNG, SVG or PDF; or a sequence as a film: GIF.

    \b
    curve, surface  with control points and the net of the lifting or, without one, of the lattice;
                    a model's patches have colours of their own, and its open edges are red
    stripes         what a surface mirrors of a room with parallel lamps: normals, and their kinks at seams
    basis           T_i, or with --unnormalised β_i: over t, or as graphs over the domain
    domain          numbered knots and edges, and weights
    decomposition   cells, λ at the knots, knots in no cell hollow; with --lifted the upper hull
    decompositions  all regular ones, numbered as by gtb decompose --all; of more than 100, the first
    sequence        panels of a degeneration (-x, --lifting), or of a knot limit (--merge, --steps); the
                    limit's net is drawn over each, and at step 0 the patch's own
    distance        of such a sequence from its limit, with logarithmic axes

    With --thickness or --radius it draws the solid that gtb mesh makes with the same options.

    The same spec and options give the same bytes (with the same matplotlib). Needs matplotlib: gtb-cli[plot].
    """
    output, what = streams.output, looks.pop("what")
    kind = output_format(output, format, (*FIGURE_FORMATS, ANIMATION_FORMAT))
    if kind != "svg":
        refuse_terminal(output, kind, "-o FIG")
    from gtb_cli.plots.look import encoded_animation, encoded_figure, settings

    os.environ.pop("MPLBACKEND", None)  # it is for windows, and matplotlib is not imported where it names nothing
    settings()  # a missing matplotlib is reported before anything is computed
    from gtb_cli.plots.figures import Variation, figure_of, frames_of_picture, picture_of
    from gtb_cli.plots.panels import figure_of_members

    is_animation = kind == ANIMATION_FORMAT
    if is_animation and what not in (None, "sequence"):
        raise click.UsageError(f"a film shows a sequence, and this is {what}")
    with streams.spec_of(spec) as loaded:
        shape: Spec | Mesh = loaded
        if solid is not None:
            for name in ("labels", "net", "curvature"):
                if looks[name]:
                    raise click.UsageError(f"--{name} is not for a solid: leave --thickness and --radius out")
            shape, remarks = replace(solid, resolution=looks["resolution"] or RESOLUTION, normals=True).mesh(loaded)
            for remark in remarks:
                streams.console.warn(in_options(remark))
        looks |= vars(limit) | {"vary": Variation(*looks["vary"]) if looks["vary"] else None}
        picture = picture_of(shape, "sequence" if is_animation else what, looks)
        if is_animation:
            frames = frames_of_picture(shape, picture, "animation")
            members = range(len(frames.meshes))  # all with one camera and one scale
            data = encoded_animation(figure_of_members(frames, [member], picture.look) for member in members)
        else:
            data = encoded_figure(figure_of(shape, picture), kind)
    write_blocks(output, [data])
    streams.console.report(output, f"{len(data) / 1000:.0f} kB")
