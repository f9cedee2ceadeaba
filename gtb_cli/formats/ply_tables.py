"""Tables of PLY files: their description in the header, and their columns, text or binary in both byte orders."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from struct import Struct
from struct import error as StructError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import IntArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.text import SAMPLED_VERTICES, float_rows, integer_rows, integers, lines_of, shown

NUMBER_TYPES = {b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4"}
NUMBER_TYPES |= {b"float": "f4", b"double": "f8", b"int8": "i1", b"uint8": "u1", b"int16": "i2", b"uint16": "u2"}
NUMBER_TYPES |= {b"int32": "i4", b"uint32": "u4", b"float32": "f4", b"float64": "f8"}

STRUCT_LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}
"""Letters of `struct` for the types of list lengths."""

BYTE_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}

MAX_HEADER = 1 << 20
"""Largest size of a header in bytes; the longest have some thousands."""

CORNER_LISTS = ("vertex_indices", "vertex_index")
"""Possible names of a face's list of corners."""

READ_ELEMENTS = {"vertex", "face", "edge"}
"""Elements that are read; others are skipped."""


@dataclass(frozen=True)
class Property:
    """A column; `count_type` is the type of the lengths of lists."""

    name: str
    type: str
    count_type: str | None = None

    @property
    def size(self) -> int:
        """Number of bytes of a number."""
        return int(self.type[1:])


@dataclass
class Element:
    """A table of the file: its description in the header, and later its columns.

    A list column is the concatenated numbers of all rows, with the length of each row.
    """

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)
    scalars: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    lists: dict[str, list[tuple[NDArray[Any], IntArray]]] = field(default_factory=dict)

    def column(self, name: str) -> NDArray[Any]:
        """All numbers of a property that is not a list."""
        if self.type_of(name) is None:
            raise GtbError(f"element {self.name}: has no property {name}")
        return np.concatenate([np.empty(0, dtype=np.uint8), *self.scalars.get(name, [])])

    def type_of(self, name: str) -> str | None:
        """The type of a property that is not a list; None if there is no such property."""
        return next((item.type for item in self.properties if item.name == name and item.count_type is None), None)

    def whole(self, name: str) -> NDArray[Any]:
        """All numbers of a property of indices, which must be whole."""
        column = self.column(name)
        if (self.type_of(name) or "").startswith("f"):
            raise GtbError(f"{name}: expected whole numbers, got {self.type_of(name)}")
        return column.astype(np.int64)


def read_header(data: bytes) -> tuple[list[Element], str, int]:
    """Return the elements, the byte order (empty for text), and the offset of the data."""
    if not data.startswith((b"ply\n", b"ply\r")):
        raise GtbError("is not a PLY file: it does not begin with ply")
    end = data.find(b"end_header", 0, MAX_HEADER)
    stop = min((place for sign in (b"\n", b"\r") if (place := data.find(sign, end)) >= 0), default=-1)
    if end < 0 or stop < 0:
        raise GtbError("is cut off: no end_header")
    if data[stop : stop + 2] == b"\r\n":
        stop += 1
    order: str | None = None
    elements: list[Element] = []
    tables: set[str] = set()
    columns: set[str] = set()
    for number, line in enumerate(data[:end].splitlines()[1:], 2):
        words = line.split()
        if not words or words[0] in (b"comment", b"obj_info"):
            continue
        try:
            if words[0] == b"format" and len(words) == 3 and words[1] in BYTE_ORDERS:
                order = BYTE_ORDERS[words[1]]
            elif words[0] == b"element" and len(words) == 3:
                elements.append(Element(_name(words[1]), _count(words[2])))
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
    """Refuse a second element, or a second property of an element, with the same name: columns would be mixed up."""
    if name in known:
        raise GtbError(f"{name} occurs twice")
    known.add(name)


def _name(word: bytes) -> str:
    return word.decode("utf-8", "replace")


def _count(word: bytes) -> int:
    count = int(integers([word])[0])
    if count < 0:
        raise GtbError(f"a number of rows is not negative, got {count}")
    return count


