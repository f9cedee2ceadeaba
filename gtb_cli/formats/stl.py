"""STL, both ways, binary and text: facets; corners at exactly the same place become one vertex."""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, bounds_of
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import STL_HEADER_BYTES, Content, faulty_point, single_half_steps
from gtb_cli.formats.digits import BLOCK_ROWS
from gtb_cli.formats.text import SAMPLED_VERTICES, floats, half_step, shown
from gtb_cli.meshes.topology import compacted
from gtb_cli.meshes.welding import weld


def stl_blocks(vertices: FloatArray, triangles: IntArray, name: str, *, ascii: bool) -> Iterable[bytes]:
    """Return an STL file: binary with 32-bit numbers, or text with numbers that read back exactly.

    Parameters
    ----------
    vertices : (m, 3) float
    triangles : (k, 3) int
        Indices into `vertices`.
    name : str
        Name of the solid, written in text files.
    """
    from trimesh import Trimesh
    from trimesh.exchange.stl import export_stl

    # trimesh takes triangles with a cross product below 1e-13 for points, and squares lengths; powers of two are exact.
    exponent = int(np.frexp(np.ptp(bounds_of(vertices), axis=0).max() or 1.0)[1])
    exponent = 0 if -10 < exponent < 200 else exponent
    facets = Trimesh(np.ldexp(vertices, -exponent), triangles, process=False, validate=False)
    if ascii:
        return _text(vertices, triangles, facets.face_normals, name)
    if exponent:
        facets.face_normals  # noqa: B018 (they stay as they are when the facets shrink)
        facets.apply_scale(2.0**exponent)
    return [export_stl(facets)]


def _text(vertices: FloatArray, triangles: IntArray, normals: FloatArray, name: str) -> Iterator[bytes]:
    """Yield text without blank lines, at which meshio stops, and with all digits."""
    title = name.encode("ascii", "replace")[:80]  # some readers have no room for more
    facet = "facet normal {!r} {!r} {!r}\nouter loop\n{}{}{}endloop\nendfacet\n"
    yield b"solid " + title + b"\n"
    for start in range(0, len(triangles), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        used, places = compacted(triangles[rows])
        corners = ["vertex {!r} {!r} {!r}\n".format(*row) for row in vertices[used].tolist()]
        facets = [
            facet.format(*normal, corners[a], corners[b], corners[c])
            for normal, (a, b, c) in zip(normals[rows].tolist(), places.tolist(), strict=True)
        ]
        yield "".join(facets).encode("ascii")
    yield b"endsolid " + title + b"\n"


def read_stl(data: bytes) -> Content:
    """Read an STL file.

    Raises
    ------
    GtbError
        The file is neither a whole binary file nor text with whole facets.
    """
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    number = int.from_bytes(data[STL_HEADER_BYTES - 4 : STL_HEADER_BYTES], "little")
    if len(data) >= STL_HEADER_BYTES and len(data) == STL_HEADER_BYTES + number * facet.itemsize:
        facets = np.frombuffer(data, dtype=facet, offset=STL_HEADER_BYTES)
        corners = facets["corners"].astype(np.float64).reshape(-1, 3)
        return _content(corners, single_half_steps)
    if data[:5].lower() == b"solid" and b"\0" not in data[:STL_HEADER_BYTES]:
        return _read_text(data)
    if len(data) < STL_HEADER_BYTES:
        raise GtbError(f"is not an STL file: {len(data)} bytes, and not text that begins with solid")
    held = (len(data) - STL_HEADER_BYTES) / facet.itemsize
    raise GtbError(f"says that it has {number} facets, and its size is that of {held:.10g}")


def _content(corners: FloatArray, half_steps: Callable[[FloatArray], FloatArray]) -> Content:
    fault = faulty_point(corners)
    if fault is not None:
        raise GtbError(f"facet {fault[0] // 3 + 1}: a corner {fault[1]}")
    first, labels = weld(corners)
    return Content(corners[first], labels.reshape(-1, 3), half_steps)


def _read_text(data: bytes) -> Content:
    chunk = 1 << 22  # bytes of text parsed together
    if b"FACET" in data:
        data = data.lower()
    solid = rb"^[ \t]*(end[ \t]*)?solid\b[^\r\n]*"
    marks = list(re.finditer(solid, data, re.IGNORECASE | re.MULTILINE))
    ends = [bool(mark[1]) for mark in marks]
    if not ends or ends != [False, True] * (len(ends) // 2):
        raise GtbError("is cut off: a solid without endsolid")
    words: list[bytes] = []
    blocks: list[FloatArray] = []
    places = [*(edge for mark in marks for edge in mark.span()), len(data)]
    count = 0
    for index, (begin, end) in enumerate(zip(places[1::2], places[2::2], strict=True)):
        while begin < end:
            stop = data.find(b"endfacet", begin + chunk, end)
            stop = end if stop < 0 else stop + len(b"endfacet")
            found = data[begin:stop].split()
            begin = stop
            if not found:
                continue
            if index % 2:
                raise GtbError(f"expected solid, got {shown(found[0])}")
            numbers = _corners(found, count)
            count += len(numbers) // 9
            words += numbers[: max(0, 3 * SAMPLED_VERTICES - len(words))]
            blocks.append(floats(numbers))
    corners = np.concatenate([np.empty(0), *blocks]).reshape(-1, 3)
    return _content(corners, partial(half_step, words))


def _corners(words: list[bytes], before: int) -> list[bytes]:
    """Return the coordinates of the corners of facets, in order; `before` is the number of facets before these."""
    facet = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
    width = len(facet)  # 0 stands for any number
    for place, expected in enumerate(facet):
        column = words[place::width]
        if expected != b"0" and column.count(expected) != len(column):
            index, word = next((index, word) for index, word in enumerate(column) if word != expected)
            raise GtbError(f"facet {before + index + 1}: expected {expected.decode()}, got {shown(word)}")
    if len(words) % width:
        raise GtbError(f"facet {before + len(words) // width + 1}: is cut off after {shown(words[-1])}")
    columns = [words[place::width] for place in range(5, width) if facet[place] == b"0"]
    return [word for row in zip(*columns, strict=True) for word in row]
