"""A complex that grows: its edges are split in the middle, and cells are cut by pattern; which edges: `refinement`."""

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, column_dot, cross, dot, groups, joined, rows_of
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.topology import sides_of
from gtb_cli.tessellation.complexes import Complex, kinds_of
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.edges import edge_curves

Numbers: TypeAlias = tuple[tuple[int, ...], ...]  # of corners and middles of a cell


class Vertices(NamedTuple):
    """The v vertices of a subdivision."""

    patch: IntArray
    parameters: FloatArray  # (v, d) in the domain of the patch
    face: IntArray  # the number of the face of Δ that holds them
    points: FloatArray
    guess: FloatArray  # (v, 2) for points of a surface beside the vertex, see `gtb_cli.tessellation.refinement_samples`


class Edges(NamedTuple):
    """The e sides of cells, and what is known of the surface over them; NaN stands for what is not known yet."""

    ends: IntArray  # (e, 2)
    patch: IntArray
    parameters: FloatArray  # (e, 2, d) of the ends in the domain of the patch
    face: IntArray  # the number of the face of Δ that holds the middle
    middle: FloatArray  # (e, 3) the middle of the curve over the edge
    guess: FloatArray  # (e, 2) of a vertex there
    bend: FloatArray  # distance of that middle from the edge
    error: FloatArray  # distance of the farthest sample of the curve from the edge, 0 if it was split
    roughness: FloatArray  # by how much samples differ from a parabola

    @property
    def middles(self) -> FloatArray:
        """The parameters halfway, (e, d)."""
        return np.asarray((self.parameters[:, 0] + self.parameters[:, 1]) / 2)

    @property
    def widths(self) -> FloatArray:
        """The largest differences of parameters, (e,)."""
        width = np.abs(self.parameters[:, 1] - self.parameters[:, 0])
        return np.maximum(width[:, 0], width[:, -1])


class Cells(NamedTuple):
    """The k cells: segments or triangles."""

    cells: IntArray  # (k, d + 1) vertices
    sides: IntArray  # (k, 1 or 3) edges; side i runs from vertex i to the next
    corners: FloatArray  # (k, d + 1, d) parameters in the domain of the cell's own patch
    patch: IntArray
    holds: BoolArray  # found to be within the tolerance: a segment everywhere, a triangle at samples


