"""The Hausdorff distance of two meshes, as the surfaces or curves that their cells fill."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, joined, row_blocks, rows_of
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh, vertices_to_measure
from gtb_cli.meshes.nearest import NearestCells, middles, spatial_order
from gtb_cli.meshes.overlay import CellParts
from gtb_cli.meshes.topology import are_used

RELATIVE_ERROR = 1e-5  # of a distance, at which the search for farther points ends
DISTANCE_ROUNDING = 1e-14  # fraction of the meshes' size below which a distance is rounding
MAX_CUTS = 250_000  # pieces cut in each direction; the search then stops with the bound proved so far


@dataclass(frozen=True)
class Farthest:
    """The point that is farthest from something else, and its distance, in model units."""

    distance: float
    at: tuple[float, float, float]


@dataclass(frozen=True)
class Distance:
    """Two-sided (Hausdorff) distance between two meshes, surfaces or curves; ``float(found)`` is its value.

    Attributes
    ----------
    forward, backward : Farthest
        The point of the first one that is farthest from the second, and the other way round, in model units.
    bound : float
        What the distance can be at most: proved, or estimated.
    is_proved : bool
        Whether the bound is proved, as it is between meshes; between surfaces, points are searched for.
    """

    forward: Farthest
    backward: Farthest
    bound: float
    is_proved: bool

    @property
    def distance(self) -> float:
        """The larger of the two directed distances."""
        return max(self.forward.distance, self.backward.distance)

    @property
    def error(self) -> float:
        """Largest error of the distance."""
        return self.bound - self.distance

    def __float__(self) -> float:
        return self.distance


def mesh_distance(a: Mesh, b: Mesh, accuracy: float = 0.0) -> Distance:
    """Measure the Hausdorff distance between two meshes, as the surfaces or curves that their cells fill.

    The search ends at an error of `accuracy`, in model units, or of 1e-5 of the distance, whichever is more, or
    when `MAX_CUTS` pieces are cut in each direction. Raises `DomainError` for a mesh without cells, or with vertices
    that are not finite.

    Corners are measured first, each to its nearest cell (`NearestCells`). The distance to a single cell is convex, so
    that no point of a piece is farther than its farthest corner is from any one cell. Pieces for which this exceeds the
    distance found are cut where they leave the region over the cell below (`CellParts.cut`), until each lies over one.
    `Distance.bound` is what is proved at the end: the distance itself for meshes of up to some ten thousand cells; only
    about the length of the cells for two meshes of a million cells each that do not match.
    """
    used = [vertices_to_measure(mesh, "no distance can be measured") for mesh in (a, b)]
    frame = Frame.around(*used)
    first, second, allowed = frame.inside(a.vertices), frame.inside(b.vertices), float(frame.length(accuracy, -1))
    cells, others = (_distinct(mesh.cells, len(rows)) for mesh, rows in zip((a, b), used, strict=True))
    searches = _directed(first, cells, second[others], allowed), _directed(second, others, first[cells], allowed)
    ways = [Farthest(float(frame.length(way.found)), tuple(frame.outside(way.place).tolist())) for way in searches]
    return Distance(ways[0], ways[1], float(frame.length(max(way.bound for way in searches))), is_proved=True)


def _distinct(cells: IntArray, used: int) -> IntArray:
    """Cells of `used` vertices, once each if there are far too many, as in damaged files: every copy is searched."""
    if len(cells) <= 16 * used:  # surfaces have two for each vertex, and curves one
        return cells
    return cells[np.unique(np.sort(cells, axis=1), axis=0, return_index=True)[1]]


def _directed(vertices: FloatArray, cells: IntArray, other: FloatArray, accuracy: float) -> _FarthestPoint:
    """Search cells for the point farthest from those with the corners `other`."""
    cell_batch, cut_batch = 1 << 16, 20_000  # cells bounded together, and pieces cut together: they bound the memory
    cells_per_cut = 4  # that cost as much as a cut; a large mesh leaves less for cuts …
    least_share = 0.16  # … but this part of the effort
    excess = 10  # pieces for each allowed cut above which little can be proved: only likely ones are kept, and cut once
    used = np.flatnonzero(are_used(cells, len(vertices)))
    used = used[spatial_order(vertices[used])]
    search = _FarthestPoint(NearestCells(other), accuracy, vertices[used[0]])
    distances, nearest = np.empty(len(vertices)), np.empty(len(vertices), dtype=np.int64)
    distances[used], nearest[used] = search.look_at(vertices[used])
    # Few cells that need many cuts have whole lines as far as the farthest point, where the bound falls slowly.
    effort = min(MAX_CUTS, 20_000 + 50 * max(len(cells), len(other)))
    effort = max(effort - len(cells) // cells_per_cut, round(effort * least_share))
    # Boxes of long and thin cells lie on each other, and a search visits all of them: a few cuts prove no less.
    effort = round(effort * (40 / max(search.tree.crowd, 40)) ** 2)
    by_sample, kept = False, list[CellParts]()
    for rows in (cells[block] for block in row_blocks(len(cells), cell_batch)):
        block = CellParts.of(vertices[rows], distances[rows], nearest[rows], search.tree)
        kept.append(search.bounded(search.needed(block)))
        if sum(len(each.bounds) for each in kept) > excess * effort:
            kept, by_sample = [search.likeliest(joined(kept), min(cut_batch, effort))], True
    pieces = joined(kept)
    effort = min(cut_batch, effort) if by_sample else effort
    while True:
        worst = np.argsort(-pieces.bounds, kind="stable")[:64]  # the pieces of which corners are measured in each round
        search.look_at(pieces.corners[worst, pieces.worst[worst]])
        pieces = search.needed(pieces)
        if not len(pieces.bounds) or effort <= 0:
            break
        # Alternate between the pieces that may be farthest, so that the bound falls, and those that probably are.
        number = min(cut_batch, effort, len(pieces.bounds))
        order = np.argpartition(-(pieces.samples if by_sample else pieces.bounds), number - 1)
        by_sample = not by_sample
        effort -= number
        parts = search.bounded_well(search.bounded(rows_of(pieces, order[:number]).cut(search.tree)))
        farthest = np.argsort(-parts.samples, kind="stable")[:64]
        search.look_at(parts.corners[farthest, parts.worst[farthest]])
        pieces = joined([rows_of(pieces, order[number:]), parts])
    search.bound = max(search.found, search.bound, float(pieces.bounds.max(initial=0.0)))
    del search.tree  # which takes more memory than both meshes
    return search


class _FarthestPoint:
    """The farthest point found so far, and a bound for everything left out so far."""

    def __init__(self, tree: NearestCells, accuracy: float, place: FloatArray) -> None:
        self.tree, self.accuracy, self.place = tree, accuracy, place
        self.found = self.bound = 0.0

    def needed(self, pieces: CellParts) -> CellParts:
        """Leave out the pieces whose bounds are low enough, and remember the highest of these."""
        low = pieces.bounds <= self.found + max(self.found * RELATIVE_ERROR, self.accuracy, DISTANCE_ROUNDING)
        self.bound = max(self.bound, float(pieces.bounds[low].max(initial=0.0)))
        return rows_of(pieces, ~low)

    def likeliest(self, pieces: CellParts, number: int) -> CellParts:
        """Leave out all pieces but those whose samples are farthest, and remember the highest of their bounds."""
        order = np.argpartition(-pieces.samples, number)
        self.bound = max(self.bound, float(pieces.bounds[order[number:]].max()))
        return rows_of(pieces, order[:number])

    def bounded(self, pieces: CellParts) -> CellParts:
        """Bound pieces by cells near their middles, and keep those that need more; the middles are also samples."""
        samples, likely = self.look_at(middles(pieces.corners), pieces.likely)
        return self.needed(pieces.bounded(self.tree, likely, samples))

    def bounded_well(self, pieces: CellParts) -> CellParts:
        """Like `bounded`, with the cells nearest to the middles."""
        samples, likely = self.tree.search(middles(pieces.corners), pieces.samples, pieces.likely)
        return self.needed(pieces.bounded(self.tree, likely, samples))

    def look_at(self, points: FloatArray, likely: IntArray | None = None) -> tuple[FloatArray, IntArray]:
        """Distances of (m, 3) points, exact if they may be the largest, else upper bounds; and the nearest cells."""
        distances, cells = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
        if likely is not None:
            distances, cells = self.tree.distances(points, likely), likely.copy()
        chosen = self._open(np.arange(len(points)), distances)
        others, those = self.tree.start(points[chosen])
        better = others < distances[chosen]
        distances[chosen[better]], cells[chosen[better]] = others[better], those[better]
        order = self._open(np.arange(len(points)), distances)
        order = order[np.argsort(-distances[order], kind="stable")]
        begin, length = 0, 64  # points in the first batch measured exactly, farthest estimate first
        order = order[: self.tree.most_points]
        while begin < len(order):
            chosen = self._open(order[begin : begin + length], distances)
            if not len(chosen):
                break
            distances[chosen], cells[chosen] = self.tree.search(points[chosen], distances[chosen], cells[chosen])
            farthest = chosen[distances[chosen].argmax()]
            if distances[farthest] > max(self.found, DISTANCE_ROUNDING):
                self.found, self.place = float(distances[farthest]), points[farthest]
            begin, length = begin + length, length * 4
        return distances, cells

    def _open(self, chosen: IntArray, distances: FloatArray) -> IntArray:
        """Return the chosen points whose distances must be exact."""
        return chosen[distances[chosen] > self.found * (1 + RELATIVE_ERROR) + DISTANCE_ROUNDING]
