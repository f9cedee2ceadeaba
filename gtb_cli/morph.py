"""A sequence of meshes in one GLB file that other programs play: morph targets, and an animation through them.

trimesh knows no morph targets; its exporter would only pass on what is made here, and writes no indexed lines.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import ExportError
from gtb_cli.mesh import Mesh

SINGLE = np.dtype("<f4")
UNSIGNED = np.dtype("<u4")

SECONDS = 1.0
"""From one mesh to the next."""

_COMPONENTS = {SINGLE: 5126, UNSIGNED: 5125}  # glTF's numbers for them
_LINES, _TRIANGLES = 1, 4


def animated_glb(meshes: Sequence[Mesh], labels: Sequence[str], *, normals: bool = False, uv: bool = False) -> bytes:
    """Encode meshes with the same cells as a GLB file that shows the first and plays through to the last.

    Parameters
    ----------
    meshes : sequence of Mesh
        With the same cells: curves or surfaces.
    labels : sequence of str
        A name for each; those of the morph targets, which are all but the first.
    normals, uv : bool
        Include the unit normals of surfaces, which are morphed too; the parameters as texture coordinates.

    Returns
    -------
    bytes
        One node with one mesh; the animation is `SECONDS` long from each mesh to the next. The same meshes give the
        same bytes.

    Raises
    ------
    ExportError
        Cells that differ, or coordinates beyond 32-bit numbers.

    References
    ----------
    glTF 2.0, sections 3.7.2.2 (morph targets) and 3.11 (animations).
    """
    first, *others = meshes
    if any(not np.array_equal(mesh.cells, first.cells) for mesh in others):
        raise ExportError("GLB: the meshes of an animation must have the same cells")
    data = _Data()
    normals = normals and not first.is_curve
    attributes: dict[str, int] = {"POSITION": data.add(_single(first.vertices), "VEC3", bounds=True)}
    if normals:
        attributes["NORMAL"] = data.add(_single(_normals(first)), "VEC3")
    if uv:
        attributes["TEXCOORD_0"] = data.add(_single(_texture_coordinates(first)), "VEC2")
    targets = []
    for mesh in others:
        target = {"POSITION": data.add(_single(mesh.vertices - first.vertices), "VEC3", bounds=True)}
        if normals:
            target["NORMAL"] = data.add(_single(_normals(mesh) - _normals(first)), "VEC3")
        targets.append(target)
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": data.add(first.cells.astype(UNSIGNED).ravel(), "SCALAR"),
        "mode": _LINES if first.is_curve else _TRIANGLES,
        "material": 0,
    }
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": first.name, "mesh": 0}],
        "meshes": [{"name": first.name, "primitives": [primitive]}],
        # A patch is open: with the default material, viewers leave out its back.
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}, "doubleSided": True}],
    }
    if targets:
        primitive["targets"] = targets
        tree["meshes"][0]["weights"] = [0.0] * len(targets)
        tree["meshes"][0]["extras"] = {"targetNames": list(labels[1:])}
        times = (np.arange(len(meshes)) * SECONDS).astype(SINGLE)
        weights = np.eye(len(meshes), dtype=SINGLE)[:, 1:]
        sampler = {
            "input": data.add(times, "SCALAR", bounds=True),
            "output": data.add(weights.ravel(), "SCALAR"),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        tree["animations"] = [{"name": first.name, "samplers": [sampler], "channels": [channel]}]
    return data.glb(tree)


class _Data:
    """The binary part of a GLB file, and what it says of itself."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []
        self._length = 0

    def add(self, values: NDArray[Any], kind: str, *, bounds: bool = False) -> int:
        """Append an array of four-byte numbers, and return the number of its accessor."""
        chunk = values.tobytes()
        self._views.append({"buffer": 0, "byteOffset": self._length, "byteLength": len(chunk)})
        self._chunks.append(chunk)
        self._length += len(chunk)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": _COMPONENTS[values.dtype],
            "count": len(values),
            "type": kind,
        }
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def glb(self, tree: dict[str, Any]) -> bytes:
        """Return the whole file."""
        described = tree | {
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self._length}],
        }
        text = json.dumps(described, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        sizes = np.array([28 + len(text) + self._length, len(text), self._length], dtype=UNSIGNED)
        total, text_size, data_size = (size.tobytes() for size in sizes)
        return b"".join([b"glTF\2\0\0\0", total, text_size, b"JSON", text, data_size, b"BIN\0", *self._chunks])


def _single(values: FloatArray) -> NDArray[np.float32]:
    with np.errstate(over="ignore", under="ignore"):
        rounded = values.astype(SINGLE)
    if not np.isfinite(rounded).all():
        raise ExportError("GLB: coordinates are too large for 32-bit numbers")
    return rounded


def _normals(mesh: Mesh) -> FloatArray:
    if mesh.normals is None:
        raise ExportError("normals: the mesh has none")
    return mesh.normals


def _texture_coordinates(mesh: Mesh) -> FloatArray:
    if mesh.parameters is None:
        raise ExportError("uv: the mesh has no parameters")
    u = mesh.parameters[:, 0]
    v = mesh.parameters[:, 1] if mesh.parameters.shape[1] == 2 else np.zeros(len(u))
    return np.column_stack([u, 1.0 - v])
