"""PLY, both ways: vertices, faces, and edges (which trimesh does not read); text, and binary in both byte orders."""

import os
import re
from array import array
from collections.abc import Container, Iterator, Mapping
from functools import partial
from itertools import islice
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import BoolArray, FloatArray, IntArray
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.file_arrays import SINGLE_FLOAT, FileArrays, mark_of, single_half_steps, unreserved
from gtb_cli.formats.numbers_read import half_step, lines_of, number_rows, padded, sampled, shown
from gtb_cli.formats.numbers_written import text_rows
from gtb_cli.formats.polygons import polygons_of, triangles
from gtb_cli.meshes.mesh import ABSENT, LIBRARIES, MARKED, NORMALS, OTHER, TEXTURE, Mesh, Values
from gtb_cli.vocabulary import plain_name

POLYGONS = "vertex_indices", "vertex_index"  # names of the corners of faces: the first of them in a file


def ply_blocks(mesh: Mesh, uv: FloatArray | None, attributes: Mapping[str, FloatArray], ascii: bool) -> Iterator[bytes]:
    """Yield a PLY file: text with numbers that read back exactly, or binary with 32-bit numbers, as trimesh does."""
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    if (normals := mesh.vertex_normals) is not None:
        columns |= zip(("nx", "ny", "nz"), normals.T, strict=True)
    if uv is not None:
        columns |= zip("st", uv.T, strict=True)
    columns |= attributes
    table = np.column_stack(list(columns.values()))
    encoding, number = ("ascii", "double") if ascii else ("binary_little_endian", "float")
    source = [] if ascii or mesh.is_curve else ["comment https://github.com/mikedh/trimesh"]
    lines = ["ply", f"format {encoding} 1.0", *source, f"element vertex {len(table)}"]
    lines += [f"property {number} {name}" for name in columns]
    if mesh.is_curve:
        lines += [f"element edge {len(mesh.cells)}", "property int vertex1", "property int vertex2"]
    else:
        lines += [f"element face {len(mesh.cells)}", "property list uchar int vertex_indices"]
    yield "".join(f"{line}\n" for line in [*lines, "end_header"]).encode("ascii")
    if ascii:
        yield from text_rows(" ".join(["%r"] * len(columns)) + "\n", table)
        yield from text_rows("%d %d\n" if mesh.is_curve else "3 %d %d %d\n", mesh.cells)
    else:
        yield table.astype(SINGLE_FLOAT).tobytes()
        counted = [] if mesh.is_curve else [("corners", "u1")]
        rows = np.full(len(mesh.cells), 3, [*counted, ("cell", "<i4", mesh.cells.shape[1])])
        rows["cell"] = mesh.cells
        yield rows.tobytes()


