"""Names and limits that commands offer, in a room without numpy."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

COMPLETION_VARIABLE = "_GTB_COMPLETE"
"""Environment variable by which a shell asks `gtb` for completions."""

SEQUENCE_RECORD = "sequence.json"
"""File of a sequence's folder that says what its meshes are."""

LFS_POINTER = b"version https://git-lfs"
"""How a file begins that Git LFS keeps elsewhere."""

LFS_FAULT = "is a pointer of Git LFS in place of the file, which git lfs pull fetches"


Up: TypeAlias = Literal["z", "y"]
"""An axis that is up in a file where z is in the spec."""

UP: tuple[Up, ...] = ("z", "y")


class Format(NamedTuple):
    """What a mesh format holds; its name in `FORMATS` is also its suffix.

    Attributes
    ----------
    curves, groups, normals, uv, attributes : bool
        Whether the format has segments, named parts, and each of these values at vertices. All formats have triangles.
    text : {"always", "on request", "never"}
        Whether files are text.
    digits : str
        How exactly binary files, or those that are always text, hold a coordinate. Text on request reads back exactly.
    up : {"z", "y"}
        Which axis is up in files where z is in the spec. glTF prescribes y; the others have the spec's coordinates.
    """

    curves: bool
    groups: bool
    normals: bool
    uv: bool
    attributes: bool
    text: Literal["always", "on request", "never"]
    digits: Literal["9 at the model's size", "32 bits"]
    up: Up

    def is_text(self, ascii: bool) -> bool:
        """Whether a file is text, where `ascii` says whether text is requested."""
        return self.text == "always" or (ascii and self.text == "on request")

    def is_single(self, ascii: bool) -> bool:
        """Whether a file holds 32-bit numbers."""
        return self.digits == "32 bits" and not self.is_text(ascii)


FORMATS = {
    "obj": Format(True, True, True, True, False, "always", "9 at the model's size", "z"),
    "ply": Format(True, False, True, True, True, "on request", "32 bits", "z"),
    "stl": Format(False, False, False, False, False, "on request", "32 bits", "z"),
    "glb": Format(True, True, True, True, False, "never", "32 bits", "y"),
}
"""Mesh formats by name, the default first."""

CAD_FORMATS = ("step", "iges", "brep")
"""Formats of surfaces, which CAD programs read."""

CAD_SUFFIXES = {"step": "step", "stp": "step", "iges": "iges", "igs": "iges", "brep": "brep"}

CELL_FORMATS = ("vtu",)
"""Formats of curved cells, which ParaView reads; also the suffixes of their files."""

UNITS = ("mm", "cm", "m", "in", "ft")
"""Units of length that CAD files may have, the default first."""

SPEC_FORMATS = ("toml", "json")
"""Formats of specs; also the suffixes of their files."""

IMPORTS = ("trp", "bv", "bpt", "bzr", "iges", "3dm", "geomdl")
"""Formats of other programs that become specs."""

ATTRIBUTES = ("u", "v", "gaussian_curvature", "mean_curvature")
"""Scalars that a mesh may have at each vertex."""

BASIS = "basis:"
"""Before the index of a basis function: a further such scalar."""

PARAMETRIZATIONS = ("linear", "toric")
"""Where the vertices of a mesh are put, the default first."""

TEMPLATES = ("curve", "triangle", "rectangle", "pentagon", "n-gon", "model")
"""Starter specs."""

SHELLS = ("bash", "zsh", "fish")
"""Shells that complete names and options."""

RESOLUTION = 32
"""Segments along each edge of the domain, where neither a number nor a tolerance is given."""

MAX_FACES = 5_000_000
"""Cells of a mesh that is made without being asked for more."""

COLOUR_MAPS = ("PuOr", "RdBu", "viridis", "cividis", "magma", "gray")
"""Maps of numbers to colours, by their names in matplotlib: they print, and whoever sees fewer colours can use them."""
