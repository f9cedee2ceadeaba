"""Samples of the surface over a subdivision's edges and cells, and their distances from these.

Where a point is looked for, is guessed from its neighbours (see `gtb_cli.tessellation.sampler.Nets.near`). Guesses are
kept at vertices and in the middles of edges, NaN where there are none, as on the boundary of Δ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.nearest import to_segments, to_triangles
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision


class _Places(NamedTuple):
    """Places at which edges or cells, given by their rows, are sampled.

    Attributes
    ----------
    number : int
        w, how many places an edge or cell has.
    patch, face : callable
        (r,) int, for r rows.
    parameters, guesses : callable
        (rw, d) parameters, and (2, rw) guesses, one row after another.
    distances : callable
        (m,) distances of (m, 3) samples from the edges or cells in m rows.
    """

    number: int
    patch: Callable[[IntArray], IntArray]
    face: Callable[[IntArray], IntArray]
    parameters: Callable[[IntArray], FloatArray]
    guesses: Callable[[IntArray], FloatArray]
    distances: Callable[[IntArray, FloatArray], FloatArray]


class Sampling:
    """Samples over the edges and cells of a subdivision.

    Parameters
    ----------
    mesh : Subdivision
    sampler : Sampler
        One of linear parameters.
    """

    def __init__(self, mesh: Subdivision, sampler: Sampler) -> None:
        self.mesh, self.sampler = mesh, sampler
        self.at_vertices, self.at_middles = np.full((2, len(mesh.points)), np.nan), np.empty((2, 0))

    def middles(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """(e, 3) middles of the curves of new edges, which are learnt from, and (e,) distances from the edges."""

        def guesses(rows: IntArray) -> FloatArray:
            start, end = self._at_ends(rows)
            return (_either(start, end) + _either(end, start)) / 2

        samples, distance, right = self._sampled(rows, self._on_edges(np.array([0.5]), guesses), 0.0)
        self.at_middles = np.concatenate([self.at_middles, right], axis=1)
        return samples[:, 0], distance[:, 0]

    def follow(self, chosen: IntArray) -> None:
        """Follow the subdivision, in which the middles of some edges have become vertices."""
        self.at_vertices = np.concatenate([self.at_vertices, self.at_middles.take(chosen, axis=1)], axis=1)

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> tuple[FloatArray, FloatArray]:
        """(e, f, 3) points at fractions of some edges' curves, and their (e, f) distances from the edges."""
        t = fractions
        shares = np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])

        def guesses(rows: IntArray) -> FloatArray:
            middle = self.at_middles.take(rows, axis=1)
            start, end = (_either(value, middle) for value in self._at_ends(rows))
            return _sums([start, middle, end], shares)

        samples, distance, _ = self._sampled(rows, self._on_edges(fractions, guesses), within)
        return samples, distance

    def _at_ends(self, rows: IntArray) -> list[FloatArray]:
        return [self.at_vertices.take(ends, axis=1) for ends in self.mesh.edges.ends.take(rows, axis=0).T]

    def _on_edges(self, fractions: FloatArray, guesses: Callable[[IntArray], FloatArray]) -> _Places:
        edges, shares = self.mesh.edges, np.array([1 - fractions, fractions])
        return _Places(
            len(fractions),
            edges.patch.take,
            edges.face.take,
            lambda rows: _at_shares(edges.parameters.take(rows, axis=0), shares),
            guesses,
            lambda rows, samples: to_segments(samples, *self.mesh.ends(rows)),
        )

    def inside(self, rows: IntArray, weights: FloatArray, within: float) -> FloatArray:
        """(k, w) distances of the surface at (w, 3) barycentric places from the triangles they lie in."""
        cells, a = self.mesh.cells, weights.T
        shares = np.concatenate([a * (2 * a - 1), 4 * a * np.roll(a, -1, axis=0)])

        def guesses(rows: IntArray) -> FloatArray:
            sides = [self.at_middles.take(side, axis=1) for side in cells.sides.take(rows, axis=0).T]
            corners = [self.at_vertices.take(vertex, axis=1) for vertex in cells.cells.take(rows, axis=0).T]
            corners = [_either(corner, _either(sides[k], sides[k - 1])) for k, corner in enumerate(corners)]
            sides = [_either(side, (corners[k] + corners[k - 2]) / 2) for k, side in enumerate(sides)]
            return _sums([*corners, *sides], shares)

        places = _Places(
            len(weights),
            cells.patch.take,
            lambda rows: np.full(len(rows), INTERIOR),
            lambda rows: _at_shares(cells.corners.take(rows, axis=0), a),
            guesses,
            lambda rows, samples: to_triangles(samples, *self.mesh.corners(rows)),
        )
        return self._sampled(rows, places, within)[1]

    def at(self, cell: IntArray, u: FloatArray, within: float) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        inner = np.full(len(cell), INTERIOR)
        sample = self.sampler.points(self.mesh.cells.patch.take(cell), u, inner, within)
        return to_triangles(sample, *self.mesh.corners(cell))

    def _sampled(self, rows: IntArray, places: _Places, within: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, w, 3) samples, their (k, w) distances, and (2, kw) right guesses of their torus coordinates."""
        number, sampler = places.number, self.sampler
        length = max(block_length(max(len(patch.knots) for patch in sampler.evaluated)) // number, 1)
        points, distances, right = np.empty((len(rows) * number, 3)), np.empty(len(rows) * number), [np.empty((2, 0))]
        for begin in range(0, len(rows), length):
            own = rows[begin : begin + length]
            each = np.repeat(own, number)
            block = slice(begin * number, begin * number + len(each))
            where = places.patch(each), places.parameters(own), places.face(each)
            if self.mesh.is_surface:
                points[block], found = sampler.near(*where, places.guesses(own), within)
            else:
                points[block], found = sampler.points(*where, within), np.full((2, len(each)), np.nan)
            distances[block] = places.distances(each, points[block])
            right.append(found)
        shape = len(rows), number
        return points.reshape(*shape, 3), distances.reshape(shape), np.concatenate(right, axis=1)


def _either(values: FloatArray, others: FloatArray) -> FloatArray:
    """Fill in others where values are not known."""
    return np.where(np.isnan(values), others, values)


def _at_shares(corners: FloatArray, shares: FloatArray) -> FloatArray:
    """(kw, d) sums of the (k, c, d) corners of k edges or cells with (c, w) shares."""
    count, number, d = corners.shape
    # One product of matrices takes less time than many small ones.
    for_rows = (shares[:, None, :, None] * np.eye(d)[:, None]).reshape(number * d, -1)
    return np.asarray((corners.reshape(count, -1) @ for_rows).reshape(-1, d))


def _sums(values: Sequence[FloatArray], shares: FloatArray) -> FloatArray:
    """(2, kw) sums of c arrays of k columns with (c, w) shares, w for each column."""
    return np.asarray((np.stack(values, axis=-1) @ shares).reshape(2, -1))
