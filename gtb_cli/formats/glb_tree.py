"""The tree of a GLB file: its description and buffer, the places of its meshes, and the numbers of its accessors."""

import hashlib
import json
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import GtbError

HEADER_BYTES = 12  # before the chunks, each of which has 8 more before its content


def glb_chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the description and the buffer of a file."""
    description, buffer = 0x4E4F534A, 0x004E4942  # kinds of chunks: JSON, BIN
    if data[:4] != b"glTF" or len(data) < HEADER_BYTES:
        raise GtbError("is not a GLB file: it does not begin with glTF")
    version, size = (int(number) for number in np.frombuffer(data, dtype="<u4", offset=4, count=2))
    if version != 2:
        raise GtbError(f"is glTF of version {version}, expected 2")
    if size != len(data):
        raise GtbError(f"says that it has {size} bytes, and has {len(data)}")
    chunks: dict[int, bytes] = {}
    start = HEADER_BYTES
    while start < size:
        if size - start < 8:
            raise GtbError("is cut off between its chunks")
        length, kind = (int(number) for number in np.frombuffer(data, dtype="<u4", offset=start, count=2))
        if length > size - start - 8:
            raise GtbError("is cut off within a chunk")
        chunks.setdefault(kind, data[start + 8 : start + 8 + length])
        start += 8 + length
    if description not in chunks:
        raise GtbError("has no description (no chunk JSON)")
    try:
        tree = json.loads(chunks[description])
    except (ValueError, RecursionError) as error:
        raise GtbError(f"its description is not JSON: {error}") from None
    if not isinstance(tree, dict):
        raise GtbError("its description is not an object of JSON")
    return tree, chunks.get(buffer, b"")


def placed_meshes(tree: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, FloatArray]]:
    """Yield the meshes of a scene with the names of their nodes and their (4, 4) places."""
    harmless = {"materials_unlit", "texture_transform", "lights_punctual", "materials_specular"}
    most = 100  # nodes within nodes
    needed = set(tree.get("extensionsRequired", ())) - {f"KHR_{name}" for name in harmless}
    if needed:
        raise GtbError(f"needs {', '.join(sorted(map(str, needed)))}, which is not known here")
    nodes = tree.get("nodes", [])
    if "scenes" in tree:
        roots = tree["scenes"][tree.get("scene", 0)].get("nodes", [])
    else:
        inner = {child for node in nodes for child in node.get("children", ())}
        roots = [index for index in range(len(nodes)) if index not in inner]
    stack = [(_index(root), np.eye(4), 0) for root in reversed(roots)]
    seen = set()
    while stack:
        index, above, depth = stack.pop()
        if index in seen:  # glTF has trees of nodes only; others can be longer than any file
            raise GtbError(f"has node {index} in two places")
        seen.add(index)
        if depth > most:
            raise GtbError(f"has nodes within nodes more than {most} deep")
        node = nodes[index]
        place = above @ _matrix(node)
        if "mesh" in node:
            yield tree["meshes"][_index(node["mesh"])], str(node.get("name", "")), place
        stack += [(_index(child), place, depth + 1) for child in reversed(node.get("children", []))]


def accessor_values(tree: dict[str, Any], binary: bytes, number: object) -> NDArray[Any]:
    """Return the (count, width) numbers of an accessor."""
    component_types = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    element_widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
    accessor = tree["accessors"][_index(number)]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise GtbError("sparse accessors are not known here")
    view = tree["bufferViews"][_index(accessor["bufferView"])]
    buffer = tree["buffers"][_index(view.get("buffer", 0))]
    if "uri" in buffer or view.get("buffer", 0) != 0:
        raise GtbError("has its numbers in another file")
    kind = np.dtype(component_types[accessor["componentType"]])
    width, count = element_widths[accessor["type"]], _index(accessor["count"])
    stride = _index(view.get("byteStride", 0)) or width * kind.itemsize
    begin = _index(view.get("byteOffset", 0))
    start, end = begin + _index(accessor.get("byteOffset", 0)), begin + _index(view["byteLength"])
    if not count:
        return np.empty((0, width), dtype=kind)
    if start + (count - 1) * stride + width * kind.itemsize > min(end, len(binary)):
        raise GtbError("is cut off: an accessor is longer than the data")
    return np.ndarray((count, width), dtype=kind, buffer=binary, offset=start, strides=(stride, kind.itemsize))


def further_description(tree: dict[str, Any], binary: bytes) -> list[Any]:
    """Return what is said beside meshes, their places and materials, such as skins, with the numbers of accessors."""
    placing = {"mesh", "matrix", "translation", "rotation", "scale", "children", "name"}
    drawing = {"attributes", "indices", "material", "mode"}

    @cache
    def digest(number: int) -> str:
        """Return what stands for the numbers of an accessor, also a sparse one, or its own number if it has none."""
        accessor = tree["accessors"][number]
        try:
            held = [accessor_values(tree, binary, number).tobytes()]
        except GtbError:
            parts = [accessor["sparse"][name] for name in ("indices", "values")]
            views = [tree["bufferViews"][part["bufferView"]] for part in parts]
            held = [binary[view.get("byteOffset", 0) :][: view["byteLength"]] for view in views]
        return hashlib.sha256(b"".join(held)).hexdigest()

    def told(value: Any, key: str = "", above: str = "") -> Any:
        if key == "extras":
            return value
        if isinstance(value, dict):
            found = {name: told(inner, name, key) for name, inner in value.items()}
            return {name: inner for name, inner in found.items() if inner not in ({}, [], None)}
        if isinstance(value, list):
            inner = [told(each, key, above) for each in value]
            return inner if any(each not in ({}, [], None) for each in inner) else []
        if key in ("input", "output", "inverseBindMatrices") or {key, above} & {"targets", "attributes"}:
            with suppress(LookupError, TypeError, AttributeError):
                return digest(value)
        return float(value) if type(value) is int else value

    def without(table: dict[str, Any], names: set[str]) -> dict[str, Any]:
        return {name: value for name, value in table.items() if name not in names}

    names = [node.get("name") for node in tree.get("nodes", ()) if "mesh" not in node]
    scenes = tree.get("scenes", ())
    parts = [tree.get(name) for name in ("skins", "animations", "cameras", "extensions")]
    parts += [names if len(names) > 1 else None, scenes if len(scenes) > 1 else None]
    is_plain = len(scenes) < 2 and not tree.get("skins")  # no node has a place beside those of the meshes
    parts += [[without(node, placing) if is_plain else node for node in tree.get("nodes", ())]]
    for mesh in tree.get("meshes", ()):
        points = [primitive for primitive in mesh["primitives"] if primitive.get("mode") == 0]
        rest = [without(primitive, drawing) for primitive in mesh["primitives"]]
        parts += [without(mesh, {"primitives", "name"}), rest, points]
    found: list[Any] = told(parts)
    return found


def _index(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value) or value < 0:
        raise GtbError(f"expected a whole number in its description, got {value!r:.40}")
    return int(value)


def _matrix(node: dict[str, Any]) -> FloatArray:
    """The (4, 4) transformation of a node."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] = np.array(rotation) * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    return matrix
