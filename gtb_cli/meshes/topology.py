"""Connectivity of cells: their sides, the edges that sides share, and the vertices in use.

Cells are segments (k, 2) or triangles (k, 3). A segment has one side, from its first vertex to its second; side i of a
triangle runs from its vertex i to the next.
"""

from functools import cached_property
from itertools import combinations

import numpy as np

from gtb_cli.arrays import BoolArray, IntArray, merged, paired, taken
from gtb_cli.values import frozen


@frozen
class Sides:
    """The sides of cells, and the edges that they share. Made by `sides_of`."""

    directed: IntArray  # (k s, 2) sides in the order of the cells, s = 1 for segments and 3 for triangles
    edges: IntArray  # (e, 2) vertices joined by at least one side, each pair once, ascending, sorted
    edge: IntArray  # (k, s) the edge of each side
    first: IntArray  # (e,) the first side, a row of `directed`, that runs along each edge
    uses: IntArray  # (e,) number of sides along each edge

    @cached_property
    def balance(self) -> IntArray:
        """(e,) number of sides that run along an edge from the lower vertex to the higher, less those that run back."""
        upwards = np.where(self.directed[:, 0] < self.directed[:, 1], 1.0, -1.0)
        return np.bincount(self.edge.ravel(), upwards, len(self.edges)).astype(np.int64)

    @property
    def is_proper(self) -> BoolArray:
        """(e,) true where an edge has two ends."""
        return np.asarray(self.edges[:, 0] != self.edges[:, 1])

    @property
    def is_manifold(self) -> BoolArray:
        """(e,) true where an edge has one side, or two that run in opposite directions."""
        return np.asarray((self.uses == 1) | ((self.uses == 2) & (self.balance == 0)))

    @property
    def alone(self) -> IntArray:
        """(b,) rows of `directed`, ascending: sides that do not share their edge."""
        return np.sort(self.first[(self.uses == 1) & self.is_proper])

    @property
    def open(self) -> IntArray:
        """(b,) rows of `directed`, ascending: sides that do not meet exactly one other, in the opposite direction."""
        return np.flatnonzero((((self.uses == 1) | ~self.is_manifold) & self.is_proper)[self.edge.ravel()])


def sides_of(cells: IntArray) -> Sides:
    """Return the sides of segments (k, 2) or triangles (k, 3), and which of them share an edge."""
    around = [0, 1] if cells.shape[1] == 2 else [0, 1, 1, 2, 2, 0]
    directed = cells[:, around].reshape(-1, 2)
    count = int(cells.max(initial=-1)) + 1
    start, end = directed.T
    keys = paired(np.minimum(start, end), np.maximum(start, end), count)  # single numbers are sorted sooner than pairs
    keys, first, edge, uses = np.unique(keys, return_index=True, return_inverse=True, return_counts=True)
    edges = np.stack(np.divmod(keys, max(count, 1)), axis=1)
    return Sides(directed, edges, edge.reshape(len(cells), len(around) // 2), first, uses)


def adjacent(cells: IntArray) -> tuple[IntArray, IntArray]:
    """(p, 2) triangles that share an edge, two by two where more do, and (p, 2) the ascending ends of these edges."""
    sides = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    ordered = sides[order]
    first = np.flatnonzero((ordered[1:] == ordered[:-1]).all(axis=1))
    return np.stack([order[first] // 3, order[first + 1] // 3], axis=1), ordered[first]


def runs_of(segments: IntArray) -> list[IntArray]:
    """The vertices along each run of segments, (k, 2), each of which begins where the one before ends."""
    breaks = np.flatnonzero(segments[1:, 0] != segments[:-1, 1]) + 1
    return [np.append(run[:, 0], run[-1, 1]) for run in np.split(segments, breaks)]


def are_proper(cells: IntArray) -> BoolArray:
    """(k,) true where all vertices of a cell differ."""
    return np.asarray(np.logical_and.reduce([one != other for one, other in combinations(cells.T, 2)]))


def are_used(cells: IntArray, count: int) -> BoolArray:
    """(count,) true where a vertex belongs to a cell."""
    used = np.zeros(count, dtype=bool)
    for corner in cells.T:
        used[corner] = True
    return used


def compacted(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices that cells use, ascending, and the cells as indices of these."""
    low, high = int(cells.min(initial=0)), int(cells.max(initial=-1))
    is_used = are_used(cells - low, high - low + 1)
    return np.flatnonzero(is_used) + low, taken(np.cumsum(is_used, dtype=cells.dtype) - 1, cells - low)


def components_of(cells: IntArray, count: int) -> IntArray:
    """(count,) the least vertex of the connected component to which each of `count` vertices belongs."""
    return merged(count, np.concatenate([cells[:, [0, k]] for k in range(1, cells.shape[1])]))


def component_count(cells: IntArray, count: int) -> int:
    """The number of connected components of a mesh of `count` vertices; unused vertices do not count."""
    return int((components_of(cells, count) == np.arange(count))[are_used(cells, count)].sum())
