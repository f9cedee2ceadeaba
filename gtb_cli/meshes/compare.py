"""How far apart two meshes are, as surfaces or curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells, spatial_order
from gtb_cli.meshes.overlay import Pieces
from gtb_cli.meshes.topology import are_used

RELATIVE_ERROR = 1e-3
"""Relative error of a distance at which the search for farther points ends."""

IGNORED_GAIN = 1e-5
"""Relative gain over the largest distance found below which a sample is not measured exactly."""

DISTANCE_ROUNDING = 1e-14
"""Distance, as a fraction of the meshes' size, below which it is rounding."""

NEIGHBOUR_BLOCK = 64
"""Number of vertices, consecutive in space, of which one is measured first to find the others' distances sooner."""

FIRST_BATCH = 64
"""Number of points that are measured exactly first, farthest estimate first; each further batch is four times as
large."""

CELL_BATCH = 1 << 16
"""Number of cells that are bounded together, which bounds the memory."""

MAX_CUTS = 250_000
"""Largest number of pieces that are cut in the search, in each direction; the bound is what has been proved by then."""

CELLS_PER_CUT = 4
"""Number of uncut cells that cost as much as one that is cut; a large mesh leaves less for cuts."""

MIN_CUT_SHARE = 0.16
"""Fraction of `MAX_CUTS` that is left for the cuts of any large mesh."""

CUT_BATCH = 20_000
"""Number of pieces that are cut together."""

EXCESS_RATIO = 10
"""Ratio of pieces to the cuts allowed above which little can be proved: then only the likely pieces are cut, once."""

CORNER_BATCH = 64
"""Number of corners, of the pieces with the largest bounds, that are measured exactly in each round."""

CONCURRENT_CELLS = 100_000
"""Number of cells of a mesh from which the two directions are measured at the same time."""


@dataclass(frozen=True)
class Distance:
    """Two-sided (Hausdorff) distance between two meshes. Made by `surface_distance`.

    Attributes
    ----------
    forward, backward : float
        Largest distance found of a point of the first mesh from the second, and the other way, in model units. There
        are such points: the distances are no larger than the true ones.
    forward_at, backward_at : tuple of 3 float
        Those points.
    bound : float
        No point of either mesh is farther from the other than this.
    """

    forward: float
    backward: float
    forward_at: tuple[float, float, float]
    backward_at: tuple[float, float, float]
    bound: float

    @property
    def value(self) -> float:
        """The larger one of the two directions."""
        return max(self.forward, self.backward)


def surface_distance(
    a: Mesh, b: Mesh, accuracy: float = 0.0, *, effort: int = MAX_CUTS, concurrent: int = CONCURRENT_CELLS
) -> Distance:
    """Measure the Hausdorff distance between two meshes, as the surfaces or curves that their cells fill.

    Parameters
    ----------
    a, b : Mesh
        Triangles or segments; vertices that belong to none do not count.
    accuracy : float
        An error of the distance that does not matter, in model units: the search ends there, or at a thousandth of
        the distance, whichever is more.
    effort : int
        How many pieces may be cut in each direction; with none, the bound is that of whole cells.
    concurrent : int
        Cells of the larger mesh from which on both directions are searched at the same time: the result is the same.

    Returns
    -------
    Distance

    Raises
    ------
    DomainError
        A mesh without cells, or with vertices that are not finite.

    Notes
    -----
    The distance from a point to a mesh is that to its exactly nearest cell (`NearestCells`). Its maximum over a cell is
    at a corner or between them. The corners are looked at first. Then, as the distance to one cell is a convex
    function, no point of a piece of a cell is farther from the other mesh than the farthest of its corners is from any
    single cell there. Pieces for which this bound exceeds what was found are cut where they leave the region over the
    cell below them (`Pieces.cut`), so that in the end each lies over one cell, and its bound is a distance that there
    is. This ends when nothing more than `accuracy` can be gained, or the effort is spent; `Distance.bound` says what is
    proved then: of meshes of up to some ten thousand cells the distance itself; of a million cells each that do not
    match, only about the length of the cells.
    """
    used = []
    for mesh in (a, b):
        if not len(mesh.cells):
            raise DomainError("mesh: has no cells, and no distance from them")
        used.append(mesh.vertices[are_used(mesh.cells, len(mesh.vertices))])
        if not np.isfinite(used[-1]).all():
            raise DomainError("mesh: vertices must be finite")
    # A common power of two and origin, so that squares neither over- nor underflow.
    low = np.minimum(*(points.min(axis=0) for points in used))
    high = np.maximum(*(points.max(axis=0) for points in used))
    origin, exponent = low + (high - low) / 2, int(np.frexp((high - low).max())[1])
    first, second = (np.ldexp(mesh.vertices - origin, -exponent) for mesh in (a, b))
    allowed = float(np.ldexp(accuracy, -exponent))
    directions = [(first, a.cells, second[b.cells]), (second, b.cells, first[a.cells])]
    at_once = max(len(a.cells), len(b.cells)) >= concurrent
    forward, backward = (_at_once if at_once else _in_turn)(directions, allowed, effort)

    def place(point: FloatArray) -> tuple[float, float, float]:
        x, y, z = (np.ldexp(point, exponent) + origin).tolist()
        return x, y, z

    return Distance(
        forward=float(np.ldexp(forward.found, exponent)),
        backward=float(np.ldexp(backward.found, exponent)),
        forward_at=place(forward.place),
        backward_at=place(backward.place),
        bound=float(np.ldexp(max(forward.bound, backward.bound), exponent)),
    )


