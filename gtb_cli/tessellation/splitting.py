"""Vertices, edges and cells as tables of columns, and the pieces into which cells with split sides are cut."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, dot, rows_of
from gtb_cli.knots.face import INTERIOR


class Vertices(NamedTuple):
    """Vertices of a complex; `face` is the number of the face of Δ in whose interior each lies.

    Attributes
    ----------
    patch, face : (v,) int
    parameters : (v, d) float
        In the domain of that patch.
    points : (v, 3) float
    guess : (v, 2) float
        For points of a surface beside it, see `gtb_cli.tessellation.sampling`.
    """

    patch: IntArray
    parameters: FloatArray
    face: IntArray
    points: FloatArray
    guess: FloatArray


class Edges(NamedTuple):
    """Sides of cells, and the surface over them as far as it is known; NaN stands for what is not known yet.

    Attributes
    ----------
    ends : (e, 2) int
    patch, face : (e,) int
        The face of Δ that holds the middle.
    parameters : (e, 2, d) float
    middle : (e, 3) float
        The middle of the edge's curve.
    guess : (e, 2) float
        That of the vertex there, if the edge is split.
    bend, error : (e,) float
        Distances of the middle, and of the farthest sample of the curve, from the edge. The error is 0 for edges that
        were split.
    roughness : (e,) float
        By how much samples differ from a parabola.
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
    """Cells with their sides: side i runs from vertex i to the next.

    Attributes
    ----------
    cells, sides : (k, d + 1) and (k, 1 or 3) int
        Vertices and edges.
    corners : (k, d + 1, d) float
        Parameters in the domain of the cell's own patch.
    patch : (k,) int
    sampled, certified : (k,) bool
        Whether it was found to be within the tolerance at samples, and at all points.
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


class _Cut(NamedTuple):
    """A pattern by which cells are cut. The k corners are 0 … k − 1, and k + i is the middle of side i."""

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
            made.append(unknown_edges(around.take(line, axis=1), cells.patch, places.take(line, axis=1), face))
            next_edge += len(around)
        for piece in cut.pieces:
            sides = _sides(piece, inner, cells, edges, child)
            pieces.append(new_cells(around.take(piece, axis=1), sides, places.take(piece, axis=1), cells.patch))
    return pieces, made


def _cuts(whole: Cells, points: FloatArray, vertex: IntArray) -> list[tuple[Cells, _Cut]]:
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
