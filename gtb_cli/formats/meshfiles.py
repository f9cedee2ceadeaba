"""Mesh files to meshes: OBJ, PLY, STL, GLB and 3MF from any program.

trimesh does not read them here: it reads neither OBJ `l` nor PLY edges, reorders vertices, and accepts damaged files.
"""

import os
from codecs import BOM_UTF8
from collections.abc import Iterable, Sequence
from functools import partial
from importlib import import_module

import numpy as np

from gtb_cli.errors import GtbError, MeshError
from gtb_cli.files import read_file
from gtb_cli.formats.file_arrays import STL_HEADER_BYTES, FileArrays, faulty_point, mark_of
from gtb_cli.formats.polygons import unfolded
from gtb_cli.meshes.mesh import GROUPS, KnownMesh, Mesh, Values, largest_coordinates, rounding
from gtb_cli.vocabulary import FORMATS, LFS_FAULT, LFS_POINTER

MAX_FILE_BYTES = 1 << 31  # largest size of a file in bytes; larger ones are refused
# Bytes read from a stream, which may have no end: five million faces, the default limit, take 200 MB of OBJ
MAX_STREAM_BYTES = 1 << 28


def read_mesh(path: str | os.PathLike[str], format: str | None = None) -> Mesh:
    """Read a mesh file; the format, "obj", "ply", "stl", "glb" or "3mf", is by default the one of its content.

    Returns
    -------
    Mesh
        Triangles or segments, with vertices and cells in the order of the file. Polygons are cut into triangles, which
        do not overlap unless it crosses itself or has thousands of corners. Corners of STL facets at exactly the same
        place become one vertex. Normals and texture coordinates are not read.

    Raises `GtbError` if the file cannot be read; the message is one line that names it.
    """
    return decode_mesh(read_file(path, MAX_FILE_BYTES + 1, GtbError), os.fspath(path), format).mesh


def decode_mesh(data: bytes, shown: str, format: str | None = None) -> KnownMesh:
    """Read a mesh from the bytes of a file; `shown` is its name in errors. See `read_mesh`."""
    try:
        if not data:
            raise GtbError("is empty")
        if len(data) > MAX_FILE_BYTES:
            raise GtbError(f"is larger than {MAX_FILE_BYTES >> 30} GB")
        if data.startswith(LFS_POINTER):
            raise MeshError(LFS_FAULT)
        if not _is_facets(data):
            data = data.removeprefix(BOM_UTF8)
        kind = format or format_of(data)
        if kind not in FORMATS:
            raise GtbError("is not a mesh: expected OBJ, PLY, STL, GLB or 3MF")
        with np.errstate(all="ignore"):  # NaN is refused below, with a message
            room = "threemf" if kind == "3mf" else kind
            content: FileArrays = getattr(import_module(f"gtb_cli.formats.{room}"), f"read_{room}")(data)
        _check(content)
    except GtbError as error:
        raise type(error)(f"{shown}: {_printable(str(error))}") from None
    shown_names = {name: _printable(name) for name in {name for name, *_ in content.groups}}  # one may have many ranges
    is_plain = all(name == shown_name for name, shown_name in shown_names.items())
    groups = content.groups if is_plain else [(shown_names[name], a, b) for name, a, b in content.groups]
    has_polygons = len(content.polygons) > 0
    content, fans = unfolded(content) if has_polygons else (content, 0)
    mesh = Mesh(content.vertices, content.cells, groups=tuple(groups))
    largest, space = largest_coordinates(mesh.used), _printable(content.space)
    half_steps = content.half_steps(largest) + rounding(largest)
    values = partial(values_of, content, mesh, shown)
    return KnownMesh(mesh, half_steps, kind, space, values, content.libraries, (), has_polygons, fans)


