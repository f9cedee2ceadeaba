"""A sequence of meshes in one GLB file that other programs can play: morph targets, and an animation through them.

`export` writes the first mesh like any GLB file; the targets and the animation, which trimesh's exporter does not know,
are then added to that file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import ExportError
from gtb_cli.formats.export import encode_mesh, standing
from gtb_cli.formats.file_arrays import SINGLE_FLOAT
from gtb_cli.formats.glb import VERTICES, GlbFile, accessor_values, glb_chunks
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.vocabulary import Up

MAX_MESHES = 1000  # largest number of meshes of an animation, whose weights form a square table


def animated_glb(
    meshes: Sequence[Mesh],
    labels: Sequence[str],
    *,
    normals: bool = False,
    uv: bool = False,
    up: Up | None = None,
    extras: Mapping[str, Any] | None = None,
) -> list[bytes]:
    """Encode meshes with the same cells as a GLB file that shows the first and plays through to the last.

    All meshes but the first are morph targets with their labels: differences from the first mesh as stored, so that at
    its time every vertex is right to 32-bit rounding. The animation of their weights takes one second from each mesh to
    the next and is linear between them (glTF 2.0, sections 3.7.2.2 and 3.11). `extras` are further data of the mesh.
    """
    first, *others = meshes
    check_count(len(meshes))
    if any(not np.array_equal(mesh.cells, first.cells) for mesh in others):
        raise ExportError("GLB: the meshes of an animation must have the same cells")
    tree, body = glb_chunks(b"".join(encode_mesh(replace(first, groups=()), "glb", normals=normals, uv=uv, up=up)))
    file = GlbFile(tree, body)
    (mesh,) = tree["meshes"]
    (primitive,) = mesh["primitives"]
    mesh["extras"] = {**extras} if extras else {}
    if others:
        stored = {
            name: accessor_values(tree, body, primitive["attributes"][name]).astype(np.float64)
            for name in _morphed(first, normals)
        }
        primitive["targets"] = []
        for other, label in zip(others, labels[1:], strict=True):
            target = {}
            for name, vectors in _morphed(standing(other, "glb", up), normals).items():
                with np.errstate(over="ignore", under="ignore"):
                    difference = (vectors - stored[name]).astype(SINGLE_FLOAT)
                if not np.isfinite(difference).all():
                    raise ExportError(f"GLB: {label}: {name}: too large for 32-bit numbers")
                target[name] = file.add(difference, VERTICES)
            primitive["targets"].append(target)
        mesh["weights"] = [0.0] * len(others)
        mesh["extras"]["targetNames"] = list(labels[1:])
        sampler = {
            "input": file.add(np.arange(len(meshes), dtype=SINGLE_FLOAT)[:, None]),  # seconds
            "output": file.add(np.eye(len(meshes), dtype=SINGLE_FLOAT)[:, 1:].reshape(-1, 1)),
            "interpolation": "LINEAR",
        }
        node = next(number for number, node in enumerate(tree["nodes"]) if "mesh" in node)
        channel = {"sampler": 0, "target": {"node": node, "path": "weights"}}
        tree["animations"] = [{"name": mesh["name"], "samplers": [sampler], "channels": [channel]}]
    return file.blocks()


def check_count(meshes: int) -> None:
    """Refuse an animation of more than `MAX_MESHES` meshes."""
    if meshes > MAX_MESHES:
        raise ExportError(
            f"GLB: an animation of {meshes} meshes, more than {MAX_MESHES}: the files of a folder may be more"
        )


def _morphed(mesh: Mesh, normals: bool) -> dict[str, FloatArray]:
    """Return the arrays that differ from mesh to mesh, under their names in glTF."""
    if not normals or mesh.is_curve:
        return {"POSITION": mesh.vertices}
    if mesh.normals is None:
        raise ExportError("normals: the mesh has none")
    return {"POSITION": mesh.vertices, "NORMAL": mesh.normals}
