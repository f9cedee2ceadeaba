"""Tables of PLY files: their description in the header, and their columns, text or binary in both byte orders."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from struct import Struct, unpack_from
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import IntArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.text import SAMPLED_VERTICES, float_rows, integer_rows, integers, lines_of, shown

CORNER_LISTS = ("vertex_indices", "vertex_index")  # possible names of a face's list of corners


@dataclass(frozen=True)
class Property:
    """A column; `type` is numpy's name of its numbers, and `count_type` that of the lengths of lists."""

    name: str
    type: str
    count_type: str | None = None


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
        """Return all numbers of a property that is not a list."""
        if self.type_of(name) is None:
            raise GtbError(f"element {self.name}: has no property {name}")
        return np.concatenate([np.empty(0, dtype=np.uint8), *self.scalars.get(name, [])])

    def type_of(self, name: str) -> str | None:
        """Return the type of a property that is not a list; None if there is no such property."""
        return next((item.type for item in self.properties if item.name == name and item.count_type is None), None)

    def whole(self, name: str) -> NDArray[Any]:
        """Return all numbers of a property of indices, which must be whole."""
        column = self.column(name)
        if (self.type_of(name) or "").startswith("f"):
            raise GtbError(f"{name}: expected whole numbers, got {self.type_of(name)}")
        return column.astype(np.int64)

    def add(self, numbers: NDArray[Any], widths: IntArray, rows: Sequence[bytes] | None = None) -> None:
        """Add rows to the columns.

        Parameters
        ----------
        numbers : (c,) int or float
            The numbers of all rows, one row after another; the length of a list stands before its numbers.
        widths : (k,) int
            How many each row has.
        rows : sequence of bytes, optional
            The rows as text, for errors. Others have been checked.

        Raises
        ------
        GtbError
            A row has too few numbers, too many, or one that is not whole.
        """
        ends = np.cumsum(widths)
        place = ends - widths

        def check(wrong: NDArray[np.bool_], what: str) -> None:
            if rows is not None and wrong.any():
                raise GtbError(f"{what}: {_shown_row(rows[int(wrong.argmax())])}")

        def whole(values: NDArray[Any], of: IntArray) -> NDArray[Any]:
            if values.dtype.kind != "f":
                return values
            wrong = np.zeros(len(ends), dtype=bool)
            wrong[of[values != np.floor(values)]] = True
            check(wrong, "expected a whole number")
            return values.astype(np.int64)

        every = np.arange(len(ends))
        for item in self.properties:
            check(place >= ends, "a row has too few numbers")
            values = numbers[place]
            place = place + 1
            if item.count_type is None:
                values = values if item.type.startswith("f") else whole(values, every)
                self.scalars.setdefault(item.name, []).append(values)
                continue
            counts = whole(values, every)
            check((counts < 0) | (counts > ends - place), "a row has too few numbers")
            if item.name in CORNER_LISTS:
                corners = _between(numbers, place, counts)
                corners = corners if item.type.startswith("f") else whole(corners, np.repeat(every, counts))
                self.lists.setdefault(item.name, []).append((corners, counts))
            place = place + counts
        check(place != ends, "a row has too many numbers")


