"""Reading STL, binary and text: facets, whose corners are one vertex where they are at exactly the same place."""

from __future__ import annotations

import re

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import Content, single_half_steps
from gtb_cli.formats.text import SAMPLE, floats, half_step, shown
from gtb_cli.meshes.known import largest_coordinates
from gtb_cli.meshes.welding import weld

HEADER = 84
"""Bytes before the facets of a binary file."""

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

WORDS = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
"""A facet as text; 0 stands for any number."""

CHUNK = 1 << 22
"""Bytes of text that are taken apart together."""

_SOLID = re.compile(rb"^[ \t]*(end[ \t]*)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)


def read_stl(data: bytes) -> Content:
    """Read an STL file.

    Raises
    ------
    GtbError
        It is neither a whole binary file nor text with whole facets.
    """
    number = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) >= HEADER and len(data) == HEADER + number * FACET.itemsize:
        facets = np.frombuffer(data, dtype=FACET, offset=HEADER)
        corners = facets["corners"].astype(np.float64).reshape(-1, 3)
        return _content(corners, single_half_steps(corners))
    if data[:5].lower() == b"solid" and b"\0" not in data[:HEADER]:
        return _read_text(data)
    if len(data) < HEADER:
        raise GtbError(f"is no STL file: {len(data)} bytes, and not text that begins with solid")
    held = (len(data) - HEADER) / FACET.itemsize
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
            stop = data.find(b"endfacet", begin + CHUNK, end)
            stop = end if stop < 0 else stop + len(b"endfacet")
            found = data[begin:stop].split()
            if found and index % 2:
                raise GtbError(f"expected solid, got {shown(found[0])}")
            numbers = _corners(found, count)
            count += len(numbers) // 9
            words += numbers[: max(0, SAMPLE - len(words))]
            blocks.append(floats(numbers))
            begin = stop
    corners = np.concatenate(blocks).reshape(-1, 3)
    half = half_step(words, float(largest_coordinates(corners).max()))
    return _content(corners, np.full(3, half))


def _corners(words: list[bytes], before: int) -> list[bytes]:
    """The coordinates of the corners of facets, in their order; `before` is the number of facets before these."""
    width = len(WORDS)
    for place, expected in enumerate(WORDS):
        column = words[place::width]
        if expected != b"0" and column.count(expected) != len(column):
            index, word = next((index, word) for index, word in enumerate(column) if word != expected)
            raise GtbError(f"facet {before + index + 1}: expected {expected.decode()}, got {shown(word)}")
    if len(words) % width:
        raise GtbError(f"facet {before + len(words) // width + 1}: is cut off after {shown(words[-1])}")
    columns = [words[place::width] for place in range(5, width) if WORDS[place] == b"0"]
    return [word for row in zip(*columns, strict=True) for word in row]
