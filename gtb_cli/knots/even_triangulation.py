"""The domain cut evenly, for `-n`: parameters and cells in an order that depends on the domain and the number only."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, index_type, planar_cross
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR, Faces
from gtb_cli.values import frozen


@frozen
class Triangulation:
    """Δ cut into cells."""

    parameters: FloatArray  # (m, d) of the vertices
    cells: IntArray  # (k, d + 1) counter-clockwise triangles, or ascending segments
    boundary: IntArray  # (r, N) vertices on each edge of Δ, without its last corner; for d = 1 the two ends

    def side(self, edge: int) -> IntArray:
        """Return the (N + 1,) vertices on an edge, both corners included; for d = 1 the end."""
        return np.append(self.boundary[edge], np.roll(self.boundary, -1, axis=0)[edge, : self.cells.shape[1] - 2])

    def faces(self, faces: Faces) -> IntArray:
        """Return the numbers of the faces of Δ in whose relative interior the vertices lie, (m,)."""
        face = np.full(len(self.parameters), INTERIOR, dtype=index_type(len(faces)))
        face[self.boundary] = faces.edges[:, None]
        face[self.boundary[:, 0]] = faces.corners
        return face

    def moved(self, corners: FloatArray, edge: int, fractions: FloatArray) -> "Triangulation":
        """Move the vertices on an edge of Δ to (N + 1,) ascending fractions of it.

        A vertex between the edge and the centroid of the (r, 2) corners moves along, the less the nearer to that.
        """
        start, end = corners[edge], corners[(edge + 1) % len(corners)]
        center, u = corners.mean(axis=0), self.parameters.copy()
        shares = np.linalg.solve(np.stack([start - center, end - center], axis=1), (u - center).T)
        height = shares.sum(axis=0)
        rows = np.flatnonzero((shares > 0).all(axis=0))
        t, height = shares[1, rows] / height[rows], height[rows, None]
        way = (np.interp(t, np.linspace(0.0, 1.0, len(fractions)), fractions) - t)[:, None]
        u[rows] += height**2 * way * (end - start)
        u[self.boundary[edge]] = start + fractions[:-1, None] * (end - start)
        return Triangulation(u, self.cells, self.boundary)

    def is_turned_over(self) -> bool:
        """Tell whether a triangle is clockwise, or has no area."""
        a, b, c = (self.parameters[corner] for corner in self.cells.T)
        return not bool((planar_cross(b - a, c - a) > 0).all())

    def with_cut_beside(self, corner: int) -> "Triangulation":
        """Halve the side from the first vertex after a corner to the inner vertex of their cell."""
        first = corner * self.boundary.shape[1]
        at, after = self.boundary.ravel().take([first, first + 1], mode="wrap")
        cell = self.cells[(np.isin(self.cells, (at, after)).sum(axis=1) == 2).argmax()]
        inner = int(cell[~np.isin(cell, (at, after))][0])
        rows = np.flatnonzero(np.isin(self.cells, (inner, after)).sum(axis=1) == 2)
        middle = self.parameters[[inner, after]].mean(axis=0)
        halves = [np.where(self.cells[rows] == end, len(self.parameters), self.cells[rows]) for end in (inner, after)]
        cells = np.concatenate([np.delete(self.cells, rows, axis=0), *halves])
        return Triangulation(np.concatenate([self.parameters, middle[None]]), cells, self.boundary)


def cell_count(domain: Domain | int, resolution: int) -> int:
    """Count the cells of `triangulation` without making it, of a domain or of a polygon with so many corners."""
    corners = domain if isinstance(domain, int) else len(domain.vertices)
    return resolution if corners == 2 else resolution**2 * {3: 1, 4: 2}.get(corners, corners)


def triangulation(domain: Domain, resolution: int) -> Triangulation:
    """Cut Δ into equal parts, `resolution` on each edge.

    A segment is cut into N; a triangle into N² similar triangles; a quadrilateral into an N × N grid of cells, all with
    the same diagonal; any other polygon into triangles around the centroid of the corners, with N² similar triangles in
    each. Vertices on the boundary lie on it to rounding, corners exactly; the vertices of a rectangle along the axes
    are exactly a grid.
    """
    n, v = resolution, domain.vertices
    opposite = v[len(v) // 2]
    lines = v[0] + (opposite - v[0]) * (np.arange(n + 1) / n)[:, None]
    lines[-1] = opposite
    if domain.dimension == 1:
        steps = np.arange(n)
        return Triangulation(lines, np.stack([steps, steps + 1], axis=1), np.array([[0], [n]]))
    if len(v) == 4 and (v[1] == [v[2, 0], v[0, 1]]).all() and (v[3] == [v[0, 0], v[2, 1]]).all():
        return Triangulation(np.stack(np.meshgrid(*lines.T), axis=-1).reshape(-1, 2), *_squares(n))
    return _with_exact_boundary(domain, *{3: _triangle, 4: _quadrilateral}.get(len(v), _sectors)(v, n))


def central_triangulation(domain: Domain, resolution: int) -> Triangulation:
    """Cut any polygon Δ, even a triangle or quadrilateral, into triangles around the centroid, with N² cells in each.

    A side of a cell joins two vertices on the boundary only if it lies on the boundary itself.
    """
    return _with_exact_boundary(domain, *_sectors(domain.vertices, resolution))


def _with_exact_boundary(domain: Domain, u: FloatArray, cells: IntArray, boundary: IntArray) -> Triangulation:
    n = boundary.shape[1]
    edges = np.roll(domain.vertices, -1, axis=0) - domain.vertices
    u[boundary] = domain.vertices[:, None] + edges[:, None] * (np.arange(n) / n)[None, :, None]
    return Triangulation(u, cells, boundary)


def _triangle(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Rows parallel to edge 0; row j has n + 1 − j vertices."""
    lengths = n + 1 - np.arange(n + 1)
    first = np.concatenate([[0], np.cumsum(lengths)])
    kind = index_type(int(first[-1]))
    numbers = np.arange(first[-1], dtype=kind)
    s, t = (numbers - np.repeat(first[:-1], lengths)) / n, np.repeat(np.arange(n + 1) / n, lengths)
    u = v[0] + s[:, None] * (v[1] - v[0]) + t[:, None] * (v[2] - v[0])
    cells = np.empty((n * n, 3), dtype=kind)
    for row in range(n):
        here, above = numbers[first[row] : first[row + 1]], numbers[first[row + 1] : first[row + 2]]
        strip = cells[n * n - (n - row) ** 2 : n * n - (n - row - 1) ** 2]
        strip[::2, 0], strip[::2, 1], strip[::2, 2] = here[:-1], here[1:], above
        strip[1::2, 0], strip[1::2, 1], strip[1::2, 2] = here[1:-1], above[1:], above[:-1]
    side = np.arange(n)
    return u, cells, np.stack([side, first[side] + n - side, first[n - side]])