def read_header(data: bytes) -> tuple[list[Element], str, int]:
    """Return the elements, the byte order (empty for text), and the offset of the data."""
    orders = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
    if not data.startswith((b"ply\n", b"ply\r")):
        raise GtbError("is not a PLY file: it does not begin with ply")
    end = data.find(b"end_header", 0, 1 << 20)  # the longest headers have some thousands of bytes
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
            if words[0] == b"format" and len(words) == 3 and words[1] in orders:
                order = orders[words[1]]
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
    known = {b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4"}
    known |= {b"int8": "i1", b"uint8": "u1", b"int16": "i2", b"uint16": "u2", b"int32": "i4", b"uint32": "u4"}
    known |= {b"float": "f4", b"double": "f8", b"float32": "f4", b"float64": "f8"}
    types = words[1:3] if words[:1] == [b"list"] else words[:1]
    if len(words) != (4 if len(types) == 2 else 2):
        raise GtbError("expected property TYPE NAME or property list TYPE TYPE NAME")
    for word in types:
        if word not in known:
            raise GtbError(f"unknown type {shown(word)}")
    if len(types) == 1:
        return Property(_name(words[1]), known[types[0]])
    if known[types[0]].startswith("f"):
        raise GtbError(f"the length of a list is a whole number, not {shown(types[0])}")
    return Property(_name(words[3]), known[types[1]], known[types[0]])


def read_binary(data: bytes, start: int, element: Element, order: str) -> int:
    """Read the rows of an element; return the offset of their end.

    The rows of most files have the same length: their columns are then views of the file. Others are read one by one.
    """
    if not element.count or not element.properties:
        return start
    numbers, widths = array("d"), array("q")
    plan = [
        (np.dtype(item.type).char, np.dtype(item.type).itemsize, _length_of_list(item, order))
        for item in element.properties
    ]

    def read_row(number: int, place: int) -> tuple[list[int], int]:
        """Append the numbers of a row; return how many each property has, and the offset of the row's end."""
        before, lengths = len(numbers), []
        for letter, size, length in plan:
            count = 1
            if length and place + length.size <= len(data):
                (count,) = length.unpack_from(data, place)
                numbers.append(count)
            place += length.size if length else 0
            if count < 0 or place + count * size > len(data):
                raise GtbError(_cut_off(element, number))
            numbers.extend(unpack_from(f"{order}{count}{letter}", data, place))
            place += count * size
            lengths.append(count)
        widths.append(len(numbers) - before)
        return lengths, place

    lengths, place = read_row(0, start)
    fields: list[tuple[Any, ...]] = []
    for index, (item, count) in enumerate(zip(element.properties, lengths, strict=True)):
        if item.count_type is not None:
            fields.append((f"count{index}", order + item.count_type))
        fields.append((f"value{index}", order + item.type, () if item.count_type is None else (count,)))
    row = np.dtype(fields)
    rows = np.frombuffer(data, dtype=row, offset=start, count=min(element.count, (len(data) - start) // row.itemsize))
    listed = [index for index, item in enumerate(element.properties) if item.count_type is not None]
    even = all((rows[f"count{index}"] == lengths[index]).all() for index in listed)
    if len(rows) < element.count and not listed:
        raise GtbError(_cut_off(element, len(rows)))
    if even and len(rows) == element.count:
        for index, (item, count) in enumerate(zip(element.properties, lengths, strict=True)):
            if item.count_type is None:
                element.scalars[item.name] = [rows[f"value{index}"]]
            elif item.name in CORNER_LISTS:
                element.lists[item.name] = [(rows[f"value{index}"].ravel(), np.full(len(rows), count))]
        return start + element.count * row.itemsize
    for number in range(1, element.count):
        _, place = read_row(number, place)
    element.add(np.frombuffer(numbers), np.frombuffer(widths, dtype=np.int64))
    return place


def _length_of_list(item: Property, order: str) -> Struct | None:
    return None if item.count_type is None else Struct(order + np.dtype(item.count_type).char)


def _between(values: NDArray[Any], begin: IntArray, count: IntArray) -> NDArray[Any]:
    """Return the values in successive ranges that do not overlap."""
    begin, end = (column[count > 0] for column in (begin, begin + count))
    inside = np.zeros(len(values) + 1, dtype=np.int8)
    inside[begin] += 1
    inside[end] -= 1
    np.cumsum(inside, out=inside)
    return np.asarray(values[inside[:-1].view(bool)])


def _cut_off(element: Element, row: int) -> str:
    return f"is cut off: element {element.name} has {element.count} rows, the file ends in row {row}"


def read_text(data: bytes, start: int, elements: Sequence[Element]) -> list[bytes]:
    """Read all elements, one row per line; return the words of some coordinates."""
    most = 1 << 16  # rows that are read together
    rows = (line for _, lines in lines_of(data, start) for line in lines if line and not line.isspace())
    sample: list[bytes] = []
    for element in elements:
        left = element.count if element.properties else 0
        has_fractions = any(item.type.startswith("f") for item in element.properties)
        while left:
            block = list(islice(rows, min(left, most)))
            if not block:
                raise GtbError(_cut_off(element, element.count - left))
            left -= len(block)
            try:
                numbers, widths = (float_rows if has_fractions else integer_rows)(b"\n".join(block))
                element.add(numbers, widths, block)
            except GtbError as error:
                raise GtbError(f"element {element.name}: {error}") from None
            if element.name == "vertex":
                wanted = max(0, SAMPLED_VERTICES - len(sample) // 3)
                sample += [word for row in block[:wanted] for word in row.split()[:3]]
    extra = next(rows, None)
    if extra is not None:
        raise GtbError(f"has more than its header says: {_shown_row(extra)}")
    return sample


def _shown_row(row: bytes) -> str:
    return shown(b" ".join(row.split()))
