"""GLB (binary glTF 2.0) that is written: trimesh's exporter describes triangles; their numbers are made by blocks."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, reduce
from hashlib import sha256
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ExportError
from gtb_cli.formats.content import BINARY_ROWS, SINGLE_FLOAT
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import compacted
from gtb_cli.values import frozen
from gtb_cli.vocabulary import FORMATS, Up

HEADER_BYTES = 12
"""Bytes before the chunks; each chunk has 8 bytes before its content."""

MAX_GLB_BYTES = 2**32 - 1
"""Largest size of a file in bytes, as its header holds the size in 32 bits."""

FLOAT, UNSIGNED = 5126, 5125
"""glTF's numbers for the types of components."""

VERTICES, INDICES = 34962, 34963
"""glTF's numbers for the content of a view of the buffer."""


@frozen
class _Numbers:
    """Numbers of 32 bits, made block by block: once to be described, and once to be written.

    Attributes
    ----------
    values : (m, k)
    rows : (r,) int or None
        Those of the values that are meant; None for all.
    single : function
        Of some rows of the values: (s, w) elements of glTF.
    """

    values: FloatArray | IntArray
    rows: IntArray | None
    single: Callable[[NDArray[Any]], NDArray[Any]]

    def blocks(self) -> Iterator[NDArray[Any]]:
        """The elements."""
        for start in range(0, len(self.values if self.rows is None else self.rows), BINARY_ROWS):
            some = slice(start, start + BINARY_ROWS)
            yield self.single(self.values[some if self.rows is None else self.rows[some]])

    @cached_property
    def known(self) -> tuple[dict[str, Any], int, bytes]:
        """Their description in glTF, the number of their bytes, and a key that other numbers do not have."""
        count, low, high, key = 0, [], [], sha256()
        for block in self.blocks():
            count += len(block)
            low.append(block.min(axis=0))
            high.append(block.max(axis=0))
            key.update(block.tobytes())
        least, most = reduce(np.minimum, low), reduce(np.maximum, high)
        return {"count": count, "max": most.tolist(), "min": least.tolist()}, count * least.nbytes, key.digest()


Parts: TypeAlias = Mapping[str, Mapping[str, _Numbers]]
"""What each named part has, under its name in glTF, in the order of the file."""


def glb_blocks(
    mesh: Mesh, groups: Sequence[tuple[str, int, int]], normals: FloatArray | None, uv: FloatArray | None, up: Up
) -> Iterator[bytes]:
    """Yield a GLB file with a node for each group. `up` is the vertical axis."""
    parts = {name: _numbers(mesh, slice(start, stop), len(groups) == 1, normals, uv) for name, start, stop in groups}
    stored: dict[int, _Numbers] = {}

    def finish(tree: dict[str, Any]) -> None:
        """Describe the numbers in a tree that has only the places of their descriptions."""
        for mesh, part in zip(tree["meshes"], parts.values(), strict=True):
            (primitive,) = mesh["primitives"]
            places = {"indices": primitive["indices"], **primitive["attributes"]}
            for name, numbers in part.items():
                accessor = tree["accessors"][places[name]]
                accessor |= {key: value for key, value in numbers.known[0].items() if key in accessor}
                stored.setdefault(accessor["bufferView"], numbers)
        length = 0
        for number, view in enumerate(tree["bufferViews"]):
            view |= {"byteOffset": length, "byteLength": stored[number].known[1]}
            length += view["byteLength"]
        tree["buffers"][0]["byteLength"] = length
        mark_views(tree)
        tree["asset"] |= {} if up == FORMATS["glb"].up else {"extras": {"up": up}}  # for `read_glb`

    text = (_text_of_lines if mesh.is_curve else _text_of_triangles)(parts, finish)
    yield _header(text, sum(numbers.known[1] for numbers in stored.values()))
    for number in sorted(stored):
        yield from (block.tobytes() for block in stored[number].blocks())


def _numbers(
    mesh: Mesh, group: slice, is_whole: bool, normals: FloatArray | None, uv: FloatArray | None
) -> dict[str, _Numbers]:
    """What a group has, with the vertices that its cells use; a whole mesh has all its vertices."""
    used, cells = (None, mesh.cells) if is_whole else compacted(mesh.cells[group])
    indices = _Numbers(cells, None, lambda rows: rows.astype("<u4").reshape(-1, 1))
    found = {"POSITION": _Numbers(mesh.vertices, used, lambda rows: rows.astype(SINGLE_FLOAT))}
    if uv is not None:
        found["TEXCOORD_0"] = _Numbers(uv, used, _downwards)
    if normals is not None:
        from trimesh.util import unitize

        found["NORMAL"] = _Numbers(normals, used, lambda rows: unitize(rows).astype(SINGLE_FLOAT))
    return {**found, "indices": indices} if mesh.is_curve else {"indices": indices, **found}


