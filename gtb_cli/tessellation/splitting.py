"""Cells with their sides as arrays, and how cells are split whose sides are split in the middle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, dot

TIE_RATIO = 1 + 1e-9
"""Squares of diagonals whose ratio is less are equal: rounding, of which processors differ in, does not choose."""

Scalar = TypeVar("Scalar", bound=np.generic)


class Growth:
    """Memory with room for more rows of some arrays, so that not all rows are copied whenever some are appended."""

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


@dataclass(frozen=True, eq=False)
class Edges:
    """Sides of cells. `face` is that of the middle: where the edge lies on the boundary of its patch, that edge."""

    ends: IntArray
    patch: IntArray
    parameters: FloatArray
    face: IntArray

    def __getitem__(self, rows: IntArray) -> Edges:
        return Edges(
            self.ends.take(rows, axis=0),
            self.patch.take(rows),
            self.parameters.take(rows, axis=0),
            self.face.take(rows),
        )

    def followed_by(self, growth: Growth, *others: Edges) -> Edges:
        """Append others to these."""
        return Edges(
            growth.append("edges.ends", self.ends, *(edges.ends for edges in others)),
            growth.append("edges.patch", self.patch, *(edges.patch for edges in others)),
            growth.append("edges.parameters", self.parameters, *(edges.parameters for edges in others)),
            growth.append("edges.face", self.face, *(edges.face for edges in others)),
        )

    @property
    def middles(self) -> FloatArray:
        """(e, d) parameters halfway."""
        return np.asarray((self.parameters[:, 0] + self.parameters[:, 1]) / 2)

    @property
    def widths(self) -> FloatArray:
        """(e,) largest differences of parameters."""
        width = np.abs(self.parameters[:, 1] - self.parameters[:, 0])
        return np.maximum(width[:, 0], width[:, -1])


@dataclass(frozen=True, eq=False)
class Cells:
    """Some cells with their sides: side i runs from vertex i to the next."""

    cells: IntArray
    sides: IntArray
    corners: FloatArray
    patch: IntArray

    def __getitem__(self, rows: IntArray) -> Cells:
        return Cells(
            self.cells.take(rows, axis=0),
            self.sides.take(rows, axis=0),
            self.corners.take(rows, axis=0),
            self.patch.take(rows),
        )

    def replaced(self, growth: Growth, rows: IntArray, pieces: Sequence[Cells]) -> Cells:
        """Put pieces in the place of the given cells, and those for which there is none at the end."""

        def column(name: str) -> NDArray[Any]:
            new = np.concatenate([getattr(piece, name) for piece in pieces])
            column = growth.append(f"cells.{name}", getattr(self, name), new[len(rows) :])
            column[rows] = new[: len(rows)]
            return column

        return Cells(column("cells"), column("sides"), column("corners"), column("patch"))


def divide_segments(
    whole: Cells, edges: Edges, points: FloatArray, vertex: IntArray, child: IntArray
) -> tuple[list[Cells], list[Edges]]:
    """Cut segments in two; arguments and results as of `divide_triangles`."""
    cells, sides, corners, patch = whole.cells, whole.sides[:, 0], whole.corners, whole.patch
    middle, center = vertex[sides], corners.mean(axis=1)
    pieces = []
    for end in (0, 1):
        half = cells.copy()
        half[:, 1 - end] = middle
        ends = corners.copy()
        ends[:, 1 - end] = center
        pieces.append(Cells(half, half_at(edges, child, sides, cells[:, end])[:, None], ends, patch))
    return pieces, []


def divide_triangles(
    whole: Cells, edges: Edges, points: FloatArray, vertex: IntArray, child: IntArray
) -> tuple[list[Cells], list[Edges]]:
    """Cut triangles with one, two or three split sides into two, three or four.

    Parameters
    ----------
    whole : Cells
        Each with a split side at least.
    edges : Edges
        With the halves of split ones.
    points : (v, 3) float
        Places of the vertices: the shorter of two diagonals is taken.
    vertex : (e,) int
        The vertex in the middle of a split edge, −1 for others.
    child : (e, 2) int
        The half of a split edge at its first and at its second end.

    Returns
    -------
    pieces : list of Cells
    made : list of Edges
        New ones inside cells, to be numbered after `edges`.
    """
    marks = vertex.take(whole.sides) >= 0
    pieces: list[Cells] = []
    made: list[Edges] = []
    count = marks.sum(axis=1)
    next_edge = len(edges.ends)
    for number in (1, 2, 3):
        rows = np.flatnonzero(count == number)
        # Turned so that the marked sides come first.
        turn = marks[rows].argmax(axis=1)
        if number == 2:
            turn = (np.argmin(marks[rows], axis=1) + 1) % 3
        order = 3 * rows[:, None] + (np.arange(3) + turn[:, None]) % 3
        v, e = whole.cells.ravel().take(order), whole.sides.ravel().take(order)
        patterns: list[tuple[slice | BoolArray, _Pattern]] = [(slice(None), _PATTERNS[number])]
        if number == 2:
            start, end = points.take(v, axis=0), points.take(vertex.take(e[:, :2]), axis=0)
            across = [end[:, 1] - start[:, 0], end[:, 0] - start[:, 2]]
            other = dot(across[0], across[0]) > TIE_RATIO * dot(across[1], across[1])
            patterns = [(~other, _PATTERNS[2]), (other, _OTHER_DIAGONAL)]
        for chosen, (triangles, lines) in patterns:
            own, corner, side = order[chosen], v[chosen], e[chosen]
            if not len(own):
                continue
            # Columns 0 … 2 are the corners, 3 … 5 the middles of the sides, where these are marked.
            around = np.concatenate([corner, vertex.take(side)], axis=1)
            p = whole.corners.reshape(-1, 2).take(own, axis=0)
            places = np.concatenate([p, (p + p.take((1, 2, 0), axis=1)) / 2], axis=1)
            patch = whole.patch.take(own[:, 0] // 3)
            edge_of: dict[tuple[int, int], IntArray] = {}
            for line in lines:
                edge_of[line] = edge_of[line[::-1]] = next_edge + np.arange(len(own))
                next_edge += len(own)
                inner = np.zeros(len(own), dtype=np.int64)
                made.append(Edges(around.take(line, axis=1), patch, places.take(line, axis=1), inner))
            for near, far in ((0, 1), (1, 2), (2, 0)):
                edge_of[near, far] = side[:, near]
                for end in (near, far) if near < number else ():
                    half = half_at(edges, child, side[:, near], corner[:, end])
                    edge_of[end, 3 + near] = edge_of[3 + near, end] = half
            for triangle in triangles:
                sides = [edge_of[triangle[i], triangle[(i + 1) % 3]] for i in range(3)]
                cells, corners = around.take(triangle, axis=1), places.take(triangle, axis=1)
                pieces.append(Cells(cells, np.stack(sides, axis=1), corners, patch))
    return pieces, made


_Pattern = tuple[tuple[tuple[int, int, int], ...], tuple[tuple[int, int], ...]]

_PATTERNS: dict[int, _Pattern] = {
    1: (((0, 3, 2), (3, 1, 2)), ((3, 2),)),
    2: (((3, 1, 4), (0, 3, 4), (0, 4, 2)), ((3, 4), (0, 4))),
    3: (((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)), ((3, 5), (3, 4), (4, 5))),
}
"""Triangles and new edges by number of marked sides; corners are 0 … 2, the middle of side i is 3 + i."""

_OTHER_DIAGONAL: _Pattern = (((3, 1, 4), (0, 3, 2), (3, 4, 2)), ((3, 4), (3, 2)))
"""For two marked sides, the quadrilateral that remains cut the other way."""


def half_at(edges: Edges, child: IntArray, split: IntArray, vertex: IntArray) -> IntArray:
    """The half of each split edge that ends at the given vertex."""
    second = edges.ends.ravel().take(2 * split) != vertex
    return np.asarray(child.ravel().take(2 * split + second))
