"""GLB (binary glTF 2.0) that is read: triangles and lines of all nodes of a scene."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, as_indices, shifted
from gtb_cli.errors import GtbError
from gtb_cli.formats.content import Content, segments, single_half_steps, stacked, triangles
from gtb_cli.formats.gltf import HEADER_BYTES

JSON, BIN = 0x4E4F534A, 0x004E4942


_IDENTITY = np.eye(4)


def read_glb(data: bytes) -> Content:
    """Read a GLB file. Its y axis, glTF's vertical one, becomes z, unless the file states another vertical axis.

    Raises
    ------
    GtbError
        The file is damaged, or needs another file or an unknown extension.
    """
    tree, binary = glb_chunks(data)
    try:
        scene = _Scene(tree, binary)
        scene.read()
        return scene.content()
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError) as error:
        # The tree may hold anything anywhere; a wrong type raises one of these errors.
        raise GtbError(f"its description is wrong: {type(error).__name__}: {error}") from None


def glb_chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the description and the buffer of a file."""
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
    if JSON not in chunks:
        raise GtbError("has no description (no chunk JSON)")
    try:
        tree = json.loads(chunks[JSON])
    except (ValueError, RecursionError) as error:
        raise GtbError(f"its description is not JSON: {error}") from None
    if not isinstance(tree, dict):
        raise GtbError("its description is not an object of JSON")
    return tree, chunks.get(BIN, b"")


