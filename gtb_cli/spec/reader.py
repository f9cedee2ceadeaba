"""From the plain data of a spec to a `Patch` or `Model`, noting every fault on the way."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import Any, TypeAlias, cast, get_args

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError, SpecError
from gtb_cli.knots.domain import Domain, EdgeNormals
from gtb_cli.knots.hull import convex_hull
from gtb_cli.spec.document import Faults, shown
from gtb_cli.spec.expression import evaluate_expression
from gtb_cli.spec.scanner import Path
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import COEFFICIENTS, Patch

PATCH_KEYS = frozenset(
    {"name", "knots", "weights", "log_weights", "control_points", "coefficients"}
    | {"lifting", "edge_normals", "edge_scale"}
)
MODEL_KEYS = frozenset(("name", "patches"))
NAMED_COEFFICIENTS = tuple(COEFFICIENTS)

LARGEST = 1e100
"""Largest size of a coordinate, lifting value or scale: squares and products of two stay finite."""

MAX_NAME = 200
"""Longest name, in characters."""

CONTROL = r"[\u0000-\u001f\u007f-\u009f\u2028\u2029\ud800-\udfff]"
"""Characters no name may have: control characters, line ends and halves of surrogate pairs."""

MAX_KNOTS = 5000
"""Most knots of a patch: a tensor product patch of degree 69 × 69."""

MAX_HEIGHTS = 2_000_000
"""Most knots times edges of a patch: the domain needs about 50 bytes for each pair."""

MAX_PATCHES = 1000
"""Most patches of a model."""

MAX_UNITY = 300
"""Most knots for "partition-of-unity", a dense linear system."""

MAX_EXPRESSIONS = 100_000
"""Most characters in all expressions of a spec together: a fifth of a second of evaluation."""

Check: TypeAlias = tuple[str, Callable[[float], bool]]

_COORDINATE: Check = (f"must be at most {LARGEST:g} in size", lambda x: abs(x) <= LARGEST)
_POSITIVE: Check = ("must be positive", lambda x: x > 0)
_SCALE: Check = (f"must be between {1 / LARGEST:g} and {LARGEST:g}", lambda x: 1 / LARGEST <= x <= LARGEST)


class Reader:
    """Turns a document's data into a patch, and collects all that is wrong with it."""

    def __init__(self, faults: Faults) -> None:
        self.faults = faults
        self.expression_length = 0

    def spec(self, data: object, name: str | None) -> Patch | Model | None:
        """Read a whole document."""
        if not isinstance(data, dict):
            self.faults.add((), f"must be a table with the keys of a patch, got {shown(data)}")
            return None
        if "patches" not in data:
            return self.patch(data, (), name)
        for key in data:
            if key in PATCH_KEYS - MODEL_KEYS:
                self.faults.add((key,), "belongs in one of the [[patches]]")
        self.unknown_keys({key: data[key] for key in data if key not in PATCH_KEYS}, (), MODEL_KEYS)
        title = self.name(data, (), name)
        tables = data["patches"]
        if not isinstance(tables, list) or not tables:
            self.faults.add(("patches",), f"must be a list of at least one table ([[patches]]), got {shown(tables)}")
            return None
        if len(tables) > MAX_PATCHES:
            self.faults.add(("patches",), f"must be at most {MAX_PATCHES}, got {len(tables)}")
            return None
        patches = [self.patch(table, ("patches", i), None) for i, table in enumerate(tables)]
        try:
            return None if self.faults.count else Model(tuple(patch for patch in patches if patch is not None), title)
        except DomainError as error:
            self.domain_fault((), error)
            return None

    def patch(self, table: object, path: Path, name: str | None) -> Patch | None:
        """Read one patch; wrong parts are left out or replaced, so that the rest is still checked."""
        if not isinstance(table, dict):
            self.faults.add(path, f"must be a table, got {shown(table)}")
            return None
        meant = self.unknown_keys(table, path, PATCH_KEYS if path else PATCH_KEYS | MODEL_KEYS)
        for key in ("knots", "control_points"):
            if key not in table and key not in meant and "patches" not in meant:
                self.faults.add((*path, key), "is missing")
        title = self.name(table, path, name)
        knots, n = self.knots(table, path)
        points = self.points(table, path, n)
        weights = self.row(table, path, "weights", n, _POSITIVE)
        logarithms = self.row(table, path, "log_weights", n, _COORDINATE)
        if "weights" in table and "log_weights" in table:
            self.faults.add((*path, "log_weights"), "stands in place of weights, leave out one of them")
        lifting = self.row(table, path, "lifting", n, _COORDINATE)
        coefficients, named = None, None
        if isinstance(table.get("coefficients"), str):
            named = self.choice(table, path, "coefficients", NAMED_COEFFICIENTS, "a list of numbers, ")
        else:
            coefficients = self.row(table, path, "coefficients", n, _POSITIVE)
        normals = self.choice(table, path, "edge_normals", get_args(EdgeNormals))
        scale = self.scale(table, path)
        if knots is None:
            return None
        try:
            _check_size(knots)
            patch = Patch(
                knots,
                np.zeros((len(knots), 3)) if points is None else points,
                weights,  # type: ignore[arg-type]
                np.ones(len(knots)) if coefficients is None else coefficients,
                edge_normals=cast(EdgeNormals, normals or "auto"),
                edge_scale=1.0 if scale is None else scale,
                lifting=lifting,
                name=title,
                log_weights=logarithms,  # type: ignore[arg-type]
            )
            return patch if named is None else patch.replace(coefficients=_coefficients(patch.domain, named))
        except DomainError as error:
            self.domain_fault(path, error)
            return None

    def domain_fault(self, path: Path, error: DomainError) -> None:
        """Note what a constructor refused, under the name that its message begins with: they are the keys."""
        key, _, message = str(error).partition(": ")
        self.faults.add((*path, key), message)

    def unknown_keys(self, table: dict[str, Any], path: Path, known: frozenset[str]) -> set[str]:
        """Note unknown keys; return the known ones that were probably meant."""
        meant = set()
        for key in [key for key in table if key not in known]:
            likely = _likely(key, known - table.keys()) if self.faults.count < Faults.SHOWN else None
            hint = _suggestion(likely) or f", known are {', '.join(sorted(known))}"
            self.faults.add((*path, key), f"is not a key of a spec{hint}")
            meant.add(likely or "")
        return meant

    def name(self, table: dict[str, Any], path: Path, default: str | None) -> str | None:
        """Read the name, if there is one."""
        if "name" not in table:
            return default
        name = table["name"]
        fault = name_fault(name) if isinstance(name, str) else f"must be a string, got {shown(name)}"
        if fault:
            self.faults.add((*path, "name"), fault)
            return default
        return str(name)

    def choice(
        self, table: dict[str, Any], path: Path, key: str, words: tuple[str, ...], others: str = ""
    ) -> str | None:
        """Read one of some words."""
        if key not in table:
            return None
        value = table[key]
        if isinstance(value, str) and value in words:
            return value
        likely = _likely(value, words) if isinstance(value, str) else None
        expected = ", ".join(f'"{word}"' for word in words[:-1]) + f' or "{words[-1]}"'
        self.faults.add((*path, key), f"must be {others}{expected}, got {shown(value)}{_suggestion(likely)}")
        return None

    def knots(self, table: dict[str, Any], path: Path) -> tuple[FloatArray | None, int | None]:
        """Read the knots; also return how many there are, even if some are wrong."""
        if "knots" not in table:
            return None, None
        path = (*path, "knots")
        entries = table["knots"]
        surface = isinstance(entries, list) and bool(entries) and isinstance(entries[0], list)
        if not isinstance(entries, list) or len(entries) < (3 if surface else 2):
            expected = "a list of at least 2 numbers (curve) or 3 pairs of numbers (surface)"
            self.faults.add(path, f"must be {expected}, got {shown(entries)}")
            return None, None
        if len(entries) > MAX_KNOTS:
            self.faults.add(path, f"must be at most {MAX_KNOTS}, got {len(entries)}")
            return None, None
        return self.tuples(entries, path, (2,)) if surface else self.numbers(entries, path, _COORDINATE), len(entries)

    def points(self, table: dict[str, Any], path: Path, n: int | None) -> FloatArray | None:
        """Read the control points."""
        path = (*path, "control_points")
        entries = self.entries(table, path, n)
        points = None if entries is None else self.tuples(entries, path, (2, 3))
        return points if points is not None and len(points) == n else None

    def row(self, table: dict[str, Any], path: Path, key: str, n: int | None, check: Check) -> FloatArray | None:
        """Read one number for each knot."""
        path = (*path, key)
        entries = self.entries(table, path, n)
        values = None if entries is None else self.numbers(entries, path, check)
        return values if values is not None and len(values) == n else None

    def entries(self, table: dict[str, Any], path: Path, n: int | None) -> list[object] | None:
        """Return the list under the last key of a path, if it is there; it should have n entries."""
        if path[-1] not in table:
            return None
        entries = table[str(path[-1])]
        if not isinstance(entries, list):
            self.faults.add(path, f"must be a list with an entry for each knot, got {shown(entries)}")
            return None
        if n is not None and len(entries) != n:
            self.faults.add(path, f"must have {n} entries, one for each knot, got {len(entries)}")
        return entries

    def scale(self, table: dict[str, Any], path: Path) -> float | FloatArray | None:
        """Read the factor of the edge functions, or the factors."""
        if "edge_scale" not in table:
            return None
        path = (*path, "edge_scale")
        value = table["edge_scale"]
        return self.numbers(value, path, _SCALE) if isinstance(value, list) else self.number(value, path, _SCALE)

    def tuples(self, entries: list[object], path: Path, sizes: tuple[int, ...]) -> FloatArray | None:
        """Read pairs or triples of coordinates, all of the same size."""
        expected = " or ".join(map(str, sizes))
        lengths = {len(entry) if isinstance(entry, list) else None for entry in entries}
        if len(lengths) == 1 and not lengths & set(sizes):  # one fault, not one for each
            (length,) = lengths
            got = "no lists" if length is None else f"lists of {length}"
            self.faults.add(path, f"must be lists of {expected} coordinates, got {got}")
            return None
        size, rows = 0, []
        for i, entry in enumerate(entries):
            if not isinstance(entry, list):
                self.faults.add((*path, i), f"must be a list of {expected} coordinates, got {shown(entry)}")
            elif len(entry) not in sizes:
                self.faults.add((*path, i), f"must have {expected} coordinates, got {len(entry)}")
            elif size and len(entry) != size:
                self.faults.add((*path, i), f"must have {size} coordinates, as those before, got {len(entry)}")
            else:
                size = len(entry)
                rows.append(self.numbers(entry, (*path, i), _COORDINATE))
        good = [row for row in rows if row is not None]
        return np.array(good) if len(good) == len(entries) else None

    def numbers(self, entries: list[object], path: Path, check: Check) -> FloatArray | None:
        """Read a list of numbers."""
        values = [self.number(entry, (*path, i), check) for i, entry in enumerate(entries)]
        good = [value for value in values if value is not None]
        return np.array(good) if len(good) == len(values) else None

    def number(self, value: object, path: Path, check: Check) -> float | None:
        """Read a number or an expression."""
        number, text = value, ""
        if isinstance(value, str):
            self.expression_length += len(value)
            if self.expression_length > MAX_EXPRESSIONS:
                if self.expression_length - len(value) <= MAX_EXPRESSIONS:  # said once
                    limit = f"expressions may have {MAX_EXPRESSIONS} characters together"
                    self.faults.add(path, f"{limit}, write numbers from here on")
                return None
            try:
                number = evaluate_expression(value)
            except SpecError as error:
                self.faults.add(path, str(error))
                return None
            text = f" = {shown(number)}"
        if isinstance(number, bool) or not isinstance(number, int | float):
            self.faults.add(path, f"must be a number, got {shown(value)}")
            return None
        try:
            number = float(number)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.faults.add(path, f"must be finite, got {shown(value)}")
            return None
        expected, holds = check
        if not holds(number):
            self.faults.add(path, f"{expected}, got {shown(value)}{text}")
            return None
        return number


