"""Samples of the surface over a subdivision's edges and cells, and their distances from these.

Where a point is looked for, is known from its neighbours: corrections of torus coordinates (see
`gtb_cli.theory.linear.LinearParametrization.near`) change slowly. They are kept at vertices and in the middles of
edges, NaN where there are none, as on the boundary of Δ.
"""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.meshes.distance import to_segments, to_triangles
from gtb_cli.tessellation.complex import Sampler
from gtb_cli.tessellation.splitting import Growth
from gtb_cli.tessellation.subdivision import Subdivision

MIDDLE = np.array([0.5])


class Sampling:
    """Samples over the edges and cells of a subdivision.

    Parameters
    ----------
    mesh : Subdivision
    sampler : Sampler
        One of linear parameters.
    """

    def __init__(self, mesh: Subdivision, sampler: Sampler) -> None:
        self.mesh, self.sampler, self.growth = mesh, sampler, Growth()
        self.at_vertices, self.at_middles = np.full((len(mesh.points), 2), np.nan), np.empty((0, 2))

    def middles(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """(e, 3) middles of the curves of new edges, which are learnt from, and (e,) distances from the edges."""
        start, end = self._at_ends(rows)
        learnt = np.empty((len(rows), 2))
        samples, distance = self._along(rows, MIDDLE, (_either(start, end) + _either(end, start)) / 2, 0.0, learnt)
        self.at_middles = self.growth.append("middles", self.at_middles, learnt)
        return samples[:, 0], distance[:, 0]

    def follow(self, chosen: IntArray) -> None:
        """Follow the subdivision, in which the middles of some edges have become vertices."""
        self.at_vertices = self.growth.append("vertices", self.at_vertices, self.at_middles.take(chosen, axis=0))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> tuple[FloatArray, FloatArray]:
        """(e, f, 3) points at fractions of some edges' curves, and their (e, f) distances from the edges."""
        middle = self.at_middles.take(rows, axis=0)
        start, end = (_either(value, middle)[:, None] for value in self._at_ends(rows))
        t = fractions[:, None]
        guesses = start * ((1 - t) * (1 - 2 * t)) + middle[:, None] * (4 * t * (1 - t)) + end * (t * (2 * t - 1))
        return self._along(rows, fractions, guesses.reshape(-1, 2), within)

    def _at_ends(self, rows: IntArray) -> list[FloatArray]:
        return [self.at_vertices.take(ends, axis=0) for ends in self.mesh.edges.ends.take(rows, axis=0).T]

    def _along(
        self,
        rows: IntArray,
        fractions: FloatArray,
        guesses: FloatArray,
        within: float,
        found: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        rows = np.repeat(rows, len(fractions))
        edges = self.mesh.edges.at(rows)
        t = np.tile(fractions, len(rows) // len(fractions))[:, None]
        u = (1 - t) * edges.parameters[:, 0] + t * edges.parameters[:, 1]
        if self.mesh.is_surface:
            sample = self.sampler.near(edges.patch, u, edges.face, guesses, within, found)
        else:
            sample = self.sampler.points(edges.patch, u, edges.face, within)
        distance = to_segments(sample, *self.mesh.ends(rows))
        return sample.reshape(-1, len(fractions), 3), distance.reshape(-1, len(fractions))

    def inside(self, rows: IntArray, weights: FloatArray, within: float) -> FloatArray:
        """(k, w) distances of the surface at (w, 3) barycentric places from the triangles they lie in."""
        cells = self.mesh.cells
        u = np.einsum("wc,kcd->kwd", weights, cells.corners.take(rows, axis=0)).reshape(-1, 2)
        sides = [self.at_middles.take(side, axis=0) for side in cells.sides.take(rows, axis=0).T]
        corners = [self.at_vertices.take(vertex, axis=0) for vertex in cells.cells.take(rows, axis=0).T]
        corners = [_either(corner, _either(sides[k], sides[k - 1])) for k, corner in enumerate(corners)]
        sides = [_either(side, (corners[k] + corners[k - 2]) / 2) for k, side in enumerate(sides)]
        a = weights.T
        shares = [*(a * (2 * a - 1)), *(4 * a * np.roll(a, -1, axis=0))]
        guesses = np.zeros((len(rows), len(weights), 2))
        for share, value in zip(shares, [*corners, *sides], strict=True):
            guesses += share[:, None] * value[:, None]
        cell, inner = np.repeat(rows, len(weights)), np.zeros(len(u), dtype=np.int64)
        sample = self.sampler.near(cells.patch.take(cell), u, inner, guesses.reshape(-1, 2), within)
        return to_triangles(sample, *self.mesh.corners(cell)).reshape(len(rows), -1)

    def at(self, cell: IntArray, u: FloatArray, within: float) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        inner = np.zeros(len(cell), dtype=np.int64)
        sample = self.sampler.points(self.mesh.cells.patch.take(cell), u, inner, within)
        return to_triangles(sample, *self.mesh.corners(cell))


def _either(values: FloatArray, others: FloatArray) -> FloatArray:
    """Fill in others where values are not known."""
    return np.where(np.isnan(values), others, values)
