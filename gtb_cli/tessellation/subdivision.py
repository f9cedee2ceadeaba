"""A complex that grows: its edges are split in the middle, and the cells beside them are cut by pattern."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, bounds_of, cross_of_columns, dot, groups, planar_cross
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.topology import sides_of
from gtb_cli.moment.newton import dot as column_dot
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.complex import Complex
from gtb_cli.tessellation.sharing import shared
from gtb_cli.tessellation.splitting import Cells, Edges, Growth, divide
from gtb_cli.theory.edges import edge_curves
from gtb_cli.theory.patch import Patch

MAX_ASPECT_RATIO = 12.0
"""Ratio of length to height from which on a triangle that is split has its longest edge split too: slivers then hardly
get thinner, and refinement ends."""

BLOCK_PAIRS = 1 << 18
"""Pairs of a cell and a peak that are tried at once."""


class Subdivision:
    """The growing arrays of a complex with points; their order depends on the input alone.

    Parameters
    ----------
    start : Complex
        Simplicial.
    points : (v, 3) float
    patches : sequence of Patch
    slim : float
        Height of a triangle in Δ over its longest side, in units of the smallest such ratio at the start, that is thin.
    """

    def __init__(self, start: Complex, points: FloatArray, patches: Sequence[Patch], slim: float) -> None:
        start = replace(start, cells=start.cells.astype(np.int64))  # others are joined to the arrays
        self.patch, self.parameters, self.face = start.patch, start.parameters, start.face
        self.points, self.collapsed = points, start.collapsed
        self.edges, sides = edges_of(start, patches)
        self.cells = Cells(start.cells, sides, start.corners, start.cell_patch)
        self.growth = Growth()
        self.is_surface = start.cells.shape[1] == 3
        self.peaks = [peaks_of(patch) for patch in patches] if self.is_surface else []
        self.domains = [patch.domain for patch in patches]
        uneven = sorted(start.uneven)
        self.uneven = dict(zip(uneven, edge_curves(patches, uneven), strict=True))
        self.slim = slim * min(1.0, float(slimness(start.corners)[0].min())) if self.is_surface else slim

    def __len__(self) -> int:
        """Number of cells."""
        return len(self.cells.cells)

    def corners(self, rows: IntArray) -> list[FloatArray]:
        """(k, 3) points of the first vertices of some cells, of the second ones, …."""
        cells = self.cells.cells.take(rows, axis=0)
        return [self.points.take(vertex, axis=0) for vertex in cells.T]

    def corner_columns(self, rows: IntArray) -> list[FloatArray]:
        """The same as contiguous (3, k) arrays, of which sums and products take less time."""
        return [np.ascontiguousarray(corner.T) for corner in self.corners(rows)]

    def ends(self, rows: IntArray) -> list[FloatArray]:
        """(e, 3) points of both ends of some edges."""
        ends = self.edges.ends.take(rows, axis=0)
        return [self.points.take(end, axis=0) for end in ends.T]

    def sides_of(self, rows: IntArray) -> IntArray:
        """The sides of some cells, each once, ascending."""
        chosen = np.zeros(len(self.edges.ends), dtype=bool)
        chosen[self.cells.sides.take(rows, axis=0)] = True
        return np.flatnonzero(chosen)

    def lengths(self, sides: IntArray) -> FloatArray:
        """Lengths of edges, in the shape of their numbers."""
        start, end = self.ends(sides.ravel())
        chord = end - start
        return np.asarray(np.sqrt(dot(chord, chord)).reshape(sides.shape))

    def has_mark(self, marked: BoolArray, rows: IntArray | None = None) -> BoolArray:
        """Whether any side of each cell, or of some cells, is marked; by columns, as short rows are slow to reduce."""

        def is_marked(rows: slice | IntArray) -> BoolArray:
            sides = self.cells.sides[rows] if isinstance(rows, slice) else self.cells.sides.take(rows, axis=0)
            return reduce(np.logical_or, [marked.take(side) for side in sides.T])

        return shared(is_marked, len(self) if rows is None else rows)

    def mark_thin(self, marked: BoolArray) -> None:
        """Mark the longest edge of triangles that are thin, in space or in Δ, and have a marked edge.

        Without those thin in Δ, parts of a surface that bends to and fro along an edge could be split for ever.
        Triangles beyond the newly marked edges are left as they are: near a knot close to an edge of Δ all triangles
        are thin, in space and in Δ along different sides, and marks would spread over the whole neighbourhood.
        """
        if not self.is_surface:
            return
        longest = shared(self._longest_if_thin, np.flatnonzero(self.has_mark(marked)))
        marked[longest[longest >= 0]] = True

    def _longest_if_thin(self, rows: IntArray) -> IntArray:
        """(2, k) longest edges in space and in Δ of those triangles that are thin there, −1 for others."""
        a, b, c = self.corner_columns(rows)
        normal = cross_of_columns(b - a, c - a)
        squares = [column_dot(side, side) for side in (b - a, c - b, a - c)]
        is_thin = MAX_ASPECT_RATIO**2 * column_dot(normal, normal) < reduce(np.maximum, squares) ** 2
        share, longest = slimness(self.cells.corners.take(rows, axis=0))
        sides = self.cells.sides.take(rows, axis=0).ravel()
        found = ((is_thin, _largest(squares)), (share < self.slim, longest))
        return np.stack([np.where(thin, sides.take(3 * np.arange(len(rows)) + side), -1) for thin, side in found])

    def split(self, chosen: IntArray, middles: FloatArray, rows: IntArray) -> IntArray:
        """Split edges at their (e, 3) middles, and the cells beside them, in the given rows; return all that changed.

        New edges come after all others: first the halves of split edges, then those inside cells.
        """
        count = len(self.edges.ends)
        old = self.edges.at(chosen)
        vertex = np.full(count, -1)
        vertex[chosen] = len(self.points) + np.arange(len(chosen))
        child = np.full((count, 2), -1)
        child[chosen] = count + np.arange(2 * len(chosen)).reshape(2, -1).T
        places = old.middles
        if len(self.collapsed):
            self._collapse(old, vertex[chosen])
        self.patch = self.growth.append("patch", self.patch, old.patch)
        self.parameters = self.growth.append("parameters", self.parameters, places)
        self.face = self.growth.append("face", self.face, old.face)
        self.points = self.growth.append("points", self.points, middles)
        halves = [
            Edges(
                np.stack([old.ends[:, end], vertex[chosen]], axis=1),
                old.patch,
                np.stack([old.parameters[:, end], places], axis=1),
                old.face,
            )
            for end in (0, 1)
        ]
        self.edges = self.edges.followed_by(self.growth, *halves)
        pieces, made = divide(self.cells.at(rows), self.edges, self.points, vertex, child, self.middles)
        if made:
            self.edges = self.edges.followed_by(self.growth, *made)
        before = len(self)
        self.cells = self.cells.replaced(self.growth, rows, pieces)
        return np.concatenate([rows, np.arange(before, len(self))])

    def _collapse(self, old: Edges, vertex: IntArray) -> None:
        """Note which halves of edges, split at new vertices, are points because the edges are."""
        rows = np.flatnonzero(old.face != INTERIOR)
        known, ends = (np.sort(pairs, axis=1) @ [1 << 32, 1] for pairs in (self.collapsed, old.ends[rows]))
        rows = rows[np.isin(ends, known)]
        halves = [np.column_stack([old.ends[rows, end], vertex[rows]]) for end in (0, 1)]
        self.collapsed = np.concatenate([self.collapsed, *halves])

    def middles(self, cells: Cells, vertex: IntArray) -> FloatArray:
        """(k, s, d) parameters of the middles of the sides of cells, with the (e,) vertices there, −1 for none.

        They are halfway; but a vertex from another patch is where this patch's edge has the same point.
        """
        following = np.roll(cells.corners, -1, axis=1)
        result = np.asarray((cells.corners + following) / 2)
        if not self.uneven:
            return result
        row, side = np.nonzero((vertex.take(cells.sides) >= 0) & (self.edges.face.take(cells.sides) != INTERIOR))
        known = self.edges.at(cells.sides[row, side])
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

    def peaks_along(self, sides: IntArray) -> tuple[IntArray, FloatArray]:
        """Edges on the boundary of Δ with peaks between their ends, and these; see `peaks_of`."""
        sides = sides[self.edges.face[sides] > 0]
        groups = []
        for index, peaks in enumerate(self.peaks):
            own = sides[self.edges.patch[sides] == index]
            for face in range(1, len(peaks)):
                rows = own[self.edges.face[own] == face]
                groups.append((rows, self.edges.parameters.take(rows, axis=0), peaks[face]))
        return _with_peaks(groups, _is_between)

    def peaks_inside(self, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """Triangles with peaks inside, and these; see `peaks_of`."""
        groups = []
        for index, peaks in enumerate(self.peaks):
            own = rows[self.cells.patch[rows] == index]
            groups.append((own, self.cells.corners.take(own, axis=0), peaks[0]))
        return _with_peaks(groups, _is_inside)

    def result(self) -> Complex:
        """The complex, its cells ordered by patch, then as they were made."""
        order = np.argsort(self.cells.patch, kind="stable")
        cells = self.cells.at(order)
        return Complex(self.patch, self.parameters, self.face, cells.cells, cells.patch, cells.corners, self.collapsed)


def edges_of(start: Complex, patches: Sequence[Patch]) -> tuple[Edges, IntArray]:
    """The sides of all cells, each once, and the (k, 1 or 3) sides of each cell."""
    k = start.cells.shape[1]
    if k == 2:
        edges = Edges(start.cells, start.cell_patch, start.corners, np.zeros(len(start.cells), dtype=np.int64))
        return edges, np.arange(len(start.cells))[:, None]
    sides = sides_of(start.cells)
    first = sides.first
    places = np.stack([start.corners, start.corners[:, [1, 2, 0]]], axis=2).reshape(-1, 2, 2)
    patch = np.repeat(start.cell_patch, 3)
    # A side lies on an edge of its domain if both ends do.
    face = np.zeros(len(first), dtype=np.int64)
    for index, domain in enumerate(shape.domain for shape in patches):
        rows = np.flatnonzero(patch[first] == index)
        heights = [domain.heights_of_columns(places[first[rows], end]) for end in (0, 1)]
        face[rows] = domain.faces.at(np.maximum(*heights))
    return Edges(sides.directed[first], patch[first], places[first], face), sides.edge


def peaks_of(patch: Patch) -> list[FloatArray]:
    """Parameters, inside Δ and on each edge of it, near which samples may miss much of a surface.

    They are the knots, whose weights may be extreme, and the middles between neighbouring knots, which may crowd.
    """
    domain, knots = patch.domain, patch.knots
    inner = np.unique(knots[~domain.incidence.any(axis=1)], axis=0)
    middles, length = [], block_length(len(knots))
    for begin in range(0, len(inner), length):
        block = inner[begin : begin + length]
        apart = sum(np.subtract.outer(x, y) ** 2 for x, y in zip(block.T, knots.T, strict=True))
        middles.append((block + knots[np.where(apart > 0, apart, np.inf).argmin(axis=1)]) / 2)
    peaks = [np.concatenate([inner, *middles])]
    for edge in range(len(domain.vertices)):
        ordered = knots[domain.edge_knots(edge)]
        peaks.append(np.concatenate([ordered, (ordered[1:] + ordered[:-1]) / 2]))
    return peaks


def _with_peaks(
    groups: Sequence[tuple[IntArray, FloatArray, FloatArray]],
    holds: Callable[[FloatArray, FloatArray], BoolArray],
) -> tuple[IntArray, FloatArray]:
    """Rows of cells that hold peaks, and these; each group has rows, the corners of their cells, and peaks to try."""
    rows_found, found = [np.empty(0, dtype=np.int64)], [np.empty((0, 2))]
    for rows, corners, peaks in groups:
        if not len(rows) or not len(peaks):
            continue
        low, high = bounds_of(corners.reshape(-1, 2))
        axis = (high - low).argmax()
        order = np.argsort(peaks[:, axis], kind="stable")
        columns, places = corners[:, :, axis].T, peaks[order, axis]
        first = np.searchsorted(places, reduce(np.minimum, columns))
        count = np.searchsorted(places, reduce(np.maximum, columns), side="right") - first
        near = np.flatnonzero(count)
        first, count = first[near], count[near]
        cell = np.repeat(near, count)
        peak = order[np.arange(len(cell)) + np.repeat(first - np.cumsum(count) + count, count)]
        for begin in range(0, len(cell), BLOCK_PAIRS):
            block = slice(begin, begin + BLOCK_PAIRS)
            held = begin + np.flatnonzero(holds(corners.take(cell[block], axis=0), peaks.take(peak[block], axis=0)))
            rows_found.append(rows[cell[held]])
            found.append(peaks[peak[held]])
    return np.concatenate(rows_found), np.concatenate(found)


def _is_between(ends: FloatArray, peak: FloatArray) -> BoolArray:
    start, end = np.moveaxis(ends, 1, 0)
    along = ((peak - start) * (end - start)).sum(axis=1)
    return np.asarray((along > 0) & (along < ((end - start) ** 2).sum(axis=1)))


def _is_inside(corners: FloatArray, peak: FloatArray) -> BoolArray:
    a, b, c = np.moveaxis(corners, 1, 0)
    signs = np.stack([planar_cross(b - a, peak - a), planar_cross(c - b, peak - b), planar_cross(a - c, peak - c)])
    return np.asarray((signs > 0).all(axis=0) | (signs < 0).all(axis=0))


def slimness(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """(k,) ratios of height to longest side of (k, 3, 2) triangles, and which side is the longest."""
    x, y = (corners[:, :, axis].T for axis in (0, 1))
    x, y = (np.ascontiguousarray(np.roll(each, -1, axis=0) - each) for each in (x, y))
    squares = x * x + y * y
    return np.abs(x[0] * y[2] - y[0] * x[2]) / reduce(np.maximum, squares), _largest(squares)


def _largest(rows: Sequence[FloatArray] | FloatArray) -> IntArray:
    """(k,) which of three rows is the largest, the first of equal ones; `numpy.argmax` takes several times as long."""
    return np.where(rows[2] > np.maximum(rows[0], rows[1]), 2, rows[1] > rows[0])
