"""The domain cut into equal parts: parameters and cells whose order depends on the domain and the number alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.domain import Domain


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Parameters in Δ and the cells between them.

    Attributes
    ----------
    parameters : (m, d) float
    cells : (k, d + 1) int
        Counter-clockwise; segments ascending.
    boundary : (r, N) int
        Vertices on each edge of Δ, from its first corner up to, not including, its last; for d = 1 the two ends.
    """

    parameters: FloatArray
    cells: IntArray
    boundary: IntArray

    def with_cut_beside(self, corner: int) -> Triangulation:
        """Cut the side that the first vertex after a corner has with the inner vertex of their cell, in the middle."""
        first = corner * self.boundary.shape[1]
        at, after = self.boundary.ravel().take([first, first + 1], mode="wrap")
        cell = self.cells[(np.isin(self.cells, (at, after)).sum(axis=1) == 2).argmax()]
        inner = int(cell[~np.isin(cell, (at, after))][0])
        rows = np.flatnonzero(np.isin(self.cells, (inner, after)).sum(axis=1) == 2)
        middle = self.parameters[[inner, after]].mean(axis=0)
        halves = [np.where(self.cells[rows] == end, len(self.parameters), self.cells[rows]) for end in (inner, after)]
        cells = np.concatenate([np.delete(self.cells, rows, axis=0), *halves])
        return Triangulation(np.concatenate([self.parameters, middle[None]]), cells, self.boundary)


def cell_count(domain: Domain, resolution: int) -> int:
    """Number of cells of `triangulation`, without making it."""
    return cell_count_of(len(domain.vertices), resolution)


def cell_count_of(corners: int, resolution: int) -> int:
    """The same for a polygon that is known by its number of corners; a segment has 2."""
    if corners == 2:
        return resolution
    return resolution**2 * {3: 1, 4: 2}.get(corners, corners)


def triangulation(domain: Domain, resolution: int) -> Triangulation:
    """Cut Δ into equal parts, `resolution` to an edge.

    A segment into N; a triangle into N² similar triangles; a quadrilateral into an N × N grid of cells, each
    with its diagonal the same way; any other polygon into its triangles around the centroid of the corners,
    N² similar ones each. Vertices on the boundary lie on it to rounding, corners exactly.
    """
    n = resolution
    if domain.dimension == 1:
        start, end = domain.vertices[0, 0], domain.vertices[1, 0]
        u = start + (end - start) * (np.arange(n + 1) / n)
        u[-1] = end
        steps = np.arange(n)
        return Triangulation(u[:, None], np.stack([steps, steps + 1], axis=1), np.array([[0], [n]]))
    make = {3: _triangle, 4: _quadrilateral}.get(len(domain.vertices), _sectors)
    return _with_exact_boundary(domain, *make(domain.vertices, n))


def central_triangulation(domain: Domain, resolution: int) -> Triangulation:
    """Cut any polygon Δ, triangles and quadrilaterals too, into its triangles around the centroid, N² each.

    No side of a cell joins two vertices on the boundary, but those that lie on it.
    """
    return _with_exact_boundary(domain, *_sectors(domain.vertices, resolution))


def _with_exact_boundary(domain: Domain, u: FloatArray, cells: IntArray, boundary: IntArray) -> Triangulation:
    n = boundary.shape[1]
    edges = np.roll(domain.vertices, -1, axis=0) - domain.vertices
    u[boundary] = domain.vertices[:, None] + edges[:, None] * (np.arange(n) / n)[None, :, None]
    return Triangulation(u, cells, boundary)


def _triangle(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Rows parallel to edge 0; row j has n + 1 − j vertices."""
    first = np.concatenate([[0], np.cumsum(n + 1 - np.arange(n + 1))])
    j = np.repeat(np.arange(n + 1), n + 1 - np.arange(n + 1))
    i = np.arange(len(j)) - first[j]
    u = v[0] + (i / n)[:, None] * (v[1] - v[0]) + (j / n)[:, None] * (v[2] - v[0])
    inner = i + j < n
    here, above = np.arange(len(j))[inner], (first[j + 1] + i)[inner]
    upward = np.stack([here, here + 1, above], axis=1)
    second = (i + j < n - 1)[inner]
    downward = np.stack([here + 1, above + 1, above], axis=1)[second]
    cells = np.empty((n * n, 3), dtype=np.int64)
    order = np.cumsum(1 + second) - (1 + second)
    cells[order] = upward
    cells[order[second] + 1] = downward
    side = np.arange(n)
    return u, cells, np.stack([side, first[side] + n - side, first[n - side]])


def _quadrilateral(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Rows from edge 0 to edge 2, n + 1 vertices each."""
    j, i = (index.ravel() for index in np.mgrid[: n + 1, : n + 1])
    s, t = (i / n)[:, None], (j / n)[:, None]
    u = (1 - t) * ((1 - s) * v[0] + s * v[1]) + t * ((1 - s) * v[3] + s * v[2])
    row, column = (index.ravel() for index in np.mgrid[:n, :n])
    a = row * (n + 1) + column
    b, c, d = a + 1, a + n + 2, a + n + 1
    cells = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
    side = np.arange(n)
    return u, cells, np.stack([side, n + side * (n + 1), n * (n + 2) - side, (n - side) * (n + 1)])


def _sectors(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """The centroid, then rings of r·k vertices, k = 1 … n, each from the ray to corner 0."""
    r = len(v)
    center = v.mean(axis=0)
    ring = np.repeat(np.arange(1, n + 1), r * np.arange(1, n + 1))
    first = 1 + r * (np.arange(n + 2) * (np.arange(n + 2) - 1)) // 2
    place = np.arange(len(ring)) + 1 - first[ring]
    sector, i = place // ring, place % ring
    along = v[sector] * (1 - i / ring)[:, None] + v[(sector + 1) % r] * (i / ring)[:, None]
    u = np.concatenate([center[None], center + (along - center) * (ring / n)[:, None]])

    def at(k: IntArray, position: IntArray) -> IntArray:
        """Vertex of ring k at a position counted around it."""
        return np.where(k == 0, 0, first[k] + position % np.maximum(r * k, 1))

    inside = at(ring - 1, sector * (ring - 1) + i)
    outer = at(ring, sector * ring + i)
    following = at(ring, sector * ring + i + 1)
    outward = np.stack([inside, outer, following], axis=1)
    second = i < ring - 1
    inward = np.stack([inside, following, at(ring - 1, sector * (ring - 1) + i + 1)], axis=1)[second]
    cells = np.empty((r * n * n, 3), dtype=np.int64)
    order = np.cumsum(1 + second) - (1 + second)
    cells[order] = outward
    cells[order[second] + 1] = inward
    return u, cells, (first[n] + np.arange(r)[:, None] * n + np.arange(n)[None]).astype(np.int64)