class Subdivision:
    """The vertices, edges and cells of a simplicial complex that grows, with the points of a sampler."""

    def __init__(self, start: Complex, sampler: Sampler) -> None:
        thin_height = 0.01  # of a triangle in Δ over its longest side, in units of the smallest such ratio at the start
        self.points = sampler.points(start.patch, start.parameters, start.face)
        guess = np.full((len(self.points), 2), np.nan)
        self.vertices = Vertices(start.patch, start.parameters, start.face, self.points, guess)
        self.collapsed = start.collapsed
        self.domains = sampler.domains
        self.kinds = kinds_of(self.domains)
        self.edges, sides = _edges_of(start, self.domains, self.kinds)
        # Indices may have 32 bits, and others are joined to them.
        self.cells = _new_cells(start.cells.astype(np.int64), sides, start.corners, start.cell_patch)
        self.is_surface = start.cells.shape[1] == 3
        uneven = sorted(start.uneven)
        self.uneven = dict(zip(uneven, edge_curves(sampler.patches, uneven), strict=True))
        self.slim = thin_height * min(1.0, float(_slimness(start.corners)[0].min())) if self.is_surface else 0.0

    def __len__(self) -> int:
        """Number of cells."""
        return len(self.cells.cells)

    def corners(self, rows: IntArray) -> list[FloatArray]:
        """Return the points of some cells' first vertices, (k, 3), of their second vertices, and so on."""
        return [self.points.take(vertex, axis=0) for vertex in self.cells.cells.take(rows, axis=0).T]

    def corner_columns(self, rows: IntArray) -> list[FloatArray]:
        """Return the points of `corners` as columns, (3, k)."""
        return [np.ascontiguousarray(corner.T) for corner in self.corners(rows)]

    def ends(self, rows: IntArray) -> list[FloatArray]:
        """Return the points of both ends of some edges, (e, 3) each."""
        return [self.points.take(end, axis=0) for end in self.edges.ends.take(rows, axis=0).T]

    def sides_of(self, rows: IntArray) -> IntArray:
        """Return the sides of some cells, each once, ascending."""
        chosen = np.zeros(len(self.edges.ends), dtype=bool)
        chosen[self.cells.sides.take(rows, axis=0)] = True
        return np.flatnonzero(chosen)

    def lengths(self, sides: IntArray) -> FloatArray:
        """Return the lengths of edges, in the shape of their numbers."""
        start, end = self.ends(sides.ravel())
        chord = end - start
        return np.asarray(np.sqrt(dot(chord, chord)).reshape(sides.shape))

    def has_mark(self, marked: BoolArray, rows: IntArray | slice = slice(None)) -> BoolArray:
        """Mark cells, all or the (k,) given, that have a marked side."""
        return reduce(np.logical_or, [marked.take(side) for side in self.cells.sides[rows].T])

    def mark_thin(self, marked: BoolArray) -> None:
        """Mark the longest edge of triangles that are thin, in space or in Δ, and have a marked edge.

        Otherwise a surface that bends to and fro along an edge could be split for ever. Marks do not spread further:
        near a knot close to an edge of Δ all triangles are thin, in space and in Δ along different sides.
        """
        if not self.is_surface:
            return
        max_aspect_ratio = 12.0  # of length to height: slivers then hardly get thinner, and refinement ends
        rows = np.flatnonzero(self.has_mark(marked))
        a, b, c = self.corner_columns(rows)
        normal = cross(b - a, c - a, 0)
        squares = [column_dot(side, side) for side in (b - a, c - b, a - c)]
        is_thin = max_aspect_ratio**2 * column_dot(normal, normal) < reduce(np.maximum, squares) ** 2
        share, longest = _slimness(self.cells.corners.take(rows, axis=0))
        sides = self.cells.sides.take(rows, axis=0)
        for thin, side in ((is_thin, np.argmax(squares, axis=0)), (share < self.slim, longest)):
            marked[sides[thin, side[thin]]] = True

    def split(self, chosen: IntArray, rows: IntArray) -> IntArray:
        """Split edges at the middles of their curves, and the given cells beside them; return all changed cells."""
        count, before = len(self.edges.ends), len(self)
        old = rows_of(self.edges, chosen)
        vertex = np.full(count, -1)  # in the middle of each split edge
        vertex[chosen] = len(self.points) + np.arange(len(chosen))
        child = np.full((count, 2), -1)  # its halves at its first and at its second end
        child[chosen] = count + np.arange(2 * len(chosen)).reshape(2, -1).T
        self._collapse(old, vertex[chosen])
        self.vertices = joined([self.vertices, Vertices(old.patch, old.middles, old.face, old.middle, old.guess)])
        self.points = self.vertices.points
        ends = [np.stack([end, vertex[chosen]], axis=1) for end in old.ends.T]
        places = [np.stack([old.parameters[:, end], old.middles], axis=1) for end in (0, 1)]
        halves = [_unknown_edges(ends[k], old.patch, places[k], old.face) for k in (0, 1)]
        self.edges.error[chosen] = 0.0
        self.edges = joined([self.edges, *halves])
        pieces, made = self._divided(rows, vertex, child)
        self.edges, new = joined([self.edges, *made]), joined(pieces)
        # The first pieces take the places of the cells that were cut.
        self.cells = joined([self.cells, rows_of(new, slice(len(rows), None))])
        for column, piece in zip(self.cells, new, strict=True):
            column[rows] = piece[: len(rows)]
        return np.concatenate([rows, np.arange(before, len(self))])

    def _collapse(self, old: Edges, vertex: IntArray) -> None:
        """Note which halves of edges, split at new vertices, are points because the edges are."""
        rows = np.flatnonzero(old.face != INTERIOR)
        known, ends = (np.sort(pairs, axis=1) @ [1 << 32, 1] for pairs in (self.collapsed, old.ends[rows]))
        rows = rows[np.isin(ends, known)]
        halves = [np.column_stack([old.ends[rows, end], vertex[rows]]) for end in (0, 1)]
        self.collapsed = np.concatenate([self.collapsed, *halves])

    def _divided(self, rows: IntArray, vertex: IntArray, child: IntArray) -> tuple[list[Cells], list[Edges]]:
        """Cut cells with split sides: segments in two, triangles in two to four. New edges inside them come second."""
        pieces, made = list[Cells](), list[Edges]()
        next_edge = len(self.edges.ends)
        for cells, parts, lines in self._patterns(rows_of(self.cells, rows), vertex):
            around = np.concatenate([cells.cells, vertex.take(cells.sides)], axis=1)
            places = np.concatenate([cells.corners, self._middles(cells, vertex)], axis=1)
            known = self._sides_and_halves(cells, child)
            for line in lines:
                known[frozenset(line)] = next_edge + np.arange(len(around))
                face = np.full(len(around), INTERIOR)
                made.append(_unknown_edges(around.take(line, axis=1), cells.patch, places.take(line, axis=1), face))
                next_edge += len(around)
            for part in parts:
                pairs = [*pairwise(part), (part[-1], part[0])][: cells.sides.shape[1]]
                sides = np.stack([known[frozenset(pair)] for pair in pairs], axis=1)
                pieces.append(_new_cells(around.take(part, axis=1), sides, places.take(part, axis=1), cells.patch))
        return pieces, made

    def _patterns(self, whole: Cells, vertex: IntArray) -> Iterator[tuple[Cells, Numbers, Numbers]]:
        """Yield triangles turned so that split sides come first, their pieces, and the edges between these.

        Corners are 0 … k − 1, and k + i is the middle of side i; the shorter diagonal is taken.
        """
        if not self.is_surface:
            yield whole, ((0, 2), (2, 1)), ()
            return
        marks = vertex.take(whole.sides) >= 0
        count = marks.sum(axis=1)
        one, two, three = (np.flatnonzero(count == number) for number in (1, 2, 3))
        yield _turned(whole, one, marks[one].argmax(axis=1)), ((0, 3, 2), (3, 1, 2)), ((3, 2),)
        pair = _turned(whole, two, marks[two].argmin(axis=1) + 1)
        corner, middle = (self.points.take(each, axis=0) for each in (pair.cells, vertex.take(pair.sides[:, :2])))
        usual, other = middle[:, 1] - corner[:, 0], middle[:, 0] - corner[:, 2]
        tie_ratio = 1 + 1e-9  # of squares: rounding, which depends on the processor, must not choose the diagonal
        is_longer = dot(usual, usual) > tie_ratio * dot(other, other)
        yield rows_of(pair, ~is_longer), ((3, 1, 4), (0, 3, 4), (0, 4, 2)), ((3, 4), (0, 4))
        yield rows_of(pair, is_longer), ((3, 1, 4), (0, 3, 2), (3, 4, 2)), ((3, 4), (3, 2))
        yield rows_of(whole, three), ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)), ((3, 5), (3, 4), (4, 5))

    def _sides_and_halves(self, cells: Cells, child: IntArray) -> dict[frozenset[int], IntArray]:
        """Return the sides of cells, and the halves of sides that are split, by the numbers of their two ends."""
        found, count = {}, cells.cells.shape[1]
        for k, side in enumerate(cells.sides.T):
            corners = k, (k + 1) % count
            found[frozenset(corners)] = side
            for corner in corners:
                is_second = self.edges.ends.ravel().take(2 * side) != cells.cells[:, corner]
                found[frozenset((corner, count + k))] = np.asarray(child.ravel().take(2 * side + is_second))
        return found

    def _middles(self, cells: Cells, vertex: IntArray) -> FloatArray:
        """Return the parameters, (k, s, d), in the middles of sides of cells, with (e,) vertices there, −1 for none.

        They are halfway; but a vertex from another patch is where this patch's edge has the same point.
        """
        following = np.roll(cells.corners, -1, axis=1)
        result = np.asarray((cells.corners + following) / 2)
        if not self.uneven:
            return result
        row, side = np.nonzero((vertex.take(cells.sides) >= 0) & (self.edges.face.take(cells.sides) != INTERIOR))
        known = rows_of(self.edges, cells.sides[row, side])
        is_own = (known.patch == cells.patch[row]) & (known.middles == result[row, side]).all(axis=1)
        row, side = row[~is_own], side[~is_own]
        for index, members in groups(cells.patch[row]):
            domain = self.domains[index]
            heights = domain.heights_of_columns(result[row[members], side[members]])
            for edge, some in groups(domain.nearest_edge(heights)):
                if (index, edge) in self.uneven:
                    at = row[members[some]], side[members[some]]
                    start, end = domain.vertices[edge], np.roll(domain.vertices, -1, axis=0)[edge]
                    ends = [domain.along(edge, u[at]) / np.hypot(*(end - start)) for u in (cells.corners, following)]
                    low, high = np.minimum(*ends), np.maximum(*ends)
                    points = self.points.take(vertex.take(cells.sides[at]), axis=0)
                    t, _ = self.uneven[index, edge].nearest(points, (low + high) / 2, low, high)
                    result[at] = start + t[:, None] * (end - start)
        return result

    def result(self) -> Complex:
        """Return the complex, its cells ordered by patch, then as they were made."""
        cells = rows_of(self.cells, np.argsort(self.cells.patch, kind="stable"))
        patch, parameters, face, *_ = self.vertices
        return Complex(patch, parameters, face, cells.cells, cells.patch, cells.corners, self.collapsed)


