"""Reads the plain data of a patch as a `Patch`, and notes every fault."""

from __future__ import annotations

from typing import Any, cast, get_args

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain, EdgeNormals
from gtb_cli.knots.hull import convex_hull
from gtb_cli.language.document import shown
from gtb_cli.language.scanner import Path
from gtb_cli.language.values import COORDINATE, POSITIVE, SCALE, Check, Values
from gtb_cli.theory.patch import COEFFICIENTS, Patch

MAX_PATCHES = 20_000  # patches in a model, copies and included files counted
PATCH_KEYS = frozenset(
    {"name", "knots", "weights", "log_weights", "control_points", "coefficients"}
    | {"lifting", "edge_normals", "edge_scale"}
)
RIBBON = "ribbon"  # key of the second row of control points, for gtb fill, in the curves of a loop
COPY_KEYS = frozenset(("name", "copy", "mirror", "scale", "rotate", "translate", "repeat"))
MODEL_KEYS = frozenset(("name", "let", "include", "weld", "patches"))
NAMED_COEFFICIENTS = tuple(COEFFICIENTS)
MAX_KNOTS = 5000  # knots of a patch: a tensor product patch of degree 69 × 69
MAX_UNITY = 300  # knots for "partition-of-unity", which solves a dense linear system


class Reader:
    """Turns tables into patches, and notes all faults.

    Parameters
    ----------
    values : Values
    second_row : bool or None
        Whether a patch gets its ribbon, if any, as control points; None: ribbons are refused.
    """

    def __init__(self, values: Values, second_row: bool | None = None) -> None:
        self.values = values
        self._second_row = second_row
        self._bases: dict[tuple[object, ...], Patch] = {}

    def patch(self, table: object, path: Path, name: str | None) -> Patch | None:
        """Read one patch; wrong parts are left out or replaced, so that the rest is still checked."""
        if not isinstance(table, dict):
            self.values.faults.add(path, f"must be a table, got {shown(table)}")
            return None
        self._check_keys(table, path)
        title = self.values.name(table, path, name)
        knots, n = self.knots(table, path)
        points = self.points(table, path, n)
        ribbon = self.points(table, path, n, RIBBON) if self._second_row else None
        if ribbon is not None:
            if points is not None and np.array_equal(with_heights(ribbon), with_heights(points)):
                self.values.faults.add((*path, RIBBON), "is the curve itself, and leads nowhere")
            points = ribbon
        weights = self.row(table, path, "weights", n, POSITIVE)
        logarithms = self.row(table, path, "log_weights", n, COORDINATE)
        if "weights" in table and "log_weights" in table:
            self.values.faults.add((*path, "log_weights"), "stands in place of weights, leave out one of them")
            logarithms = None
        lifting = self.row(table, path, "lifting", n, COORDINATE)
        coefficients, named = None, None
        if isinstance(table.get("coefficients"), str):
            named = self.values.choice(table, path, "coefficients", NAMED_COEFFICIENTS, "a list of numbers, ")
        else:
            coefficients = self.row(table, path, "coefficients", n, POSITIVE)
        normals = self.values.choice(table, path, "edge_normals", get_args(EdgeNormals))
        scale = self.scale(table, path)
        if knots is None:
            return None
        try:
            points = np.zeros((len(knots), 3)) if points is None else points
            arrays = (knots, weights, logarithms, coefficients, None if scale is None else np.asarray(scale))
            key = (named, normals, *(None if array is None else (array.shape, array.tobytes()) for array in arrays))
            if key in self._bases:  # patches with the same Δ and basis share them
                return self._bases[key].replace(control_points=points, lifting=lifting, name=title)
            _check_size(knots)
            patch = Patch(
                knots,
                points,
                weights,  # type: ignore[arg-type]
                np.ones(len(knots)) if coefficients is None else coefficients,
                edge_normals=cast(EdgeNormals, normals or "auto"),
                edge_scale=1.0 if scale is None else scale,
                lifting=lifting,
                name=title,
                log_weights=logarithms,  # type: ignore[arg-type]
            )
            self._bases[key] = (
                patch if named is None else patch.replace(coefficients=_coefficients(patch.domain, named))
            )
            return self._bases[key]
        except DomainError as error:
            self.domain_fault(path, error)
            return None

    def _check_keys(self, table: dict[str, Any], path: Path) -> None:
        """Note keys of a patch that are unknown, belong elsewhere, or are missing."""
        for key in table:
            if key in (MODEL_KEYS if path else {"weld"}) - PATCH_KEYS:
                self.values.faults.add(
                    (*path, key),
                    "belongs to a model, before all [[patches]]"
                    if key != "patches"
                    else "belongs to the model, not to a patch",
                )
            elif key in COPY_KEYS - PATCH_KEYS:
                fault = "belongs to a copy: copy = NAME says of which patch"
                self.values.faults.add((*path, key), fault if path else "belongs in one of several [[patches]]")
        own = {key: value for key, value in table.items() if key not in (MODEL_KEYS | COPY_KEYS) - PATCH_KEYS}
        self._check_ribbon(own, path)
        known = PATCH_KEYS if self._second_row is None else PATCH_KEYS | {RIBBON}
        meant = self.values.unknown_keys(own, path, known if path else known | MODEL_KEYS)
        for key in ("knots", "control_points"):
            if key not in table and key not in meant and "patches" not in meant:
                self.values.faults.add((*path, key), "is missing")

    def _check_ribbon(self, own: dict[str, Any], path: Path) -> None:
        """Take the ribbon, if any, out of a table's keys; note one that does not belong there."""
        if RIBBON not in own:
            return
        del own[RIBBON]
        knots = own.get("knots")
        if self._second_row is None:
            self.values.faults.add((*path, RIBBON), "is for gtb fill alone, in the curves of its loop")
        elif isinstance(knots, list) and knots and isinstance(knots[0], list):
            self.values.faults.add((*path, RIBBON), "belongs to a curve, this is a surface")

    def domain_fault(self, path: Path, error: DomainError) -> None:
        """Note a constructor's error under the key with which its message begins."""
        key, _, message = str(error).partition(": ")
        self.values.faults.add((*path, key), message)

    def knots(self, table: dict[str, Any], path: Path) -> tuple[FloatArray | None, int | None]:
        """Read the knots; also return their number, even if some are wrong."""
        if "knots" not in table:
            return None, None
        path = (*path, "knots")
        entries = table["knots"]
        surface = isinstance(entries, list) and bool(entries) and isinstance(entries[0], list)
        if not isinstance(entries, list) or len(entries) < (3 if surface else 2):
            expected = "a list of at least 2 numbers (curve) or 3 pairs of numbers (surface)"
            self.values.faults.add(path, f"must be {expected}, got {shown(entries)}")
            return None, None
        if len(entries) > MAX_KNOTS:
            self.values.faults.add(path, f"must be at most {MAX_KNOTS}, got {len(entries)}")
            return None, None
        return self.values.tuples(entries, path, (2,)) if surface else self.values.numbers(
            entries, path, COORDINATE
        ), len(entries)

    def points(
        self, table: dict[str, Any], path: Path, n: int | None, key: str = "control_points"
    ) -> FloatArray | None:
        """Read the control points, or another row of the same length."""
        path = (*path, key)
        entries = self.entries(table, path, n)
        points = None if entries is None else self.values.tuples(entries, path, (2, 3))
        return points if points is not None and len(points) == n else None

    def row(self, table: dict[str, Any], path: Path, key: str, n: int | None, check: Check) -> FloatArray | None:
        """Read one number for each knot."""
        path = (*path, key)
        entries = self.entries(table, path, n)
        values = None if entries is None else self.values.numbers(entries, path, check)
        return values if values is not None and len(values) == n else None

    def entries(self, table: dict[str, Any], path: Path, n: int | None) -> list[object] | None:
        """Return the list under the last key of a path, if present; it should have n entries."""
        if path[-1] not in table:
            return None
        entries = table[str(path[-1])]
        if not isinstance(entries, list):
            self.values.faults.add(path, f"must be a list with an entry for each knot, got {shown(entries)}")
            return None
        if n is not None and len(entries) != n:
            self.values.faults.add(path, f"must have {n} entries, one for each knot, got {len(entries)}")
        return entries

    def scale(self, table: dict[str, Any], path: Path) -> float | FloatArray | None:
        """Read the factor, or factors, of the edge functions."""
        if "edge_scale" not in table:
            return None
        path = (*path, "edge_scale")
        value = table["edge_scale"]
        return (
            self.values.numbers(value, path, SCALE)
            if isinstance(value, list)
            else self.values.number(value, path, SCALE)
        )


def with_heights(points: FloatArray) -> FloatArray:
    """(n, 3) points; z is 0 for points with two coordinates."""
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def _check_size(knots: FloatArray) -> None:
    """Refuse surfaces whose knots and edges would fill the memory."""
    # Largest product of knots and edges of a patch: the domain needs about 50 bytes for each pair
    max_heights = 2_000_000
    if knots.ndim == 2 and len(knots) ** 2 > max_heights:
        edges = len(convex_hull(knots))
        if len(knots) * edges > max_heights:
            raise DomainError(f"knots: {len(knots)} knots times {edges} edges, at most {max_heights} are allowed")


def _coefficients(domain: Domain, name: str) -> FloatArray:
    if name == "partition-of-unity" and len(domain.knots) > MAX_UNITY:
        raise DomainError(f"coefficients: {name} is for at most {MAX_UNITY} knots, got {len(domain.knots)}")
    return COEFFICIENTS[name](domain)
