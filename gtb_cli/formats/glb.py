"""GLB (binary glTF 2.0), both ways: surfaces as trimesh writes them, curves as indexed lines; any scene is read."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, TypeAlias
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, as_indices, shifted
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.file_arrays import SINGLE_FLOAT, FileArrays, Ranges, single_half_steps, unreserved
from gtb_cli.formats.glb_tree import HEADER_BYTES, Scene, accessor_values, glb_chunks, meant
from gtb_cli.formats.polygons import segments, triangles
from gtb_cli.meshes.mesh import MATERIALS, NORMALS, OTHER, TEXTURE, Mesh, Values
from gtb_cli.meshes.topology import compacted
from gtb_cli.vocabulary import FORMATS, PATCH_COLOURS, UNITS, Up

VERTICES, INDICES = 34962, 34963  # glTF's numbers for the content of a view of the buffer
FREE = 20_000_000  # vertices and corners of cells that any file may stand for


_Part: TypeAlias = tuple[int, int, object, FloatArray]  # first vertex, number of vertices, accessor, and turn


def glb_blocks(
    mesh: Mesh, groups: Ranges, uv: FloatArray | None, up: Up, unit: str | None, name: str
) -> Iterable[bytes]:
    """Return a GLB file of at most 4 GB with a node for each group. `up` is the vertical axis.

    Several groups have a colour each, below one node of this name. A unit scales the node to metres: numbers stay.
    The buffer and its description are as by trimesh's exporter: what parts have in common is there once.
    """
    parts = []
    for label, start, stop in groups:
        whole = len(groups) == 1  # then vertices without cells stay
        used, cells = (slice(None), mesh.cells) if whole else compacted(mesh.cells[start:stop])
        normals, own_uv = (v if v is None else v[used] for v in (mesh.normals, uv))
        parts.append(Mesh(mesh.vertices[used], cells, own_uv, normals, name=label))
    said = ({} if up == FORMATS["glb"].up else {"up": up}) | ({} if unit is None else {"unit": unit})  # for `read_glb`
    chunks: dict[tuple[int, int, bytes], int] = {}  # targets, widths and contents of accessors, with their numbers
    accessors, views = list[dict[str, Any]](), list[dict[str, int]]()

    def add(values: NDArray[Any], target: int) -> int:
        """Append (m, w) numbers of 32 bits that are not there yet, and return their accessor."""
        key = target, values.shape[1], values.tobytes()
        if key not in chunks:
            start = views[-1]["byteOffset"] + views[-1]["byteLength"] if views else 0
            chunks[key] = len(views)
            kind, width = 5126 if values.dtype.kind == "f" else 5125, ("SCALAR", "VEC2", "VEC3")[values.shape[1] - 1]
            accessors.append({"bufferView": len(views), "componentType": kind, "count": len(values), "type": width})
            accessors[-1] |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
            # Graphics cards want to know which views hold vertices or indices.
            views.append({"buffer": 0, "byteOffset": start, "byteLength": len(key[2]), "target": target})
        return chunks[key]

    meshes, materials = list[dict[str, Any]](), list[dict[str, Any]]()
    for number, part in enumerate(parts):
        primitive = {"indices": add(part.cells.astype("<u4").reshape(-1, 1), INDICES)}
        own_uv = part.parameters
        if own_uv is not None:  # glTF counts from the top
            own_uv = np.column_stack([own_uv[:, 0], 1.0 - own_uv[:, 1]])
        attributes = {"POSITION": part.vertices, "TEXCOORD_0": own_uv, "NORMAL": part.normals}
        held = {key: add(v.astype(SINGLE_FLOAT), VERTICES) for key, v in attributes.items() if v is not None}
        # A patch is open, and viewers leave out its back with the default material.
        shading: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
        material: dict[str, Any] = {"pbrMetallicRoughness": shading, "doubleSided": True}
        if len(parts) > 1:  # with the colours of patches, which glTF takes as linear light
            # All are above sRGB's linear beginning
            shares = bytes.fromhex(PATCH_COLOURS[number % len(PATCH_COLOURS)][1:])
            linear = [round(((share / 255 + 0.055) / 1.055) ** 2.4, 6) for share in shares]
            material["name"], shading["baseColorFactor"] = part.name, [*linear, 1.0]
        materials += [material] * (not part.is_curve)
        kind = {"mode": 1} if part.is_curve else {"mode": 4, "material": number}
        meshes.append({"name": part.name, "primitives": [primitive | {"attributes": held} | kind]})
    nodes: list[dict[str, Any]] = [{"name": part.name, "mesh": number} for number, part in enumerate(parts)]
    if len(nodes) > 1:
        nodes.append({"name": name, "children": [*range(len(nodes))]})
    if "unit" in said:  # in metres
        nodes[-1]["scale"] = [UNITS[said["unit"]]] * 3
    asset: dict[str, Any] = {"version": "2.0"} | ({"extras": said} if said else {})
    length = sum(view["byteLength"] for view in views)
    tree = {"asset": asset, "scene": 0, "scenes": [{"nodes": [len(nodes) - 1]}], "nodes": nodes, "meshes": meshes}
    tree |= {"materials": materials} if materials else {}
    tree |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": length}]}
    text = json.dumps(tree, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    total = HEADER_BYTES + 8 + len(text) + 8 + length
    if total > 2**32 - 1:  # the header has 32 bits for it
        raise ExportError(f"GLB: holds no more than 4 GB, and this has {total / 1e9:.1f}")
    whole_size, text_size, body_size = (size.to_bytes(4, "little") for size in (total, len(text), length))
    head = b"glTF\2\0\0\0" + whole_size + text_size + b"JSON" + text + body_size + b"BIN\0"
    return [head, *(content for *_, content in chunks)]


@contextmanager
def _tree_faults() -> Iterator[None]:
    """Turn what a wrong type raises, as the tree may hold anything anywhere, into a `GtbError`."""
    try:
        yield
    except (LookupError, TypeError, AttributeError, ValueError, OverflowError, RecursionError) as error:
        raise GtbError(f"its description is wrong: {type(error).__name__}: {error}") from None


@_tree_faults()
def read_glb(data: bytes) -> FileArrays:
    """Read a GLB file. Its y axis, glTF's vertical one, becomes z, unless the file states another vertical axis."""
    tree, binary = glb_chunks(data)
    # Many nodes may share one mesh: vertices and corners of cells are counted before they are made.
    most = 2 * len(binary) + FREE
    effort = 400  # vertices that take as long as a primitive without any
    vertices: list[FloatArray] = []
    cells: dict[int, list[NDArray[Any]]] = {2: [], 3: []}
    groups = []
    others: dict[str, list[_Part]] = {}
    materials: list[tuple[list[float], int, int]] = []
    scene = Scene(tree, binary, len(data))
    numbers_of, look_of = cache(partial(accessor_values, tree, binary)), cache(scene.material)
    count = rows = used = 0
    for mesh, name, place in scene.placed_meshes():
        before, starts = rows, dict[str, int]()  # of vertices, which primitives of a mesh may share
        for primitive in mesh["primitives"]:
            used += 20  # points take time as well
            if used > most:
                raise GtbError(f"has more than {most} vertices and corners of cells in all nodes together")
            if (mode := primitive.get("mode", 4)) == 0:  # points
                continue
            positions = numbers_of(primitive["attributes"]["POSITION"])
            if positions.shape[1] != 3 or positions.dtype != SINGLE_FLOAT:
                raise GtbError("POSITION: expected vectors of three 32-bit numbers")
            corners: NDArray[Any] = np.arange(len(positions))[:, None]
            if "indices" in primitive:
                corners = numbers_of(primitive["indices"])
            if corners.shape[1] != 1 or corners.dtype.kind not in "iu":
                raise GtbError("indices: expected whole numbers")
            start = starts.setdefault(str(primitive["attributes"]), count)
            used += len(corners) + effort + (len(positions) + 20 * len(primitive["attributes"])) * (start == count)
            if len(corners) and not 0 <= corners.min() <= corners.max() < len(positions):
                raise GtbError(f"indices: expected numbers below {len(positions)}, got {corners.max()}")
            found = as_indices(shifted(_cells(corners[:, 0], mode), start), np.int32)
            is_mirrored = found.shape[1] == 3 and np.linalg.det(place[:3, :3]) < 0  # then faces keep their outer sides
            cells[found.shape[1]].append(found[:, ::-1] if is_mirrored else found)
            if start == count:
                vertices.append(positions.astype(np.float64) @ place[:3, :3].T + place[:3, 3])
                for attribute, number in primitive["attributes"].items():
                    if attribute != "POSITION":
                        others.setdefault(attribute, []).append((count, len(positions), number, place[:3, :3]))
                count += len(positions)
            rows += len(found)
            materials.append((look_of(primitive.get("material")), rows - len(found), rows))
        if (name := name or str(mesh.get("name", ""))) and rows > before:
            groups.append((name, before, rows))
    if cells[2] and cells[3]:
        raise GtbError("has both triangles and lines: expected one of them")
    width = 2 if cells[2] else 3
    points = np.concatenate([np.empty((0, 3)), *vertices])
    unit, is_z_up = scene.said.get("unit", ""), scene.said.get("up") == "z"
    points /= UNITS.get(unit, 1.0)
    if not is_z_up:
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    space = f"{unit or 'no unit'}, {'z' if is_z_up else 'y'} up"
    points += 0.0  # not -0
    corners = np.concatenate([np.empty((0, width), dtype=np.int32), *cells[width]])

    @_tree_faults()
    def values() -> Values:
        known: dict[str, str] = {"NORMAL": NORMALS, "TEXCOORD_0": TEXTURE}
        found: Values = {}
        if 4 * count * len(others) > (most := max(20 * len(binary), 100_000_000)):
            raise GtbError(f"has more than {most} numbers of attributes in all nodes together")
        for name, parts in sorted(others.items()):
            label = known.get(name) or unreserved(name.lower().strip("_"), ())
            label = unreserved(name, found) if label in found else label  # other names differ in more than case
            found[label] = _values(tree, binary, name, parts, count, is_z_up), corners
        if mark := scene.further():
            found[f"{OTHER}description"] = np.array([mark]), np.zeros(corners.shape, dtype=np.int64)
        return found

    uris = sorted(str(image["uri"]) for image in tree.get("images", ()) if isinstance(image, dict) and "uri" in image)
    pictures = tuple(unquote(uri) for uri in uris if not uri.startswith("data:"))
    ranges = {f"{MATERIALS}GLB": materials}
    return FileArrays(points, corners, single_half_steps, tuple(groups), space, values, ranges, pictures)


