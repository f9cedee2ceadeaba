"""The content of a mesh file, and its accuracy."""

import hashlib
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, bounds_of
from gtb_cli.meshes.mesh import COLOURS, FACETS, GROUPS, MATERIALS, NORMALS, OBJECTS, OTHER, SETTINGS, TEXTURE, Values
from gtb_cli.values import frozen

STL_HEADER_BYTES = 84  # bytes before the facets of a binary STL file; the last four are the number of facets
SINGLE_FLOAT = np.dtype("<f4")  # numbers of binary files
Ranges: TypeAlias = Sequence[tuple[str, int, int]]  # names, each with its first cell and the one after its last


@frozen
class FileArrays:
    """The arrays of a file, not checked yet: (m, 3) vertices, segments or triangles, named ranges of cells.

    `half_steps` gives the largest rounding of a coordinate along each axis, half a unit in the last digit or bit, at
    (3,) largest coordinates. `space` is what the file says of the unit and the vertical axis, in words. `values` reads
    what else it holds at the corners of its cells; `ranges` are rows of numbers for cells, each from one to another.
    `libraries` are names of files with its materials and pictures; `polygons` those of `polygons_of`.
    """

    vertices: FloatArray
    cells: IntArray
    half_steps: Callable[[FloatArray], FloatArray]
    groups: Ranges = ()
    space: str = ""
    values: Callable[[], Values] = dict
    ranges: Mapping[str, Sequence[tuple[Sequence[float], int, int]]] = field(default_factory=dict)
    libraries: tuple[str, ...] = ()
    polygons: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.intp))


def unreserved(name: str, taken: Container[str]) -> str:
    """Return the name under which values with a name of their own are known: no other values have it."""
    reserved = (NORMALS, TEXTURE, FACETS, GROUPS, COLOURS)
    while name in reserved or name in taken or name.startswith((OBJECTS, MATERIALS, SETTINGS, OTHER)):
        name = f"attribute {name}"
    return name


def mark_of(*contents: str | bytes) -> list[float]:
    """Four whole numbers of 32 bits that differ where texts, or bytes, do, which stand for them among numbers."""
    parts = [each.encode("utf-8", "surrogatepass") if isinstance(each, str) else each for each in contents]
    return [*map(float, np.frombuffer(hashlib.sha256(b"".join(parts)).digest()[:16], ">u4"))]


def single_half_steps(largest: FloatArray) -> FloatArray:
    """Half the distance between neighbouring 32-bit numbers at the largest coordinate along each axis."""
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.spacing(largest.astype(np.float32)).astype(np.float64) / 2
    return np.asarray(np.where(np.isfinite(steps), steps, 0.0))


def first_beyond(rows: NDArray[Any], limit: float) -> int | None:
    """Return the first of (m, k) rows with a number that is not finite or larger than a limit."""
    if not rows.size or np.abs(bounds_of(rows).astype(np.float64)).max() <= limit:
        return None
    return int((~(np.abs(rows.astype(np.float64)) <= limit).all(axis=1)).argmax())


def faulty_point(points: NDArray[Any]) -> tuple[int, str] | None:
    """Return the first of (m, 3) points that no mesh may have, and what is wrong with it."""
    if (number := first_beyond(points, 2.0**1000)) is None:  # differences of larger coordinates may overflow
        return None
    reason = "too large" if np.isfinite(points[number]).all() else "not finite"
    return number, f"is {reason}: {' '.join(f'{x:g}' for x in points[number])}"
