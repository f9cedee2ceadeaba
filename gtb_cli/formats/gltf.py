"""GLB (binary glTF 2.0) that is written: surfaces by trimesh's exporter, curves as indexed lines."""

import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ExportError
from gtb_cli.formats.content import SINGLE_FLOAT
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import compacted
from gtb_cli.vocabulary import FORMATS, Up

HEADER_BYTES = 12  # before the chunks, each of which has 8 more before its content
VERTICES, INDICES = 34962, 34963  # glTF's numbers for the content of a view of the buffer


class Part(NamedTuple):
    """A node of the file: a group of cells with the vertices that they use, and values at these."""

    name: str
    vertices: FloatArray
    cells: IntArray
    normals: FloatArray | None
    uv: FloatArray | None


def glb_blocks(
    mesh: Mesh, groups: Sequence[tuple[str, int, int]], normals: FloatArray | None, uv: FloatArray | None, up: Up
) -> Iterable[bytes]:
    """Return a GLB file with a node for each group. `up` is the vertical axis.

    Raises
    ------
    ExportError
        The file would be larger than 4 GB.
    """
    parts = []
    for name, start, stop in groups:
        whole = len(groups) == 1  # then vertices without cells stay
        used, cells = (slice(None), mesh.cells) if whole else compacted(mesh.cells[start:stop])
        parts.append(Part(name, mesh.vertices[used], cells, *(v if v is None else v[used] for v in (normals, uv))))
    _check_size(sum(4 * np.size(values) for part in parts for values in part[1:] if values is not None))
    extras = {} if up == FORMATS["glb"].up else {"extras": {"up": up}}  # for `read_glb`
    return _lines(parts, extras) if mesh.is_curve else [_triangles(parts, extras)]


def _triangles(parts: Sequence[Part], extras: dict[str, Any]) -> bytes:
    from trimesh import Scene, Trimesh
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    root = "world"
    while root in (part.name for part in parts):
        root += "_"
    scene = Scene(base_frame=root)
    # A patch is open, and viewers leave out its back with the default material.
    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True)
    for name, vertices, cells, normals, uv in parts:
        visual = TextureVisuals(uv=uv, material=material)
        surface = Trimesh(vertices, cells, vertex_normals=normals, visual=visual, process=False, validate=False)
        scene.add_geometry(surface, node_name=name, geom_name=name)

    def finish(tree: dict[str, Any]) -> None:
        """Say which views hold vertices or indices, for viewers that pass them to the graphics card."""
        tree["asset"] |= extras
        for mesh in tree["meshes"]:
            for primitive in mesh["primitives"]:
                for number in primitive["attributes"].values():
                    tree["bufferViews"][tree["accessors"][number]["bufferView"]]["target"] = VERTICES
                tree["bufferViews"][tree["accessors"][primitive["indices"]]["bufferView"]]["target"] = INDICES

    data: bytes = export_glb(
        scene,
        include_normals=parts[0].normals is not None,
        unitize_normals=True,
        tree_postprocessor=finish,
        extension_webp=False,
        extension_draco=False,
    )
    return data


def _lines(parts: Sequence[Part], extras: dict[str, Any]) -> list[bytes]:
    """Return indexed lines.

    trimesh's exporter writes every inner vertex of a polyline twice. Its reader takes the vertices for one polyline in
    their order, and reads these files correctly.
    """
    file = GlbFile(
        {
            "asset": {"version": "2.0", **extras},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(parts)))}],
            "nodes": [{"name": part.name, "mesh": number} for number, part in enumerate(parts)],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{}],
        }
    )
    for part in parts:
        attributes = {"POSITION": file.add(part.vertices.astype(SINGLE_FLOAT), VERTICES)}
        if part.uv is not None:
            upwards = np.column_stack([part.uv[:, 0], 1.0 - part.uv[:, 1]])  # glTF counts from the top
            attributes["TEXCOORD_0"] = file.add(upwards.astype(SINGLE_FLOAT), VERTICES)
        indices = file.add(part.cells.astype("<u4").reshape(-1, 1), INDICES)
        primitive = {"attributes": attributes, "indices": indices, "mode": 1}
        file.tree["meshes"].append({"name": part.name, "primitives": [primitive]})
    return file.blocks()


class GlbFile:
    """A glTF tree and its buffer, to which arrays of 32-bit numbers are added.

    Parameters
    ----------
    tree : dict
    body : bytes
        What the buffer has already.
    """

    def __init__(self, tree: dict[str, Any], body: bytes = b"") -> None:
        self.tree = tree
        self._chunks = [body]
        self._length = len(body)

    def add(self, values: NDArray[Any], target: int | None = None) -> int:
        """Append (m, w) numbers, say what they are for (`VERTICES` or `INDICES`), and return their accessor."""
        chunk = values.tobytes()
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": len(chunk)}
        self.tree["bufferViews"].append(view if target is None else view | {"target": target})
        self.tree["accessors"].append(
            {
                "bufferView": len(self.tree["bufferViews"]) - 1,
                "componentType": 5126 if values.dtype.kind == "f" else 5125,
                "count": len(values),
                "type": ("SCALAR", "VEC2", "VEC3")[values.shape[1] - 1],
                "min": values.min(axis=0).tolist(),
                "max": values.max(axis=0).tolist(),
            }
        )
        self._chunks.append(chunk)
        self._length += len(chunk)
        return len(self.tree["accessors"]) - 1

    def blocks(self) -> list[bytes]:
        """Return the whole file."""
        self.tree["buffers"][0]["byteLength"] = self._length
        text = json.dumps(self.tree, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        total = HEADER_BYTES + 8 + len(text) + 8 + self._length
        _check_size(total)
        whole, text_size, body_size = (size.to_bytes(4, "little") for size in (total, len(text), self._length))
        return [b"glTF\2\0\0\0" + whole + text_size + b"JSON" + text + body_size + b"BIN\0", *self._chunks]


def _check_size(length: int) -> None:
    if length > 2**32 - 1:  # the header has 32 bits for it
        raise ExportError(f"GLB: holds no more than 4 GB, and this has {length / 1e9:.1f}")
