"""Reading Wavefront OBJ: vertices, faces, polylines (`l`, which trimesh does not read) and groups."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import groupby
from operator import itemgetter

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError
from gtb_cli.meshfiles.content import Content, joined, largest_coordinates, triangles
from gtb_cli.meshfiles.text import SAMPLE, floats, half_step, integers, lines_of, shown

IGNORED = set(
    b"vn vt p s mg mtllib usemtl maplib usemap bevel c_interp d_interp lod shadow_obj trace_obj".split()
)
"""Keywords of what is no geometry, and of single points."""

FREE_FORM = set(b"curv curv2 surf cstype deg bmat step vp parm trim hole scrv sp end con".split())
"""Keywords of curves and surfaces that are no meshes."""

_SLASHES = re.compile(rb"/\S*")


def read_obj(data: bytes) -> Content:
    """Read an OBJ file.

    Vertices keep their order. A face of more than three corners is cut into triangles. A reference `v/vt/vn` is that to
    its vertex; negative ones count back from the last vertex so far.

    Raises
    ------
    GtbError
        With the number of the line.
    """
    if b"\\\n" in data or b"\\\r\n" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    reader = _Reader()
    for start, lines in lines_of(data):
        number = start
        for _, run in groupby(lines, key=itemgetter(slice(0, 2))):
            rows = list(run)
            try:
                reader.read(rows)
            except GtbError as error:
                raise GtbError(f"line {_line_of(reader, rows, number)}: {error}") from None
            number += len(rows)
    return reader.content()


def _line_of(reader: _Reader, rows: list[bytes], first: int) -> int:
    """Number of the first line with an error, found by reading them one by one."""
    for number, row in enumerate(rows):
        try:
            reader.read([row])
        except GtbError:
            return first + number + 1
    return first + len(rows)


class _Reader:
    """What was read so far."""

    def __init__(self) -> None:
        self.vertices: list[FloatArray] = []
        self.count = 0
        self.words: list[bytes] = []
        self.faces: list[IntArray] = []
        self.segments: list[IntArray] = []
        self.names: list[tuple[str, int]] = []
        self.cells = 0

    def read(self, rows: list[bytes]) -> None:
        """Read lines with the same first two characters."""
        text = b" \n".join(rows)
        words = text.split()
        if not words or rows[0].lstrip()[:1] == b"#":
            if len(rows) > 1 and rows[0][:1] != b"#":  # blanks, and then different things
                for row in rows:
                    self.read([row])
            return
        keyword = words[0]
        take = self._takers.get(keyword)
        if take is not None:
            width = _width(words, len(rows), keyword)
            if width:
                take(self, [word for k in range(1, width) for word in words[k::width]], width - 1)
                return
            if len(rows) == 1:
                take(self, words[1:], len(words) - 1)
                return
        elif len(rows) == 1:
            self._other(keyword, words)
            return
        for row in rows:
            self.read([row])

    def _vertex(self, words: list[bytes], width: int) -> None:
        if width < 3:
            raise GtbError(f"a vertex has 3 coordinates, got {width}")
        rows = len(words) // width
        coordinates = words[: 3 * rows]
        self.vertices.append(floats(coordinates).reshape(3, rows).T)
        self.count += rows
        self.words += coordinates[: max(0, SAMPLE - len(self.words))]

    def _face(self, words: list[bytes], width: int) -> None:
        if width < 3:
            raise GtbError(f"a face has at least 3 corners, got {width}")
        corners = triangles(self._references(words, width))
        self.faces.append(corners)
        self.cells += len(corners)

    def _line(self, words: list[bytes], width: int) -> None:
        if width < 2:
            raise GtbError(f"a line has at least 2 points, got {width}")
        points = self._references(words, width)
        pairs = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2)
        self.segments.append(pairs)
        self.cells += len(pairs)

    def _references(self, words: list[bytes], width: int) -> IntArray:
        """Indices of vertices, (lines, width), from words that are ordered by columns."""
        text = b" ".join(words)
        if b"/" in text:
            words = _SLASHES.sub(b"", text).split()
            if len(words) * 1 != text.count(b" ") + 1:
                raise GtbError("a reference without the number of a vertex")
        numbers = integers(words).reshape(width, -1).T
        if (numbers == 0).any():
            raise GtbError("vertices are counted from 1, got 0")
        return np.where(numbers < 0, numbers + self.count, numbers - 1)

    def _other(self, keyword: bytes, words: list[bytes]) -> None:
        if keyword in (b"g", b"o"):
            name = b" ".join(words[1:]).decode("utf-8", "replace")
            self.names.append((name, self.cells))
        elif keyword in FREE_FORM:
            raise GtbError(f"{shown(keyword)}: free-form curves and surfaces are no mesh")
        elif keyword not in IGNORED:
            raise GtbError(f"unknown keyword {shown(keyword)}")

    _takers: dict[bytes, Callable[[_Reader, list[bytes], int], None]] = {b"v": _vertex, b"f": _face, b"l": _line}

    def content(self) -> Content:
        """All of it."""
        if self.faces and self.segments:
            raise GtbError("has both faces (f) and polylines (l): expected one of them")
        vertices = np.concatenate([np.empty((0, 3)), *self.vertices])
        starts = [start for _, start in self.names] + [self.cells]
        groups = [
            (name, start, stop) for (name, start), stop in zip(self.names, starts[1:], strict=True) if name and stop > start
        ]
        half = half_step(self.words, float(largest_coordinates(vertices).max()))
        return Content(
            vertices,
            joined(self.segments, 2) if self.segments else joined(self.faces, 3),
            np.full(3, half),
            tuple(groups),
        )


def _width(words: list[bytes], rows: int, keyword: bytes) -> int:
    """Number of words on each line, if it is the same and all begin with the keyword, else 0."""
    width, rest = divmod(len(words), rows)
    same = not rest and words[0::width].count(keyword) == rows
    return width if same else 0
