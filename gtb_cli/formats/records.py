"""What trimesh's exporters have no way to write: PLY as text and with edges, STL as text, GLB lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.formats.obj import ROWS

SINGLE = np.dtype("<f4")

_FLOAT, _UNSIGNED = 5126, 5125  # glTF's numbers for the types of components
_VERTICES, _INDICES = 34962, 34963  # and for what a view of the buffer holds
_FACET = "facet normal {!r} {!r} {!r}\nouter loop\n{}{}{}endloop\nendfacet\n"


@dataclass(frozen=True)
class Part:
    """A named piece of a mesh with vertices of its own.

    Parameters
    ----------
    name : str
        What it is called; no other part has the same name.
    vertices : (m, 3) float
        Positions.
    cells : (k, 2) or (k, 3) int
        Segments or triangles, as indices into `vertices`.
    normals : (m, 3) float or None
        Unit normal of each vertex.
    uv : (m, 2) float or None
        Texture coordinates of each vertex, v upwards.
    """

    name: str
    vertices: FloatArray
    cells: IntArray
    normals: FloatArray | None
    uv: FloatArray | None


def ply_text(columns: Mapping[str, FloatArray], cells: IntArray) -> Iterator[bytes]:
    """Yield a PLY file as text, with numbers that read back exactly.

    Parameters
    ----------
    columns : mapping of name to (m,) float
        The properties of the vertices, x, y, z first.
    cells : (k, 2) or (k, 3) int
        Segments, written as edges, or triangles.
    """
    table = np.column_stack(list(columns.values()))
    yield _ply_header("ascii", "double", list(columns), len(table), cells)
    yield from _text_rows(" ".join(["%r"] * len(columns)) + "\n", table)
    yield from _text_rows("%d %d\n" if cells.shape[1] == 2 else "3 %d %d %d\n", cells)


def ply_of_edges(columns: Mapping[str, FloatArray], edges: IntArray) -> Iterator[bytes]:
    """Yield a binary PLY file of 32-bit numbers with `edges` `(k, 2)`; `columns` as in `ply_text`.

    trimesh writes a path without properties, and its vertices anew for each of its entities.
    """
    table = np.column_stack(list(columns.values()))
    yield _ply_header("binary_little_endian", "float", list(columns), len(table), edges)
    yield table.astype(SINGLE).tobytes()
    yield edges.astype("<i4").tobytes()


def _ply_header(encoding: str, number: str, names: Sequence[str], vertices: int, cells: IntArray) -> bytes:
    lines = ["ply", f"format {encoding} 1.0", f"element vertex {vertices}"]
    lines += [f"property {number} {name}" for name in names]
    if cells.shape[1] == 2:
        lines += [f"element edge {len(cells)}", "property int vertex1", "property int vertex2"]
    else:
        lines += [f"element face {len(cells)}", "property list uchar int vertex_indices"]
    return "".join(f"{line}\n" for line in [*lines, "end_header"]).encode("ascii")


def _text_rows(line: str, values: FloatArray | IntArray) -> Iterator[bytes]:
    for start in range(0, len(values), ROWS):
        block = values[start : start + ROWS]
        text: str = line * len(block) % tuple(block.ravel().tolist())
        yield text.encode("ascii")


def facet_normals(corners: FloatArray) -> FloatArray:
    """Return the unit normals `(k, 3)` of triangles `(k, 3, 3)`; zero for a triangle without area.

    Notes
    -----
    Right at any scale, as each triangle is brought to size 1. trimesh takes a cross product below 1e-13 for zero, which
    loses every normal of a model of size 1e-9.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    largest = np.maximum(np.abs(first).max(axis=1), np.abs(second).max(axis=1))
    exponents = np.frexp(largest)[1][:, None]
    first, second = np.ldexp(first, -exponents), np.ldexp(second, -exponents)
    normals: FloatArray = np.empty_like(first)
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        normals[:, axis] = first[:, one] * second[:, two] - first[:, two] * second[:, one]
    length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    length[length == 0.0] = 1.0
    normals /= length[:, None]
    return normals


def stl_text(vertices: FloatArray, triangles: IntArray, name: bytes) -> Iterator[bytes]:
    """Yield an STL file as text, with numbers that read back exactly and no blank lines (meshio stops at them).

    Parameters
    ----------
    vertices : (m, 3) float
        Positions.
    triangles : (k, 3) int
        Indices into `vertices`.
    name : bytes
        Of the solid: printable ASCII.
    """
    yield b"solid " + name + b"\n"
    for start in range(0, len(triangles), ROWS):
        block = triangles[start : start + ROWS]
        used, places = np.unique(block, return_inverse=True)
        corners = ["vertex {!r} {!r} {!r}\n".format(*row) for row in vertices[used].tolist()]
        normals = facet_normals(vertices[block]).tolist()
        triples = places.reshape(-1, 3).tolist()
        facets = [
            _FACET.format(*normal, corners[a], corners[b], corners[c])
            for normal, (a, b, c) in zip(normals, triples, strict=True)
        ]
        yield "".join(facets).encode("ascii")
    yield b"endsolid " + name + b"\n"


def glb_of_lines(parts: Sequence[Part]) -> bytes:
    """Return a GLB file with one node of indexed lines for each part.

    trimesh's exporter writes every inner vertex of a polyline twice; its reader, which
    takes the vertices for one polyline in their order, gets these right.
    """
    import json

    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []
    chunks: list[bytes] = []

    def accessor(values: NDArray[Any], kind: str, component: int, **bounds: list[float]) -> int:
        data = values.tobytes()  # four bytes a number: every view starts at a multiple of four
        views.append({"buffer": 0, "byteOffset": sum(map(len, chunks)), "byteLength": len(data)})
        chunks.append(data)
        count = values.size if kind == "SCALAR" else len(values)
        described = {"bufferView": len(views) - 1, "componentType": component, "count": count, "type": kind}
        accessors.append({**described, **bounds})
        return len(accessors) - 1

    meshes = []
    for part in parts:
        points = part.vertices.astype(SINGLE)
        attributes = {
            "POSITION": accessor(
                points, "VEC3", _FLOAT, min=points.min(axis=0).tolist(), max=points.max(axis=0).tolist()
            )
        }
        if part.uv is not None:
            downwards = np.column_stack([part.uv[:, 0], 1.0 - part.uv[:, 1]])
            attributes["TEXCOORD_0"] = accessor(downwards.astype(SINGLE), "VEC2", _FLOAT)
        indices = accessor(part.cells.astype("<u4"), "SCALAR", _UNSIGNED)
        meshes.append({"name": part.name, "primitives": [{"attributes": attributes, "indices": indices, "mode": 1}]})
    body = b"".join(chunks)
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(parts)))}],
        "nodes": [{"name": part.name, "mesh": number} for number, part in enumerate(parts)],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    mark_views(tree)
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    sizes = np.array([28 + len(text) + len(body), len(text), len(body)], dtype="<u4")
    total, text_size, body_size = (size.tobytes() for size in sizes)
    return b"".join([b"glTF\2\0\0\0", total, text_size, b"JSON", text, body_size, b"BIN\0", body])


def mark_views(tree: dict[str, Any]) -> None:
    """Say in a glTF tree, for viewers that hand them on to the graphics card, which views hold vertices or indices."""
    views, accessors = tree["bufferViews"], tree["accessors"]
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            for attributes in (primitive["attributes"], *primitive.get("targets", ())):
                for number in attributes.values():
                    views[accessors[number]["bufferView"]]["target"] = _VERTICES
            views[accessors[primitive["indices"]]["bufferView"]]["target"] = _INDICES
