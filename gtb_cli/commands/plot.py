"""`gtb plot`: specs and sequences → figures."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import click

from gtb_cli.errors import DomainError
from gtb_cli.shell.console import STANDARD
from gtb_cli.shell.limits import LimitRequest, heights_of, limit_options, refuse_limit
from gtb_cli.shell.options import INPUT, OUTPUT, WholeNumber, console_option, gathered, numbers_of, spec_format_option
from gtb_cli.shell.streams import Streams, about, format_of, refuse_terminal, single, write_blocks
from gtb_cli.vocabulary import COLOUR_MAPS, SEQUENCE_RECORD

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gtb_cli.pictures.look import Look
    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch

FIGURE_FORMATS = ("png", "svg", "pdf")  # the default first
PLOT_KINDS = ("curve", "surface", "basis", "domain", "decomposition", "decompositions", "sequence", "distance")


class Variation(NamedTuple):
    """One number of a spec, and the values it takes."""

    key: Literal["knots", "weights", "coefficients"]
    knot: int
    values: tuple[float, ...]
    texts: tuple[str, ...]


def several_of(expected: str, *limits: tuple[float, float]) -> Callable[..., tuple[float, ...]]:
    """Return the reader of as many numbers as there are limits, each within its own."""

    def read(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, ...]:
        numbers = numbers_of(ctx, param, value) or ()
        if len(numbers) != len(limits) or not all(a <= x <= b for x, (a, b) in zip(numbers, limits, strict=True)):
            raise click.BadParameter(f"{value!r}: expected {expected}", ctx, param)
        return numbers

    return read


def variation_of(ctx: click.Context, param: click.Parameter, value: str | None) -> Variation | None:
    """Read the number that varies, and its values."""
    if value is None:
        return None
    match = re.fullmatch(r"\s*(knots|weights|coefficients)\[(\d{1,6})\]\s*=(.*)", value, re.ASCII | re.DOTALL)
    if match is None:
        raise click.BadParameter(f"{value!r}: expected KEY[I]=V,…, such as weights[2]=1,5,25", ctx, param)
    values = numbers_of(ctx, param, match[3]) or ()
    texts = tuple(part.strip() for part in match[3].split(","))
    return Variation(match[1], int(match[2]), values, texts)  # type: ignore[arg-type]


@click.command
@click.argument("spec", metavar="SPEC|FOLDER", type=INPUT)
@click.option(
    "-o",
    "--output",
    metavar="FIG",
    default=STANDARD,
    type=OUTPUT,
    help="Write to this file: PNG, SVG or PDF, by its suffix. Without it, or with -, to standard output.",
)
@click.option(
    "--what", type=click.Choice(PLOT_KINDS), help="What to draw; by default a curve, a surface or a sequence."
)
@click.option(
    "-f", "--format", type=click.Choice(FIGURE_FORMATS), help="Format, whatever FIG is called; png on standard output."
)
@click.option(
    "--size",
    callback=several_of("width,height in inches, such as 6,4.5", (0.5, 40), (0.5, 40)),
    default="6,4.5",
    show_default=True,
    metavar="W,H",
    help="Width and height in inches.",
)
@click.option("--dpi", type=WholeNumber(20, 1200), default=150, show_default=True, metavar="N", help="Pixels per inch.")
@click.option(
    "--camera",
    callback=several_of("azimuth,elevation in degrees, such as -60,30", (-360, 360), (-90, 90)),
    default="-60,30",
    show_default=True,
    metavar="AZ,EL",
    help="Where the eye is: degrees around the z axis, and above the xy plane.",
)
@click.option(
    "--stretch",
    callback=several_of("three positive factors, such as 1,1,0.2", *[(1e-6, 1e6)] * 3),
    default="1,1,1",
    show_default=True,
    metavar="X,Y,Z",
    help="Factors along the axes, for shapes that are too long or too flat to be seen.",
)
@click.option("--labels/--no-labels", default=None, help="Number points, knots and edges; by default if they are few.")
@click.option("--net/--no-net", default=None, help="Draw control points and net; by default for a single patch.")
@click.option("--curvature", type=click.Choice(["gaussian", "mean"]), help="Colour a surface by its curvature.")
@click.option("--colours", "colour_map", type=click.Choice(COLOUR_MAPS), help="Map of numbers to colours.")
@click.option(
    "--isolines",
    type=WholeNumber(0, 200),
    default=0,
    metavar="N",
    help="Lines of constant u, and of constant v; none without this option.",
)
@click.option(
    "--index",
    "indices",
    type=WholeNumber(0),
    multiple=True,
    metavar="I",
    help="Draw only this basis function. May be repeated.",
)
@click.option("--unnormalised", is_flag=True, help="Draw the basis β_i instead of the rational one, T_i.")
@click.option("--lifted", is_flag=True, help="Draw lifted knots and their upper hull above the decomposition.")
@click.option(
    "--vary",
    callback=variation_of,
    metavar="KEY[I]=V,…",
    help="Draw a curve, or its basis, for several values of one of its knots, weights or coefficients.",
)
@click.option(
    "-n",
    "--resolution",
    type=WholeNumber(1, 1000),
    metavar="N",
    help="Segments along each edge of the domain; by default as fine as the figure can show.",
)
@limit_options
@gathered("streams", Streams, spec_format_option, console_option)
def plot(
    spec: str,
    what: str | None,
    format: str | None,
    limit: LimitRequest,
    vary: Variation | None,
    streams: Streams,
    **looks: Any,
) -> None:
    """\b
    Example: gtb plot specs/pentagon.toml -o pentagon.png

    Draw a spec, or a sequence of meshes, as a figure for print: PNG, SVG or PDF.

    \b
    curve, surface  with control points and the net of the lifting or, without one, of the lattice;
                    a model's patches have colours of their own, and its open edges are red
    basis           T_i, or with --unnormalised β_i: over t, or as graphs over the domain
    domain          numbered knots and edges, and weights
    decomposition   cells, λ at the knots, knots in no cell hollow; with --lifted the upper hull
    decompositions  all regular ones, numbered as by gtb decompose --all; of more than 100, the first
    sequence        panels of a degeneration (-x, --lifting), of a knot limit (--merge, --steps), or of a
                    FOLDER's sequence.json, which has no net; the limit's net is drawn over each
    distance        of such a sequence from its limit, with logarithmic axes

    Shading uses the surface's own normals at the vertices of a mesh, interpolated between them, and means of the faces'
    where it has none; a sequence.json has no normals, so the means are used throughout. In SVG and PDF, lines and
    labels are vectors and text, and shading is an image.
    The same spec and options give the same bytes (with the same matplotlib). Needs matplotlib: gtb-cli[plot].
    """
    output = streams.output
    kind = format_of(output, format, FIGURE_FORMATS)
    if kind != "svg":
        refuse_terminal(output, kind, "-o FIG")
    look = _look(**looks)
    if os.path.isdir(spec) or os.path.basename(spec) == SEQUENCE_RECORD:
        from gtb_cli.pictures.sequences import figure_of_frames, read_frames

        refuse_limit(limit, spec)
        if what not in (None, "sequence", "distance"):
            raise click.UsageError(f"{spec} is a sequence, and --what {what} is for a spec")
        frames = read_frames(spec)
        with about(spec):
            figure = figure_of_frames(frames, what or "sequence", look)
    else:
        with streams.spec_of(spec) as loaded:
            figure = _of_spec(loaded, what, look, limit, vary)
    from gtb_cli.pictures.look import encoded, settings

    with settings():
        data = encoded(figure, kind)
    write_blocks(output, [data])
    streams.console.report(output, f"{len(data) / 1000:.0f} kB")


def _look(
    camera: tuple[float, float], stretch: tuple[float, float, float], size: tuple[float, float], dpi: int, **others: Any
) -> Look:
    if size[0] * size[1] * dpi * dpi > 60e6:
        raise click.UsageError(f"--size {size[0]:g},{size[1]:g} at {dpi} dpi is more than 60M pixels")
    from gtb_cli.pictures.look import Camera, Look, settings

    os.environ.pop("MPLBACKEND", None)  # it is for windows, and matplotlib is not imported where it names nothing
    with settings():  # a missing matplotlib is reported before anything is computed
        return Look(size=size, dpi=dpi, camera=Camera(*camera, stretch), **others)


def _of_spec(shape: Patch | Model, what: str | None, look: Look, limit: LimitRequest, vary: Variation | None) -> Figure:
    from gtb_cli.pictures.figures import default_picture, figure_of, figure_of_variants
    from gtb_cli.theory.patch import Patch

    what = what or ("sequence" if limit.xs or limit.moves else default_picture(shape))
    sequence, cells = what in ("sequence", "distance"), what == "decomposition"
    for name, given in (("--index", look.indices), ("--unnormalised", look.unnormalised)):
        if given and what != "basis":
            raise click.UsageError(f"{name} is for --what basis, and this is {what}")
    for name in limit.given():
        if not (sequence or (cells and name == "--lifting")):
            cells_too = "decomposition, " if name == "--lifting" else ""
            raise click.UsageError(f"{name} is for --what {cells_too}sequence and distance")
    if vary is not None:
        if what not in ("curve", "basis") or not isinstance(shape, Patch):
            raise click.UsageError("--vary is for a single curve, or its basis")
        variants, names = _variants(shape, vary)
        if what == "basis" and not look.indices:
            from dataclasses import replace

            look = replace(look, indices=(vary.knot,))
        return figure_of_variants(variants, names, what, look)
    if sequence:
        from gtb_cli.pictures.sequences import default_resolution, default_values, figure_of_frames

        xs, steps = default_values(what)
        fine = look.resolution or default_resolution(shape.dimension)
        frames = limit.frames(shape, fine, xs=xs, steps=steps, distances=what == "distance")
        return figure_of_frames(frames, what, look)
    heights = None if limit.lifting is None else heights_of(single(shape), limit.lifting)
    return figure_of(shape, what, look, lifting=heights)


def _variants(patch: Patch, vary: Variation) -> tuple[list[Patch], list[str]]:
    from gtb_cli.pictures.look import subscript

    variants = []
    for value in vary.values:
        numbers = getattr(patch, vary.key).copy()
        if vary.knot >= len(numbers) or patch.dimension == 2:
            raise DomainError(f"--vary {vary.key}[{vary.knot}]: expected a curve, and an index below {len(numbers)}")
        numbers[vary.knot] = value
        variants.append(patch.replace(**{vary.key: numbers}))
    symbol = subscript({"knots": "a", "weights": "ω", "coefficients": "c"}[vary.key], vary.knot)
    pretty = [re.sub(r"sqrt\((\d+)\)", r"√\1", text) for text in vary.texts]
    return variants, [f"{symbol} = {text}" for text in pretty]
