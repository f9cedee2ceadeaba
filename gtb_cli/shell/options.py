"""Options and arguments that several commands share."""

import functools
import os
from collections.abc import Callable, Sequence
from typing import Any

import click

from gtb_cli.errors import DomainError, ExportError, SpecError
from gtb_cli.language.reading import Reading, assignment
from gtb_cli.shell.gathering import Function, Option, gathered, option, reads
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.shell.messages import STANDARD, Console
from gtb_cli.shell.streams import Spec, Streams, refuse_overwriting, shown_input
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import (
    ATTRIBUTES,
    BASIS,
    CAD_SUFFIXES,
    CELL_FORMATS,
    CONTINUITIES,
    FORMATS,
    MAX_FACES,
    PARAMETRIZATIONS,
    RESOLUTION,
    RIMS,
    SIDES,
    SPEC_FORMATS,
    UP,
    Rim,
    percentage,
    suffix_of,
    thickness_of,
)


def tolerance_of(text: str) -> float | str:
    """Read a positive number as a float; leave a percentage as it is."""
    word = text.strip()
    try:
        percentage(word if word.endswith("%") else f"{word}%")
    except DomainError:
        raise ValueError(f"{text!r} is not a positive number or percentage, such as 0.01 or 1%") from None
    return word if word.endswith("%") else float(word)


def numbers_of(text: str, words: Sequence[str] = ()) -> tuple[float, ...]:
    """Read numbers, or number expressions as in a spec, separated by commas; or only the given words of the text."""
    from gtb_cli.language.expression import evaluate_expression

    try:
        return tuple(evaluate_expression(word.strip()) for word in words or text.split(","))
    except SpecError as error:
        raise ValueError(f"{text!r}: {error}") from None


def length_of(text: str) -> float:
    """Read a number other than zero, or a number expression as in a spec."""
    if text.startswith("--") or text in ("-o", "-n", "-q") or text.rstrip().endswith("%"):
        raise ValueError(f"expected a length, such as 2, in the units of the spec, got {text!r}")
    (number,) = numbers_of(text, [text])
    if number == 0:
        raise ValueError(f"{text!r} is zero: leave the option out")
    return number


def _thickness(text: str) -> float | str:
    """Read a length, or a side and a positive length, such as inwards:1.6."""
    side, colon, length = text.partition(":")
    if not colon and not text.strip().startswith(SIDES):
        return length_of(text)
    thickness = f"{side.strip()}:{length_of(length)!r}" if side.strip() in SIDES and length.strip() else text
    thickness_of(thickness)
    return thickness


# Names of files that a command reads, and that it writes; - is a standard stream
INPUT, OUTPUT = click.Path(readable=False), click.Path(readable=False)


def _aspects(text: str) -> tuple[str, ...]:
    aspects = ("orientation", "connectivity", "attributes")
    words = [word.strip() for word in text.split(",")]
    if wrong := [word for word in words if word not in aspects]:
        raise ValueError(f"expected {', '.join(aspects)}, or several with commas, got {wrong[0]!r}")
    return tuple(aspect for aspect in aspects if aspect in words)


class WholeNumber(click.IntRange):
    """A whole number within limits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a whole number, or raise an error that says what is expected."""
        try:
            int(value)
        except ValueError:
            limits = "" if self.min is None else f" from {self.min}"
            limits += "" if self.max is None else f" to {self.max}"
            self.fail(f"expected a whole number{limits}, got {str(value)[:60]!r}", param, ctx)
        return super().convert(value, param, ctx)


class AttributeName(click.Choice):  # type: ignore[type-arg]
    """A scalar at vertices: one of the given names, or a basis function, such as basis:3."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a name; whether the patch has that basis function is checked later."""
        text = str(value).removeprefix(BASIS)
        return value if text != value and text.isascii() and text.isdecimal() else super().convert(value, param, ctx)


def named_files(kind: click.Path) -> list[str]:
    """Return the inputs or outputs of the running command."""
    context = click.get_current_context()
    given = [context.params.get(param.name or "") for param in context.command.params if param.type is kind]
    return [path for value in given if value is not None for path in ((value,) if isinstance(value, str) else value)]


