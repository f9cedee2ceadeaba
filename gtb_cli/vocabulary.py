"""Words and tables without numpy: mesh formats, suffixes, units, patch colours, percentages, limits, defaults."""

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from typing import Literal, NamedTuple, TypeAlias, get_args

from gtb_cli.errors import DomainError


def suffix_of(name: str) -> str:
    """Return the suffix of a file's name in lower case, without the dot."""
    return os.path.splitext(name)[1][1:].lower()


def percentage(text: str) -> float:
    """Read a positive percentage, or raise a `DomainError`."""
    number = text.strip().removesuffix("%")
    value = math.nan
    if number != text.strip() and "_" not in text and text.isascii():
        with suppress(ValueError):
            value = float(number)
    if not 0 < value < math.inf:
        raise DomainError(f"tolerance: expected a positive number or percentage, such as 0.01 or '1%', got {text!r}")
    return value


def check_word(name: str, word: object, known: Sequence[str]) -> None:
    """Raise `DomainError`, with the name of an option, for a word that is not known."""
    if word not in known:
        raise DomainError(f"{name}: expected {', '.join(known[:-1])} or {known[-1]}, got {word!r}")


def check_fineness(resolution: int, tolerance: float | str | None, parametrization: str) -> None:
    """Raise `DomainError` for numbers that make no sense, and for a tolerance in toric parameters."""
    if isinstance(resolution, bool) or not hasattr(resolution, "__index__") or resolution < 1:
        raise DomainError(f"resolution: expected a whole number of at least 1, got {resolution!r}")
    check_word("parametrization", parametrization, ("toric", "linear"))
    if isinstance(tolerance, str):
        percentage(tolerance)
    elif tolerance is not None and not 0 < tolerance < math.inf:
        raise DomainError(f"tolerance: must be positive, got {tolerance!r}")
    if tolerance is not None and parametrization == "toric":
        raise DomainError("parametrization: a tolerance chooses the parameters itself: leave out toric")


def requirements(words: Sequence[str]) -> dict[str, float]:
    """Read requirements: the name of each, with the angle of "smooth" in degrees, and 0 for the others.

    Raises `DomainError` if a word is none of "watertight", "solid", "one-piece", "unfolded" and "smooth:ANGLE".
    """
    found = {}
    for word in words:
        name, _, text = word.partition(":")
        angle = math.nan
        if word in ("watertight", "solid", "one-piece", "unfolded"):
            angle = 0.0
        elif name == "smooth" and "_" not in text:
            with suppress(ValueError):
                angle = float(text.removesuffix("deg"))
        if not 0 <= angle <= 180:
            expected = "watertight, solid, one-piece, unfolded, or an angle in degrees, as in smooth:1deg"
            raise DomainError(f"require: expected {expected}, got {word!r}")
        found[name] = angle
    return found


COMPLETION_VARIABLE = "_GTB_COMPLETE"  # environment variable with which a shell asks `gtb` for completions
SEQUENCE_RECORD = "sequence.json"  # file in the folder of a sequence that describes its meshes
SCHEMA = 1  # version of what all JSON holds: within it keys are added, but none changes or goes
LFS_POINTER = b"version https://git-lfs"  # beginning of the pointer to a file that Git LFS keeps elsewhere
LFS_FAULT = "is a pointer of Git LFS in place of the file, which git lfs pull fetches"
Up: TypeAlias = Literal["z", "y"]  # the axis of a file that stands for the spec's vertical z axis
UP: tuple[Up, ...] = get_args(Up)
Rim: TypeAlias = Literal["normal", "flat"]  # the way of a solid from its surface's rim to its offset's
RIMS: tuple[Rim, ...] = get_args(Rim)  # the default first
Side: TypeAlias = Literal["inwards", "outwards"]
SIDES: tuple[Side, ...] = get_args(Side)  # of a surface, to which a wall grows
Fairness: TypeAlias = Literal["variation", "thin-plate", "dirichlet"]
ENERGIES: tuple[Fairness, ...] = get_args(Fairness)  # the default first
Keep: TypeAlias = Literal["boundary", "tangents", "curvature"]
KEEPS: tuple[Keep, ...] = get_args(Keep)  # along edges, each more than the one before


def thickness_of(value: float | str) -> tuple[Side | None, float]:
    """Read a thickness: a side with a positive length, as in "inwards:1.6", or no side and a number other than zero.

    Raises `DomainError` for all else.
    """
    name, colon, text = value.partition(":") if isinstance(value, str) else ("", "", value)
    side: Side | None = next((side for side in SIDES if side == name), None)
    length = math.nan
    with suppress(ValueError, TypeError):
        length = float(text) if not isinstance(value, str) or (side is not None and "_" not in value) else math.nan
    if not math.isfinite(length) or length == 0 or (colon and length < 0):
        expected = 'must be a number other than zero, or a side and a positive length, such as "inwards:1.6"'
        raise DomainError(f"thickness: {expected}, got {value!r}")
    return side, length


