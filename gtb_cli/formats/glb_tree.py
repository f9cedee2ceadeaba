"""The tree of a GLB file: its description and buffer, the places of its meshes, and the numbers of its accessors."""

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import GtbError
from gtb_cli.formats.file_arrays import mark_of
from gtb_cli.vocabulary import UNITS

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
        tree = json.loads(chunks[description].decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise GtbError(f"its description is not JSON: {error}") from None
    if not isinstance(tree, dict):
        raise GtbError("its description is not an object of JSON")
    return tree, chunks.get(buffer, b"")


def accessor_values(tree: dict[str, Any], binary: bytes, number: object) -> NDArray[Any]:
    """Return the (count, width) numbers of an accessor."""
    accessor = tree["accessors"][_index(number)]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise GtbError("sparse accessors are not known here")
    return _rows(tree, binary, accessor)


def _rows(tree: dict[str, Any], binary: bytes, accessor: dict[str, Any]) -> NDArray[Any]:
    component_types = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    element_widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
    view = tree["bufferViews"][_index(accessor["bufferView"])]
    if "uri" in tree["buffers"][_index(view.get("buffer", 0))] or view.get("buffer", 0) != 0:
        raise GtbError("has its numbers in another file")
    kind = np.dtype(component_types[accessor["componentType"]])
    width, count = element_widths[accessor["type"]], _index(accessor["count"])
    stride = _index(view.get("byteStride", 0)) or width * kind.itemsize
    if stride < width * kind.itemsize:
        raise GtbError("has rows of numbers that overlap, which would be more than the file holds")
    begin = _index(view.get("byteOffset", 0))
    start, end = begin + _index(accessor.get("byteOffset", 0)), begin + _index(view["byteLength"])
    if not count:
        return np.empty((0, width), dtype=kind)
    if start + (count - 1) * stride + width * kind.itemsize > min(end, len(binary)):
        raise GtbError("is cut off: an accessor is longer than the data")
    return np.ndarray((count, width), dtype=kind, buffer=binary, offset=start, strides=(stride, kind.itemsize))


def meant(rows: NDArray[Any], accessor: dict[str, Any]) -> FloatArray:
    """Return the numbers of an accessor as they are meant: whole ones may stand for fractions."""
    if accessor.get("normalized") and rows.dtype.kind in "iu":
        return np.maximum(rows / float(np.iinfo(rows.dtype).max), -1.0)
    return rows.astype(np.float64)


class Scene:
    """The nodes that are shown, and what is said of them, whatever the numbers in tables, and without defaults."""

    def __init__(self, tree: dict[str, Any], binary: bytes, size: int) -> None:
        self.tree, self.binary = tree, binary
        self.placed = [*_placed_nodes(tree, 20_000 + size // 100)]
        self.asset, known = tree.get("asset", {}), {"unit": UNITS, "up": ("y", "z")}
        extras = self.asset.get("extras")  # said are those that gtb writes
        said = extras.items() if isinstance(extras, dict) else ()
        self.said = {key: value for key, value in said if key in known and str(value) in known[key]}
        self._marks: dict[tuple[str, Any], Any] = {}
        self._left = 4 * len(binary) + (1 << 28)  # bytes that marks may stand for: views of a buffer may overlap

    def placed_meshes(self) -> Iterator[tuple[dict[str, Any], str, FloatArray]]:
        """Yield the meshes with the names of their nodes and their (4, 4) places."""
        for number, _, place in self.placed:
            if "mesh" in (node := self.tree["nodes"][number]):
                yield self.tree["meshes"][_index(node["mesh"])], str(node.get("name", "")), place

    def material(self, number: int | None) -> list[float]:
        """Return the colour of a material, the default one's for None, and a mark of all else, its name too."""
        material = {} if number is None else self.tree["materials"][number]
        colour = material.get("pbrMetallicRoughness", {}).get(COLOUR, (1, 1, 1, 1))
        if len(colour) != 4:
            raise GtbError(f"{COLOUR}: expected 4 numbers, got {len(colour)}")
        return [*map(float, colour), *mark_of(json.dumps(self._mark("shadings", number)))]

    def further(self) -> list[float] | None:
        """Return a mark of what is said beside the faces, places and materials of meshes, if there is anything."""
        placing = {"mesh", "matrix", "translation", "rotation", "scale", "children", "name"}
        drawing = {"attributes", "indices", "material", "mode"}

        def without(table: dict[str, Any], names: set[str]) -> dict[str, Any]:
            return {name: value for name, value in table.items() if name not in names}

        nodes, scenes, meshes = (self.tree.get(name, ()) for name in ("nodes", "scenes", "meshes"))
        names = [f"{mark_of(str(nodes[number].get('name', '')))}" for number, *_ in self.placed]  # short
        uses = Counter(names)
        labels = {number: names[k] if uses[names[k]] == 1 else k for k, (number, *_) in enumerate(self.placed)}
        self._marks |= {("nodes", number): label for number, label in labels.items()}
        are_posed = len(scenes) > 1 or self.tree.get("skins") or self.tree.get("animations")  # their places count
        has_root = sum(depth == 0 for _, depth, _ in self.placed) == 1
        are_several = sum("mesh" in nodes[number] for number in labels) > 1
        of_meshes, of_nodes = dict[tuple[int, bool], tuple[Any, bool]](), []  # marks, and whether they have points
        path = list[Any]([None])  # of names, without that of a root that holds all
        least = 1e-9 * max((np.abs(place[:3, 3]).max() for *_, place in self.placed), default=0.0)
        for number, depth, place in self.placed:
            node, has_place = nodes[number], False
            said = without(node, {"mesh"} if are_posed else placing)
            if "mesh" in node:
                mesh = meshes[key := _index(node["mesh"])]
                has_own = are_several and "name" in node and mesh.get("name") != node["name"]
                if (key, has_own) not in of_meshes:  # many nodes may share it
                    rest = [each if each.get("mode") == 0 else without(each, drawing) for each in mesh["primitives"]]
                    told = self._told(without(mesh, set() if has_own else {"name"}) | {"primitives": rest}, "mesh")
                    mark = mark_of(json.dumps(told, sort_keys=True)) if told else None
                    of_meshes[key, has_own] = mark, any("attributes" in each for each in rest)
                said["mesh"], has_place = of_meshes[key, has_own]
            is_lone = "mesh" not in node and (said or not node.get("children"))  # as a camera is
            if has_place or is_lone:
                said["place"] = []
                for part, low in ((place[:3, :3], 0.0), (place[:3, 3], least)):  # rounding is not a shift
                    size = largest if (largest := np.abs(part).max()) > low else np.inf
                    said["place"] += [*(np.round(part / size, 6) + 0.0).ravel().tolist(), float(f"{size:.7g}")]
            counts = "mesh" in node or ("name" in node and not (has_root and depth == 0))
            path[depth + 1 :] = [mark_of(f"{path[depth]} {node.get('name')}") if counts else path[depth]]
            if told := self._told(said | {"path": path[depth]} if "mesh" in node or is_lone else said):
                of_nodes.append(told | {"node": labels[number]})
        found = {name: self.tree.get(name) for name in ("skins", "animations", "cameras", "extensions", "extras")}
        extras = self.asset.get("extras")
        extras = without(extras, {*self.said}) if self.said else extras
        found["asset"] = {"extensions": self.asset.get("extensions"), "extras": extras}
        tables = ("textures", "images") if self.tree.keys() & {"extensions", "extensionsUsed"} else ()
        numbers = [(name, k) for name in tables for k in range(len(self.tree.get(name, ())))]
        found["named"] = [self._mark(*each) for each in numbers if each not in self._marks]  # perhaps by a bare number
        found["scenes"] = scenes if len(scenes) > 1 else [without(scene, {"nodes", "name"}) for scene in scenes]
        told = self._told(found)
        unseen = [node for number, node in enumerate(nodes) if number not in labels]
        unseen += [mesh for number, mesh in enumerate(meshes) if number not in {key for key, _ in of_meshes}]
        for name, values in (("nodes", of_nodes), ("others", [*map(self._told, unseen)])):  # in any order
            told |= {name: sorted(json.dumps(each, sort_keys=True) for each in values)} if values else {}
        if self._left <= 0:
            raise GtbError("has parts of its buffer that overlap, which would be more than four times the file")
        return mark_of(json.dumps(told, sort_keys=True)) if told else None

    def _told(self, value: Any, key: str = "", above: str = "") -> Any:
        """Return a value with marks of what it refers to; `key` and `above` are the names below which it stands."""
        if key == "extras":
            return value
        if isinstance(value, dict):
            known = _DEFAULTS | {COLOUR: value.get(COLOUR)} if above == "shadings" else _DEFAULTS
            said = [each for each in value.items() if above == "extensions" or each[1] != known.get(each[0])]
            told = {name: self._told(inner, name, key) for name, inner in said}
            return {name: inner for name, inner in told.items() if key == "extensions" or inner not in _NOTHING}
        if isinstance(value, list):
            each = [self._told(inner, key, above) for inner in value]
            each = sorted(each, key=str) if key == "children" else each
            return each if any(inner not in _NOTHING for inner in each) else []
        table = _TABLES.get(key, "")
        if {key, above} & {"targets", "attributes"}:
            table = "accessors"
        elif "texture" in above.lower():
            table = {"index": "textures", "source": "images", "sampler": "samplers"}.get(key, "")
        return self._mark(table, value) if table else float(value) if type(value) is int else value

    def _mark(self, table: str, number: Any) -> Any:
        """Return what stands for an entry of a table, which is its number if there is no such entry."""
        if (table, number) not in self._marks and self._left > 0:
            self._marks[table, number] = number
            with suppress(LookupError, TypeError, AttributeError, GtbError):
                self._marks[table, number] = self._found(table, number)
        return self._marks.get((table, number))

    def _found(self, table: str, number: Any) -> Any:
        entry = {} if number is None else self.tree["materials" if table == "shadings" else table][number]
        if table == "bufferViews":
            start, buffer = entry.get("byteOffset", 0), self.tree["buffers"][entry.get("buffer", 0)]
            content = self.binary[start : start + entry["byteLength"]]
            self._left -= len(content)
            return mark_of(buffer.get("uri", content))
        if table == "accessors":
            held = [entry] if "bufferView" in entry else []
            if sparse := entry.get("sparse"):
                held += [entry | {"byteOffset": 0, "count": sparse["count"]} | sparse["values"]]
                held += [{"type": "SCALAR", "count": sparse["count"]} | sparse["indices"]]
            rows = [meant(_rows(self.tree, self.binary, each), each) for each in held]
            self._left -= sum(each.nbytes for each in rows)
            return mark_of(*(each.tobytes() for each in rows))
        told = entry if table in ("materials", "shadings", "nodes") else entry | {"name": None}
        return mark_of(json.dumps(self._told(told, table), sort_keys=True))


COLOUR = "baseColorFactor"
# What numbers below some names refer to
_TABLES = {"material": "materials"}
_TABLES |= dict.fromkeys(("bufferView", "values", "arrayOffsets", "stringOffsets"), "bufferViews")
_TABLES |= dict.fromkeys(("input", "output", "inverseBindMatrices", "indices"), "accessors")
_TABLES |= dict.fromkeys(("node", "nodes", "joints", "skeleton", "children"), "nodes")
_NOTHING: tuple[object, ...] = ({}, [], None)
# Values that say nothing, by names which have no other meaning but within extensions
_DEFAULTS: dict[str, Any] = {"metallicFactor": 1, "roughnessFactor": 1, "emissiveFactor": [0, 0, 0]}
_DEFAULTS |= {"alphaMode": "OPAQUE", "alphaCutoff": 0.5, "doubleSided": False, "texCoord": 0, "scale": 1, "strength": 1}
_DEFAULTS |= {"wrapS": 10497, "wrapT": 10497, "interpolation": "LINEAR"}


def _placed_nodes(tree: dict[str, Any], most: int) -> Iterator[tuple[int, int, FloatArray]]:
    """Yield the nodes of a scene, each before those within it: their numbers, depths and (4, 4) places."""
    harmless = {"materials_unlit", "texture_transform", "lights_punctual", "materials_specular"}
    deepest = 100  # nodes within nodes
    if needed := set(tree.get("extensionsRequired", ())) - {f"KHR_{name}" for name in harmless}:
        raise GtbError(f"needs {', '.join(sorted(map(str, needed)))}, which is not known here")
    if len(nodes := tree.get("nodes", [])) > most:
        raise GtbError(f"has {len(nodes)} nodes, more than {most} for its bytes")
    if "scenes" in tree:
        roots = tree["scenes"][tree.get("scene", 0)].get("nodes", [])
    else:
        inner = {child for node in nodes for child in node.get("children", ())}
        roots = [index for index in range(len(nodes)) if index not in inner]
    world = np.eye(4)
    stack = [(_index(root), world, 0) for root in reversed(roots)]
    seen = set()
    while stack:
        index, above, depth = stack.pop()
        if index in seen:  # glTF has trees of nodes only; others can be longer than any file
            raise GtbError(f"has node {index} in two places")
        seen.add(index)
        if depth > deepest:
            raise GtbError(f"has nodes within nodes more than {deepest} deep")
        place = above @ _matrix(nodes[index])
        yield index, depth, place
        stack += [(_index(child), place, depth + 1) for child in reversed(nodes[index].get("children", []))]


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
    crossed = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # a vector by this is its product with the axis
    rotation = np.eye(3) + 2 * (w * crossed + np.einsum("ij,jk", crossed, crossed))
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    return matrix
