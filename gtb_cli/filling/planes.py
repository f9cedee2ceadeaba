"""Polynomial fields in given tangent planes, which may be added to the row of control points inside an edge."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.filling.osculation import SecondRow, osculating
from gtb_cli.filling.sides import HoleSide, bernstein, points_and_tangents, raised, stations

MIN_CROSSING = 1e-3  # of the mean length of a field: its component across an edge that it crosses

# Rows (m, 3) of weight 0 in homogeneous coordinates, which may be added with any factors; None: the row is free
Field: TypeAlias = "list[FloatArray] | None"


def row_fields(
    sides: Sequence[HoleSide], normals: Sequence[FloatArray | None], least: int
) -> tuple[list[FloatArray], list[Field], list[SecondRow | None], list[int]]:
    """Return each side's curve with its degree raised, the fields for its rows, and the number of raises."""
    edges: list[FloatArray] = []
    fields: list[Field] = []
    seconds: list[SecondRow | None] = []
    times: list[int] = []
    for side, normal in zip(sides, normals, strict=True):
        step = len(side.multiplier) - 1
        second = None
        if normal is None:
            # A rational side stays as it is: its row is free, and many knots would make it no fairer.
            wanted = max(least if step == 1 else 0, 2 - side.degree)
            edge, field = raised(side.curve, -(-wanted // step), side.multiplier), None
        else:
            first = -(-max(least, 2 - side.degree) // step)
            most = (least + 6) // step  # to find a field that crosses the edge and is exact
            counts = range(first, max(first, most) + 1)
            if side.bend is None:
                edge, field = _touching(side, normal, counts)
            else:
                second = osculating(side, normal, counts)
                edge, field = second.curve, second.fields
        edges.append(edge)
        fields.append(field)
        seconds.append(second)
        times.append(len(edge) - len(side.curve))
    return edges, fields, seconds, times


def _touching(side: HoleSide, normals: FloatArray, counts: range) -> tuple[FloatArray, list[FloatArray]]:
    """Return fields tangent to the planes: exact ones with the fewest raises, or approximate ones if none is exact."""
    # Normal component relative to the field: rounding; or, if no field is exact, 0.2 degrees, and a message gives the
    # angle.
    exact_residual, fitted_residual = side.rounding, 3e-3
    t = stations()
    _, tangents = points_and_tangents(side.curve, t)
    inward = np.cross(normals, tangents)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    nearly: tuple[float, FloatArray, list[FloatArray]] | None = None
    for count in counts:
        edge = raised(side.curve, count, side.multiplier)
        degree = len(edge) - 2
        values = bernstein(degree, t)
        matrix = (values[:, :, None] * normals[:, None]).reshape(len(t), -1)
        _, singular, basis = np.linalg.svd(matrix, full_matrices=True)
        singular = np.concatenate([singular, np.zeros(len(basis) - len(singular))]) / singular[0]
        inexact = np.unique(singular[(singular > exact_residual) & (singular <= fitted_residual)])
        for bound in (exact_residual, *inexact.tolist()):
            field = [row.reshape(-1, 3) for row in basis[singular <= bound]]
            if _crosses(field, values, inward):
                if bound == exact_residual:
                    return edge, field
                if nearly is None or bound < nearly[0] / 2:
                    nearly = bound, edge, field
                break
    if nearly is None:
        raise DomainError(f"{side.name}: no polynomial field of degree up to {degree} follows its tangent planes")
    return nearly[1:]


def _crosses(field: list[FloatArray], values: FloatArray, inward: FloatArray) -> bool:
    """Tell whether a combination of fields points inwards all along the side."""
    if not field:
        return False
    across = np.array([((values @ row) * inward).sum(axis=1) for row in field])
    target = np.ones(across.shape[1])
    found = np.linalg.lstsq(across.T, target, rcond=MIN_CROSSING**2)[0] @ across
    return bool(found.min() > MIN_CROSSING)


def nearest_fields(
    sides: Sequence[HoleSide],
    normals: Sequence[FloatArray | None],
    fields: Sequence[Field],
    seconds: Sequence[SecondRow | None],
) -> tuple[list[Field], list[SecondRow | None]]:
    """Return for each side the single field nearest to the given directions across, with length 1, and its row 2."""
    singles: list[Field] = []
    rows: list[SecondRow | None] = []
    for side, normal, field, second in zip(sides, normals, fields, seconds, strict=True):
        if normal is not None and side.across is not None and field:
            values = bernstein(len(field[0]) - 1, stations())
            table = np.array([(values @ row).ravel() for row in field])
            _, tangents = points_and_tangents(side.curve, stations())
            inward = np.cross(normal, tangents)
            wanted = (inward / np.linalg.norm(inward, axis=1, keepdims=True)).ravel()
            factors = np.linalg.lstsq(table.T, wanted, rcond=MIN_CROSSING**2)[0]
            field = [np.asarray(np.einsum("f,fij->ij", factors, np.array(field)))]
            second = second and second.chosen(factors[None])
        singles.append(field)
        rows.append(second)
    return singles, rows
