"""VTU files for ParaView, made of exact rational Bézier cells, or of quadratic ones, instead of triangles."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.bezier.pieces import bezier_pieces
from gtb_cli.cad.exact_surfaces import exact_surfaces, homogeneous_points
from gtb_cli.errors import DomainError
from gtb_cli.knots.lattice import lattice_of
from gtb_cli.models.model import Model
from gtb_cli.theory.edges import patch_name
from gtb_cli.theory.patch import Patch

# VTK's numbers for its types of cells, the latter of Bézier's
QUADRATIC_EDGE, QUADRATIC_TRIANGLE = 21, 22
CURVE, TRIANGLE, QUADRILATERAL = 75, 76, 77


class Cell(NamedTuple):
    """A rational Bézier cell: its degrees, and (n, 4) points and weights in VTK's order (corners, edges, interior)."""

    kind: int
    degrees: tuple[int, int, int]
    points: FloatArray


class QuadraticCells(NamedTuple):
    """Cells of one patch: (k, 3) or (k, 6) of (m, 3) points, corners first, then middles of sides; and (m,) fields."""

    points: FloatArray
    cells: IntArray
    fields: Mapping[str, FloatArray]


def cells_of(patch: Patch, index: int = 0) -> list[Cell | FloatArray]:
    """Return the exact cells of a patch: the patch itself, if it is a Bézier patch, or its charts; rectangles as nets.

    A `DomainError` says why there are none.
    """
    lattice = lattice_of(patch.domain)
    if patch.dimension == 1:
        curves = [patch] if lattice else bezier_pieces(patch)
        ordered = [homogeneous_points(curve)[np.argsort(curve.knots[:, 0])] for curve in curves]
        return [Cell(CURVE, (len(rows) - 1, 0, 0), np.vstack([rows[0], rows[-1], rows[1:-1]])) for rows in ordered]
    if lattice is not None and len(lattice) == 1:
        degree, places = lattice[0].degree, map(tuple, lattice[0].places.tolist())
        numbers = dict(zip(places, range(len(patch.knots)), strict=True))
        order = [numbers[place] for place in _triangle_places(degree)]
        return [Cell(TRIANGLE, (degree, degree, 0), homogeneous_points(patch)[order])]
    return [surface.net for surface in exact_surfaces(patch, index)]


def encode_vtu(spec: Patch | Model) -> tuple[bytes, int, list[str]]:
    """Return a VTU file of the exact cells of a patch or model, their number, and warnings.

    Points have `RationalWeights`; cells have `HigherOrderDegrees`, and the number of their patch as `patch`. Numbers
    have the fewest digits that read back exactly. Cells do not share points, because neighbours agree on the ratios of
    the weights along an edge, but not on the weights.
    """
    cells: list[tuple[int, Cell | FloatArray]] = []
    for index, patch in enumerate(spec.patches):
        try:
            cells += ((index, cell) for cell in cells_of(patch, index))
        except DomainError as fault:
            if isinstance(spec, Patch):
                raise
            raise DomainError(f"{patch_name(patch, index)}: {fault}") from None
    nets = iter(_raised([cell for _, cell in cells if not isinstance(cell, Cell)]))
    whole = [(index, cell if isinstance(cell, Cell) else _quadrilateral(next(nets))) for index, cell in cells]
    degrees = sorted({max(cell.degrees) for _, cell in whole if cell.kind != CURVE})
    warnings = []
    if len(degrees) > 1:  # triangles are not raised
        unlike = " and ".join(map(str, degrees))
        warnings.append(f"cells have degrees {unlike}, and VTK cuts each by its own: it may draw slits between them")
    points = np.concatenate([cell.points for _, cell in whole])
    data: dict[str, dict[str, FloatArray | IntArray]] = {
        'PointData RationalWeights="RationalWeights"': {"RationalWeights": points[:, 3:]},
        'CellData HigherOrderDegrees="HigherOrderDegrees"': {
            "HigherOrderDegrees": np.array([cell.degrees for _, cell in whole]),
            "patch": np.array([[index] for index, _ in whole]),
        },
    }
    ends = np.cumsum([len(cell.points) for _, cell in whole])
    kinds = np.array([cell.kind for _, cell in whole])
    return _encoded(data, points[:, :3], np.arange(len(points)), ends, kinds), len(whole), warnings


