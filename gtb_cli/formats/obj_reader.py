"""Reading Wavefront OBJ: vertices, faces, polylines (`l`, which trimesh does not read) and groups."""

from __future__ import annotations

import re
from itertools import groupby
from operator import itemgetter

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import Content, joined, triangles
from gtb_cli.formats.text import SAMPLE, float_table, floats, half_step, integer_table, integers, lines_of, shown
from gtb_cli.meshes.known import largest_coordinates

IGNORED = set(b"vn vt p s mg mtllib usemtl maplib usemap bevel c_interp d_interp lod shadow_obj trace_obj".split())
"""Keywords of what is no geometry, and of single points."""

FREE_FORM = set(b"curv curv2 surf cstype deg bmat step vp parm trim hole scrv sp end con".split())
"""Keywords of curves and surfaces that are no meshes."""

_TABLES = {b"v ": 3, b"f ": 3, b"l ": 2}
"""How lines start that are read many at once, and how many words such a line has at least."""

FEW = 3
"""Lines that are read faster one by one than as a table."""

_SLASHES = re.compile(rb"/[^ \n]*")


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
            reader.read(rows, number + 1)
            number += len(rows)
    return reader.content()


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

    def read(self, rows: list[bytes], number: int) -> None:
        """Read lines with the same first two characters; `number` is that of the first, for errors."""
        start = rows[0][:2]
        if start in (b"vn", b"vt"):
            return
        if len(rows) > FEW and start in _TABLES and self._read_table(start, rows):
            return
        for place, row in enumerate(rows, number):
            words = row.split()
            if words and not words[0].startswith(b"#"):
                try:
                    self._read_line(words[0], words[1:])
                except GtbError as error:
                    raise GtbError(f"line {place}: {error}") from None

    def _read_table(self, start: bytes, rows: list[bytes]) -> bool:
        """Read lines that are alike, all at once; say whether they are."""
        text = b"\n" + b"\n".join(rows)
        plain = text.replace(b"\n" + start, b"\n ")[1:]
        if start == b"v ":
            coordinates = float_table(plain, len(rows))
            if coordinates is None or coordinates.shape[1] < 3:
                return False
            self._add_vertices(coordinates)
            self._sample(plain[: 20 * SAMPLE].split()[:SAMPLE])
            return True
        numbers = integer_table(_SLASHES.sub(b"", plain) if b"/" in plain else plain, len(rows))
        if numbers is None or numbers.shape[1] < _TABLES[start] or not numbers.all():
            return False
        self._add_cells(start, numbers)
        return True

    def _read_line(self, keyword: bytes, words: list[bytes]) -> None:
        if keyword == b"v":
            if len(words) < 3:
                raise GtbError(f"a vertex has 3 coordinates, got {len(words)}")
            self._add_vertices(floats(words)[None, :])
            self._sample(words[:3])
        elif keyword in (b"f", b"l"):
            least = _TABLES[keyword + b" "]
            if len(words) < least:
                raise GtbError(f"{shown(keyword)} has at least {least} vertices, got {len(words)}")
            self._add_cells(keyword, integers([word.partition(b"/")[0] for word in words])[None, :])
        else:
            self._other(keyword, words)

    def _sample(self, words: list[bytes]) -> None:
        if len(self.words) < SAMPLE:
            self.words += words

    def _add_vertices(self, coordinates: FloatArray) -> None:
        self.vertices.append(coordinates[:, :3])
        self.count += len(coordinates)

    def _add_cells(self, keyword: bytes, numbers: IntArray) -> None:
        """Add faces or polylines, (rows, corners), whose vertices count from 1, or back from the last one so far."""
        if not numbers.all():
            raise GtbError("vertices are counted from 1, got 0")
        indices = np.where(numbers < 0, numbers + self.count, numbers - 1)
        if keyword[:1] == b"f":
            cells = triangles(indices)
            self.faces.append(cells)
        else:
            cells = np.stack([indices[:, :-1], indices[:, 1:]], axis=2).reshape(-1, 2)
            self.segments.append(cells)
        self.cells += len(cells)

    def _other(self, keyword: bytes, words: list[bytes]) -> None:
        if keyword in (b"g", b"o"):
            self.names.append((b" ".join(words).decode("utf-8", "replace"), self.cells))
        elif keyword in FREE_FORM:
            raise GtbError(f"{shown(keyword)}: free-form curves and surfaces are no mesh")
        elif keyword not in IGNORED:
            raise GtbError(f"unknown keyword {shown(keyword)}")

    def content(self) -> Content:
        """All of it."""
        if self.faces and self.segments:
            raise GtbError("has both faces (f) and polylines (l): expected one of them")
        vertices = np.concatenate([np.empty((0, 3)), *self.vertices])
        starts = [start for _, start in self.names] + [self.cells]
        groups = [
            (name, start, stop)
            for (name, start), stop in zip(self.names, starts[1:], strict=True)
            if name and stop > start
        ]
        half = half_step(self.words, float(largest_coordinates(vertices).max()))
        return Content(
            vertices,
            joined(self.segments, 2) if self.segments else joined(self.faces, 3),
            np.full(3, half),
            tuple(groups),
        )