def values_of(content: FileArrays, mesh: Mesh, shown: str) -> Values:
    """Return what a file holds at the corners of cells, with the numbers of their groups and their materials."""
    try:
        held, corners, most = content.values(), mesh.cells.size, 100_000_000
        found = {_printable(name): values for name, values in held.items()}
        if len(found) < len(held):
            raise GtbError("has two columns whose names differ in control characters, or after 300 others, only")
        columns = sum(rows.shape[1] for rows, _ in held.values())
        if columns > 100 and columns * corners > max(most, 20 * sum(rows.size for rows, _ in held.values())):
            raise GtbError(f"has {columns} numbers at each of {corners} corners of cells: more than {most} in all")
    except GtbError as error:
        raise GtbError(f"{shown}: {_printable(str(error))}") from None
    ranges: dict[str, Iterable[tuple[Sequence[float], int, int]]] = dict(content.ranges)
    marks = {name: mark_of(name) for name in {name for name, *_ in content.groups}}
    grouped = sum(stop - start for _, start, stop in mesh.groups)
    if len(marks) > 1 or 0 < grouped < len(mesh.cells):  # not the name of the whole mesh
        ranges[GROUPS] = ((marks[name], start, stop) for name, start, stop in content.groups)
    for label, parts in ranges.items():
        part, numbers = np.zeros(len(mesh.cells), dtype=np.int64), {tuple[float, ...](): 0}  # of rows, first of none
        for row, start, stop in parts:
            part[start:stop] = numbers.setdefault(tuple(row), len(numbers))
        if width := max(map(len, numbers)):
            rows = np.array([row or [np.nan] * width for row in numbers])
            found[label] = rows, np.broadcast_to(part[:, None], mesh.cells.shape)
    return found


def size_limit(start: bytes, otherwise: int) -> int:
    """Return the largest number of bytes read from a file with this beginning.

    A mesh is read up to `MAX_FILE_BYTES`, or to the size that its beginning states; any other file only up to
    `otherwise`, since a device or a pipe may have no end.
    """
    text_bytes = bytes([*b"\t\n\f\r", *range(32, 127), *range(128, 256)])  # bytes that occur in text
    if format_of(start) is not None or len(start) < STL_HEADER_BYTES:
        return MAX_FILE_BYTES
    said = STL_HEADER_BYTES + 50 * int.from_bytes(start[STL_HEADER_BYTES - 4 : STL_HEADER_BYTES], "little")
    return max(otherwise, min(said, MAX_FILE_BYTES) if start.translate(None, text_bytes) else 0)


def format_of(data: bytes) -> str | None:
    """Return the format of a mesh file, found from its content; None if it is not a known one."""
    if _is_facets(data):
        return "stl"
    words_of_obj = (b"v", b"vn", b"vt", b"g", b"o", b"s", b"mtllib", b"usemtl", b"f", b"l")
    beginning = data[:65536].removeprefix(BOM_UTF8)
    starts = {b"glTF": "glb", b"PK\3\4": "3mf", b"ply\n": "ply", b"ply\r": "ply"}  # no other mesh is a ZIP archive
    if beginning[:4] in starts:
        return starts[beginning[:4]]
    start = beginning[:4096].lstrip()
    if start[:5].lower() == b"solid" and start[5:6] in b" \t\r\n":
        return "stl"
    for line in beginning.splitlines():
        if (words := line.split(None, 1)) and not words[0].startswith(b"#"):
            return "obj" if words[0] in words_of_obj and b"=" not in line else None
    return None


def _is_facets(data: bytes) -> bool:
    """Return whether a file has the size of the facets of a binary STL file, whatever it begins with."""
    return len(data) > STL_HEADER_BYTES and len(data) == STL_HEADER_BYTES + 50 * int.from_bytes(data[80:84], "little")


def _printable(text: str) -> str:
    """Text of a file made fit for a terminal: short, and without control characters."""
    max_name_characters = 300  # longest name, or message of an error, in characters
    kept = "".join(c if c.isprintable() else "\ufffd" for c in text[:max_name_characters])
    return kept + ("…" if len(text) > max_name_characters else "")


def _check(content: FileArrays) -> None:
    """Refuse a mesh without vertices or cells, with wrong indices, or with coordinates that are not finite."""
    vertices, cells = content.vertices, content.cells
    if not len(vertices):
        raise MeshError("has no vertices")
    if not len(cells):
        raise MeshError("has neither faces nor segments")
    low, high = int(cells.min()), int(cells.max())
    if low < 0 or high >= len(vertices):
        cell = int(np.flatnonzero(((cells < 0) | (cells >= len(vertices))).any(axis=1))[0])
        what, wrong = "segment" if cells.shape[1] == 2 else "face", low if low < 0 else high
        raise GtbError(f"{what} {cell}: expected vertices from 0 to {len(vertices) - 1}, got {wrong}")
    if fault := faulty_point(vertices):
        raise MeshError(f"vertex {fault[0]}: {fault[1]}")
