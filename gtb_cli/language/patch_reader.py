"""The keys of a spec, and the reader of a patch, which notes faults; what is left out becomes 1 in `theory.basis`."""

import re
from typing import Any, get_args

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain, EdgeNormals
from gtb_cli.knots.hull import convex_hull
from gtb_cli.language.document import shown
from gtb_cli.language.keys_and_values import COORDINATE, POSITIVE, SCALE, Check, Table, Values, decimal_commas, is_arc
from gtb_cli.language.scanner import Path
from gtb_cli.theory.basis import COEFFICIENTS
from gtb_cli.theory.patch import Patch

MAX_PATCHES = 20_000  # patches in a model, copies and included files counted
_ARRAYS = frozenset(("knots", "weights", "log_weights", "control_points", "coefficients", "lifting"))  # of a patch
PATCH_KEYS = _ARRAYS | {"name", "edge_normals", "edge_scale"}
RIBBONS = ("ribbon", "ribbon2")  # keys of further rows of control points, for gtb fill, in the curves of a loop
MOVE_KEYS = frozenset(("name", "mirror", "scale", "rotate", "translate", "repeat"))
COPY_KEYS, INCLUDE_KEYS = MOVE_KEYS | {"copy", "hidden"}, MOVE_KEYS | {"file", "let"}
MODEL_KEYS = frozenset(("name", "let", "include", "weld", "patches"))
_OF_A_FILE = "is that of the whole file, and stands before [let] and [[patches]], which take all keys that follow"
AT_THE_TOP = dict.fromkeys(MODEL_KEYS - {"name"}, _OF_A_FILE)
MAX_KNOTS = 5000  # knots of a patch: a tensor product patch of degree 69 × 69
GRID = "grid ([2-9]|[1-9][0-9]{1,2})x([2-9]|[1-9][0-9]{1,2})"  # its rows, and the knots of each
MAX_UNITY = 300  # knots for "partition-of-unity", which solves a dense linear system


class Reader:
    """Turns tables into patches, and notes all faults.

    `row` is the number of the row that a patch gets as its control points, if it has as many: 0, or 1 and 2 for its
    ribbons; None: ribbons are refused.
    """

    def __init__(self, values: Values, row: int | None = None) -> None:
        self.values = values
        self._row = row
        self._bases: dict[tuple[object, ...], Patch] = {}

    def patch(self, entries: object, path: Path, name: str | None) -> Patch | None:
        """Read one patch; wrong parts are left out or replaced, so that the rest is still checked."""
        if not isinstance(entries, dict):
            self.values.faults.add(path, f"must be a table, got {shown(entries)}")
            return None
        table = Table(entries, path, self.values)
        self._check_keys(table)
        title = table.name(name)
        knots, n = _knots(table)
        points = self._control_points(table, n)
        weights = _row(table, "weights", n, POSITIVE)
        logs = _row(table, "log_weights", n, COORDINATE)
        if "weights" in entries and "log_weights" in entries:
            table.fault("log_weights", "stands in place of weights, leave out one of them")
            logs = None
        lifting = _row(table, "lifting", n, COORDINATE)
        is_named = isinstance(entries.get("coefficients"), str)
        named = table.choice("coefficients", tuple(COEFFICIENTS), "a list of numbers, ") if is_named else None
        coefficients = None if is_named else _row(table, "coefficients", n, POSITIVE)
        normals = table.choice("edge_normals", get_args(EdgeNormals))
        is_list = isinstance(entries.get("edge_scale"), list)
        scale = table.numbers("edge_scale", SCALE) if is_list else table.number("edge_scale", SCALE)
        if knots is None:
            return None
        points = np.zeros((len(knots), 3)) if points is None else points
        arrays = (knots, weights, logs, coefficients, None if scale is None else np.asarray(scale))
        key = (named, normals, *(None if array is None else (array.shape, array.tobytes()) for array in arrays))
        try:
            if key in self._bases:  # patches with the same Δ and basis share them
                return self._bases[key].replace(control_points=points, lifting=lifting, name=title)
            _check_size(knots)
            edges: dict[str, Any] = {"edge_normals": normals or "auto", "edge_scale": 1.0 if scale is None else scale}
            patch = Patch(knots, points, weights, coefficients, lifting=lifting, name=title, log_weights=logs, **edges)
            if named is not None:
                patch = patch.replace(coefficients=_coefficients(patch.domain, named))
            self._bases[key] = patch
            return patch
        except DomainError as error:
            self.domain_fault(path, error)
            return None

    def _control_points(self, table: Table, n: int | None) -> FloatArray | None:
        """Read the row that becomes the control points: their own or, of the ribbons asked for, the last."""
        points = _points(table, "control_points", n)
        straight = "is the ribbon itself; of a strip straight across, it is 2 ribbon - curve"
        faults = "is the curve itself, and leads nowhere", straight
        for key, fault in zip(RIBBONS[: self._row or 0], faults, strict=False):
            if (ribbon := _points(table, key, n)) is not None:
                if points is not None and not np.any(ribbon - points):
                    table.fault(key, fault)
                points = ribbon
        return points

    def _check_keys(self, table: Table) -> None:
        """Note keys of a patch that are unknown, belong elsewhere, or are missing."""
        knots = table.entries.get("knots")
        is_surface = isinstance(knots, str) or (isinstance(knots, list) and bool(knots) and isinstance(knots[0], list))
        known = PATCH_KEYS | {"hidden"} if table.path else PATCH_KEYS | MODEL_KEYS - {"weld"}
        if self._row is not None and not is_surface:
            known |= {*RIBBONS}
            if RIBBONS[1] in table.entries and RIBBONS[0] not in table.entries:
                table.fault(RIBBONS[1], f"is the row after {RIBBONS[0]}, which is missing")
        elsewhere = dict.fromkeys(COPY_KEYS, "belongs to a copy, one of several [[patches]]")
        elsewhere |= AT_THE_TOP if table.path else {"weld": "belongs to a model of several [[patches]], not to a patch"}
        elsewhere |= dict.fromkeys(RIBBONS, "is for gtb fill alone, in the curves of its loop")
        table.unknown_keys(known, elsewhere)
        let = {} if table.path or not isinstance(let := table.entries.get("let"), dict) else let
        for key in ("knots", "control_points"):
            if not any(key in keys for keys in (table.entries, table.meant, let)) and "patches" not in table.meant:
                table.fault(key, "is missing")

    def domain_fault(self, path: Path, error: DomainError) -> None:
        """Note a constructor's error under the key with which its message begins."""
        key, _, message = str(error).partition(": ")
        self.values.faults.add((*path, key), message)