def _quadrilateral(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Rows from edge 0 to edge 2, n + 1 vertices each."""
    steps = (np.arange(n + 1) / n)[:, None]
    low, high = (1 - steps) * v[0] + steps * v[1], (1 - steps) * v[3] + steps * v[2]
    return ((1 - steps[:, :, None]) * low + steps[:, :, None] * high).reshape(-1, 2), *_squares(n)


def _squares(n: int) -> tuple[IntArray, IntArray]:
    """Return the cells and the boundary of n rows of n squares."""
    side = np.arange(n, dtype=index_type((n + 1) ** 2))
    square = np.array([0, 1, n + 2, 0, n + 2, n + 1], dtype=side.dtype)
    cells = (side * (n + 1))[:, None] + (side[:, None] + square).ravel()
    return cells.reshape(-1, 3), np.stack([side, n + side * (n + 1), n * (n + 2) - side, (n - side) * (n + 1)])


def _sectors(v: FloatArray, n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """The centroid, then rings of r·k vertices, k = 1 … n, each from the ray to corner 0."""
    r, center, count = len(v), v.mean(axis=0), 1 + len(v) * n * (n + 1) // 2
    kind = index_type(count + 1)
    numbers, side = np.arange(count + 1, dtype=kind), np.arange(n)
    columns, cells = np.empty((2, count)), np.empty((r * n * n, 3), dtype=kind)
    start, end, middle = (rows.T[:, :, None] for rows in (v, np.roll(v, -1, axis=0), center[None]))
    columns[:, 0] = center
    sectors, inner = np.arange(r)[:, None], 0
    for k in range(1, n + 1):
        # Join each vertex of the ring to the next one and to the ring inside; the first vertex follows the last.
        first = 1 + r * k * (k - 1) // 2
        s = side[:k] / k
        columns[:, first : first + r * k] = (middle + (start * (1 - s) + end * s - middle) * (k / n)).reshape(2, -1)
        here, after = (numbers[begin : begin + r * k].reshape(r, k) for begin in (first, first + 1))
        inside = numbers[inner : inner + k] + sectors * (k - 1)
        strip = cells[r * (k - 1) ** 2 : r * k**2].reshape(r, -1, 3)
        strip[:, 1::2, 0], strip[:, 1::2, 1], strip[:, 1::2, 2] = inside[:, :-1], after[:, :-1], inside[:, 1:]
        strip[:, ::2, 0], strip[:, ::2, 1], strip[:, ::2, 2] = inside, here, after
        strip[-1, -1, 0], strip[-1, -1, 2] = inner, first
        strip[-1, -2:-1, 2] = inner
        inner = first
    return np.ascontiguousarray(columns.T), cells, numbers[inner:-1].reshape(r, n)