def _downwards(uv: FloatArray) -> NDArray[Any]:
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype(SINGLE_FLOAT)


def _text_of_triangles(parts: Parts, finish: Callable[[dict[str, Any]], None]) -> bytes:
    """The description that trimesh's exporter makes of stand-ins for the parts: equal where their numbers are equal."""
    import trimesh
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    root = "world"
    while root in parts:
        root += "_"
    scene = trimesh.Scene(base_frame=root)
    # A patch is open, and viewers leave out its back with the default material.
    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True)
    keys: dict[bytes, int] = {}
    for name, part in parts.items():
        tables = {key: keys.setdefault(each.known[2], len(keys) + 1) * np.eye(3) for key, each in part.items()}
        geometry = trimesh.Trimesh(
            vertices=tables["POSITION"],
            faces=tables["indices"].astype(np.int64),
            vertex_normals=tables.get("NORMAL"),
            visual=TextureVisuals(uv=tables.get("TEXCOORD_0"), material=material),
            process=False,
            validate=False,
        )
        scene.add_geometry(geometry, node_name=name, geom_name=name)
    data: bytes = export_glb(
        scene,
        include_normals="NORMAL" in part,
        unitize_normals=False,
        tree_postprocessor=finish,
        extension_webp=False,
        extension_draco=False,
    )
    begin = HEADER_BYTES + 8
    return data[begin : begin + int.from_bytes(data[HEADER_BYTES : HEADER_BYTES + 4], "little")]


def _text_of_lines(parts: Parts, finish: Callable[[dict[str, Any]], None]) -> bytes:
    """The description of indexed lines.

    trimesh's exporter writes every inner vertex of a polyline twice. Its reader takes the vertices for one polyline in
    their order, and reads these files correctly.
    """
    meshes: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    kinds = {"POSITION": (FLOAT, "VEC3"), "TEXCOORD_0": (FLOAT, "VEC2"), "indices": (UNSIGNED, "SCALAR")}
    for name, part in parts.items():
        attributes = {}
        for key in part:
            attributes[key] = len(accessors)
            component, kind = kinds[key]
            bounds: dict[str, Any] = {"min": [], "max": []} if key == "POSITION" else {}
            described = {"bufferView": len(accessors), "componentType": component, "count": 0, "type": kind}
            accessors.append({**described, **bounds})
        indices = attributes.pop("indices")
        meshes.append({"name": name, "primitives": [{"attributes": attributes, "indices": indices, "mode": 1}]})
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(parts)))}],
        "nodes": [{"name": name, "mesh": number} for number, name in enumerate(parts)],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": [{"buffer": 0} for _ in accessors],
        "buffers": [{}],
    }
    finish(tree)
    return _text(tree)


def mark_views(tree: dict[str, Any]) -> None:
    """Mark in a glTF tree which views hold vertices or indices, for viewers that pass them to the graphics card."""
    views, accessors = tree["bufferViews"], tree["accessors"]
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            for attributes in (primitive["attributes"], *primitive.get("targets", ())):
                for number in attributes.values():
                    views[accessors[number]["bufferView"]]["target"] = VERTICES
            views[accessors[primitive["indices"]]["bufferView"]]["target"] = INDICES


def glb_file(tree: dict[str, Any], chunks: Sequence[bytes]) -> list[bytes]:
    """Return the blocks of a file: a description, with the length of the chunks for its buffer, and these chunks."""
    length = tree["buffers"][0]["byteLength"] = sum(map(len, chunks))
    return [_header(_text(tree), length), *chunks]


def _text(tree: dict[str, Any]) -> bytes:
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    return text + b" " * (-len(text) % 4)


def _header(text: bytes, length: int) -> bytes:
    """The beginning of a file, up to the buffer of the given length."""
    total = HEADER_BYTES + 8 + len(text) + 8 + length
    if total > MAX_GLB_BYTES:
        raise ExportError(f"GLB: holds no more than 4 GB, and this has {total / 1e9:.1f}")
    whole, text_size, body_size = (size.to_bytes(4, "little") for size in (total, len(text), length))
    return b"glTF\2\0\0\0" + whole + text_size + b"JSON" + text + body_size + b"BIN\0"
