"""GLB (binary glTF 2.0), both ways: surfaces by trimesh's exporter, curves as indexed lines; any scene is read."""

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, as_indices, shifted
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.file_arrays import SINGLE_FLOAT, FileArrays, segments, single_half_steps, stacked, triangles
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import compacted
from gtb_cli.vocabulary import FORMATS, PATCH_COLOURS, UNITS, Up

HEADER_BYTES = 12  # before the chunks, each of which has 8 more before its content
VERTICES, INDICES = 34962, 34963  # glTF's numbers for the content of a view of the buffer


class Node(NamedTuple):
    """A node of the file: a group of cells with the vertices that they use, and values at these."""

    name: str
    vertices: FloatArray
    cells: IntArray
    normals: FloatArray | None
    uv: FloatArray | None


def glb_blocks(
    mesh: Mesh,
    groups: Sequence[tuple[str, int, int]],
    normals: FloatArray | None,
    uv: FloatArray | None,
    up: Up,
    unit: str | None = None,
    name: str = "",
) -> Iterable[bytes]:
    """Return a GLB file of at most 4 GB with a node for each group. `up` is the vertical axis.

    Several groups have a colour each, and are below one node of this name. A unit of length scales the node to metres,
    and the numbers stay.
    """
    parts = []
    for label, start, stop in groups:
        whole = len(groups) == 1  # then vertices without cells stay
        used, cells = (slice(None), mesh.cells) if whole else compacted(mesh.cells[start:stop])
        parts.append(Node(label, mesh.vertices[used], cells, *(v if v is None else v[used] for v in (normals, uv))))
    _check_size(sum(4 * np.size(values) for part in parts for values in part[1:] if values is not None))
    extras: dict[str, Any] = {} if up == FORMATS["glb"].up else {"up": up}  # for `read_glb`
    extras |= {} if unit is None else {"unit": unit}
    extras = {"extras": extras} if extras else {}
    return _lines(parts, extras, name) if mesh.is_curve else [_triangles(parts, extras, name)]


def _triangles(parts: Sequence[Node], extras: dict[str, Any], root: str) -> bytes:
    from trimesh import Scene, Trimesh
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    frame = "world"
    while frame in (part.name for part in parts):
        frame += "_"
    scene = Scene(base_frame=frame)
    # A patch is open, and viewers leave out its back with the default material.
    material = PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True)
    for name, vertices, cells, normals, uv in parts:
        visual = TextureVisuals(uv=uv, material=material)
        surface = Trimesh(vertices, cells, vertex_normals=normals, visual=visual, process=False, validate=False)
        scene.add_geometry(surface, node_name=name, geom_name=name)

    def finish(tree: dict[str, Any]) -> None:
        """Say which views hold vertices or indices, as graphics cards want to know, and colour the parts."""
        tree["asset"] |= extras
        _gather(tree, root, extras)
        if len(parts) > 1:
            (plain,) = tree["materials"]
            tree["materials"] = [_coloured(plain, number, part.name) for number, part in enumerate(parts)]
            numbers = {part.name: number for number, part in enumerate(parts)}
            for mesh in tree["meshes"]:
                for primitive in mesh["primitives"]:
                    primitive["material"] = numbers[mesh["name"]]
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


def _gather(tree: dict[str, Any], name: str, extras: dict[str, Any]) -> None:
    """Put several nodes below one of this name, and scale the topmost node to metres if there is a unit of length."""
    nodes = tree["nodes"]
    if len(nodes) > 1:
        nodes.append({"name": name, "children": [*range(len(nodes))]})
        tree["scenes"][tree["scene"]]["nodes"] = [len(nodes) - 1]
    if (unit := extras.get("extras", {}).get("unit")) is not None:
        nodes[-1]["scale"] = [UNITS[unit]] * 3


