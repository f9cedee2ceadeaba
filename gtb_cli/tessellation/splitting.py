"""Cells with their sides as arrays, and how cells are cut whose sides are split in the middle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, dot
from gtb_cli.knots.face import INTERIOR

TIE_RATIO = 1 + 1e-9
"""Squared diagonals with a smaller ratio count as equal: rounding, which depends on the processor, must not choose."""

Scalar = TypeVar("Scalar", bound=np.generic)


class Growth:
    """Memory with room to spare for arrays that grow: appending rows does not copy all rows each time."""

    def __init__(self) -> None:
        self._rooms: dict[str, NDArray[Any]] = {}

    def append(self, name: str, array: NDArray[Scalar], *more: NDArray[Scalar]) -> NDArray[Scalar]:
        """Append rows to an array, under a name that no other array has."""
        length = len(array) + sum(map(len, more))
        room = self._rooms.get(name)
        if room is None or array.base is not room or len(room) < length:
            room = self._rooms[name] = np.empty((2 * length, *array.shape[1:]), dtype=array.dtype)
            room[: len(array)] = array
        np.concatenate(more, out=room[len(array) : length])
        return room[:length]


class Edges(NamedTuple):
    """Sides of cells; `face` is the number of the face of Δ that holds the middle."""

    ends: IntArray
    patch: IntArray
    parameters: FloatArray
    face: IntArray

    def at(self, rows: IntArray) -> Edges:
        """Some of the edges."""
        columns: list[Any] = [column.take(rows, axis=0) for column in self]
        return Edges(*columns)

    def followed_by(self, growth: Growth, *others: Edges) -> Edges:
        """Append others to these."""
        columns: list[Any] = [
            growth.append(f"edges.{name}", column, *more)
            for name, column, *more in zip(self._fields, self, *others, strict=True)
        ]
        return Edges(*columns)

    @property
    def middles(self) -> FloatArray:
        """(e, d) parameters halfway."""
        return np.asarray((self.parameters[:, 0] + self.parameters[:, 1]) / 2)

    @property
    def widths(self) -> FloatArray:
        """(e,) largest differences of parameters."""
        width = np.abs(self.parameters[:, 1] - self.parameters[:, 0])
        return np.maximum(width[:, 0], width[:, -1])


class Cells(NamedTuple):
    """Cells with their sides: side i runs from vertex i to the next."""

    cells: IntArray
    sides: IntArray
    corners: FloatArray
    patch: IntArray

    def at(self, rows: IntArray) -> Cells:
        """Some of the cells."""
        columns: list[Any] = [column.take(rows, axis=0) for column in self]
        return Cells(*columns)

    def replaced(self, growth: Growth, rows: IntArray, pieces: Sequence[Cells]) -> Cells:
        """Put pieces in the places of the given cells, and those that are left at the end."""
        columns: list[Any] = []
        for name, column, *parts in zip(self._fields, self, *pieces, strict=True):
            new = np.concatenate(parts)
            columns.append(growth.append(f"cells.{name}", column, new[len(rows) :]))
            columns[-1][rows] = new[: len(rows)]
        return Cells(*columns)


class _Cut(NamedTuple):
    """How a cell is cut. Its k corners are 0 … k − 1, and k + i is the middle of side i."""

    pieces: tuple[tuple[int, ...], ...]
    lines: tuple[tuple[int, int], ...]  # new edges, inside the cell


_SEGMENT = _Cut(((0, 2), (2, 1)), ())
_SIDE_0 = _Cut(((0, 3, 2), (3, 1, 2)), ((3, 2),))
_SIDES_0_1 = _Cut(((3, 1, 4), (0, 3, 4), (0, 4, 2)), ((3, 4), (0, 4)))
_SIDES_0_1_OTHER_DIAGONAL = _Cut(((3, 1, 4), (0, 3, 2), (3, 4, 2)), ((3, 4), (3, 2)))
_ALL_SIDES = _Cut(((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)), ((3, 5), (3, 4), (4, 5)))


def divide(
    whole: Cells,
    edges: Edges,
    points: FloatArray,
    vertex: IntArray,
    child: IntArray,
    middles: Callable[[Cells, IntArray], FloatArray],
) -> tuple[list[Cells], list[Edges]]:
    """Cut segments in two, and triangles with one, two or three split sides into two, three or four.

    Parameters
    ----------
    whole : Cells
        Each with at least one split side.
    edges : Edges
        Among them the halves of split ones.
    points : (v, 3) float
        Positions of the vertices: the shorter of two diagonals is taken.
    vertex : (e,) int
        The vertex in the middle of a split edge, −1 for others.
    child : (e, 2) int
        The half of a split edge at its first and at its second end.
    middles : function
        Of cells and `vertex`: (k, s, d) parameters of the middles of the cells' sides.

    Returns
    -------
    pieces : list of Cells
    made : list of Edges
        New ones inside cells, to be numbered after `edges`.
    """
    pieces: list[Cells] = []
    made: list[Edges] = []
    next_edge = len(edges.ends)
    for cells, cut in _cuts(whole, points, vertex) if whole.cells.shape[1] == 3 else [(whole, _SEGMENT)]:
        around = np.concatenate([cells.cells, vertex.take(cells.sides)], axis=1)
        corners = cells.corners
        places = np.concatenate([corners, middles(cells, vertex)], axis=1)
        inner: dict[frozenset[int], IntArray] = {}
        for line in cut.lines:
            inner[frozenset(line)] = next_edge + np.arange(len(around))
            face = np.full(len(around), INTERIOR)
            made.append(Edges(around.take(line, axis=1), cells.patch, places.take(line, axis=1), face))
            next_edge += len(around)
        for piece in cut.pieces:
            sides = _sides(piece, inner, cells, edges, child)
            pieces.append(Cells(around.take(piece, axis=1), sides, places.take(piece, axis=1), cells.patch))
    return pieces, made


def _cuts(whole: Cells, points: FloatArray, vertex: IntArray) -> list[tuple[Cells, _Cut]]:
    """Triangles turned so that their split sides come first, and how each of them is cut."""
    marks = vertex.take(whole.sides) >= 0
    count = marks.sum(axis=1)
    one, two, three = (np.flatnonzero(count == number) for number in (1, 2, 3))
    pair = _turned(whole, two, marks[two].argmin(axis=1) + 1)
    corner, middle = points.take(pair.cells, axis=0), points.take(vertex.take(pair.sides[:, :2]), axis=0)
    usual, other = middle[:, 1] - corner[:, 0], middle[:, 0] - corner[:, 2]
    is_longer = dot(usual, usual) > TIE_RATIO * dot(other, other)
    return [
        (_turned(whole, one, marks[one].argmax(axis=1)), _SIDE_0),
        (pair.at(np.flatnonzero(~is_longer)), _SIDES_0_1),
        (pair.at(np.flatnonzero(is_longer)), _SIDES_0_1_OTHER_DIAGONAL),
        (whole.at(three), _ALL_SIDES),
    ]


def _turned(whole: Cells, rows: IntArray, first: IntArray) -> Cells:
    """Some triangles, each from the given corner on."""
    order = 3 * rows[:, None] + (first[:, None] + np.arange(3)) % 3
    return Cells(
        whole.cells.ravel().take(order),
        whole.sides.ravel().take(order),
        whole.corners.reshape(-1, 2).take(order, axis=0),
        whole.patch.take(rows),
    )


def _sides(
    piece: tuple[int, ...], inner: dict[frozenset[int], IntArray], cells: Cells, edges: Edges, child: IntArray
) -> IntArray:
    """The edges around a piece of each cell: new ones inside it, sides of it and halves of these."""
    columns = []
    for i in range(cells.sides.shape[1]):
        start, end = piece[i], piece[(i + 1) % len(piece)]
        low, high = sorted((start, end))
        side = high - cells.cells.shape[1]
        if frozenset((start, end)) in inner:
            columns.append(inner[frozenset((start, end))])
        elif side < 0:
            columns.append(cells.sides[:, start])
        else:
            columns.append(_half_at(edges, child, cells.sides[:, side], cells.cells[:, low]))
    return np.stack(columns, axis=1)


def _half_at(edges: Edges, child: IntArray, split: IntArray, vertex: IntArray) -> IntArray:
    """The half of each split edge that ends at the given vertex."""
    second = edges.ends.ravel().take(2 * split) != vertex
    return np.asarray(child.ravel().take(2 * split + second))