Direction: TypeAlias = tuple[FloatArray, IntArray, FloatArray]


def _in_turn(directions: list[Direction], accuracy: float, effort: int) -> list[_Search]:
    return [_directed(*direction, accuracy, effort) for direction in directions]


def _at_once(directions: list[Direction], accuracy: float, effort: int) -> list[_Search]:
    """The same in two threads, as numpy and scipy let each other run."""
    import threading

    results: list[_Search | BaseException] = []

    def run() -> None:
        try:
            results.append(_directed(*directions[1], accuracy, effort))
        except BaseException as error:  # noqa: BLE001 -- it is raised again where it is waited for
            results.append(error)

    # A daemon: Ctrl-C ends the process and does not wait for it.
    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    forward = _directed(*directions[0], accuracy, effort)
    thread.join()
    if isinstance(results[0], BaseException):
        raise results[0]
    return [forward, results[0]]


def _directed(vertices: FloatArray, cells: IntArray, other: FloatArray, accuracy: float, effort: int) -> _Search:
    """Search the cells given for the point that is farthest from the cells with the corners `other`."""
    search = _Search(NearestCells(other), accuracy)
    used = np.flatnonzero(are_used(cells, len(vertices)))
    used = used[spatial_order(vertices[used])]
    distances, nearest = np.empty(len(vertices)), np.empty(len(vertices), dtype=np.int64)
    distances[used], nearest[used] = search.look_at_many(vertices[used])
    kept = [Pieces.none(cells.shape[1])]
    for begin in range(0, len(cells), CELL_BATCH):
        rows = cells[begin : begin + CELL_BATCH]
        block = Pieces.of(vertices[rows], distances[rows], nearest[rows], search.tree)
        kept.append(search.bounded(search.needed(block)))
    pieces = Pieces.together(kept)
    effort = max(effort - len(cells) // CELLS_PER_CUT, round(effort * MIN_CUT_SHARE))
    by_sample = False
    if len(pieces.bounds) > EXCESS_RATIO * effort:
        effort, by_sample = min(CUT_BATCH, effort), True
    while True:
        search.try_corners(pieces)
        pieces = search.needed(pieces)
        if not len(pieces.bounds) or effort <= 0:
            break
        # In turn those that may be farthest, so that the bound falls, and those that probably are.
        number = min(CUT_BATCH, effort, len(pieces.bounds))
        order = np.argpartition(-(pieces.samples if by_sample else pieces.bounds), number - 1)
        by_sample = not by_sample
        effort -= number
        parts = search.bounded_well(search.bounded(pieces.at(order[:number]).cut(search.tree)))
        pieces = Pieces.together([pieces.at(order[number:]), parts])
    search.bound = max(search.found, search.bound, float(pieces.bounds.max(initial=0.0)))
    return search


class _Search:
    """The farthest point found so far, and a bound for what was left out so far."""

    def __init__(self, tree: NearestCells, accuracy: float) -> None:
        self.tree = tree
        self.accuracy = accuracy
        self.found = -1.0
        self.place: FloatArray = np.zeros(3)
        self.bound = 0.0

    @property
    def enough(self) -> float:
        """What a bound need not go below."""
        return self.found + max(self.found * RELATIVE_ERROR, self.accuracy, DISTANCE_ROUNDING)

    @property
    def low(self) -> float:
        """Points that are no farther than this need not be looked at exactly."""
        return self.found * (1 + IGNORED_GAIN) + DISTANCE_ROUNDING

    def needed(self, pieces: Pieces) -> Pieces:
        """Leave out the pieces whose bounds are low enough, and remember the highest of these."""
        low = pieces.bounds <= self.enough
        if not low.any():
            return pieces
        self.bound = max(self.bound, float(pieces.bounds[low].max(initial=0.0)))
        return pieces.at(~low)

    def bounded(self, pieces: Pieces) -> Pieces:
        """Bound pieces by cells near their middles, and keep those that need more; the middles are samples, too."""
        if not len(pieces.bounds):
            return pieces
        samples, likely = self.look_at(pieces.middles, pieces.likely)
        return self.needed(pieces.bounded(self.tree, likely, samples))

    def bounded_well(self, pieces: Pieces) -> Pieces:
        """As `bounded`, by the cells that are nearest to the middles."""
        for find in (self.tree.nearby, self.tree.search):
            if len(pieces.bounds):
                samples, likely = find(pieces.middles, pieces.samples, pieces.likely)
                pieces = self.needed(pieces.bounded(self.tree, likely, samples))
        return pieces

    def look_at_many(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """As `look_at`, for (m, 3) points of which those that follow each other are near each other."""
        block = np.arange(len(points)) // NEIGHBOUR_BLOCK
        first = np.arange(0, len(points), NEIGHBOUR_BLOCK)
        distances, cells = self.look_at(points[first])
        away = np.linalg.norm(points - points[first][block], axis=1)
        radius = np.maximum.reduceat(away, first)
        upper, guess = distances[block] + away, cells[block]
        open_ = np.flatnonzero((distances + radius > self.found)[block])
        upper[open_], guess[open_] = self.look_at(points[open_])
        return upper, guess

    def look_at(self, points: FloatArray, likely: IntArray | None = None) -> tuple[FloatArray, IntArray]:
        """Distances of (m, 3) points, exact where they may be the largest, else upper bounds; and of which cells.

        Cells that are likely to be the nearest ones save work.
        """
        if likely is None:
            distances, cells = self.tree.start(points)
        else:
            distances, cells = self.tree.distances(points, likely), likely.copy()
            chosen = self._open(np.arange(len(points)), distances)
            others, those = self.tree.start(points[chosen])
            better = others < distances[chosen]
            distances[chosen[better]], cells[chosen[better]] = others[better], those[better]
        order = self._open(np.arange(len(points)), distances)
        order = order[np.argsort(-distances[order], kind="stable")]
        begin, length = 0, FIRST_BATCH
        while begin < len(order):
            chosen = self._open(order[begin : begin + length], distances)
            if not len(chosen):
                break
            # One of some cells nearby is mostly the nearest, and found sooner than by a search.
            distances[chosen], cells[chosen] = self.tree.nearby(
                points[chosen], distances[chosen], cells[chosen], self.low
            )
            chosen = self._open(chosen, distances)
            if len(chosen):
                distances[chosen], cells[chosen] = self.tree.search(points[chosen], distances[chosen], cells[chosen])
                self.note(points[chosen], distances[chosen])
            begin, length = begin + length, length * 4
        return distances, cells

    def _open(self, chosen: IntArray, distances: FloatArray) -> IntArray:
        return chosen[distances[chosen] > self.low]

    def note(self, points: FloatArray, distances: FloatArray) -> None:
        """Keep the farthest of points whose distances are exact."""
        farthest = int(distances.argmax())
        if distances[farthest] > self.found:
            self.found, self.place = float(distances[farthest]), points[farthest]

    def try_corners(self, pieces: Pieces) -> None:
        """Look at the worst corners of the pieces with the largest bounds."""
        if len(pieces.bounds):
            worst = np.argsort(-pieces.bounds, kind="stable")[:CORNER_BATCH]
            self.look_at(pieces.corners[worst, pieces.worst[worst]])