class Format(NamedTuple):
    """A mesh format: what it can hold beside triangles. Its name in `FORMATS` is also its suffix."""

    curves: bool
    groups: bool  # named parts
    normals: Literal["always", "on request", "never"]  # at vertices, as the next two
    uv: bool
    attributes: bool
    text: Literal["always", "on request", "never"]  # on request, it reads back exactly
    digits: Literal["9 at the model's size", "32 bits"]  # of coordinates in files that are binary, or always text
    up: Up  # the axis of files that stands for the spec's vertical z axis: glTF prescribes y

    def is_text(self, ascii: bool) -> bool:
        """Tell whether a file is text; `ascii` says whether text is requested."""
        return self.text == "always" or (ascii and self.text == "on request")

    def has_normals(self, asked: bool | None) -> bool:
        """Tell whether a file holds normals; None leaves it to the format, as viewers shade GLB flat without them."""
        return self.normals == "always" if asked is None else asked and self.normals != "never"

    def is_single(self, ascii: bool) -> bool:
        """Tell whether a file holds 32-bit numbers."""
        return self.digits == "32 bits" and not self.is_text(ascii)


# Mesh formats by name, the default first
FORMATS = {
    "obj": Format(True, True, "on request", True, False, "always", "9 at the model's size", "z"),
    "ply": Format(True, False, "on request", True, True, "on request", "32 bits", "z"),
    "stl": Format(False, False, "never", False, False, "on request", "32 bits", "z"),
    "glb": Format(True, True, "always", True, False, "never", "32 bits", "y"),
    "3mf": Format(False, True, "never", False, False, "never", "32 bits", "z"),
}

CAD_FORMATS = ("step", "iges", "brep")  # surface formats for CAD programs
CAD_SUFFIXES = {"step": "step", "stp": "step", "iges": "iges", "igs": "iges", "brep": "brep"}
CELL_FORMATS = ("vtu",)  # formats of curved cells, for ParaView; also the suffixes of their files
# Units of length in metres, the default first, and the formats of files that have one
DEFAULT_UNIT = "mm"
UNITS = {DEFAULT_UNIT: 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048}
UNIT_FORMATS = ("step", "iges", "3mf", "glb")
SpecFormat: TypeAlias = Literal["toml", "json"]
SPEC_FORMATS: tuple[SpecFormat, ...] = get_args(SpecFormat)  # also the suffixes of their files
IMPORTS = ("trp", "bv", "bpt", "bzr", *CAD_FORMATS)  # formats of other programs
ATTRIBUTES = ("u", "v", "gaussian_curvature", "mean_curvature")  # scalars that a mesh may have at each vertex
BASIS = "basis:"  # prefix of the index of a basis function, whose values are a further scalar
Parametrization: TypeAlias = Literal["linear", "toric"]
PARAMETRIZATIONS: tuple[Parametrization, ...] = get_args(Parametrization)  # placements of vertices, the default first
Comparison: TypeAlias = Literal["auto", "vertices", "surface"]  # as what two meshes are compared
Aspect: TypeAlias = Literal["orientation", "connectivity", "attributes"]  # what may be no difference
# Starter specs, and how many sides at most where a number may be given
TEMPLATES: dict[str, int | None] = dict.fromkeys(("curve", "triangle", "rectangle", "pentagon"))
TEMPLATES |= {"n-gon": 100, "model": None, "bowl": 24, "ring": 12, "shade": 24, "joint": 8, "handle": None}
CONTINUITIES = ("g1", "g0", "g2")  # of a filling: planes are met, the default, curves alone, or curvatures too
SHELLS = ("bash", "zsh", "fish")  # shells that complete names and options
RESOLUTION = 32  # segments along each edge of the domain if neither a number nor a tolerance is given
MAX_FACES = 5_000_000  # largest number of cells of a mesh unless the caller allows more
# Colours of patches and cells, in turn: they print well, and colour-blind readers can tell them apart
PATCH_COLOURS = ("#8FBCD9", "#F2B48A", "#86CDB5", "#E3B5CE", "#F1CF85", "#AEDBF3", "#C9C9C9", "#E9E39A")
# Colour maps, by their names in matplotlib: readable in print and with colour-blindness
COLOUR_MAPS = ("PuOr", "RdBu", "viridis", "cividis", "magma", "gray")
SHAPE_PICTURES = ("curve", "surface", "stripes")
PLOT_KINDS = (*SHAPE_PICTURES, "basis", "domain", "decomposition", "decompositions", "sequence", "distance")
SIZE_LIMITS = ((0.5, 40.0),) * 2  # of a picture, in inches
CAMERA_LIMITS = ((-360.0, 360.0), (-90.0, 90.0))  # azimuth and elevation in degrees
STRETCH_LIMITS = ((1e-6, 1e6),) * 3


def printable(text: str) -> str:
    """Return a text on one line, with escapes for what cannot be seen, or would control a terminal or GitHub's log."""
    return without_commands("".join(c if c.isprintable() else ascii(c)[1:-1] for c in text))


def without_commands(text: str) -> str:
    """Escape what is a command of GitHub's at any place in a line; a name in a spec or a mesh may hold it."""
    return text.replace("##[", "##\\x5b")


def plain_name(name: str) -> str:
    """Return a name without characters that would end a word, or continue a line, in a text format."""
    return "".join("_" if c.isspace() or not c.isprintable() or c == "\\" else c for c in name) or "patch"
