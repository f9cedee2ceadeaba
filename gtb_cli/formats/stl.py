"""STL, both ways, binary and text: facets; corners at exactly the same place become one vertex."""

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import count as count_up
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, bounds_of, row_blocks
from gtb_cli.errors import GtbError, MeshError
from gtb_cli.formats.file_arrays import STL_HEADER_BYTES, FileArrays, faulty_point, mark_of, single_half_steps
from gtb_cli.formats.numbers_read import half_step, numbers, sampled, shown
from gtb_cli.formats.numbers_written import BLOCK_ROWS, text_rows
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.mesh import FACETS, OBJECTS, OTHER, Values
from gtb_cli.solids.crossings import facing_of

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])  # of a binary file


def stl_blocks(vertices: FloatArray, triangles: IntArray, name: str, *, ascii: bool) -> Iterable[bytes]:
    """Return an STL file: binary with 32-bit numbers, or text with numbers that read back exactly, and a name."""
    exponent = int(np.frexp(np.ptp(bounds_of(vertices), axis=0).max())[1])  # squares of lengths must be numbers
    directions = facing_of(np.ldexp(vertices, -exponent)[triangles])
    if ascii:
        return _text(vertices, triangles, directions, name)
    facets = np.zeros(len(triangles), FACET)
    facets["normal"], facets["corners"] = directions, vertices[triangles]
    return [bytes(STL_HEADER_BYTES - 4) + len(facets).to_bytes(4, "little") + facets.tobytes()]


def _text(vertices: FloatArray, triangles: IntArray, normals: FloatArray, name: str) -> Iterator[bytes]:
    """Yield text without blank lines, at which meshio stops, and with all digits."""
    title = name.encode("ascii", "replace")[:80]  # some readers have no room for more
    facet = "facet normal %r %r %r\nouter loop\n" + 3 * "vertex %r %r %r\n" + "endloop\nendfacet\n"
    yield b"solid " + title + b"\n"
    for rows in row_blocks(len(triangles), BLOCK_ROWS):
        yield from text_rows(facet, np.column_stack([normals[rows], vertices[triangles[rows]].reshape(-1, 9)]))
    yield b"endsolid " + title + b"\n"


def read_stl(data: bytes) -> FileArrays:
    """Read an STL file: a whole binary one, or text with whole facets."""
    number = int.from_bytes(data[STL_HEADER_BYTES - 4 : STL_HEADER_BYTES], "little")
    if len(data) >= STL_HEADER_BYTES and len(data) == STL_HEADER_BYTES + number * FACET.itemsize:
        facets = np.frombuffer(data, dtype=FACET, offset=STL_HEADER_BYTES)
        kept = ["normal", "attribute"] if facets["attribute"].any() else ["normal"]  # text has no attributes
        values = {FACETS if name == "normal" else name: facets[name].copy() for name in kept}  # without the rest
        content = _content(facets["corners"].reshape(-1, 3), single_half_steps, values)
        look = re.findall(rb"(?s)(COLOR=.{4}|MATERIAL=.{12})", data[:80])  # of facets without a colour, by Magics
        return replace(content, ranges={f"{OTHER}colour": [(mark_of(*look), 0, number)] if look else []})
    if data[:5].lower() == b"solid" and b"\0" not in data[:STL_HEADER_BYTES]:
        return _read_text(data)
    if len(data) < STL_HEADER_BYTES:
        raise GtbError(f"is not an STL file: {len(data)} bytes, and not text that begins with solid")
    held = (len(data) - STL_HEADER_BYTES) / FACET.itemsize
    raise GtbError(f"says that it has {number} facets, and its size is that of {held:.10g}")


def _content(corners: NDArray[Any], half_steps: Callable[[FloatArray], FloatArray], held: dict[str, Any]) -> FileArrays:
    if fault := faulty_point(corners):
        raise MeshError(f"facet {fault[0] // 3 + 1}: a corner {fault[1]}")
    first, labels = numbered_places(corners)
    cells = labels.reshape(-1, 3)

    def values() -> Values:
        rows = np.broadcast_to(np.arange(len(cells))[:, None], cells.shape)
        return {name: (found.reshape(len(cells), -1).astype(np.float64), rows) for name, found in held.items()}

    return FileArrays(corners[first].astype(np.float64), cells, half_steps, values=values)


def _read_text(data: bytes) -> FileArrays:
    most = 1 << 20  # words that are read together
    number = rb"\s+(\S+)"
    corner = rb"\s+vertex" + 3 * number
    loop = rb"\s+outer\s+loop" + 3 * corner + rb"\s+endloop"
    facet = re.compile(rb"(?i)\s*facet\s+normal" + 3 * number + loop + rb"\s+endfacet\b")
    solid, endsolid = (re.compile(rb"(?i)\s*" + word + rb"\b([^\r\n]*)") for word in (b"solid", b"end *solid"))
    corners, normals, words, sample = [np.empty(0)], list[bytes](), list[bytes](), list[bytes]()
    count = place = 0
    solids = list[tuple[str, int, int]]()
    while found := solid.match(data, place):
        place, start, name = found.end(), count, found[1].split()
        while found := facet.match(data, place):
            normals += found.groups()[:3]
            words += found.groups()[3:]
            place = found.end()
            count += 1
            if len(words) >= most:
                corners.append(numbers(words, np.float64))
                sample, words = sample + sampled(words, len(sample)), []
        if not (found := endsolid.match(data, place)):
            raise _fault(data, place, count + 1)
        place = found.end()
        name = name or found[1].split()
        solids.append((b" ".join(name).decode("utf-8", "backslashreplace"), start, count))
    if rest := re.compile(rb"\S+").search(data, place):
        raise GtbError(f"expected solid, got {shown(rest[0])}")
    corners.append(numbers(words, np.float64))
    sample += sampled(words, len(sample))
    parts, alike = [each for each in solids if each[1] < each[2]], defaultdict[str, Iterator[int]](count_up)
    marks = [(mark_of(f"{next(alike[name])} {name}"), a, b) for name, a, b in parts]  # the first of a name, the next
    held = {FACETS: numbers(normals, np.float64)}
    content = _content(np.concatenate(corners).reshape(-1, 3), partial(half_step, sample), held)
    ranges = {f"{OBJECTS} in STL": marks if len(parts) > len({name for name, *_ in parts}) else []}
    return replace(content, groups=tuple(each for each in parts if each[0] and len(solids) > 1), ranges=ranges)


def _fault(data: bytes, place: int, number: int) -> GtbError:
    """Return the error of a text in which a facet, or endsolid, is expected."""
    facet = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
    for found, expected in zip(re.compile(rb"\S+").finditer(data, place), facet, strict=False):
        if expected != b"0" and found[0].lower() != expected:
            return GtbError(f"facet {number}: expected {expected.decode()}, got {shown(found[0])}")
    return GtbError("is cut off: a solid without endsolid")