def _property(words: Sequence[bytes]) -> Property:
    types = words[1:3] if words[:1] == [b"list"] else words[:1]
    if len(words) != (4 if len(types) == 2 else 2):
        raise GtbError("expected property TYPE NAME or property list TYPE TYPE NAME")
    for word in types:
        if word not in NUMBER_TYPES:
            raise GtbError(f"unknown type {shown(word)}")
    if len(types) == 1:
        return Property(_name(words[1]), NUMBER_TYPES[types[0]])
    if NUMBER_TYPES[types[0]].startswith("f"):
        raise GtbError(f"the length of a list is a whole number, not {shown(types[0])}")
    return Property(_name(words[3]), NUMBER_TYPES[types[1]], NUMBER_TYPES[types[0]])


def read_binary(data: bytes, start: int, element: Element, order: str) -> int:
    """Read the rows of an element; return the offset of their end."""
    if not element.count or not element.properties:
        return start
    lengths = _lengths(data, start, element, order)
    fields: list[tuple[Any, ...]] = []
    for index, (item, length) in enumerate(zip(element.properties, lengths, strict=True)):
        if item.count_type is not None:
            fields.append((f"count{index}", order + item.count_type))
        fields.append((f"value{index}", order + item.type, () if length is None else (length,)))
    row = np.dtype(fields)
    rows = np.frombuffer(data, dtype=row, offset=start, count=min(element.count, (len(data) - start) // row.itemsize))
    listed = [(index, item) for index, item in enumerate(element.properties) if item.count_type is not None]
    if all((rows[f"count{index}"] == lengths[index]).all() for index, _ in listed) and len(rows) == element.count:
        # The rows of most files have the same length; their columns are then views of the file.
        for index, (item, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if length is None:
                element.scalars[item.name] = [rows[f"value{index}"]]
            elif item.name in CORNER_LISTS:
                element.lists[item.name] = [(rows[f"value{index}"].ravel(), np.full(len(rows), length))]
        return start + element.count * row.itemsize
    if not listed:
        raise GtbError(_cut_off(element, len(rows)))
    return _read_uneven(data, start, element, order)


def _read_uneven(data: bytes, start: int, element: Element, order: str) -> int:
    """Read rows whose lists have different lengths: first where each list begins, then all numbers at once."""
    plan: list[tuple[int, Struct, int]] = []
    passed = 0
    for item in element.properties:
        if item.count_type is None:
            passed += item.size
        else:
            plan.append((passed, Struct(order + STRUCT_LETTERS[item.count_type]), item.size))
            passed = 0
    begins, counts = array("q"), array("q")
    kept = element.name in READ_ELEMENTS
    place = start
    for row in range(element.count):
        try:
            for before, length, size in plan:
                place += before
                (count,) = length.unpack_from(data, place)
                place += length.size
                if kept:
                    begins.append(place)
                    counts.append(count)
                if count < 0:
                    raise GtbError(_cut_off(element, row))
                place += count * size
            place += passed
        except StructError:
            place = len(data) + 1
        if place > len(data):
            raise GtbError(_cut_off(element, row))
    if not kept:
        return place
    content = np.frombuffer(data, dtype=np.uint8)
    begin, count = (np.frombuffer(column, dtype=np.int64).reshape(-1, len(plan)) for column in (begins, counts))
    at, index = begin[:, 0] - plan[0][1].size - plan[0][0], -1
    for item in element.properties:
        if item.count_type is None:
            element.scalars[item.name] = [content[at[:, None] + np.arange(item.size)].view(order + item.type)[:, 0]]
            at = at + item.size
            continue
        index += 1
        sizes = count[:, index] * item.size
        if item.name in CORNER_LISTS:
            own = _between(content, begin[:, index], sizes).view(order + item.type)
            element.lists[item.name] = [(own, count[:, index])]
        at = begin[:, index] + sizes
    return place


def _between(values: NDArray[Any], begin: IntArray, count: IntArray) -> NDArray[Any]:
    """The values in successive ranges that do not overlap."""
    begin, end = (column[count > 0] for column in (begin, begin + count))
    inside = np.zeros(len(values) + 1, dtype=np.int8)
    inside[begin] += 1
    inside[end] -= 1
    np.cumsum(inside, out=inside)
    return np.asarray(values[inside[:-1].view(bool)])


def _lengths(data: bytes, start: int, element: Element, order: str) -> list[int | None]:
    """The lengths of the lists in the row that begins at `start`; None for scalars."""
    lengths: list[int | None] = []
    for item in element.properties:
        if item.count_type is None:
            lengths.append(None)
            start += item.size
            continue
        width = int(item.count_type[1:])
        if start + width > len(data):
            raise GtbError(_cut_off(element, None))
        length = int(np.frombuffer(data, dtype=order + item.count_type, offset=start, count=1)[0])
        start += width + length * item.size
        if length < 0 or start > len(data):
            raise GtbError(_cut_off(element, None))
        lengths.append(length)
    return lengths


def _cut_off(element: Element, row: int | None) -> str:
    place = "" if row is None else f", the file ends in row {row}"
    return f"is cut off: element {element.name} has {element.count} rows{place}"


def read_text(data: bytes, start: int, elements: Sequence[Element]) -> list[bytes]:
    """Read all elements, one row per line; return the words of some coordinates."""
    rows = _Rows(data, start)
    sample: list[bytes] = []
    for element in elements:
        left = element.count
        while left and element.properties:
            block = rows.take(left)
            if not block:
                raise GtbError(_cut_off(element, element.count - left))
            left -= len(block)
            try:
                _read_rows(block, element)
            except GtbError as error:
                raise GtbError(f"element {element.name}: {error}") from None
            if element.name == "vertex":
                wanted = max(0, SAMPLED_VERTICES - len(sample) // 3)
                sample += [word for row in block[:wanted] for word in row.split()[:3]]
    extra = rows.take(1)
    if extra:
        raise GtbError(f"has more than its header says: {_shown_row(extra[0])}")
    return sample


class _Rows:
    """The non-empty lines, taken in order."""

    def __init__(self, data: bytes, start: int) -> None:
        self.blocks = lines_of(data, start)
        self.waiting: list[bytes] = []
        self.place = 0

    def take(self, most: int) -> list[bytes]:
        """The next rows: at least one, if any is left."""
        while self.place == len(self.waiting):
            _, lines = next(self.blocks, (0, None))
            if lines is None:
                return []
            self.waiting, self.place = [line for line in lines if line and not line.isspace()], 0
        found = self.waiting[self.place : self.place + most]
        self.place += len(found)
        return found


def _read_rows(rows: list[bytes], element: Element) -> None:
    """Read rows, column by column for all of them together."""
    has_fractions = any(item.type.startswith("f") for item in element.properties)
    numbers, widths = (float_rows if has_fractions else integer_rows)(b"\n".join(rows))
    ends = np.cumsum(widths)
    place = ends - widths

    def check(wrong: NDArray[np.bool_], what: str) -> None:
        if wrong.any():
            raise GtbError(f"{what}: {_shown_row(rows[int(wrong.argmax())])}")

    def column(is_whole: bool) -> NDArray[Any]:
        check(place >= ends, "a row has too few numbers")
        values = numbers[place]
        if is_whole and has_fractions:
            check(values != np.floor(values), "expected a whole number")
        return np.asarray(values.astype(np.int64) if is_whole else values)

    for item in element.properties:
        if item.count_type is None:
            element.scalars.setdefault(item.name, []).append(column(not item.type.startswith("f")))
            place = place + 1
            continue
        counts = column(True)
        check((counts < 0) | (counts > ends - place - 1), "a row has too few numbers")
        if item.name in CORNER_LISTS:
            own = _between(numbers, place + 1, counts)
            element.lists.setdefault(item.name, []).append((own, counts))
        place = place + 1 + counts
    check(place != ends, "a row has too many numbers")


def _shown_row(row: bytes) -> str:
    return shown(b" ".join(row.split()))