class _Scene:
    """The nodes of a scene, one after another."""

    def __init__(self, tree: dict[str, Any], binary: bytes) -> None:
        self.tree = tree
        self.binary = binary
        self.vertices: list[FloatArray] = []
        self.count = 0
        self.corners = 0
        self.pieces = 0
        self.rows = 0
        self.cells: dict[int, list[NDArray[Any]]] = {2: [], 3: []}
        self.groups: list[tuple[str, int, int]] = []

    def read(self) -> None:
        harmless = {"materials_unlit", "texture_transform", "lights_punctual", "materials_specular"}
        max_node_depth = 100  # largest depth of nodes within nodes
        transformations = {"matrix", "rotation", "scale", "translation"}  # keys of a node's own transformation
        needed = set(self.tree.get("extensionsRequired", ())) - {f"KHR_{name}" for name in harmless}
        if needed:
            raise GtbError(f"needs {', '.join(sorted(map(str, needed)))}, which is not known here")
        nodes = self.tree.get("nodes", [])
        if "scenes" in self.tree:
            roots = self.tree["scenes"][self.tree.get("scene", 0)].get("nodes", [])
        else:
            inner = {child for node in nodes for child in node.get("children", ())}
            roots = [index for index in range(len(nodes)) if index not in inner]
        stack = [(_index(root), _IDENTITY, 0) for root in reversed(roots)]
        seen = set()
        while stack:
            index, above, depth = stack.pop()
            if index in seen:  # glTF has trees of nodes only; others can be longer than any file
                raise GtbError(f"has node {index} in two places")
            seen.add(index)
            if depth > max_node_depth:
                raise GtbError(f"has nodes within nodes more than {max_node_depth} deep")
            node = nodes[index]
            if "mesh" not in node and "children" not in node:
                continue
            place = above @ _matrix(node) if transformations & node.keys() else above
            if "mesh" in node:
                self._add(self.tree["meshes"][_index(node["mesh"])], str(node.get("name", "")), place)
            stack += [(_index(child), place, depth + 1) for child in reversed(node.get("children", []))]

    def _add(self, mesh: dict[str, Any], name: str, place: FloatArray) -> None:
        before = self.rows
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode == 0:  # points
                continue
            positions = self._accessor(primitive["attributes"]["POSITION"])
            if positions.shape[1] != 3 or positions.dtype != np.dtype("<f4"):
                raise GtbError("POSITION: expected vectors of three 32-bit numbers")
            self._count(len(positions))
            points = positions.astype(np.float64)
            if not (place == _IDENTITY).all():
                points = points @ place[:3, :3].T + place[:3, 3]
            indices: NDArray[Any] = np.arange(len(points))
            if "indices" in primitive:
                read = self._accessor(primitive["indices"])
                if read.shape[1] != 1 or read.dtype.kind != "u":
                    raise GtbError("indices: expected whole numbers")
                self._count(0, len(read))
                indices = read[:, 0]
            if len(indices) and int(indices.max()) >= len(points):
                raise GtbError(f"indices: expected numbers below {len(points)}, got {int(indices.max())}")
            cells = as_indices(shifted(_cells(indices, mode), self.count - len(points)), np.int32)
            self.cells[cells.shape[1]].append(cells)
            self.vertices.append(points)
            self.rows += len(cells)
        name = name or str(mesh.get("name", ""))
        if name and self.rows > before:
            self.groups.append((name, before, self.rows))

    def _count(self, vertices: int, corners: int = 0) -> None:
        """Refuse more vertices or corners than a file of this size can mean, before they are made."""
        # Largest number of vertices, or corners of cells, beyond those in the file: many nodes may share one mesh
        max_repeated = 3_000_000
        max_pieces = 50_000  # largest number of primitives in all nodes; even the smallest takes some time
        self.count += vertices
        self.corners += corners
        self.pieces += corners == 0
        most = len(self.binary) // 12 + max_repeated, len(self.binary) + max_repeated
        if self.count > most[0] or self.corners > most[1]:
            raise GtbError(f"has more than {most[0]} vertices or {most[1]} corners of cells in all nodes together")
        if self.pieces > max_pieces:
            raise GtbError(f"has more than {max_pieces} pieces in all nodes together")

    def _accessor(self, number: object) -> NDArray[Any]:
        """(count, width) numbers."""
        component_types = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
        element_widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
        accessor = self.tree["accessors"][_index(number)]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise GtbError("sparse accessors are not known here")
        view = self.tree["bufferViews"][_index(accessor["bufferView"])]
        buffer = self.tree["buffers"][_index(view.get("buffer", 0))]
        if "uri" in buffer or view.get("buffer", 0) != 0:
            raise GtbError("has its numbers in another file")
        kind = np.dtype(component_types[accessor["componentType"]])
        width, count = element_widths[accessor["type"]], _index(accessor["count"])
        stride = _index(view.get("byteStride", 0)) or width * kind.itemsize
        start = _index(view.get("byteOffset", 0)) + _index(accessor.get("byteOffset", 0))
        end = _index(view.get("byteOffset", 0)) + _index(view["byteLength"])
        if count and start + (count - 1) * stride + width * kind.itemsize > min(end, len(self.binary)):
            raise GtbError("is cut off: an accessor is longer than the data")
        if not count:
            return np.empty((0, width), dtype=kind)
        return np.ndarray((count, width), dtype=kind, buffer=self.binary, offset=start, strides=(stride, kind.itemsize))

    def content(self) -> Content:
        if self.cells[2] and self.cells[3]:
            raise GtbError("has both triangles and lines: expected one of them")
        width = 2 if self.cells[2] else 3
        vertices, cells = stacked(self.vertices, 3, np.float64), stacked(self.cells[width], width, np.int32)
        extras = self.tree.get("asset", {}).get("extras")
        if extras != {"up": "z"}:
            vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0] + 0.0  # not -0
        return Content(vertices, cells, single_half_steps, tuple(self.groups))


def _index(value: object) -> int:
    """The value, if it is a whole number and not negative."""
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


def _cells(indices: NDArray[Any], mode: object) -> NDArray[Any]:
    """The segments or triangles of a primitive."""
    count = len(indices)
    if mode == 1:
        return indices[: count // 2 * 2].reshape(-1, 2)
    if mode == 2:
        indices = np.append(indices, indices[:1])
    if mode in (2, 3):
        return segments(indices, np.array([len(indices)])[: len(indices)])
    if mode == 4:
        return indices[: count // 3 * 3].reshape(-1, 3)
    if mode == 5:
        strip = np.empty((max(0, count - 2), 3), dtype=indices.dtype)
        for k in range(3):
            strip[:, k] = indices[k : count - 2 + k]
        strip[1::2, :2] = strip[1::2, 1::-1]
        return strip
    if mode == 6 and count > 2:
        return triangles(indices, np.array([count]))
    raise GtbError(f"unknown mode {mode!r:.40} of a primitive")
