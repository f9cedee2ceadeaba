"""Vertices, edges and cells as tables of columns, and the pieces into which cells with split sides are cut."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, dot, rows_of
from gtb_cli.knots.face import INTERIOR


class Vertices(NamedTuple):
    """Vertices of a complex, each with its patch, its (v, d) parameters there and the number of the face of Δ below it.

    A (v, 2) `guess` is for points of a surface beside it, see `gtb_cli.tessellation.sampling`.
    """

    patch: IntArray
    parameters: FloatArray
    face: IntArray
    points: FloatArray
    guess: FloatArray


class Edges(NamedTuple):
    """Sides of cells, and the surface over them as far as it is known; NaN stands for what is not known yet.

    Each has two `ends`, the (e, 2, d) `parameters` of these in a patch, and the face of Δ that holds its middle; the
    (e, 3) `middle` of its curve, and the (e, 2) `guess` of the vertex there. `bend` and `error` are the distances of
    the middle, and of the farthest sample of the curve, from the edge, 0 if it was split; `roughness` is by how much
    samples differ from a parabola.
    """

    ends: IntArray
    patch: IntArray
    parameters: FloatArray
    face: IntArray
    middle: FloatArray
    guess: FloatArray
    bend: FloatArray
    error: FloatArray
    roughness: FloatArray

    @property
    def middles(self) -> FloatArray:
        """(e, d) parameters halfway."""
        return np.asarray((self.parameters[:, 0] + self.parameters[:, 1]) / 2)

    @property
    def widths(self) -> FloatArray:
        """(e,) largest differences of parameters."""
        width = np.abs(self.parameters[:, 1] - self.parameters[:, 0])
        return np.maximum(width[:, 0], width[:, -1])


def unknown_edges(ends: IntArray, patch: IntArray, parameters: FloatArray, face: IntArray) -> Edges:
    """Make edges of which nothing is known but where they are."""
    middle, guess, unknown = (np.full(shape, np.nan) for shape in ((len(ends), 3), (len(ends), 2), (3, len(ends))))
    return Edges(ends, patch, parameters, face, middle, guess, *unknown)


class Cells(NamedTuple):
    """Cells with their vertices and sides: side i runs from vertex i to the next.

    The (k, d + 1, d) `corners` are parameters in the domain of the cell's own patch. Cells are `sampled`, or
    `certified`, once they were found to be within the tolerance at samples, or at all points.
    """

    cells: IntArray
    sides: IntArray
    corners: FloatArray
    patch: IntArray
    sampled: BoolArray
    certified: BoolArray


def new_cells(cells: IntArray, sides: IntArray, corners: FloatArray, patch: IntArray) -> Cells:
    """Make cells that were neither sampled nor certified."""
    return Cells(cells, sides, corners, patch, *np.zeros((2, len(cells)), dtype=bool))


class _SplitPattern(NamedTuple):
    """A pattern by which cells are cut. The k corners are 0 … k − 1, and k + i is the middle of side i."""

    pieces: tuple[tuple[int, ...], ...]
    lines: tuple[tuple[int, int], ...]  # new edges, inside the cell


_SEGMENT = _SplitPattern(((0, 2), (2, 1)), ())
_SIDE_0 = _SplitPattern(((0, 3, 2), (3, 1, 2)), ((3, 2),))
_SIDES_0_1 = _SplitPattern(((3, 1, 4), (0, 3, 4), (0, 4, 2)), ((3, 4), (0, 4)))
_SIDES_0_1_OTHER_DIAGONAL = _SplitPattern(((3, 1, 4), (0, 3, 2), (3, 4, 2)), ((3, 4), (3, 2)))
_ALL_SIDES = _SplitPattern(((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)), ((3, 5), (3, 4), (4, 5)))


def divide(
    whole: Cells,
    edges: Edges,
    points: FloatArray,
    vertex: IntArray,
    child: IntArray,
    middles: Callable[[Cells, IntArray], FloatArray],
) -> tuple[list[Cells], list[Edges]]:
    """Cut segments in two, and triangles with one, two or three split sides into two, three or four.

    Each of the cells has a split side. (e,) `vertex` is the one in the middle of a split edge, −1 for others, and
    (e, 2) `child` are its halves at its first and at its second end, which are among the edges. Of two diagonals the
    one is taken that is shorter between the (v, 3) points. `middles` gives the (k, s, d) parameters of the middles of
    sides of cells, from these and `vertex`. New edges inside cells are returned, too, to be numbered after `edges`.
    """
    pieces: list[Cells] = []
    made: list[Edges] = []
    next_edge = len(edges.ends)
    for cells, cut in _cuts(whole, points, vertex) if whole.cells.shape[1] == 3 else [(whole, _SEGMENT)]:
        around = np.concatenate([cells.cells, vertex.take(cells.sides)], axis=1)
        places = np.concatenate([cells.corners, middles(cells, vertex)], axis=1)
        inner: dict[frozenset[int], IntArray] = {}
        for line in cut.lines:
            inner[frozenset(line)] = next_edge + np.arange(len(around))
            face = np.full(len(around), INTERIOR)
            made.append(unknown_edges(around.take(line, axis=1), cells.patch, places.take(line, axis=1), face))
            next_edge += len(around)
        for piece in cut.pieces:
            sides = _sides(piece, inner, cells, edges, child)
            pieces.append(new_cells(around.take(piece, axis=1), sides, places.take(piece, axis=1), cells.patch))
    return pieces, made


def _cuts(whole: Cells, points: FloatArray, vertex: IntArray) -> list[tuple[Cells, _SplitPattern]]:
    """Triangles turned so that their split sides come first, and how each of them is cut."""
    marks = vertex.take(whole.sides) >= 0
    count = marks.sum(axis=1)
    one, two, three = (np.flatnonzero(count == number) for number in (1, 2, 3))
    pair = _turned(whole, two, marks[two].argmin(axis=1) + 1)
    corner, middle = points.take(pair.cells, axis=0), points.take(vertex.take(pair.sides[:, :2]), axis=0)
    usual, other = middle[:, 1] - corner[:, 0], middle[:, 0] - corner[:, 2]
    tie_ratio = 1 + 1e-9  # of squares: rounding, which depends on the processor, must not choose the diagonal
    is_longer = dot(usual, usual) > tie_ratio * dot(other, other)
    return [
        (_turned(whole, one, marks[one].argmax(axis=1)), _SIDE_0),
        (rows_of(pair, ~is_longer), _SIDES_0_1),
        (rows_of(pair, is_longer), _SIDES_0_1_OTHER_DIAGONAL),
        (rows_of(whole, three), _ALL_SIDES),
    ]


def _turned(whole: Cells, rows: IntArray, first: IntArray) -> Cells:
    """Some triangles, each from the given corner on."""
    order = 3 * rows[:, None] + (first[:, None] + np.arange(3)) % 3
    return new_cells(
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
