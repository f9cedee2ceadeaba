"""STL, both ways, binary and text: facets; corners at exactly the same place become one vertex."""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, unit
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import SINGLE_FLOAT, STL_HEADER_BYTES, Content, single_half_steps
from gtb_cli.formats.digits import BLOCK_ROWS
from gtb_cli.formats.text import SAMPLED_VERTICES, floats, half_step, shown
from gtb_cli.meshes.known import largest_coordinates
from gtb_cli.meshes.topology import compacted
from gtb_cli.meshes.welding import weld
from gtb_cli.process.forks import in_forks

FACET_TYPE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

FACET_WORDS = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
"""The words of a facet as text; 0 stands for any number."""

CHUNK_BYTES = 1 << 22
"""Bytes of text parsed together."""

_SOLID = re.compile(rb"^[ \t]*(end[ \t]*)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)


_FACET = "facet normal {!r} {!r} {!r}\nouter loop\n{}{}{}endloop\nendfacet\n"

NAME_LENGTH = 80
"""Largest number of characters in a solid's name; some readers have no room for more."""


def stl_blocks(vertices: FloatArray, triangles: IntArray, name: str, *, ascii: bool) -> Iterator[bytes]:
    """Yield an STL file: binary with 32-bit numbers, or text with numbers that read back exactly.

    The text has no blank lines, at which meshio stops.

    Parameters
    ----------
    vertices : (m, 3) float
    triangles : (k, 3) int
        Indices into `vertices`.
    name : str
        Name of the solid, written in text files.
    """
    if not ascii:
        yield from _stl_of_trimesh(vertices, triangles)
        return

    def text(start: int) -> bytes:
        block = triangles[start : start + BLOCK_ROWS]
        used, places = compacted(block)
        corners = ["vertex {!r} {!r} {!r}\n".format(*row) for row in vertices[used].tolist()]
        normals = facet_normals(vertices[block]).tolist()
        facets = [
            _FACET.format(*normal, corners[a], corners[b], corners[c])
            for normal, (a, b, c) in zip(normals, places.tolist(), strict=True)
        ]
        return "".join(facets).encode("ascii")

    title = name.encode("ascii", "replace")[:NAME_LENGTH]
    yield b"solid " + title + b"\n"
    yield from in_forks(text, range(0, len(triangles), BLOCK_ROWS))
    yield b"endsolid " + title + b"\n"


def _stl_of_trimesh(vertices: FloatArray, triangles: IntArray) -> Iterator[bytes]:
    """Yield a binary STL file by blocks, since trimesh's exporter holds all corners, their records and the file."""
    from trimesh.exchange.stl import export_stl

    for start in range(0, len(triangles), BLOCK_ROWS):
        block = triangles[start : start + BLOCK_ROWS]
        corners = vertices[block]
        normals = facet_normals(corners).astype(SINGLE_FLOAT)
        # A Trimesh would compute its own normals (see facet_normals); the exporter needs only these three attributes.
        data: bytes = export_stl(
            SimpleNamespace(faces=block, face_normals=normals, triangles=corners.astype(SINGLE_FLOAT))
        )
        if not start:
            yield data[: STL_HEADER_BYTES - 4] + len(triangles).to_bytes(4, "little")
        yield data[STL_HEADER_BYTES:]


def facet_normals(corners: FloatArray) -> FloatArray:
    """Return the unit normals `(k, 3)` of triangles `(k, 3, 3)`; zero for a triangle without area.

    Notes
    -----
    The normals are right at any scale, as each triangle is scaled to size 1. trimesh sets a cross product below 1e-13
    to zero, and so loses every normal of a model of size 1e-9.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    largest = np.maximum(np.abs(first).max(axis=1), np.abs(second).max(axis=1))
    exponents = np.frexp(largest)[1][:, None]
    first, second = np.ldexp(first, -exponents), np.ldexp(second, -exponents)
    return unit(cross(first, second))


def read_stl(data: bytes) -> Content:
    """Read an STL file.

    Raises
    ------
    GtbError
        The file is neither a whole binary file nor text with whole facets.
    """
    number = int.from_bytes(data[STL_HEADER_BYTES - 4 : STL_HEADER_BYTES], "little")
    if len(data) >= STL_HEADER_BYTES and len(data) == STL_HEADER_BYTES + number * FACET_TYPE.itemsize:
        facets = np.frombuffer(data, dtype=FACET_TYPE, offset=STL_HEADER_BYTES)
        corners = facets["corners"].astype(np.float64).reshape(-1, 3)
        return _content(corners, single_half_steps(corners))
    if data[:5].lower() == b"solid" and b"\0" not in data[:STL_HEADER_BYTES]:
        return _read_text(data)
    if len(data) < STL_HEADER_BYTES:
        raise GtbError(f"is not an STL file: {len(data)} bytes, and not text that begins with solid")
    held = (len(data) - STL_HEADER_BYTES) / FACET_TYPE.itemsize
    raise GtbError(f"says that it has {number} facets, and its size is that of {held:.10g}")


def _content(corners: FloatArray, half_steps: FloatArray) -> Content:
    first, labels = weld(corners)
    return Content(corners[first], labels.reshape(-1, 3), half_steps)


def _read_text(data: bytes) -> Content:
    if b"FACET" in data:
        data = data.lower()
    marks = list(_SOLID.finditer(data))
    ends = [bool(mark[1]) for mark in marks]
    if not ends or ends != [False, True] * (len(ends) // 2):
        raise GtbError("is cut off: a solid without endsolid")
    words: list[bytes] = []
    blocks: list[FloatArray] = []
    places = [*(edge for mark in marks for edge in mark.span()), len(data)]
    count = 0
    for index, (begin, end) in enumerate(zip(places[1::2], places[2::2], strict=True)):
        while begin < end:
            stop = data.find(b"endfacet", begin + CHUNK_BYTES, end)
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
    half = half_step(words, float(largest_coordinates(corners).max()))
    return _content(corners, np.full(3, half))


def _corners(words: list[bytes], before: int) -> list[bytes]:
    """The coordinates of the corners of facets, in order; `before` is the number of facets before these."""
    width = len(FACET_WORDS)
    for place, expected in enumerate(FACET_WORDS):
        column = words[place::width]
        if expected != b"0" and column.count(expected) != len(column):
            index, word = next((index, word) for index, word in enumerate(column) if word != expected)
            raise GtbError(f"facet {before + index + 1}: expected {expected.decode()}, got {shown(word)}")
    if len(words) % width:
        raise GtbError(f"facet {before + len(words) // width + 1}: is cut off after {shown(words[-1])}")
    columns = [words[place::width] for place in range(5, width) if FACET_WORDS[place] == b"0"]
    return [word for row in zip(*columns, strict=True) for word in row]
