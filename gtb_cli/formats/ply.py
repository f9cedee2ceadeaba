"""Reading PLY, text and binary of both byte orders: vertices, faces, and edges (which trimesh does not read)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import IntArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import Content, joined, single_half_steps, triangles, whole
from gtb_cli.formats.text import SAMPLE, floats, half_step, integers, lines_of, shown
from gtb_cli.meshes.known import largest_coordinates

TYPES = {b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4"}
TYPES |= {b"float": "f4", b"double": "f8", b"int8": "i1", b"uint8": "u1", b"int16": "i2", b"uint16": "u2"}
TYPES |= {b"int32": "i4", b"uint32": "u4", b"float32": "f4", b"float64": "f8"}

ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}

MAX_HEADER = 1 << 20
"""Bytes; the longest headers have some thousands."""

LISTS = ("vertex_indices", "vertex_index")
"""Names of a face's list of corners."""


@dataclass
class _Property:
    name: str
    type: str
    count_type: str | None = None
    """Of a list: the type of its length."""


@dataclass
class _Element:
    """A table of the file: what the header says of it, and then its columns."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)
    scalars: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    lists: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    """Rows of the same length together, (rows, length)."""

    def add(self, item: _Property, values: NDArray[Any]) -> None:
        columns = self.scalars if item.count_type is None else self.lists
        columns.setdefault(item.name, []).append(values)

    def column(self, name: str) -> NDArray[Any]:
        if name not in (item.name for item in self.properties if item.count_type is None):
            raise GtbError(f"element {self.name}: has no property {name}")
        return np.concatenate([np.empty(0, dtype=np.uint8), *self.scalars.get(name, [])])

    def type_of(self, name: str) -> str:
        return next(item.type for item in self.properties if item.name == name)


def read_ply(data: bytes) -> Content:
    """Read a PLY file: the elements `vertex` (x, y, z), `face` (a list of corners) and `edge` (vertex1, vertex2).

    Raises
    ------
    GtbError
        The header is wrong, or the file does not have what it says.
    """
    elements, order, start = _header(data)
    if order:
        for element in elements:
            start = _read_binary(data, start, element, order)
        if data[start:].strip():
            raise GtbError(f"has {len(data) - start} bytes more than its header says")
        sample: list[bytes] = []
    else:
        sample = _read_text(data, start, elements)
    tables = {element.name: element for element in elements}
    if "vertex" not in tables:
        raise GtbError("has no element vertex")
    vertex = tables["vertex"]
    vertices = np.stack([vertex.column(axis).astype(np.float64) for axis in "xyz"], axis=1)
    half_steps = np.full(3, half_step(sample, float(largest_coordinates(vertices).max())))
    if any(vertex.type_of(axis) == "f4" for axis in "xyz"):
        half_steps = np.maximum(half_steps, single_half_steps(vertices))
    return Content(vertices, _cells(tables), half_steps)


def _cells(tables: dict[str, _Element]) -> IntArray:
    face, edge = tables.get("face"), tables.get("edge")
    faces: list[IntArray] = []
    if face is not None and face.count:
        name = next((name for name in LISTS if name in face.lists), None)
        if name is None:
            raise GtbError(f"element face: has no list {LISTS[0]}")
        for corners in face.lists[name]:
            if corners.shape[1] < 3:
                raise GtbError(f"element face: a face has at least 3 corners, got {corners.shape[1]}")
            faces.append(triangles(whole(corners, name)))
    if edge is None or not edge.count:
        return joined(faces, 3)
    if faces:
        raise GtbError("has both faces and edges: expected one of them")
    return np.stack([whole(edge.column(name), name) for name in ("vertex1", "vertex2")], axis=1)


def _header(data: bytes) -> tuple[list[_Element], str, int]:
    """The elements, the byte order (empty: text), and where the data start."""
    if not data.startswith((b"ply\n", b"ply\r")):
        raise GtbError("is no PLY file: it does not begin with ply")
    end = data.find(b"end_header", 0, MAX_HEADER)
    stop = min((place for sign in (b"\n", b"\r") if (place := data.find(sign, end)) >= 0), default=-1)
    if end < 0 or stop < 0:
        raise GtbError("is cut off: no end_header")
    if data[stop : stop + 2] == b"\r\n":
        stop += 1
    order: str | None = None
    elements: list[_Element] = []
    tables: set[str] = set()
    columns: set[str] = set()
    for number, line in enumerate(data[:end].splitlines()[1:], 2):
        words = line.split()
        if not words or words[0] in (b"comment", b"obj_info"):
            continue
        try:
            if words[0] == b"format" and len(words) == 3 and words[1] in ORDERS:
                order = ORDERS[words[1]]
            elif words[0] == b"element" and len(words) == 3:
                elements.append(_Element(_name(words[1]), _count(words[2])))
                columns = set()
                _note(elements[-1].name, tables)
            elif words[0] == b"property" and elements:
                elements[-1].properties.append(_property(words[1:]))
                _note(elements[-1].properties[-1].name, columns)
            else:
                raise GtbError(f"cannot be read: {shown(line)}")
        except GtbError as error:
            raise GtbError(f"line {number}: {error}") from None
    if order is None:
        raise GtbError("has no line format in its header")
    return elements, order, stop + 1


def _note(name: str, known: set[str]) -> None:
    """Refuse a second element, or a second property of an element, of one name: their columns would be mixed up."""
    if name in known:
        raise GtbError(f"{name} is there twice")
    known.add(name)


def _name(word: bytes) -> str:
    return word.decode("utf-8", "replace")


def _count(word: bytes) -> int:
    count = int(integers([word])[0])
    if count < 0:
        raise GtbError(f"a number of rows is not negative, got {count}")
    return count


def _property(words: Sequence[bytes]) -> _Property:
    types = words[1:3] if words[:1] == [b"list"] else words[:1]
    if len(words) != (4 if len(types) == 2 else 2):
        raise GtbError("expected property TYPE NAME or property list TYPE TYPE NAME")
    for word in types:
        if word not in TYPES:
            raise GtbError(f"unknown type {shown(word)}")
    if len(types) == 1:
        return _Property(_name(words[1]), TYPES[types[0]])
    if TYPES[types[0]].startswith("f"):
        raise GtbError(f"the length of a list is a whole number, not {shown(types[0])}")
    return _Property(_name(words[3]), TYPES[types[1]], TYPES[types[0]])


def _read_binary(data: bytes, start: int, element: _Element, order: str) -> int:
    """Read the rows of an element; return where they end."""
    left = element.count
    window = left
    while left:
        # Rows whose lists are as long as the first one's, all at once; a file of triangles is a single such block.
        # Where they end early, fewer are looked at next: else the time would go with the square of the rows.
        lengths = _lengths(data, start, element, order)
        row = np.dtype(
            [
                entry
                for index, (item, length) in enumerate(zip(element.properties, lengths, strict=True))
                for entry in _fields(index, item, length, order)
            ]
        )
        if not row.itemsize:
            return start
        rows = np.frombuffer(
            data, dtype=row, offset=start, count=min(left, window, (len(data) - start) // row.itemsize)
        )
        same = np.ones(len(rows), dtype=bool)
        for index, (item, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if item.count_type is not None:
                same &= rows[f"count{index}"] == length
        count = int(same.argmin()) if not same.all() else len(rows)
        if not count:
            raise GtbError(_cut_off(element, element.count - left))
        for index, (item, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if length is None or length > 0:
                element.add(item, rows[f"value{index}"][:count])
            else:
                element.add(item, np.empty((count, 0), dtype=item.type))
        start, left = start + count * row.itemsize, left - count
        window = max(2 * window, 64) if count == len(rows) else 2 * count
        if not element.properties:
            break
    return start


def _fields(index: int, item: _Property, length: int | None, order: str) -> Iterator[tuple[Any, ...]]:
    """How a property lies in a row."""
    if item.count_type is not None:
        yield f"count{index}", order + item.count_type
    if length is None:
        yield f"value{index}", order + item.type
    elif length > 0:
        yield f"value{index}", order + item.type, (length,)


def _lengths(data: bytes, start: int, element: _Element, order: str) -> list[int | None]:
    """Lengths of the lists of the row that starts somewhere; None for scalars."""
    lengths: list[int | None] = []
    for item in element.properties:
        if item.count_type is None:
            lengths.append(None)
            start += np.dtype(item.type).itemsize
            continue
        size = np.dtype(item.count_type).itemsize
        if start + size > len(data):
            raise GtbError(_cut_off(element, None))
        length = int(np.frombuffer(data, dtype=order + item.count_type, offset=start, count=1)[0])
        start += size + length * np.dtype(item.type).itemsize
        if length < 0 or start > len(data):
            raise GtbError(_cut_off(element, None))
        lengths.append(length)
    return lengths


def _cut_off(element: _Element, row: int | None) -> str:
    place = "" if row is None else f", the file ends in row {row}"
    return f"is cut off: element {element.name} has {element.count} rows{place}"


def _read_text(data: bytes, start: int, elements: Sequence[_Element]) -> list[bytes]:
    """Read all elements; return words of coordinates."""
    rows = _rows(data, start)
    sample: list[bytes] = []
    for element in elements:
        left = element.count
        block: list[list[bytes]] = []
        while left and element.properties:
            block = rows.take(left)
            if not block:
                raise GtbError(_cut_off(element, element.count - left))
            left -= len(block)
            try:
                _read_rows(block, element)
            except GtbError as error:
                raise GtbError(f"element {element.name}: {error}") from None
            if element.name == "vertex" and len(sample) < SAMPLE:
                sample += [word for row in block for word in row[:3]]
    extra = rows.take(1)
    if extra:
        raise GtbError(f"has more than its header says: {shown(b' '.join(extra[0]))}")
    return sample


class _rows:
    """The words of the lines that are not empty, to be taken in order."""

    def __init__(self, data: bytes, start: int) -> None:
        self.blocks = lines_of(data, start)
        self.waiting: list[list[bytes]] = []
        self.place = 0

    def take(self, most: int) -> list[list[bytes]]:
        """The next rows: at least one, if there is one."""
        while self.place == len(self.waiting):
            _, lines = next(self.blocks, (0, None))
            if lines is None:
                return []
            self.waiting, self.place = [words for words in map(bytes.split, lines) if words], 0
        found = self.waiting[self.place : self.place + most]
        self.place += len(found)
        return found


def _read_rows(rows: list[list[bytes]], element: _Element) -> None:
    """Read rows, all at once where they are alike."""
    found: list[tuple[_Property, NDArray[Any]]] = []
    width, place = len(rows[0]), 0
    alike = all(len(row) == width for row in rows)
    if alike:
        columns = list(zip(*rows, strict=True))
        for item in element.properties:
            length = 1
            if item.count_type is not None:
                counts = integers(columns[place]) if place < width else np.zeros(0, dtype=np.int64)
                alike = bool(len(counts)) and bool((counts == counts[0]).all())
                if not alike:
                    break
                length, place = int(counts[0]), place + 1
            if length < 0 or place + length > width:
                raise GtbError(f"a row has too few numbers: {shown(b' '.join(rows[0]))}")
            read = floats if item.type.startswith("f") else integers
            together = np.zeros((len(rows), length), dtype=np.float64 if read is floats else np.int64)
            for k in range(length):
                together[:, k] = read(columns[place + k])
            found.append((item, together[:, 0] if item.count_type is None else together))
            place += length
        if alike and place != width:
            raise GtbError(f"a row has too many numbers: {shown(b' '.join(rows[0]))}")
    if alike:
        for item, numbers in found:
            element.add(item, numbers)
    elif len(rows) == 1:
        raise GtbError(f"a row has too few numbers: {shown(b' '.join(rows[0]))}")
    else:
        for row in rows:
            _read_rows([row], element)