def ply_attributes(attributes: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return attributes, each of one number for each vertex, under names that PLY can hold and that are not taken."""
    reserved = ("x", "y", "z", "nx", "ny", "nz", "s", "t")  # properties with a meaning of their own
    named: dict[str, FloatArray] = {}
    for name, values in attributes.items():
        plain = plain_name(name).encode("ascii", "replace").decode().replace("?", "_")
        if plain in reserved or plain in named:
            raise ExportError(f"attributes: PLY has a property {plain!r} already, as which {name!r} would be written")
        if values.ndim != 1:
            raise ExportError(f"attributes: {name!r}: expected one number for each vertex, got shape {values.shape}")
        named[plain] = values
    return named


class PlyColumn(NamedTuple):
    """A column; `kind` is numpy's name of its numbers, `count_kind` that of the lengths of lists, or empty."""

    kind: str
    count_kind: str = ""


class Element(NamedTuple):
    """A table as the header describes it."""

    name: str
    rows: int
    properties: dict[str, PlyColumn]


# The numbers of each property, one row after another, and how many each row has
Columns: TypeAlias = dict[str, tuple[NDArray[Any], IntArray]]


def read_ply(data: bytes) -> FileArrays:
    """Read a PLY file: the elements `vertex` (x, y, z), `face` (a list of corners) and `edge` (vertex1, vertex2)."""
    elements, order, start = _header(data)
    names = re.findall(rb"(?im)^comment[ \t]+TextureFile[ \t]+(\S.*)", data[:start])
    pictures = tuple(os.fsdecode(name.strip()) for name in names)
    if "vertex" not in elements:
        raise GtbError("has no element vertex")
    tables: dict[str, Columns] = {}
    sample: list[bytes] = []
    if order:
        for name, element in elements.items():
            tables[name], start = _binary(data, start, element, order)
        if data[start:].strip():
            raise GtbError(f"has {len(data) - start} bytes more than its header says")
    else:
        rows = (line for _, lines in lines_of(data, start) for line in lines if line and not line.isspace())
        for name, element in elements.items():
            tables[name] = _text(rows, element, sample if name == "vertex" else [])
        if (extra := next(rows, None)) is not None:
            raise GtbError(f"has more than its header says: {shown(extra)}")
    vertex = elements["vertex"]
    vertices = np.stack([_numbers(vertex, tables, axis)[0].astype(np.float64) for axis in "xyz"], axis=1)
    is_single = any(vertex.properties[axis].kind == "f4" for axis in "xyz")

    def half_steps(largest: FloatArray) -> FloatArray:
        return np.maximum(half_step(sample, largest), single_half_steps(largest) if is_single else 0.0)

    cells = _cells(elements, tables)
    ranges = {LIBRARIES: [(mark_of(*pictures), 0, len(cells))] if pictures else []}
    values = partial(_values, elements, tables, cells)
    corners = next((counts for name, (_, counts) in tables.get("face", {}).items() if name in POLYGONS), cells[:0, 0])
    return FileArrays(vertices, cells, half_steps, (), "", values, ranges, pictures, polygons_of(corners))


def _values(elements: dict[str, Element], tables: dict[str, Columns], cells: IntArray) -> Values:
    """All columns but the positions of vertices and the corners of cells; what is neither's, by a mark of it."""
    known: dict[tuple[str, ...], str] = {("nx", "ny", "nz"): NORMALS}
    known |= dict.fromkeys([("s", "t"), ("u", "v"), ("texture_u", "texture_v")], TEXTURE)
    lists = {name for name, item in elements["vertex"].properties.items() if item.count_kind}
    columns = {name: numbers for name, (numbers, _) in tables["vertex"].items() if name not in {"x", "y", "z", *lists}}
    values: Values = {}
    for names, label in known.items():
        if label not in values and columns.keys() >= {*names}:
            values[label] = np.stack([columns.pop(name) for name in names], axis=1).astype(np.float64), cells
    for name, numbers in columns.items():
        if name in ("rgb", "rgba") and numbers.dtype.kind == "f" and not (np.abs(numbers) > 3.4e38).any():  # by PCL
            numbers = numbers.astype(SINGLE_FLOAT).view(np.uint32)
        values[unreserved(name, values)] = _exact(numbers), cells
    table, what = ("edge", "edges") if cells.shape[1] == 2 else ("face", "faces")
    rest = {f"{name} of vertices": tables["vertex"][name] for name in lists}
    known_ends = ("vertex1", "vertex2") if table == "edge" else POLYGONS
    ends = [name for name in tables.get(table, {}) if name in known_ends][: 2 if table == "edge" else 1]
    corners = tables[table][ends[0]][1] if table == "face" and ends else np.full(len(cells), 3)
    rows = np.broadcast_to(np.repeat(np.arange(len(corners)), (corners - 2).astype(np.intp))[:, None], cells.shape)
    for name, (numbers, counts) in tables.get(table, {}).items():
        if name in ends:
            continue
        if (counts == 1).all():
            values[f"{name} of {what}"] = _exact(numbers), rows
        elif name == "texcoord" and (counts == 2 * corners).all():
            of = triangles(np.arange(corners.sum()), corners)
            label = TEXTURE if TEXTURE not in values else f"{name} of {what}"
            values[label] = numbers.reshape(-1, 2).astype(np.float64), of
        else:
            rest[f"{name} of {what}"] = numbers, counts
    for label, (numbers, counts) in [each for each in rest.items() if each[1][1].any()]:  # rows, in any order
        longest, exact, suffix = int(counts.max()), _exact(numbers), ""
        takes_much = longest >= 64 and longest * len(counts) > 2 * len(numbers)
        if takes_much or (longest > 8 and longest * cells.size > 1 << 24):  # marks take less memory
            parts = np.split(_single(exact), np.cumsum(counts)[:-1])
            exact, longest = np.array([mark_of(part.tobytes()) for part in parts]).reshape(-1, 1), 4
            counts, suffix = np.full_like(counts, 4), MARKED
        found = padded(exact[:, 0], counts, longest, np.nan if exact.dtype.kind == "f" else ABSENT)
        values[label + suffix] = found, cells if label.endswith(" of vertices") else rows
        del rest[label]
    doubles = set[str]()
    for name in tables.keys() - {"vertex", table}:
        for column, (numbers, counts) in tables[name].items() if elements[name].rows else ():
            rest[f"{column} of {name}"] = numbers, counts
            doubles |= {f"{column} of {name}"} if elements[name].properties[column].kind == "f8" else set()
    for label, (numbers, counts) in rest.items():
        exact, lengths = _exact(numbers), counts.tobytes()
        mark = mark_of(_single(exact).tobytes(), lengths) + mark_of(exact.tobytes(), lengths) * (label in doubles)
        values[f"{OTHER}{label}"] = np.array([mark]), np.zeros(cells.shape, dtype=np.int64)
    return values


def _single(numbers: NDArray[Any]) -> NDArray[Any]:
    """Return numbers, those that are not whole to the digits of 32 bits."""
    with np.errstate(over="ignore"):
        single = numbers.astype(np.float32) if numbers.dtype.kind == "f" else numbers
    return numbers if np.isinf(single).any() else single


def _exact(numbers: NDArray[Any]) -> NDArray[Any]:
    """Return a column of numbers, whole ones with 64 bits."""
    return numbers[:, None].astype(np.float64 if numbers.dtype.kind == "f" else np.int64)


def _cells(elements: dict[str, Element], tables: dict[str, Columns]) -> IntArray:
    nothing = Element("", 0, {})
    face, edge = elements.get("face", nothing), elements.get("edge", nothing)
    if face.rows and edge.rows:
        raise GtbError("has both faces and edges: expected one of them")
    if edge.rows:
        return np.stack([_numbers(edge, tables, end)[0] for end in ("vertex1", "vertex2")], axis=1).astype(np.int64)
    if not face.rows:
        return np.empty((0, 3), dtype=np.int32)
    name = next((name for name in face.properties if name in POLYGONS), POLYGONS[0])
    corners, counts = _numbers(face, tables, name)
    if counts.min() < 3:
        raise GtbError(f"element face: a face has at least 3 corners, got {counts.min()}")
    return triangles(corners, counts)


def _numbers(element: Element, tables: dict[str, Columns], name: str) -> tuple[NDArray[Any], IntArray]:
    item, is_list = element.properties.get(name), element.name == "face"
    if item is None or bool(item.count_kind) != is_list:
        raise GtbError(f"element {element.name}: has no {'list' if is_list else 'property'} {name}")
    if element.name != "vertex" and item.kind.startswith("f"):
        raise GtbError(f"{name}: expected whole numbers, got {item.kind}")
    return tables[element.name][name]


def _header(data: bytes) -> tuple[dict[str, Element], str, int]:
    """Return the elements, the byte order (empty for text), and the offset of the data."""
    orders = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
    lengths = {b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4"}
    lengths |= {b"int8": "i1", b"uint8": "u1", b"int16": "i2", b"uint16": "u2", b"int32": "i4", b"uint32": "u4"}
    kinds = lengths | {b"float": "f4", b"double": "f8", b"float32": "f4", b"float64": "f8"}
    if not data.startswith((b"ply\n", b"ply\r")):
        raise GtbError("is not a PLY file: it does not begin with ply")
    # The longest headers have some thousands of bytes.
    end = re.compile(rb"[\r\n]end_header[^\r\n]*(\r\n|\r|\n)").search(data, 0, 1 << 20)
    if end is None:
        raise GtbError("is cut off: no end_header")
    order: str | None = None
    elements: dict[str, Element] = {}
    properties: dict[str, PlyColumn] = {}  # of the last element

    def name_of(word: bytes, known: Container[str]) -> str:
        name = word.decode("utf-8", "replace")
        if name in known:
            raise GtbError(f"line {number}: {name} occurs twice")
        return name

    for number, line in enumerate(data[: end.start()].splitlines()[1:], 2):
        match line.split():
            case [] | [b"comment" | b"obj_info", *_]:
                continue
            case [b"format", word, _] if word in orders:
                order = orders[word]
            case [b"element", word, count] if count.isdigit() and len(count) < 16:
                name, properties = name_of(word, elements), {}
                elements[name] = Element(name, int(count), properties)
            case [b"property", kind, word] if kind in kinds and elements:
                properties[name_of(word, properties)] = PlyColumn(kinds[kind])
            case [b"property", b"list", length, kind, word] if length in lengths and kind in kinds and elements:
                properties[name_of(word, properties)] = PlyColumn(kinds[kind], lengths[length])
            case _:
                raise GtbError(f"line {number}: cannot be read: {shown(line)}")
    if order is None:
        raise GtbError("has no line format in its header")
    return elements, order, end.end()


def _joined(element: Element, parts: list[Columns]) -> Columns:
    """Return the columns of all rows from parts of them, of which there may be none."""
    kinds = {name: "f8" if item.kind.startswith("f") else "i8" for name, item in element.properties.items()}
    parts = parts or [{name: (np.empty(0, kind), np.empty(0, np.intp)) for name, kind in kinds.items()}]
    return {
        name: (np.concatenate([part[name][0] for part in parts]), np.concatenate([part[name][1] for part in parts]))
        for name in element.properties
    }


def _uneven(data: bytes, start: int, element: Element, order: str, rows: int) -> tuple[Columns, int]:
    """Return the columns of some rows of an element, whose lists may differ in length, and their end."""
    place, items, columns = start, element.properties.items(), Columns()
    begins, counts = ({name: array("q") for name in element.properties} for _ in range(2))
    byte_order: Literal["little", "big"] = "big" if order == ">" else "little"
    sizes = {name: np.dtype(item.kind).itemsize for name, item in items}
    widths = {name: (int(item.count_kind[1:] or 0), item.count_kind[:1] == "i") for name, item in items}
    plan = [(begins[name].append, counts[name].append, sizes[name], *widths[name]) for name in sizes]
    for _ in range(rows):
        for begin, note, size, width, is_signed in plan:
            count, place = 1, place + width
            if width and (count := int.from_bytes(data[place - width : place], byte_order, signed=is_signed)) < 0:
                place = len(data)
            begin(place - start)
            note(count)
            place += count * size
        if place > len(data):
            raise GtbError(f"is cut off: it ends within the {element.rows} rows of element {element.name}")
    for name, item in items:
        first, lengths, edges = np.array(begins[name]), np.array(counts[name]), np.zeros(place - start + 1, np.int8)
        edges[first] += 1
        edges[first + sizes[name] * lengths] -= 1
        held = np.frombuffer(data, np.uint8, place - start, start)[np.cumsum(edges[:-1], dtype=np.int8).view(bool)]
        columns[name] = held.view(order + item.kind), lengths
    return columns, place


def _binary(data: bytes, start: int, element: Element, order: str) -> tuple[Columns, int]:
    """Return the columns of an element, views of the file if all rows are as long as the first, and its end."""
    if not element.rows or not element.properties:
        return _joined(element, []), start
    first, end = _uneven(data, start, element, order, 1)
    fields: list[tuple[Any, ...]] = []
    for (name, item), (values, _) in zip(element.properties.items(), first.values(), strict=True):
        fields += [(f"count {name}", order + item.count_kind)] if item.count_kind else []
        fields.append((f"value {name}", order + item.kind, (len(values),)))
    held = min(element.rows, (len(data) - start) // (end - start))
    rows = np.frombuffer(data, fields, held, start)
    lists = [name for name, item in element.properties.items() if item.count_kind]
    if held < element.rows or any((rows[f"count {name}"] != first[name][1]).any() for name in lists):
        return _uneven(data, start, element, order, element.rows)
    counts = {name: np.broadcast_to(first[name][1], held) for name in first}
    return {name: (rows[f"value {name}"].ravel(), counts[name]) for name in first}, start + rows.nbytes


def _text(rows: Iterator[bytes], element: Element, sample: list[bytes]) -> Columns:
    """Return the columns of an element, a row in each line; put the first words of some rows into the sample."""
    most = 1 << 16  # rows that are read together
    parts = list[Columns]()
    left = element.rows if element.properties else 0
    while left:
        if not (block := list(islice(rows, min(left, most)))):
            raise GtbError(f"is cut off: it ends within the {element.rows} rows of element {element.name}")
        left -= len(block)
        sample += [word for row in sampled(block, len(sample) // 3) for word in row.split()[:3]]
        try:
            parts.append(_text_block(block, element))
        except GtbError as error:
            raise GtbError(f"element {element.name}: {error}") from None
    return _joined(element, parts)


def _text_block(lines: list[bytes], element: Element) -> Columns:
    has_fractions = any(item.kind.startswith("f") for item in element.properties.values())
    text = b"\n".join(lines)
    numbers, widths = number_rows(text, np.float64) if has_fractions else number_rows(text, np.int64)
    left, place = widths, np.cumsum(widths) - widths
    columns: Columns = {}

    def check(right: BoolArray, what: str) -> None:
        if not right.all():
            raise GtbError(f"{what}: {shown(b' '.join(lines[int(np.argmin(right))].split()))}")

    def take(kind: str, counts: IntArray) -> NDArray[Any]:
        """Return the next numbers of each row, of a kind that may have no fractions."""
        nonlocal left, place
        check((counts >= 0) & (counts <= left), "a row has too few numbers")
        starts = np.repeat(place - (np.cumsum(counts) - counts), counts)
        found = numbers[starts + np.arange(len(starts))]
        left, place = left - counts, place + counts
        if kind.startswith("f"):
            return found
        broken = np.zeros(len(lines), dtype=bool)
        broken[np.repeat(np.arange(len(lines)), counts)[found % 1 != 0]] = True
        check(~broken, "expected a whole number")
        return found.astype(np.int64)

    one = np.ones(len(lines), dtype=np.intp)
    for name, item in element.properties.items():
        counts = take(item.count_kind, one).astype(np.intp) if item.count_kind else one
        columns[name] = take(item.kind, counts), counts
    check(left == 0, "a row has too many numbers")
    return columns