def check_outputs(*inside: str) -> None:
    """Refuse outputs of the running command, and files inside a folder, as `refuse_overwriting` does."""
    refuse_overwriting(named_files(INPUT), [*named_files(OUTPUT), *inside])


spec_argument = click.argument("spec", metavar="SPEC", type=INPUT)


def _fill(text: str) -> tuple[str, str]:
    """Read ``EDGE`` or ``EDGE=KIND``."""
    edge, sign, kind = text.rpartition("=")
    edge, kind = (edge.strip(), kind.strip()) if sign else (text.strip(), CONTINUITIES[0])
    if not edge or kind not in CONTINUITIES:
        expected = f'an edge of a hole, such as "wall edge 3", if need be with ={", =".join(CONTINUITIES)} after it'
        raise ValueError(f"expected {expected}, got {text[:60]!r}")
    return edge, kind


_reading_options = (
    option("--set NAME=EXPR", lambda texts: tuple(dict(map(assignment, texts)).items()), into="let", multiple=True)(
        help="Give a number of the spec's let another value, such as height=120 or 'turn=2*pi/5'. May be repeated."
    ),
    option("--spec-format", SPEC_FORMATS)(
        help="Read specs in this format; by default the suffix or the first character decides."
    ),
)
reading_option = gathered("reading", Reading, *_reading_options)
filling_option = gathered(
    "reading",
    Reading,
    option("--fill HOLE[=KIND]", lambda texts: tuple(map(_fill, texts)), into="fills", multiple=True)(
        help='Fill the hole of a model with this edge, "wall edge 3", or near this point, "0,0,999", as gtb fill does; '
        'with "=g0" a lid. May be repeated.'
    ),
    *_reading_options,
)


def _only(paths: tuple[str, ...]) -> str | None:
    if len(paths) > 1:
        raise ValueError(f"one output can be written, got {' and '.join(map(repr, paths))}")
    return paths[0] if paths else None


output_to = functools.partial(option, takes=OUTPUT, multiple=True, callback=reads(_only))
output_option = output_to("-o, --output OUT", default=[STANDARD])(
    help="Write to this file; by default, or with -, to standard output."
)

json_option = option("--json", bool, into="as_json")(help="Print JSON.")

weld_option = option("--weld T", tolerance_of)(
    help="Join edges of a model that are at most this far apart, in model units or such as 0.01% of the size; "
    "overrides the spec's weld."
)

parametrization_option = option("--parametrization", PARAMETRIZATIONS, default=PARAMETRIZATIONS[0])(
    help="Where vertices are put: linear, evenly up to the edges, whatever the units of the knots (the default); "
    "or toric, at the paper's parameters, which may crowd."
)

resolution_up_to = functools.partial(option, "-n, --resolution N")

# The square of the largest is still a 64-bit integer
resolution_option = resolution_up_to(WholeNumber(1, 10**8))(
    help=f"Segments along each edge of the domain; {RESOLUTION} without this option."
)

tolerance_option = option("--tolerance T", tolerance_of)(
    help="Instead of -n: largest distance between mesh and surface (not the offset of --thickness), in model units or "
    "such as 1% of the size."
)

# Options that make a solid of a curve or surface
solid_options = (
    option("--radius R", length_of)(
        help="Make a tube of this radius, in model units, around a curve. Whether distant parts meet is not checked."
    ),
    option("--thickness D", _thickness)(
        help="Make a solid of this thickness, in model units: inwards:D or outwards:D; or D on the side of the "
        "normals, and -D on the other. A message reports folds, and distant parts that meet."
    ),
    option("--rim", RIMS, default=RIMS[0])(
        help="How the rims of such a solid lie: along the normals (the default); or flat, each in the plane of the "
        "surface's rim where the surface leaves that plane."
    ),
)


def _solid(radius: float | None, thickness: float | str | None, rim: Rim) -> Recipe | None:
    recipe = Recipe(radius=radius, thickness=thickness, rim=rim)
    return None if recipe == Recipe() else recipe


solid_option = gathered("solid", _solid, *solid_options)  # None without them

max_faces_option = option("--max-faces N", WholeNumber(min=1), default=MAX_FACES)(
    help=f"Refuse to make more faces than this; {MAX_FACES} without this option."
)

lifting_option = option("--lifting L,…", numbers_of)(
    help="A lifting value for each knot, instead of the spec's. Expressions such as 4*sqrt(2) may be used."
)

