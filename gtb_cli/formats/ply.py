"""PLY, both ways: vertices, faces, and edges (which trimesh does not read); text, and binary in both byte orders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import SimpleNamespace

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.content import BINARY_ROWS, SINGLE_FLOAT, Content, joined, single_half_steps, triangles
from gtb_cli.formats.digits import BLOCK_ROWS
from gtb_cli.formats.ply_tables import CORNER_LISTS, Element, read_binary, read_header, read_text
from gtb_cli.formats.text import half_step
from gtb_cli.meshes.known import largest_coordinates
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.process.forks import in_forks
from gtb_cli.vocabulary import plain_name

RESERVED_PROPERTIES = ("x", "y", "z", "nx", "ny", "nz", "s", "t")
"""Properties with a meaning of their own, whose names attributes cannot have."""

HEADER_END = b"end_header\n"


def ply_blocks(
    mesh: Mesh,
    normals: FloatArray | None,
    uv: FloatArray | None,
    attributes: Mapping[str, FloatArray],
    *,
    ascii: bool,
) -> Iterator[bytes]:
    """Yield a PLY file: text with numbers that read back exactly, or binary with 32-bit numbers."""
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    if normals is not None:
        columns |= zip(("nx", "ny", "nz"), normals.T, strict=True)
    if uv is not None:
        columns |= zip("st", uv.T, strict=True)
    columns |= attributes
    if not ascii and not mesh.is_curve:
        yield from _ply_of_trimesh(mesh, normals, columns)
        return
    table = np.column_stack(list(columns.values()))
    encoding, number = ("ascii", "double") if ascii else ("binary_little_endian", "float")
    lines = ["ply", f"format {encoding} 1.0", f"element vertex {len(table)}"]
    lines += [f"property {number} {name}" for name in columns]
    if mesh.is_curve:
        lines += [f"element edge {len(mesh.cells)}", "property int vertex1", "property int vertex2"]
    else:
        lines += [f"element face {len(mesh.cells)}", "property list uchar int vertex_indices"]
    yield "".join(f"{line}\n" for line in [*lines, "end_header"]).encode("ascii")
    if ascii:
        yield from _text_rows(" ".join(["%r"] * len(columns)) + "\n", table)
        yield from _text_rows("%d %d\n" if mesh.is_curve else "3 %d %d %d\n", mesh.cells)
    else:  # trimesh writes a path without properties, and repeats the vertices for each of its entities
        yield table.astype(SINGLE_FLOAT).tobytes()
        yield mesh.cells.astype("<i4").tobytes()


def _text_rows(line: str, values: FloatArray | IntArray) -> Iterator[bytes]:
    def text(start: int) -> bytes:
        block = values[start : start + BLOCK_ROWS]
        lines: str = line * len(block) % tuple(block.ravel().tolist())
        return lines.encode("ascii")

    return in_forks(text, range(0, len(values), BLOCK_ROWS))


def _ply_of_trimesh(mesh: Mesh, normals: FloatArray | None, columns: Mapping[str, FloatArray]) -> Iterator[bytes]:
    """Yield a binary PLY file by blocks, since trimesh's exporter holds its tables and their bytes at once."""
    from trimesh.exchange.ply import export_ply

    scalars = list(columns)[3 if normals is None else 6 :]

    def exported(**tables: object) -> bytes:
        # A Trimesh would copy its arrays; the exporter needs only these attributes, and leaves out what is missing.
        part = SimpleNamespace(visual=SimpleNamespace(kind=None), **tables)
        data: bytes = export_ply(part, encoding="binary", vertex_normal=normals is not None, include_attributes=True)
        return data

    def vertices(rows: slice) -> dict[str, object]:
        attributes = {name: columns[name][rows].astype(SINGLE_FLOAT) for name in scalars}
        return {
            "vertices": mesh.vertices[rows],
            "vertex_normals": None if normals is None else normals[rows],
            "vertex_attributes": attributes,
        }

    header = exported(**vertices(slice(0)), faces=mesh.cells[:0])
    for element, count in ((b"vertex", len(mesh.vertices)), (b"face", len(mesh.cells))):
        header = header.replace(b"element %b 0\n" % element, b"element %b %d\n" % (element, count))
    yield header
    for start in range(0, len(mesh.vertices), BINARY_ROWS):
        yield exported(**vertices(slice(start, start + BINARY_ROWS))).partition(HEADER_END)[2]
    for start in range(0, len(mesh.cells), BINARY_ROWS):
        yield exported(faces=mesh.cells[start : start + BINARY_ROWS]).partition(HEADER_END)[2]


def ply_attributes(attributes: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return attributes under names that PLY can hold.

    Raises
    ------
    ExportError
        A name is reserved or taken, or an attribute does not have one number for each vertex.
    """
    named: dict[str, FloatArray] = {}
    for name, values in attributes.items():
        plain = plain_name(name).encode("ascii", "replace").decode().replace("?", "_")
        if plain in RESERVED_PROPERTIES or plain in named:
            raise ExportError(f"attributes: PLY has a property {plain!r} already, as which {name!r} would be written")
        if values.ndim != 1:
            raise ExportError(f"attributes: {name!r}: expected one number for each vertex, got shape {values.shape}")
        named[plain] = values
    return named


def read_ply(data: bytes) -> Content:
    """Read a PLY file: the elements `vertex` (x, y, z), `face` (a list of corners) and `edge` (vertex1, vertex2).

    Raises
    ------
    GtbError
        The header is wrong, or the data do not match it.
    """
    elements, order, start = read_header(data)
    sample: list[bytes] = []
    if order:
        for element in elements:
            start = read_binary(data, start, element, order)
        if data[start:].strip():
            raise GtbError(f"has {len(data) - start} bytes more than its header says")
    else:
        sample = read_text(data, start, elements)
    tables = {element.name: element for element in elements}
    if "vertex" not in tables:
        raise GtbError("has no element vertex")
    vertex = tables["vertex"]
    vertices = np.stack([vertex.column(axis).astype(np.float64) for axis in "xyz"], axis=1)
    half_steps = np.full(3, half_step(sample, float(largest_coordinates(vertices).max())))
    if any(vertex.type_of(axis) == "f4" for axis in "xyz"):
        half_steps = np.maximum(half_steps, single_half_steps(vertices))
    return Content(vertices, _cells(tables), half_steps)


def _cells(tables: dict[str, Element]) -> IntArray:
    face, edge = tables.get("face"), tables.get("edge")
    faces: list[IntArray] = []
    if face is not None and face.count:
        item = next((item for item in face.properties if item.name in CORNER_LISTS and item.count_type), None)
        if item is None:
            raise GtbError(f"element face: has no list {CORNER_LISTS[0]}")
        if item.type.startswith("f"):
            raise GtbError(f"{item.name}: expected whole numbers, got {item.type}")
        for corners, counts in face.lists[item.name]:
            if counts.min() < 3:
                raise GtbError(f"element face: a face has at least 3 corners, got {counts.min()}")
            faces.append(triangles(corners, counts))
    if edge is None or not edge.count:
        return joined(faces, 3, np.int32)
    if faces:
        raise GtbError("has both faces and edges: expected one of them")
    return np.stack([edge.whole(name) for name in ("vertex1", "vertex2")], axis=1)