def _unknown_edges(ends: IntArray, patch: IntArray, parameters: FloatArray, face: IntArray) -> Edges:
    """Make edges of which nothing is known but where they are."""
    middle, guess, unknown = (np.full(shape, np.nan) for shape in ((len(ends), 3), (len(ends), 2), (3, len(ends))))
    return Edges(ends, patch, parameters, face, middle, guess, *unknown)


def _new_cells(cells: IntArray, sides: IntArray, corners: FloatArray, patch: IntArray) -> Cells:
    return Cells(cells, sides, corners, patch, np.zeros(len(cells), dtype=bool))


def _edges_of(start: Complex, domains: Sequence[Domain], kinds: IntArray) -> tuple[Edges, IntArray]:
    """Return the sides of all cells, each once, and the (k, 1 or 3) sides of each cell."""
    if start.cells.shape[1] == 2:
        no_face = np.zeros(len(start.cells), dtype=np.int64)
        edges = _unknown_edges(start.cells, start.cell_patch, start.corners, no_face)
        return edges, np.arange(len(start.cells))[:, None]
    sides = sides_of(start.cells)
    first = sides.first
    places = np.stack([start.corners, start.corners[:, [1, 2, 0]]], axis=2).reshape(-1, 2, 2)[first]
    patch = np.repeat(start.cell_patch, 3)[first]
    # A side lies on an edge of its domain if both ends do.
    face = np.zeros(len(first), dtype=np.int64)
    for index, rows in groups(kinds[patch]):
        domain = domains[index]
        face[rows] = domain.faces.at(np.maximum(*(domain.heights_of_columns(places[rows, end]) for end in (0, 1))))
    return _unknown_edges(sides.directed[first], patch, places, face), sides.edge


def _turned(whole: Cells, rows: IntArray, first: IntArray) -> Cells:
    """Return some triangles, each from the given corner on."""
    order = 3 * rows[:, None] + (first[:, None] + np.arange(3)) % 3
    corners = whole.corners.reshape(-1, 2).take(order, axis=0)
    return _new_cells(whole.cells.take(order), whole.sides.take(order), corners, whole.patch.take(rows))


def _slimness(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the ratios of height to longest side of (k, 3, 2) triangles, and which side is the longest."""
    x, y = (corners[:, :, axis].T for axis in (0, 1))
    x, y = (np.ascontiguousarray(np.roll(each, -1, axis=0) - each) for each in (x, y))
    squares = x * x + y * y
    return np.abs(x[0] * y[2] - y[0] * x[2]) / reduce(np.maximum, squares), squares.argmax(axis=0)
