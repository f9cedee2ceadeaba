"""IGES files: rational B-spline curves (entity 126) and surfaces (128), as exact Bézier patches.

A file has lines of 80 columns; column 73 names the section: S for remarks, G for global values, D for the directory
(two lines an entity), P for parameters (in free format up to column 64).
"""

import math
import re
from collections import Counter
from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers.classical_nets import MAX_DEGREE
from gtb_cli.importers.nurbs import MAX_CONTROL_POINTS, spans
from gtb_cli.importers.words import SHOWN_CHARACTERS, as_number
from gtb_cli.language.entries import valid_name
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch

CURVE, SURFACE, TRANSFORMATION = 126, 128, 124


@dataclass(frozen=True)
class Entity:
    """A directory entry: kind, parameters' first line and number of lines, transformation, use and name."""

    kind: int
    first: int
    count: int
    transformation: int
    use: str
    name: str | None
    line: int


class _File:
    """The sections of a file: directory entries and parameters by number, with their lines."""

    def __init__(self, data: bytes, source: str) -> None:
        self.source = source
        self.globals = ""
        self.parameters: dict[int, tuple[int, str]] = {}
        self.entities: dict[int, Entity] = {}
        directory: list[tuple[int, str]] = []
        lines = re.split("\r\n|\n|\r", data.decode("latin-1"))
        for number, line in enumerate(lines, 1):
            match line[72:73]:
                case "G":
                    self.globals += line[:72]
                case "D":
                    directory.append((number, line))
                case "P":
                    self.parameters[len(self.parameters) + 1] = number, line[:64]
        if not directory:
            raise SpecError(f"{source}: has no directory, which IGES files have (a D in column 73)")
        for index in range(0, len(directory) - 1, 2):
            self.entities[index + 1] = self._entity(*directory[index], directory[index + 1][1])

    def fail(self, line: int, message: str) -> SpecError:
        return SpecError(f"{self.source}:{line}: {message}")

    def _entity(self, line: int, first: str, second: str) -> Entity:
        label = second[56:64].strip()
        number = second[64:72].strip()
        name = f"{label}-{number}" if label and number not in ("", "0") else label
        return Entity(
            self._field(line, first, 0, "entity type"),
            self._field(line, first, 1, "parameter pointer"),
            self._field(line + 1, second, 3, "parameter line count"),
            abs(self._field(line, first, 6, "transformation")),
            first[64:72].strip().zfill(8)[2:6],
            valid_name(name),
            line,
        )

    def _field(self, line: int, text: str, index: int, what: str) -> int:
        word = text[8 * index : 8 * index + 8].strip() or "0"
        if not re.fullmatch(r"[-+]?\d{1,8}", word, re.ASCII):
            raise self.fail(line, f"expected the {what}, a whole number, got {word!r}")
        return int(word)

    def numbers(self, entity: Entity) -> tuple[list[float], int]:
        """Return the numbers among an entity's parameters, after its type, and the line where they begin."""
        if not 1 <= entity.first <= len(self.parameters) or not 1 <= entity.count <= len(self.parameters):
            raise self.fail(entity.line, f"expected parameters of entity {entity.kind}, got none at {entity.first}")
        line = self.parameters[entity.first][0]
        rows = (self.parameters.get(entity.first + k, (0, ""))[1] for k in range(entity.count))
        fields = "".join(rows).partition(";")[0].split(",")
        values = []
        for index, word in enumerate(map(str.strip, fields)):
            values.append(as_number(word or "0"))
            if math.isnan(values[-1]):
                shown = repr(word[:SHOWN_CHARACTERS])
                raise self.fail(line, f"expected numbers of entity {entity.kind}, got {shown} at {index}")
        if int(values[0]) != entity.kind:
            raise self.fail(line, f"expected parameters of entity {entity.kind}, got those of {values[0]:g}")
        return values[1:], line

    def units(self) -> str | None:
        """Return the unit of length, from the fourteenth global value."""
        fields: list[str] = []
        text = self.globals
        while text and len(fields) < 15:
            found = re.match(r"\s*(\d{1,4})H", text)
            if found:
                end = found.end() + int(found[1])
                fields.append(text[found.end() : end])
                text = text[end:].lstrip()[1:]
            else:
                field, _, text = text.partition(",")
                fields.append(field.strip())
        if len(fields) < 14 or not fields[13].isdigit():
            return None
        other = fields[14] if len(fields) > 14 and fields[14].isprintable() else None
        names = {1: "inches", 2: "millimetres", 4: "feet", 5: "miles", 6: "metres", 7: "kilometres", 8: "mils"}
        names |= {9: "microns", 10: "centimetres", 11: "microinches"}
        return names.get(int(fields[13])) or other

    def transformation(self, entity: Entity) -> FloatArray:
        """Return the (3, 4) rotation and translation of an entity."""
        total = np.eye(3, 4)
        number = entity.transformation
        most = 20  # transformations one after another
        for _ in range(most):
            if not number:
                return total
            found = self.entities.get(number)
            if found is None or found.kind != TRANSFORMATION:
                raise self.fail(entity.line, f"expected a transformation (entity 124) at {number}")
            values, line = self.numbers(found)
            if len(values) < 12:
                raise self.fail(line, f"expected 12 numbers of a transformation, got {len(values)}")
            matrix = np.array(values[:12]).reshape(3, 4)
            total = np.column_stack([matrix[:, :3] @ total[:, :3], matrix[:, :3] @ total[:, 3] + matrix[:, 3]])
            number = found.transformation
        raise self.fail(entity.line, f"more than {most} transformations one after another")


