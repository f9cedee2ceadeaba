"""JSON files of geomdl (NURBS-Python): curves and surfaces as exact Bézier patches."""

import math
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers.classical_nets import MAX_DEGREE
from gtb_cli.importers.nurbs import MAX_CONTROL_POINTS, spans
from gtb_cli.importers.words import MAX_MAGNITUDE
from gtb_cli.language.document import Faults, read, shown
from gtb_cli.language.entries import valid_name
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.language.scanner import Path
from gtb_cli.theory.patch import Patch


class _Fault(Exception):
    """The path to a value, and what is wrong with it."""


def read_geomdl(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the shapes of a file that geomdl's ``export_json`` wrote; trims are left out."""
    document = read(data, source, "json")
    try:
        shape = _get(document.data, (), "shape", dict)
        kind = _get(shape, ("shape",), "type", str)
        if kind not in ("curve", "surface"):
            raise _Fault(("shape", "type"), f"expected curve or surface, got {shown(kind)}")
        entries = _get(shape, ("shape",), "data", list)
        patches: list[Patch] = []
        for index, entry in enumerate(entries):
            path: Path = ("shape", "data", index)
            try:
                patches += _spans(entry, path, ("",) if kind == "curve" else ("_u", "_v"))
            except DomainError as error:
                raise _Fault(path, str(error)) from None
            if len(patches) > MAX_PATCHES:
                raise _Fault(path, f"here the model has more than {MAX_PATCHES} patches")
        return patches, []
    except _Fault as fault:
        faults = Faults(document, source)
        faults.add(*fault.args)
        raise SpecError(faults.found()[0]) from None


def _spans(entry: object, path: Path, suffixes: tuple[str, ...]) -> list[Patch]:
    """Return the patches of a curve, whose keys have no suffixes, or of a surface with `_u` and `_v`."""
    degrees = [_whole(entry, path, f"degree{suffix}", MAX_DEGREE) for suffix in suffixes]
    sizes = [_whole(entry, path, f"size{suffix}", MAX_CONTROL_POINTS) for suffix in suffixes if suffix]
    rows = _rows(entry, path)
    if sizes and len(rows) != math.prod(sizes):
        raise _Fault((*path, "control_points"), f"expected {sizes[0]} × {sizes[1]} points, got {len(rows)}")
    knots = [_row(entry, path, f"knotvector{suffix}") for suffix in suffixes]
    name = valid_name(entry.get("name")) if isinstance(entry, dict) else None
    return spans(degrees, knots, rows.reshape(*sizes or [len(rows)], 4), name)


def _get(table: object, path: Path, key: str, kind: type[Any]) -> Any:
    """Return the value of a key in a table, which must be of the given type."""
    if not isinstance(table, dict):
        raise _Fault(path, f"expected a table, got {shown(table)}")
    if key not in table:
        raise _Fault(path, f"has no {key}")
    value = table[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        names = {dict: "a table", list: "a list", str: "text", int: "a whole number"}
        raise _Fault((*path, key), f"expected {names[kind]}, got {shown(value)}")
    return value


def _whole(entry: object, path: Path, key: str, most: int) -> int:
    value: int = _get(entry, path, key, int)
    if not 1 <= value <= most:
        raise _Fault((*path, key), f"expected 1 to {most}, got {shown(value)}")
    return value


def _row(table: object, path: Path, key: str) -> FloatArray:
    values = _get(table, path, key, list)
    return np.array([_number(value, (*path, key, index)) for index, value in enumerate(values)], dtype=np.float64)


def _rows(entry: object, path: Path) -> FloatArray:
    """Return (n, 4) homogeneous control points."""
    table = _get(entry, path, "control_points", dict)
    path = (*path, "control_points")
    points = _get(table, path, "points", list)
    rows = np.zeros((len(points), 4))
    for index, point in enumerate(points):
        where = (*path, "points", index)
        if not isinstance(point, list) or len(point) not in (2, 3):
            raise _Fault(where, f"expected 2 or 3 coordinates, got {shown(point)}")
        rows[index, : len(point)] = [_number(x, (*where, k)) for k, x in enumerate(point)]
    rows[:, 3] = 1.0
    if "weights" in table:
        weights = _row(table, path, "weights")
        if len(weights) != len(rows):
            raise _Fault((*path, "weights"), f"expected {len(rows)}, one for each point, got {len(weights)}")
        if not (weights > 0).all():
            bad = int(np.argmin(weights > 0))
            raise _Fault((*path, "weights", bad), f"must be positive, got {weights[bad]:g}")
        rows[:, 3] = weights
        rows[:, :3] *= weights[:, None]
    return rows


def _number(value: object, path: Path) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) <= MAX_MAGNITUDE:
        raise _Fault(path, f"expected a number up to {MAX_MAGNITUDE:g}, got {shown(value)}")
    return float(value)