def _check_size(knots: FloatArray) -> None:
    """Refuse surfaces whose knots and edges would fill the memory."""
    if knots.ndim == 2 and len(knots) ** 2 > MAX_HEIGHTS:
        edges = len(convex_hull(knots))
        if len(knots) * edges > MAX_HEIGHTS:
            raise DomainError(f"knots: {len(knots)} knots times {edges} edges, at most {MAX_HEIGHTS} are allowed")


def _coefficients(domain: Domain, name: str) -> FloatArray:
    if name == "partition-of-unity" and len(domain.knots) > MAX_UNITY:
        raise DomainError(f"coefficients: {name} is for at most {MAX_UNITY} knots, got {len(domain.knots)}")
    return COEFFICIENTS[name](domain)


def name_fault(name: str) -> str | None:
    """Return what is wrong with a name, if anything: names go into formats that are read line by line."""
    if not name.strip():
        return "must not be empty"
    if len(name) > MAX_NAME:
        return f"must have at most {MAX_NAME} characters, got {len(name)}"
    if re.search(CONTROL, name):
        return f"must not have control characters, got {shown(name)}"
    return None


def _likely(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that was probably meant."""
    import difflib

    meant = word[:MAX_NAME].lower().replace("-", "_")
    spelled = {name.replace("-", "_"): name for name in sorted(known)}
    return next((spelled[name] for name in difflib.get_close_matches(meant, spelled, n=1)), None)


def _suggestion(likely: str | None) -> str:
    return f", did you mean {likely}?" if likely else ""
