"""Wavefront OBJ files that are read: vertices, faces, polylines (`l`, which trimesh does not read) and groups."""

import re
from bisect import bisect_left
from collections import Counter
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError, MeshError
from gtb_cli.formats.file_arrays import FileArrays, faulty_point, mark_of
from gtb_cli.formats.numbers_read import BLOCK_BYTES, T, half_step, lines_of, number_rows, padded, sampled, shown
from gtb_cli.formats.polygons import polygons_of, segments, triangles
from gtb_cli.meshes.mesh import COLOURS, LIBRARIES, MATERIALS, NORMALS, OBJECTS, OTHER, SETTINGS, TEXTURE, Values

MIN_NUMBERS = {b"v": 3, b"f": 3, b"l": 2}  # fewest numbers in a line, by keyword
STATES = b"s mg usemap bevel c_interp d_interp lod".split()  # keywords of what holds for the cells behind them
FILES = b"maplib shadow_obj trace_obj".split()  # keywords of files that are used whatever the materials


def read_obj(data: bytes, block: int = BLOCK_BYTES) -> FileArrays:
    """Read an OBJ file, `block` bytes at a time.

    Vertices keep their order. A face with more than three corners is cut into triangles. Negative references count back
    from the last vertex so far. Normals and texture coordinates are read when they are asked for.
    """
    if b"\\\n" in data or b"\\\r\n" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    content = _read_all(data, block)
    if 0 < len(content.vertices) <= content.cells.max(initial=0):
        _read_all(data, block, len(content.vertices))  # finds the line
    if b"vn" not in data and b"vt" not in data:
        return content
    return replace(content, values=lambda: {**content.values(), **_values(data, block)})


def _values(data: bytes, block: int) -> Values:
    """Read the normals and the texture coordinates at the corners of faces; those without have NaN."""
    found: Values = {}
    for keyword, label, width, field in ((b"vt", TEXTURE, 2, 1), (b"vn", NORMALS, 3, 2)):
        rows, corners, so_far = [np.empty((0, 3))], list[IntArray](), 0
        for _, lines in lines_of(data, size=block) if keyword in data else ():
            places, _ = _sorted(lines)
            if places[keyword]:
                numbers, counts = number_rows(b"\n".join([lines[k][2:] for k in places[keyword]]), np.float64)
                if counts.min() < (least := 1 if keyword == b"vt" else 3):
                    raise GtbError(f"{shown(keyword)} has at least {least} numbers, got {counts.min()}")
                rows.append(padded(numbers, counts, 3, 0.0))
            cells, made = (b"l", segments) if places[b"l"] else (b"f", triangles)
            if places[cells]:
                words = [lines[k][2:].split() for k in places[cells]]
                counts = np.array([len(line) for line in words])
                parts = [(*word.split(b"/"), b"", b"")[field] or b"0" for line in words for word in line]
                chosen = number_rows(b"\n".join(parts), np.int64)[0]
                before = so_far + np.repeat(np.searchsorted(places[keyword], places[cells]), counts)
                corners.append(made(np.where(chosen < 0, before + chosen, chosen - 1), counts))
            so_far += len(places[keyword])
        of = np.concatenate(corners or [np.empty((0, 3), dtype=np.int64)])
        if of.max(initial=-1) >= so_far or of.min(initial=0) < -1:
            raise GtbError(f"{label}: a face refers to one that is not there")
        if len(of) and of.max() >= 0:
            numbers = np.concatenate([*rows, np.full((1, 3), np.nan)])
            wide = 3 if np.nan_to_num(numbers[of[of >= 0], width:]).any() else width
            found[label] = numbers[:, :wide], np.where(of < 0, so_far, of)
    return found


def _read_all(data: bytes, block: int, vertices: int | None = None) -> FileArrays:
    reader = _ObjLines(vertices)
    for start, lines in lines_of(data, size=block):
        reader.read(lines, start + 1)
    return reader.content()