def _values(tree: dict[str, Any], binary: bytes, name: str, parts: list[_Part], count: int, is_z: bool) -> FloatArray:
    """(count, w) numbers of an attribute at the vertices of all parts, which is NaN in those without it."""
    found = []
    for _, length, number, _ in parts:
        if tree["accessors"][number]["count"] != length:  # before it is read: few bytes may name many
            raise GtbError(f"{name}: {tree['accessors'][number]['count']} rows for {length} vertices")
        found.append(meant(accessor_values(tree, binary, number), tree["accessors"][number]))
    result = np.full((count, max(rows.shape[1] for rows in found)), np.nan)
    for rows, (start, length, _, turn) in zip(found, parts, strict=True):
        if name == "NORMAL":
            rows = rows @ (np.linalg.inv(turn) if np.linalg.det(turn) else turn)
        result[start : start + length, : rows.shape[1]] = rows
    if name == "NORMAL" and not is_z:
        result = result[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    if name == "TEXCOORD_0":  # glTF counts from the top
        result[:, 1] = 1.0 - result[:, 1]
    return result + 0.0  # not -0


def _cells(indices: NDArray[Any], mode: object) -> NDArray[Any]:
    if mode in (1, 4):
        width = 2 if mode == 1 else 3
        return indices[: len(indices) // width * width].reshape(-1, width)
    if mode in (2, 3):
        corners = np.append(indices, indices[:1]) if mode == 2 else indices
        return segments(corners, np.array([len(corners)])[: len(corners)])
    if mode == 5:
        strip = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
        strip[1::2, :2] = strip[1::2, 1::-1]
        return strip
    if mode == 6 and len(indices) > 2:
        return triangles(indices, np.array([len(indices)]))
    raise GtbError(f"unknown mode {mode!r:.40} of a primitive")
