"""A sequence of meshes in one GLB file that other programs can play: morph targets, and an animation through them.

`export` writes the first mesh like any GLB file, with trimesh if it has faces; the targets and the animation, which
trimesh's exporter does not know, are then added to that file. The exporter has a hook for more buffers, but its lines
do not keep the vertices of a curve, and one way of animation serves curves and surfaces.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import ExportError
from gtb_cli.formats.content import SINGLE_FLOAT
from gtb_cli.formats.export import encode_mesh, standing
from gtb_cli.formats.glb import glb_chunks
from gtb_cli.formats.gltf import VERTICES, GlbFile
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

    Parameters
    ----------
    meshes : sequence of Mesh
        Curves or surfaces, with the same cells and the same parameters.
    labels : sequence of str
        A name for each mesh. All meshes but the first are morph targets.
    normals, uv : bool
        Include the unit normals of surfaces, which are then morphed as well; the parameters as texture coordinates.
    up : {"z", "y"}, optional
        The axis of the file for the z axis of the meshes. The default is y.
    extras : mapping, optional
        Further JSON data about the mesh.

    Returns
    -------
    list of bytes
        The blocks of the file. It has one mesh and an animation of its weights, which takes one second from
        each mesh to the next and is linear between them. The same meshes give the same bytes.

    Raises
    ------
    ExportError
        The cells differ, there are more meshes than `MAX_MESHES`, or coordinates exceed 32-bit numbers.

    Notes
    -----
    A target holds the difference of its mesh from the first one as stored, so that at its time every vertex is right to
    32-bit rounding. It takes 12 bytes per vertex, and twice that with normals.

    References
    ----------
    glTF 2.0, sections 3.7.2.2 (morph targets) and 3.11 (animations).
    """
    seconds_per_mesh = 1.0  # seconds from one mesh to the next
    first, *others = meshes
    check_count(len(meshes))
    if any(not np.array_equal(mesh.cells, first.cells) for mesh in others):
        raise ExportError("GLB: the meshes of an animation must have the same cells")
    tree, body = glb_chunks(b"".join(encode_mesh(replace(first, groups=()), "glb", normals=normals, uv=uv, up=up)))
    file = GlbFile(tree, body)
    (mesh,) = file.tree["meshes"]
    (primitive,) = mesh["primitives"]
    mesh["extras"] = {**extras} if extras else {}
    if others:
        stored = {name: _vectors(file.tree, body, primitive["attributes"][name]) for name in _morphed(first, normals)}
        primitive["targets"] = [
            {
                name: file.add(
                    _single(_morphed(standing(other, "glb", up), normals)[name] - base, f"{label}: {name}"), VERTICES
                )
                for name, base in stored.items()
            }
            for other, label in zip(others, labels[1:], strict=True)
        ]
        mesh["weights"] = [0.0] * len(others)
        mesh["extras"]["targetNames"] = list(labels[1:])
        sampler = {
            "input": file.add((np.arange(len(meshes)) * seconds_per_mesh).astype(SINGLE_FLOAT)[:, None]),
            "output": file.add(np.eye(len(meshes), dtype=SINGLE_FLOAT)[:, 1:].reshape(-1, 1)),
            "interpolation": "LINEAR",
        }
        node = next(number for number, node in enumerate(file.tree["nodes"]) if "mesh" in node)
        channel = {"sampler": 0, "target": {"node": node, "path": "weights"}}
        file.tree["animations"] = [{"name": mesh["name"], "samplers": [sampler], "channels": [channel]}]
    return file.blocks()


def check_count(meshes: int) -> None:
    """Refuse an animation of more than `MAX_MESHES` meshes."""
    if meshes > MAX_MESHES:
        raise ExportError(
            f"GLB: an animation of {meshes} meshes, more than {MAX_MESHES}: the files of a folder may be more"
        )


def _vectors(tree: Mapping[str, Any], body: bytes, accessor: int) -> FloatArray:
    """Return the vectors of an accessor, as they are stored."""
    described = tree["accessors"][accessor]
    start = tree["bufferViews"][described["bufferView"]]["byteOffset"]
    return np.frombuffer(body, SINGLE_FLOAT, 3 * described["count"], start).reshape(-1, 3).astype(np.float64)


def _morphed(mesh: Mesh, normals: bool) -> dict[str, FloatArray]:
    """The arrays that differ from mesh to mesh, under their names in glTF."""
    if not normals or mesh.is_curve:
        return {"POSITION": mesh.vertices}
    if mesh.normals is None:
        raise ExportError("normals: the mesh has none")
    return {"POSITION": mesh.vertices, "NORMAL": mesh.normals}


def _single(values: FloatArray, label: str) -> NDArray[np.float32]:
    with np.errstate(over="ignore", under="ignore"):
        rounded = values.astype(SINGLE_FLOAT)
    if not np.isfinite(rounded).all():
        raise ExportError(f"GLB: {label}: too large for 32-bit numbers")
    return rounded
