"""PLY, both ways: vertices, faces, and edges (which trimesh does not read); text, and binary in both byte orders."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.content import SINGLE_FLOAT, Content, single_half_steps, stacked, triangles
from gtb_cli.formats.digits import BLOCK_ROWS
from gtb_cli.formats.ply_tables import CORNER_LISTS, Element, read_binary, read_header, read_text
from gtb_cli.formats.text import half_step
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import plain_name


def ply_blocks(
    mesh: Mesh,
    normals: FloatArray | None,
    uv: FloatArray | None,
    attributes: Mapping[str, FloatArray],
    *,
    ascii: bool,
) -> Iterable[bytes]:
    """Return a PLY file: text with numbers that read back exactly, or binary with 32-bit numbers."""
    scalars = ({} if uv is None else dict(zip("st", uv.T, strict=True))) | dict(attributes)
    if ascii or mesh.is_curve:
        return _table(mesh, normals, scalars, ascii)
    from trimesh import Trimesh
    from trimesh.exchange.ply import export_ply

    surface = Trimesh(mesh.vertices, mesh.cells, vertex_normals=normals, process=False, validate=False)
    surface.vertex_attributes |= {name: values.astype(SINGLE_FLOAT) for name, values in scalars.items()}
    return [export_ply(surface, encoding="binary", vertex_normal=normals is not None, include_attributes=True)]


def _table(mesh: Mesh, normals: FloatArray | None, scalars: Mapping[str, FloatArray], ascii: bool) -> Iterator[bytes]:
    """Yield what trimesh does not write: all digits, and paths with properties and each vertex once."""
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    if normals is not None:
        columns |= zip(("nx", "ny", "nz"), normals.T, strict=True)
    columns |= scalars
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
    else:
        yield table.astype(SINGLE_FLOAT).tobytes()
        yield mesh.cells.astype("<i4").tobytes()


def _text_rows(line: str, values: FloatArray | IntArray) -> Iterator[bytes]:
    for start in range(0, len(values), BLOCK_ROWS):
        block = values[start : start + BLOCK_ROWS]
        lines: str = line * len(block) % tuple(block.ravel().tolist())
        yield lines.encode("ascii")


def ply_attributes(attributes: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return attributes under names that PLY can hold.

    Raises
    ------
    ExportError
        A name is reserved or taken, or an attribute does not have one number for each vertex.
    """
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
    is_single = any(vertex.type_of(axis) == "f4" for axis in "xyz")

    def half_steps(largest: FloatArray) -> FloatArray:
        return np.maximum(half_step(sample, largest), single_half_steps(largest) if is_single else 0.0)

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
        return stacked(faces, 3, np.int32)
    if faces:
        raise GtbError("has both faces and edges: expected one of them")
    return np.stack([edge.whole(name) for name in ("vertex1", "vertex2")], axis=1)