difference_option = option(
    "--tolerance T", lambda text: 0.0 if text.strip() in ("0", "0%", "0.0") else tolerance_of(text)
)(
    help="Largest distance that is not a difference, in model units or such as 1% of the size; 1e-9 of the size "
    "by default. 0 means what the numbers in the files can hold."
)

ignore_option = option("--ignore WHAT", str, callback=reads(_aspects, absent=()))(
    help="What is not a difference between faces in the same place: orientation (turned over), connectivity (other "
    "holes or parts, vertices shared in another way, faces missing, there twice or without area), attributes (normals, "
    "texture coordinates, other values, groups, materials, named files: without a warning), or several of them."
)


def _console(quiet: bool) -> Console:
    check_outputs()  # so that a command is not called if it would overwrite what it reads
    output = click.get_current_context().params.get("output") or ""
    place = os.path.dirname(output)
    # Other names may mean folders, which are made if missing. Refused before the work, not after it.
    files = (*FORMATS, *CAD_SUFFIXES, *CELL_FORMATS, *SPEC_FORMATS, "html", "png", "svg", "pdf", "gif")
    if suffix_of(output) in files and place and not os.path.lexists(place):
        raise ExportError(f"cannot write {output}: the folder {place} does not exist")
    return Console(quiet)


console_option = gathered("console", _console, option("-q, --quiet", bool)(help="Print only errors."))


# Options that a command gets as `streams`: it reads no spec, or reads one, or has an -o of its own
output_options = gathered("streams", Streams, output_option, console_option)
streams_options = gathered("streams", Streams, output_option, reading_option, console_option)
reading_streams = gathered("streams", Streams, filling_option, console_option)


def spec_from_spec(function: Callable[..., Spec]) -> Function:
    """Turn a function of a patch or model, and of options, into a command that reads one spec and prints another."""

    @streams_options
    @functools.wraps(function)
    def command(*, spec: str, streams: Streams, **values: Any) -> None:
        with streams.spec_of(spec) as loaded:
            found = function(loaded, **values)
        streams.write_spec(found, shown_input(spec))

    return command


def recipe_of(resolution: int | None, **values: Any) -> Recipe:
    """Return the recipe for the values of options."""
    if resolution is not None and values.get("tolerance") is not None:
        raise click.UsageError("-n and --tolerance exclude each other")
    return Recipe(resolution or RESOLUTION, **values)


def mesh_options(*more: str) -> Option:
    """Add the options of a mesh in a mesh format, or one of `more`; the command gets them as `options`."""
    recipe = gathered(
        "recipe",
        recipe_of,
        resolution_option,
        tolerance_option,
        parametrization_option,
        option("--normals", bool)(
            help="Write the unit normals of the surface at each vertex, which GLB files always have."
        ),
        max_faces_option,
        *solid_options,
        option("--attribute NAME", AttributeName(ATTRIBUTES), into="attributes", multiple=True)(
            help=f"Write this scalar at each vertex of a PLY file: {', '.join(ATTRIBUTES)} (in 1/length² and "
            f"1/length), or {BASIS}I, the basis function T_I of a patch. May be repeated."
        ),
        weld_option,
        option("--require WHAT", str, multiple=True)(
            help="Write nothing and exit with status 1, naming edges or places, unless the mesh is watertight "
            "(closed), solid (closed, its faces look outwards, and none cross or turn back), of one piece (one-piece), "
            "no patch or offset turns back on itself (unfolded), or patches meet at angles of a degree at most "
            "(smooth:1deg). May be repeated."
        ),
        takes=Recipe,
    )
    file = gathered(
        "options",
        MeshOptions,
        option("-f, --format", click.Choice((*FORMATS, *more), case_sensitive=False))(
            help="Format, whatever the name of OUT. By default the suffix of OUT decides, or else obj."
        ),
        option("--uv", bool)(help="Write the parameters as texture coordinates."),
        option("--up", UP)(
            help="Axis of the file that points up if z does in the spec; by default y in GLB files, as glTF "
            "prescribes, and z in all others."
        ),
        option("--ascii", bool)(help="Write PLY and STL as text, with every digit."),
    )
    return lambda function: recipe(file(function))
