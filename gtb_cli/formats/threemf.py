"""3MF, both ways: a ZIP archive with a mesh as XML, by its core specification 1.3 (3mf.io).

trimesh's exporter needs lxml and networkx, and writes random identifiers.
"""

import hashlib
import math
import posixpath
import re
import zipfile
import zlib
from array import array
from collections.abc import Iterable, Iterator
from functools import cache
from html import escape
from io import BytesIO
from itertools import cycle
from typing import Any, NamedTuple, TypeAlias
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import ExportError, GtbError
from gtb_cli.formats.file_arrays import SINGLE_FLOAT, FileArrays, Ranges, mark_of, single_half_steps
from gtb_cli.formats.numbers_written import text_rows
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.mesh import MATERIALS, OBJECTS, OTHER
from gtb_cli.meshes.topology import are_proper, sides_of
from gtb_cli.vocabulary import PATCH_COLOURS

UNIT_NAMES = {"mm": "millimeter", "cm": "centimeter", "m": "meter", "in": "inch", "ft": "foot"}  # the format's names
MODEL, _LINKS = "3D/3dmodel.model", "_rels/.rels"  # the parts of the archive that hold the mesh, and what it is
LARGEST = 1 << 31  # bytes of this part, which the archive counts with 32 bits


def threemf_blocks(vertices: FloatArray, triangles: IntArray, groups: Ranges, name: str, unit: str) -> Iterable[bytes]:
    """Return a 3MF file with one object, each group of triangles in a material of its own: a name and a colour.

    Numbers have 32 bits, as in the programs that read it. Vertices at exactly the same place are one, and triangles
    without area because of it are left out. An object with a boundary is called a surface, as the format asks.
    """
    longest = 80  # bytes of a line
    if longest * (len(vertices) + len(triangles)) > LARGEST:
        raise ExportError("3MF: holds no more than 2 GB of text")
    single = vertices.astype(SINGLE_FLOAT).astype(np.float64)
    first, place = numbered_places(single)
    cells = place[triangles]
    kept = are_proper(cells)
    if not kept.any():
        raise ExportError("3MF: the mesh is a single point, or a line, for 32-bit numbers")
    kind = "surface" if len(sides_of(cells[kept]).alone) else "model"
    parts = {
        "[Content_Types].xml": [_CONTENT_TYPES],
        _LINKS: [_RELATIONSHIPS],
        MODEL: _model(single[first], cells, kept, groups, f'name="{escape(name)}" type="{kind}"', UNIT_NAMES[unit]),
    }
    file = BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for part, blocks in parts.items():
            entry = zipfile.ZipInfo(part)  # of 1980, the earliest time that there is
            entry.compress_type, entry.create_system, entry.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
            with archive.open(entry, "w") as stream:
                stream.writelines(blocks)
    return [file.getvalue()]


def _model(vertices: FloatArray, cells: IntArray, kept: Any, groups: Ranges, facts: str, unit: str) -> Iterator[bytes]:
    """Yield the description of one object, with a material for each group if there are several."""
    yield f'{_XML}<model unit="{unit}" xml:lang="en-US" xmlns="{_CORE}">\n<resources>\n'.encode()
    if len(groups) > 1:
        bases = zip((escape(name) for name, _, _ in groups), cycle(PATCH_COLOURS), strict=False)
        lines = "".join(f'<base name="{name}" displaycolor="{colour}"/>\n' for name, colour in bases)
        yield f'<basematerials id="2">\n{lines}</basematerials>\n'.encode()
        facts += ' pid="2" pindex="0"'
    yield f'<object id="1" {facts}>\n<mesh>\n<vertices>\n'.encode()
    yield from text_rows('<vertex x="%.9g" y="%.9g" z="%.9g"/>\n', vertices)
    yield b"</vertices>\n<triangles>\n"
    for number, (_, start, stop) in enumerate(groups):
        material = f' pid="2" p1="{number}"' if number else ""
        yield from text_rows(f'<triangle v1="%d" v2="%d" v3="%d"{material}/>\n', cells[start:stop][kept[start:stop]])
    yield b'</triangles>\n</mesh>\n</object>\n</resources>\n<build>\n<item objectid="1"/>\n</build>\n</model>\n'


_XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_CONTENT_TYPES = (
    f'{_XML}<Types xmlns="{_PACKAGE}/content-types">\n'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>\n'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>\n'
    "</Types>\n"
).encode()
_RELATIONSHIPS = (
    f'{_XML}<Relationships xmlns="{_PACKAGE}/relationships">\n'
    f'<Relationship Id="rel0" Target="/{MODEL}" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>\n'
    "</Relationships>\n"
).encode()


def read_threemf(data: bytes) -> FileArrays:
    """Read the objects that a 3MF file builds, in its unit, with their names."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            return _Reader(archive).content()
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, expat.ExpatError) as error:
        raise GtbError(f"is not a whole 3MF file: {str(error) or 'it is cut off'}") from None
    except (LookupError, ValueError, OverflowError) as error:
        raise GtbError(f"its description is wrong: {type(error).__name__}: {error}") from None


# A material: the number of a group, those of members at the corners, and what else is said of triangles with it
_Part: TypeAlias = tuple[str | None, tuple[str | None, ...], str]


class _Mesh(NamedTuple):
    """The mesh of an object: its numbers, where runs of triangles with one material begin, and its own material."""

    vertices: "array[float]"
    corners: "array[int]"
    parts: list[tuple[int, _Part]]
    part: _Part
    name: str
    kind: str


class _Reader:
    """Collects what the elements of a model say."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        names = [name for name in archive.namelist() if name.lower().endswith(".model")]
        name = MODEL if MODEL in names else next(iter(names), None)
        if name is None:
            raise GtbError("is a ZIP archive without the model of a 3MF file")
        has_links = _LINKS in archive.namelist()
        told = archive.read(_LINKS) if has_links and archive.getinfo(_LINKS).file_size < 1 << 20 else b""
        told = told.replace(b"\0", b"")  # of UTF-16
        is_other = has_links and (told.count(b"/01/3dmodel") != 1 or name.encode() not in told)
        if is_other or len({*archive.namelist()}) < len(archive.namelist()):
            raise GtbError(f"has a part twice, or {_LINKS} names another model than {name}")
        model, size = archive.getinfo(name), sum(each.file_size for each in archive.infolist())  # parts may overlap
        if model.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise GtbError("is compressed in a way that no 3MF file is")
        least, ratio = 1 << 24, 200  # bytes that any file may have, and how many times as many as packed ones
        if size > min(LARGEST, max(least, ratio * archive.start_dir)):
            raise GtbError(f"says that it holds more than {LARGEST >> 30} GB, or {ratio} times its packed size")
        self.depth = self.named = self.foreign = 0  # depths, of which the last is that of an element of an extension
        self.left = (1 << 19) + model.compress_size // 2  # elements: each takes four bytes, or repeats
        self.meshes: dict[str, _Mesh] = {}
        self.materials: dict[str | None, list[tuple[str, bytes]]] = {}
        self.components: dict[str, list[tuple[str, FloatArray, str]]] = {}
        self.items: list[tuple[str, FloatArray, str]] = []
        self.id = self.material = ""
        self.known_parts: dict[_Part, _Part] = {}  # each once in memory
        self.order: dict[str, str] = {}  # of what has a number in the file; marks of materials
        # Of objects that are built, no solids but for ""; numbers of those with elements of extensions in their meshes
        self.kinds, self.extended = set[str](), set[str]()
        self.extensions = hashlib.sha256()  # of elements that no place here knows, such as beams
        self.unit = UNIT_NAMES["mm"]  # that of models which name none
        digests = dict[str, str]()
        for other in sorted({*archive.namelist()} - {name}):
            with archive.open(other) as part:
                digests[other] = hashlib.file_digest(part, "sha256").hexdigest()  # type: ignore[arg-type]
        self.parts = {_name_of(other): digest for other, digest in digests.items()}  # by what elements call them
        # Lists of parts, and pictures of what is compared
        plain = re.compile(r"\[Content_Types\]\.xml$|.*(\.rels|/)$|(?!3D/).*\.(png|jpe?g)$", re.IGNORECASE)
        self.others = "".join(f"{other} {digest}\n" for other, digest in digests.items() if not plain.match(other))
        plain_ones = ("resources", "build", "mesh", "vertices", "triangles", "components")
        self.read = dict.fromkeys(plain_ones, self.plain) | {"vertex": self.vertex, "triangle": self.triangle}
        self.read |= {"model": self.model, "object": self.begun_object, "component": self.link, "item": self.link}
        self.read["metadata"] = self.metadata
        self.read |= dict.fromkeys(("basematerials", "colorgroup"), self.list_of_materials)
        self.read |= dict.fromkeys(("base", "color"), self.member)
        parser = expat.ParserCreate()
        parser.StartElementHandler = self.start
        parser.EndElementHandler = self.end
        parser.buffer_text = True
        parser.CharacterDataHandler = self.text
        parser.EntityDeclHandler = self.refuse  # it may stand for more than any memory holds
        fed, longest = 0, 1 << 20  # bytes, also of a comment, which the parser reads again at each call until it ends
        with archive.open(name) as stream:
            while block := stream.read(1 << 16):
                parser.Parse(block)
                fed += len(block)
                if fed - parser.CurrentByteIndex > longest:
                    raise GtbError("has an element, or a comment, of more than 1 MB")
        parser.Parse(b"", True)

    def refuse(self, *_: object) -> None:
        raise GtbError("declares an entity, which no 3MF file may")

    def text(self, found: str) -> None:
        self.extensions.update(b"" if not self.foreign else "".join(found.split()).encode())

    def end(self, _: str) -> None:
        self.depth -= 1
        self.foreign *= self.foreign <= self.depth

    def start(self, name: str, given: dict[str, str]) -> None:
        deepest, most = 32, 100_000  # elements within elements, and objects, materials and their uses
        name = name.rpartition(":")[2]
        self.depth += 1
        self.left -= 1
        self.named += name in ("object", "component", "item", "basematerials", "base", "colorgroup", "color")
        if self.depth > deepest or self.named > most:
            raise GtbError(f"has elements more than {deepest} deep, or more than {most} objects, materials and uses")
        if self.left < 0:
            raise GtbError("has more elements than its bytes in the archive can hold")
        if "id" in given:
            self.order.setdefault(given["id"], f"{len(self.order)}")
        if (read := self.read.get(name)) is not None and not self.foreign:
            read(name, given)
            return
        self.note(name, given)
        if not self.foreign:
            self.foreign = self.depth
            self.extended |= {f"{len(self.meshes)}"} if self.depth > 4 else set()

    def vertex(self, _: str, given: dict[str, str]) -> None:
        vertices = self.meshes[self.id].vertices
        vertices.extend((float(given["x"]), float(given["y"]), float(given["z"])))
        if len(given) > 3:
            self.note(f"vertex {len(vertices)}", given, "x", "y", "z")

    def triangle(self, _: str, given: dict[str, str]) -> None:
        mesh = self.meshes[self.id]
        first = given.get("p1", mesh.part[1][0])
        members: tuple[str | None, ...] = first, given.get("p2", first), given.get("p3", first)
        rest = sorted(given.keys() - {"v1", "v2", "v3", "pid", "p1", "p2", "p3"})
        told = "".join(sorted(f"{key.rpartition(':')[2]} {given[key]}\n" for key in rest))
        part = given.get("pid", mesh.part[0]), members, told
        if not mesh.parts or mesh.parts[-1][1] != part:
            mesh.parts.append((len(mesh.corners) // 3, self.known_parts.setdefault(part, part)))
        mesh.corners.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))

    def model(self, name: str, given: dict[str, str]) -> None:
        self.unit = given.get("unit", self.unit)
        self.note(name, given, "unit", "lang", "requiredextensions", "recommendedextensions", "schemaLocation")

    def list_of_materials(self, name: str, given: dict[str, str]) -> None:
        self.material = given["id"]
        self.materials[self.material] = []
        self.note(name, given, *_KNOWN)

    def member(self, name: str, given: dict[str, str]) -> None:
        said = given.get("displaycolor" if name == "base" else "color", "#ffffff")
        if re.fullmatch("#([0-9a-fA-F]{2}){3,4}", said) is None:
            raise GtbError(f"expected a colour such as #D97706, got {said:.40}")
        colour = bytes.fromhex(said[1:].ljust(8, "f"))
        self.materials[self.material].append((given["name"] if name == "base" else "", colour))
        self.note(name, given, "name", "displaycolor", "color")
        self.order[self.material] = f"{mark_of(f'{self.order[self.material]} {self.materials[self.material][-1]}')}"

    def begun_object(self, _: str, given: dict[str, str]) -> None:
        self.id = given["id"]
        own: _Part = given.get("pid"), (given.get("pindex"),), ""
        kind = given.get("type", "model").removeprefix("model")
        self.meshes[self.id] = _Mesh(array("f"), array("q"), [], own, given.get("name", ""), kind)
        self.components[self.id] = []
        self.note(f"object {len(self.meshes)}", given, *_KNOWN)

    def link(self, name: str, given: dict[str, str]) -> None:
        if any(key.endswith(":path") for key in given):
            raise GtbError("has an object in another part of the archive, where it is not looked for")
        matrix = np.eye(4)  # by which rows (x y z 1) are multiplied
        if "transform" in given:
            matrix[:, :3] = np.array([float(word) for word in given["transform"].split()]).reshape(4, 3)
        link = given["objectid"], matrix, "" if given.get("printable", "1") in ("1", "true") else "not printed\n"
        (self.items if name == "item" else self.components[self.id]).append(link)
        self.note(f"{name} {len(self.items)}", given, *_KNOWN)

    def plain(self, name: str, given: dict[str, str]) -> None:
        self.note(name, given, "xmlns")

    def metadata(self, _: str, given: dict[str, str]) -> None:
        unsaid = ("Title", "Application", "CreationDate", "ModificationDate")  # and what programs say for themselves
        if (name := given.get("name", "")) not in unsaid and ":" not in name:
            self.foreign = self.depth  # its text counts
            self.note(name, {})

    def note(self, name: str, given: dict[str, str], *known: str) -> None:
        """Take attributes into account that no place here knows, whatever the prefixes and numbers of this file."""
        plain = {key.rpartition(":")[2]: value for key, value in given.items() if key[:5] != "xmlns"}
        told = dict[str, str]()  # what is named counts by what it holds, or by its place in the file
        for key in sorted(plain.keys() - {"id", "identifier", "UUID", *known}):
            ids = plain[key].split() if key.endswith(("id", "ids")) else []
            value = " ".join(self.order.get(each, each) for each in ids) or plain[key]
            told[key] = value + self.parts.get(_name_of(value), "")
        if told or not known:
            self.extensions.update(f"{name} {told}".encode())

    def placed(self) -> Iterator[tuple[_Mesh, FloatArray, str, str, str]]:
        """Yield the objects that are built: with places, numbers, what else is said, and the assemblies they are in."""
        most = 50_000_000  # numbers of all placed objects: few bytes may name many
        effort = 10_000  # numbers that take as long as an object without any
        order = {key: number for number, key in enumerate(self.meshes)}
        used, stack = 0, [(*item, len(order), "") for item in reversed(self.items)]
        while stack:
            key, place, said, above, path = stack.pop()
            if order[key] >= above:  # an object names only earlier ones
                raise GtbError(f"object {key!r:.40} is not before the object that refers to it")
            mesh = self.meshes[key]
            used += len(mesh.vertices) + len(mesh.corners) + effort
            if used > most:
                raise GtbError(f"has more than {most} numbers in all objects together")
            said += mesh.kind * (len(self.kinds) > 1)  # a kind of all stands in what the file says
            number, inner = f"{order[key] + 1}", self.components[key]
            yield mesh, place, number, said, path
            if inner and (mesh.name or len(inner) > 1):  # no assembly is around one object
                path = f"{mark_of(f'{path}/{mesh.name or number}')}"  # short
            stack += [(link, motion @ place, said + more, order[key], path) for link, motion, more in reversed(inner)]

    def content(self) -> FileArrays:
        """Put the objects where they are built."""
        vertices, cells = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
        groups: list[tuple[str, int, int]] = []
        ranges: dict[str, list[tuple[list[float], int, int]]] = {name: [] for name in (_LOOK, OBJECTS, *_PLACED)}
        built = [mesh for mesh, *_ in self.placed()]
        self.kinds = {mesh.kind for mesh in built}
        materials, named = set[str](), {mesh.name for mesh in built if len(mesh.corners)}
        look = cache(self.look)  # triangles of a few materials may take turns
        count = rows = 0
        for mesh, place, number, *placed in self.placed():
            points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3) @ place[:3, :3] + place[3, :3]
            found = np.array(mesh.corners).reshape(-1, 3)
            if len(wrong := found[(found < 0) | (found >= len(points))]):
                raise GtbError(f"triangles: expected vertices below {len(points)}, got {wrong[0]}")
            if number in self.extended:  # beams may end where no face does
                self.extensions.update((np.delete(points, found, axis=0) + 0.0).astype(SINGLE_FLOAT).tobytes())
            is_mirrored = np.linalg.det(place[:3, :3]) < 0  # then faces keep their outer sides
            vertices.append(points)
            cells.append((found[:, ::-1] if is_mirrored else found) + count)
            ends = [*(rows + start for start, _ in mesh.parts[1:]), rows + len(found)]
            looks = [*map(look, (part for _, part in mesh.parts))]
            materials |= (here := {material for material, _ in looks})
            begin = rows
            for end, (material, row) in zip(ends, looks, strict=False):
                name = material or mesh.name or number
                is_same = begin > rows and groups[-1][0] == name  # with other paint
                groups.append((name, groups.pop()[1] if is_same else begin, end))
                ranges[_LOOK].append((row, begin, end))
                begin = end
            own = mesh.name if len(named) > 1 and any(here) else ""
            for label, text in zip((*_PLACED, OBJECTS), (*placed, own), strict=True):
                ranges[label] += [(mark_of(text), rows, rows + len(found))] if text else []
            count, rows = count + len(points), rows + len(found)
        extensions = self.extensions.digest() if self.extensions.digest() != hashlib.sha256().digest() else b""
        material = materials.pop() if len(materials) == 1 else ""  # that of a whole mesh
        known = {id(mesh) for mesh in built}
        unbuilt = "".join(f"{self.mark(key)}\n" for key, mesh in self.meshes.items() if id(mesh) not in known)
        others = (("further parts", self.others), ("material", material), ("objects that are not built", unbuilt))
        for label, told in (("extensions", extensions), *others):
            ranges[f"{OTHER}{label}"] = [(mark_of(told), 0, rows)] if told else []
        points, corners = np.concatenate(vertices), np.concatenate(cells)
        space = ", ".join([self.unit, *sorted(self.kinds - {""})])
        return FileArrays(points, corners, single_half_steps, tuple(groups), space, ranges=ranges)

    def look(self, part: _Part) -> tuple[str, list[float]]:
        """Return the name of a material, and its colour with a mark of what else is said; none if it is plain."""
        known, rest = self.materials.get(part[0]), part[2]
        name, colour = known[int(part[1][0] or 0)] if known else ("", b"")
        if part[0] and not known:
            rest += f"{self.order.get(part[0], part[0])} {part[1]}"
        elif known and len({*part[1]}) > 1:  # the colour runs from corner to corner
            rest += f"{[known[int(member or 0)] for member in part[1]]}"
        shares = [share / 255 for share in colour] or [math.nan] * 4
        return name, [*shares, *(mark_of(rest) if rest else [math.nan] * 4)] if colour or rest else []

    def mark(self, key: str) -> list[float]:
        """Return a mark of all that is said of an object."""
        mesh = self.meshes[key]
        looks = [(start, *self.look(part)) for start, part in mesh.parts]
        links = [(self.order.get(link, link), place.tolist(), said) for link, place, said in self.components[key]]
        return mark_of(bytes(mesh.vertices), bytes(mesh.corners), f"{mesh.name} {mesh.kind} {looks} {links}")


def _name_of(part: str) -> str:
    """Return the name of a part as it is compared: an absolute path in lower case, without escapes."""
    return posixpath.normpath("/" + unquote(part).lstrip("/")).lower()


_LOOK, _PLACED = f"{MATERIALS}3MF", (f"{OBJECTS} that are not printed, or support", f"{OBJECTS} in assemblies")
# Attributes of the core specification that are read, or say nothing of their own
_KNOWN = ["objectid", "name", "type", "pid", "pindex", "transform", "printable", "thumbnail"]