def read_iges(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the B-spline curves and surfaces of an IGES file.

    Curves that lie in the parameter plane of a surface, or bound a surface, are left out. Surfaces are whole: trimming
    is left out, and a remark says so.
    """
    file = _File(data, source)
    patches: list[Patch] = []
    remarks = []
    left = Counter[int]()
    narrow = 0
    for entity in file.entities.values():
        # The use flag is 05 for parameter space; a physically dependent curve (01, 03) belongs to something else.
        free = entity.use[:2] in ("00", "02") and entity.use[2:] != "05"
        if entity.kind == SURFACE or (entity.kind == CURVE and free):
            found, is_narrow = _nurbs(file, entity)
            patches += found
            narrow += is_narrow
            if len(patches) > MAX_PATCHES:
                raise file.fail(entity.line, f"here the model has more than {MAX_PATCHES} patches")
        elif entity.kind not in (CURVE, TRANSFORMATION) and entity.kind in (*range(100, 200), *range(500, 600)):
            left[entity.kind] += 1  # geometry, and solids
    if units := file.units():
        remarks.append(f"its unit of length is {units}")
    if left:
        parts = ", ".join(f"{number} of type {kind}" for kind, number in sorted(left.items()))
        remarks.append(f"surfaces are whole, not trimmed; entities that are left out: {parts}")
    if narrow:
        remarks.append(f"{narrow} have a parameter range other than that of their knots: the whole is given")
    return patches, remarks


def _nurbs(file: _File, entity: Entity) -> tuple[list[Patch], bool]:
    """Return the patches of a B-spline, and whether its range of parameters is not that of its knots."""
    values, line = file.numbers(entity)
    dimension, what = (2, "K1, K2, M1, M2 of a surface") if entity.kind == SURFACE else (1, "K, M of a curve")
    limits = [MAX_CONTROL_POINTS] * dimension + [MAX_DEGREE] * dimension
    head = values[: len(limits)]
    if len(head) < len(limits) or not all(x == int(x) and 1 <= x <= most for x, most in zip(head, limits, strict=True)):
        raise file.fail(line, f"expected {what}, whole numbers from 1, got {', '.join(f'{x:g}' for x in head)}")
    counts, degrees = [int(x) + 1 for x in head[:dimension]], [int(x) for x in head[dimension:]]
    lengths = [count + degree + 1 for count, degree in zip(counts, degrees, strict=True)]
    total = math.prod(counts)
    # After the properties: knots, weights, points, ranges of parameters
    sizes = [*lengths, total, 3 * total]
    *rows, ends = np.split(np.array(values[9 if dimension == 2 else 6 :]), np.cumsum(sizes))
    if len(rows[-1]) < sizes[-1]:
        noun = what.rpartition("of ")[2]
        raise file.fail(line, f"expected {sum(sizes)} numbers of {noun}: knots, weights, points; got {len(values)}")
    *knots, weights, points = rows
    matrix = file.transformation(entity)
    moved = points.reshape(-1, 3) @ matrix[:, :3].T + matrix[:, 3]
    # The first index runs fastest.
    net = np.column_stack([moved * weights[:, None], weights]).reshape(*counts[::-1], 4).swapaxes(0, dimension - 1)
    try:
        found = spans(degrees, knots, net, entity.name)
    except DomainError as error:
        raise file.fail(line, f"entity {entity.kind}: {error}") from None
    whole = np.ravel([row[[degree, -1 - degree]] for row, degree in zip(knots, degrees, strict=True)])
    given = ends[: len(whole)]
    return found, len(given) == len(whole) and not np.allclose(given, whole, rtol=0, atol=1e-9 * np.ptp(whole))