def _raised(nets: Sequence[FloatArray]) -> list[FloatArray]:
    """Raise unlike degrees to the highest of all, in both directions: VTK cuts a cell by its highest degree."""
    if len({net.shape for net in nets}) < 2:
        return list(nets)
    highest = max(max(net.shape[:2]) for net in nets) - 1
    raised = []
    for net in nets:
        weights = net[..., 3:]
        table = np.concatenate([net[..., :3] * weights, weights], axis=2)
        table = np.einsum("ki,lj,ijx->klx", *(_elevation(count - 1, highest) for count in net.shape[:2]), table)
        raised.append(np.concatenate([table[..., :3] / table[..., 3:], table[..., 3:]], axis=2))
    return raised


def _elevation(degree: int, higher: int) -> FloatArray:
    """(higher + 1, degree + 1) shares of control points in those of the higher degree."""
    comb, columns = math.comb, range(degree + 1)
    ways = [[comb(degree, i) * comb(higher - degree, max(k - i, 0)) for i in columns] for k in range(higher + 1)]
    return np.tril(np.array(ways) / np.array([[comb(higher, k)] for k in range(higher + 1)]))


def encode_quadratic(parts: Sequence[QuadraticCells]) -> bytes:
    """Return a VTU file of quadratic cells, with the fields of their points, and the number of their patch."""
    points = np.concatenate([part.points for part in parts])
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    cells = np.concatenate([part.cells + start for part, start in zip(parts, starts, strict=False)])
    fields = {name: np.concatenate([part.fields[name] for part in parts])[:, None] + 0.0 for name in parts[0].fields}
    patch = np.repeat(np.arange(len(parts)), [len(part.cells) for part in parts])
    ends = cells.shape[1] * np.arange(1, len(cells) + 1)
    kinds = np.full(len(cells), QUADRATIC_EDGE if cells.shape[1] == 3 else QUADRATIC_TRIANGLE)
    return _encoded({"PointData": fields, "CellData": {"patch": patch[:, None]}}, points, cells.ravel(), ends, kinds)


def _encoded(data: Mapping[str, Mapping[str, FloatArray | IntArray]], points: FloatArray, *columns: IntArray) -> bytes:
    """Return a VTU file of cells, three columns of numbers, with tables of points and of cells by their elements."""
    cells = {name: rows[:, None] for name, rows in zip(("connectivity", "offsets", "types"), columns, strict=True)}
    whole = {"patch": "Int32", "connectivity": "Int64", "offsets": "Int64", "types": "UInt8"}  # the others are Float64
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        "<UnstructuredGrid>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(columns[-1])}">',
    ]
    for element, tables in {**data, "Points": {"Points": points + 0.0}, "Cells": cells}.items():  # no negative zeros
        lines.append(f"<{element}>")
        for name, rows in tables.items():
            components = f' NumberOfComponents="{rows.shape[1]}"' if rows.shape[1] > 1 else ""
            lines.append(f'<DataArray type="{whole.get(name, "Float64")}" Name="{name}"{components} format="ascii">')
            lines += (" ".join(map(repr, row)) for row in rows.tolist())
            lines.append("</DataArray>")
        lines.append(f"</{element.partition(' ')[0]}>")
    return "\n".join([*lines, "</Piece>", "</UnstructuredGrid>", "</VTKFile>\n"]).encode("ascii")


def _triangle_places(degree: int) -> Iterator[tuple[int, ...]]:
    """Barycentric indices (of the first, second and third corner) in VTK's order: the boundary, then inner rings."""
    corners = np.eye(3, dtype=int)
    for inset in range(degree // 3 + 1):
        side = degree - 3 * inset
        ring = [side * corner for corner in corners[: 3 if side else 1]]
        ring += [(side - k) * corners[i] + k * corners[i - 2] for i in range(3) for k in range(1, side)]
        yield from (tuple((place + inset).tolist()) for place in ring)


def _quadrilateral(net: FloatArray) -> Cell:
    """The cell of a tensor product: edges along the first direction, then the second, away from the first corner."""
    corners, inner = net[[0, -1, -1, 0], [0, 0, -1, -1]], net[1:-1, 1:-1].swapaxes(0, 1).reshape(-1, 4)
    points = np.concatenate([corners, net[1:-1, 0], net[-1, 1:-1], net[1:-1, -1], net[0, 1:-1], inner])
    return Cell(QUADRILATERAL, (net.shape[0] - 1, net.shape[1] - 1, 0), points)