def _knots(table: Table) -> tuple[FloatArray | None, int | None]:
    """Read the knots; also return their number, even if some are wrong."""
    if "knots" not in table.entries:
        return None, None
    entries = table.entries["knots"]
    if isinstance(entries, str) and (grid := re.fullmatch(GRID, entries)):
        entries = [[i, j] for i in range(int(grid[1])) for j in range(int(grid[2]))]
        if len(entries) > 4 and "coefficients" not in table.entries and table.values.faults.doubt is None:
            doubt = 'is missing, and each is 1: "binomial" makes a Bézier patch'
            table.values.faults.doubt = (*table.path, "coefficients"), doubt
    surface = isinstance(entries, list) and bool(entries) and isinstance(entries[0], list)
    if not isinstance(entries, list) or len(entries) < (3 if surface else 2):
        expected = "a list of at least 2 numbers (curve) or 3 pairs of numbers (surface)"
        expected += ', or such as "grid 3x4"' * isinstance(entries, str)
        table.fault("knots", f"must be {expected}, got {shown(entries)}")
    elif len(entries) > MAX_KNOTS:
        table.fault("knots", f"must be at most {MAX_KNOTS}, got {len(entries)}")
    elif surface:
        return table.values.tuples(entries, (*table.path, "knots"), (2,)), len(entries)
    else:
        return table.numbers("knots", COORDINATE), len(entries)
    return None, None


def _points(table: Table, key: str, n: int | None) -> FloatArray | None:
    """Read (n, 3) control points, or another row of points as long; z is 0 where it is not given."""
    points = table.values.tuples(table.entries[key], (*table.path, key), (2, 3)) if _is_list(table, key, n) else None
    return np.pad(points, [(0, 0), (0, 3 - points.shape[1])]) if points is not None and len(points) == n else None


def _row(table: Table, key: str, n: int | None, check: Check) -> FloatArray | None:
    """Read one number for each knot."""
    values = table.numbers(key, check) if _is_list(table, key, n) else None
    return values if values is not None and len(values) == n else None


def _is_list(table: Table, key: str, n: int | None) -> bool:
    """Tell whether there is a list under a key; it should have n entries."""
    if key not in table.entries:
        return False
    entries = table.entries[key]
    if not isinstance(entries, list):
        table.fault(key, f"must be a list with an entry for each knot, got {shown(entries)}")
    elif n is not None and (count := len(entries) + 3 * sum(map(is_arc, entries))) != n:
        brackets = any(isinstance(entry, list) and any(map(is_arc, entry)) for entry in entries)
        hint = ": an arc stands without brackets of its own" if brackets else decimal_commas(entries, n)
        table.fault(key, f"must have {n} entries, one for each knot, got {count}{hint}")
    return isinstance(entries, list)


def _check_size(knots: FloatArray) -> None:
    """Refuse surfaces whose knots and edges would fill the memory."""
    # Largest product of knots and edges of a patch: the domain needs about 50 bytes for each pair
    max_heights = 2_000_000
    count = len(knots)
    if knots.ndim == 2 and count**2 > max_heights and count * (edges := len(convex_hull(knots))) > max_heights:
        raise DomainError(f"knots: {count} knots times {edges} edges, at most {max_heights} are allowed")


def _coefficients(domain: Domain, name: str) -> FloatArray:
    if name == "partition-of-unity" and len(domain.knots) > MAX_UNITY:
        raise DomainError(f"coefficients: {name} is for at most {MAX_UNITY} knots, got {len(domain.knots)}")
    try:
        return COEFFICIENTS[name](domain)
    except DomainError as error:
        raise DomainError(f"{error}; without coefficients they are 1, or give a list") from None