class _ObjLines:
    """The content read so far; references beyond the number of vertices are refused if this is known."""

    def __init__(self, limit: int | None) -> None:
        self.limit = limit
        self.vertices: list[FloatArray] = []
        self.further: list[FloatArray] = []  # numbers after the coordinates, which are mostly colours
        self.count = 0
        self.words: list[bytes] = []
        self.cells: dict[bytes, list[IntArray]] = {b"f": [], b"l": []}
        self.cell_count = 0
        self.polygons = [np.empty((0, 2), dtype=np.int64)]
        self.names: list[tuple[bytes, str, int]] = []  # by keyword, and at how many cells

    def read(self, lines: list[bytes], number: int) -> None:
        """Read lines, the first of which has this `number`. The first wrong one is found by halving."""
        try:
            self._read(lines)
        except GtbError as error:
            if len(lines) == 1:
                raise type(error)(f"line {number}: {error}") from None
            half = len(lines) // 2
            self.read(lines[:half], number)
            self.read(lines[half:], number + half)

    def _read(self, lines: list[bytes]) -> None:
        """Read the lines of each keyword together; nothing is changed if one of them is wrong."""
        places, names = _sorted(lines)
        points, starts = np.empty((0, 3)), [self.cell_count] * len(names)
        further, most = points[:, 3:], 16  # numbers of a vertex: coordinates, a weight, a colour, a normal, …
        if places[b"v"]:
            numbers, counts = _numbers(b"v", lines, places[b"v"], np.float64)
            if counts.max() > most:
                raise GtbError(f"a vertex has at most {most} numbers, got {counts.max()}")
            points, further = np.split(padded(numbers, counts, int(counts.max()), np.nan), [3], axis=1)
            if fault := faulty_point(points):
                raise MeshError(f"a vertex {fault[1]}")
        cells = {}
        for keyword, made, fewer in ((b"f", triangles, 2), (b"l", segments, 1)):
            if not places[keyword]:
                continue
            corners, counts = _numbers(keyword, lines, places[keyword], np.int64)
            if not corners.all():
                raise GtbError("vertices are counted from 1, got 0")
            if (backwards := corners < 0).any():
                before = np.repeat(self.count + np.searchsorted(places[b"v"], places[keyword]), counts)
                if (corners < -before).any():
                    raise GtbError(f"{corners[corners < -before][0]} counts back before the first vertex")
                corners += np.where(backwards, before + 1, 0)
            if self.limit is not None and corners.max() > self.limit:
                raise GtbError(f"expected vertices from 1 to {self.limit}, got {corners[corners > self.limit][0]}")
            corners -= 1
            cells[keyword] = made(corners, counts), counts
            ends = np.concatenate([[0], np.cumsum(counts - fewer)])
            through = np.searchsorted(places[keyword], [place for place, *_ in names])
            starts = [start + int(ends[row]) for start, row in zip(starts, through, strict=True)]
        rows = sampled([lines[place] for place in places[b"v"]], len(self.words) // 3)
        self.words += [word for row in rows for word in row.split()[1:4]]
        self.vertices.append(points)
        self.further.append(further)
        self.count += len(points)
        for keyword, (part, counts) in cells.items():
            self.cells[keyword].append(part)
            self.polygons += [polygons_of(counts, self.cell_count)] if keyword == b"f" else []
            self.cell_count += len(part)
        for (place, keyword, name), start in zip(names, starts, strict=True):
            so_far = self.count - len(points) + bisect_left(places[b"v"], place)
            self.names.append((keyword, _forwards(name, so_far) if keyword == b"p" else name, start))

    def content(self) -> FileArrays:
        if self.cells[b"f"] and self.cells[b"l"]:
            raise GtbError("has both faces (f) and polylines (l): expected one of them")
        vertices = np.concatenate([np.empty((0, 3)), *self.vertices])

        def named(*keywords: bytes) -> list[tuple[str, int, int]]:
            found = [each for each in self.names if each[0] in keywords] + [(b"", "", self.cell_count)]
            return [(name, a, b) for (_, name, a), (*_, b) in pairwise(found) if name and a < b]

        groups, objects, materials = named(b"g", b"o"), named(b"o"), named(b"usemtl")
        is_divided = len({name for name, *_ in objects}) > 1 or sum(b - a for _, a, b in objects) < self.cell_count
        is_divided = is_divided and any(keyword == b"g" for keyword, *_ in self.names)
        ranges = {OBJECTS: objects if is_divided else [], f"{MATERIALS}OBJ": materials}
        ranges |= {f"{SETTINGS}{keyword.decode()}": named(keyword) for keyword in STATES}
        marks = {label: [(mark_of(name), a, b) for name, a, b in named] for label, named in ranges.items()}
        digits = 6 - round(np.log10(np.ptp(vertices, axis=0).max() or 1.0)) if len(vertices) else 0
        parts = {name for keyword, name, _ in self.names if keyword in (b"g", b"o")}
        lone, state = Counter[str](), dict.fromkeys([b"usemtl", *[b"g", b"o"] * (len(parts) > 1)], "")
        for keyword, name, _ in self.names:
            if keyword in state:
                state[keyword] = name
            elif keyword == b"p":
                lone.update(f"{_place(word, vertices, digits)} {[*state.values()]}" for word in name.split()[1:])
        told = "\n".join(sorted(f"{place} {count}" for place, count in lone.items()))
        read = [*FILES, b"mtllib"] if materials or named(b"usemap") else FILES
        libraries = tuple(name for keyword, name, _ in self.names if keyword in read)
        for label, text in ((f"{OTHER}points", told), (LIBRARIES, "\n".join(libraries))):
            marks[label] = [(mark_of(text), 0, self.cell_count)] if text else []
        cells = np.concatenate(self.cells[b"l"] or [np.empty((0, 3), dtype=np.int32), *self.cells[b"f"]])
        width = max((part.shape[1] for part in self.further), default=0)
        further = [np.pad(part, ((0, 0), (0, width - part.shape[1])), constant_values=np.nan) for part in self.further]

        def values() -> Values:
            numbers = np.concatenate([np.empty((0, width)), *further])
            if width < 2 and (np.isnan(numbers) | (numbers == 1)).all():  # weights are 1 unless another one is said
                return {}
            label = COLOURS if width < 5 else "further numbers of vertices"
            return {label if width > 1 else "weights of vertices": (numbers, cells)}

        steps, polygons = partial(half_step, self.words), np.concatenate(self.polygons)
        return FileArrays(vertices, cells, steps, tuple(groups), "", values, marks, libraries, polygons)


def _sorted(lines: list[bytes]) -> tuple[dict[bytes, list[int]], list[tuple[int, bytes, str]]]:
    """Return the places of vertices and cells by keyword, and of names with theirs; a tab after one becomes a blank."""
    # Keywords of free-form curves and surfaces
    free_form_keywords = set(b"curv curv2 surf cstype deg bmat step vp parm trim hole scrv sp end con".split())
    known: dict[bytes, list[int]] = {b"v ": [], b"f ": [], b"l ": [], b"vn": [], b"vt": []}  # the last with any blank
    other: list[int] = []
    for place, line in enumerate(lines):
        known.get(line[:2], other).append(place)
    names = []
    for place in other:
        keyword, _, rest = lines[place].strip().partition(b" ")
        if b"\t" in keyword:
            keyword, rest = (*lines[place].split(None, 1), b"")[:2]
        if (kind := (keyword + b" ")[:2] if keyword in MIN_NUMBERS else keyword) in known:
            known[kind].append(place)
            lines[place] = keyword + b" " + rest
        elif keyword in (b"g", b"o", b"usemtl", b"mtllib", *FILES, *STATES):
            name = b" ".join(rest.split()).decode("utf-8", "backslashreplace")
            names.append((place, keyword, "" if keyword in STATES and name in ("0", "off") else name))
        elif keyword == b"p":
            names.append((place, b"p", b" ".join(lines[place].split()).decode("utf-8", "backslashreplace")))
        elif keyword in free_form_keywords:
            raise GtbError(f"{shown(keyword)}: free-form curves and surfaces are not a mesh")
        elif keyword and not keyword.startswith(b"#"):
            raise GtbError(f"unknown keyword {shown(keyword)}")
    return {keyword.strip(): sorted(places) for keyword, places in known.items()}, names


def _forwards(text: str, before: int) -> str:
    """Return what is said of single points with references from 1, where negative ones count back from `before`."""
    return re.sub(r"(?<= )-[0-9]{1,18}\b", lambda found: str(before + 1 + int(found[0])), text)


def _place(reference: str, vertices: FloatArray, digits: int) -> str:
    """Return where a single point is, whatever its number, or the reference itself to one that is not there."""
    found = re.fullmatch("([0-9]{1,18})(/.*)?", reference)
    number = int(found[1]) if found else 0
    is_there = 0 < number <= len(vertices)
    return f"{[round(x, digits) + 0.0 for x in vertices[number - 1].tolist()]}" if is_there else reference


def _numbers(keyword: bytes, lines: list[bytes], places: list[int], kind: type[T]) -> tuple[NDArray[T], IntArray]:
    """Return the numbers of some lines, and the count of each, which must be enough for the keyword."""
    text = b"\n".join([lines[place][2:] for place in places])
    numbers, counts = number_rows(text if keyword == b"v" else _references(text), kind)
    if counts.min() < (least := MIN_NUMBERS[keyword]):
        what = "a vertex has 3 coordinates" if keyword == b"v" else f"{shown(keyword)} has at least {least} vertices"
        raise GtbError(f"{what}, got {counts.min()}")
    return numbers, counts


def _references(text: bytes) -> bytes:
    """The references to vertices, without those to texture coordinates and normals."""
    if b"/" not in text:
        return text
    if lone := re.search(rb"(?<![^ \t\n])/[^ \t\n]*", text):
        raise GtbError(f"{shown(lone[0])} is not a whole number")
    characters = np.frombuffer(text, dtype=np.uint8)
    slash = characters == ord("/")
    # The text from a slash to the next blank is left out; a regular expression would take five times the memory.
    last = np.where(slash | (characters <= ord(" ")), np.arange(len(text), dtype=np.int32), np.int32(0))
    return bytes(characters[~slash[np.maximum.accumulate(last, out=last)]])