def _coloured(material: dict[str, Any], number: int, name: str) -> dict[str, Any]:
    """Return a material with the colour of a patch, which glTF takes as linear light."""
    hexadecimal = PATCH_COLOURS[number % len(PATCH_COLOURS)]
    parts = [int(hexadecimal[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [round(((part + 0.055) / 1.055) ** 2.4, 6) for part in parts]  # sRGB; all are above its linear beginning
    shading = material["pbrMetallicRoughness"] | {"baseColorFactor": [*linear, 1.0]}
    return material | {"name": name, "pbrMetallicRoughness": shading}


def _lines(parts: Sequence[Node], extras: dict[str, Any], root: str) -> list[bytes]:
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
    _gather(file.tree, root, extras)
    return file.blocks()


class GlbFile:
    """A glTF tree and its buffer, to which arrays of 32-bit numbers are added."""

    def __init__(self, tree: dict[str, Any], body: bytes = b"") -> None:
        self.tree = tree
        self._chunks = [body]
        self._length = len(body)

    def add(self, values: NDArray[Any], target: int | None = None) -> int:
        """Append (m, w) numbers for `VERTICES`, `INDICES` or anything else, and return their accessor."""
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


def read_glb(data: bytes) -> FileArrays:
    """Read a GLB file. Its y axis, glTF's vertical one, becomes z, unless the file states another vertical axis."""
    tree, binary = glb_chunks(data)
    try:
        return _content(tree, binary)
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError) as error:
        # The tree may hold anything anywhere; a wrong type raises one of these errors.
        raise GtbError(f"its description is wrong: {type(error).__name__}: {error}") from None


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


def _content(tree: dict[str, Any], binary: bytes) -> FileArrays:
    # Many nodes may share one mesh: vertices and corners of cells are counted before they are made.
    most = 2 * len(binary) + 20_000_000
    effort = 400  # vertices that take as long as a primitive without any
    vertices: list[FloatArray] = []
    cells: dict[int, list[NDArray[Any]]] = {2: [], 3: []}
    groups = []
    count = rows = used = 0
    for mesh, name, place in _placed_meshes(tree):
        before = rows
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode == 0:  # points
                continue
            positions = accessor_values(tree, binary, primitive["attributes"]["POSITION"])
            if positions.shape[1] != 3 or positions.dtype != SINGLE_FLOAT:
                raise GtbError("POSITION: expected vectors of three 32-bit numbers")
            corners: NDArray[Any] = np.arange(len(positions))[:, None]
            if "indices" in primitive:
                corners = accessor_values(tree, binary, primitive["indices"])
            if corners.shape[1] != 1 or corners.dtype.kind not in "iu":
                raise GtbError("indices: expected whole numbers")
            used += len(positions) + len(corners) + effort
            if used > most:
                raise GtbError(f"has more than {most} vertices and corners of cells in all nodes together")
            if len(corners) and not 0 <= corners.min() <= corners.max() < len(positions):
                raise GtbError(f"indices: expected numbers below {len(positions)}, got {corners.max()}")
            found = as_indices(shifted(_cells(corners[:, 0], mode), count), np.int32)
            is_mirrored = found.shape[1] == 3 and np.linalg.det(place[:3, :3]) < 0  # then faces keep their outer sides
            cells[found.shape[1]].append(found[:, ::-1] if is_mirrored else found)
            vertices.append(positions.astype(np.float64) @ place[:3, :3].T + place[:3, 3])
            count += len(positions)
            rows += len(found)
        name = name or str(mesh.get("name", ""))
        if name and rows > before:
            groups.append((name, before, rows))
    if cells[2] and cells[3]:
        raise GtbError("has both triangles and lines: expected one of them")
    width = 2 if cells[2] else 3
    points = stacked(vertices, 3, np.float64)
    extras = tree.get("asset", {}).get("extras")
    extras = extras if isinstance(extras, dict) else {}
    unit, is_z_up = extras.get("unit"), extras.get("up") == "z"
    if unit in UNITS:
        points /= UNITS[unit]
    if not is_z_up:
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    space = f"{unit if unit in UNITS else 'no unit'}, {'z' if is_z_up else 'y'} up"
    points += 0.0  # not -0
    return FileArrays(points, stacked(cells[width], width, np.int32), single_half_steps, tuple(groups), space)


def _placed_meshes(tree: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, FloatArray]]:
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
    element_widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
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


def _cells(indices: NDArray[Any], mode: object) -> NDArray[Any]:
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
