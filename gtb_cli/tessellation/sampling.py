"""Samples of the surface over a subdivision's edges and cells, and their distances from these.

Where a point is looked for, is known from its neighbours: corrections of torus coordinates (see
`gtb_cli.tessellation.neighbours.Neighbours`) change slowly. They are kept at vertices and in the middles of
edges, NaN where there are none, as on the boundary of Δ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.distance import to_segments, to_triangles
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision

Corrections: TypeAlias = NDArray[np.complex128]
"""Pairs of corrections as complex numbers: numpy takes several times as long for rows of two."""

UNKNOWN = complex(np.nan, np.nan)

MIDDLE = np.array([0.5])

BLOCK_ROWS = 1 << 13
"""Rows that are worked on at once: their arrays fit in the cache."""


class _Places(NamedTuple):
    """Where (k,) edges or cells, given by their rows, are sampled, each at w places.

    Attributes
    ----------
    rows, patch, face : (k,) int
    number : int
        w.
    parameters, guesses : callable
        (rw, d) parameters, and guesses of corrections there, for r of the rows, one after another.
    distances : callable
        (m,) distances of (m, 3) samples from the edges or cells in m rows.
    """

    rows: IntArray
    patch: IntArray
    face: IntArray
    number: int
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
        self.at_vertices, self.at_middles = np.full(len(mesh.points), UNKNOWN), np.empty(0, dtype=np.complex128)

    def middles(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """(e, 3) middles of the curves of new edges, which are learnt from, and (e,) distances from the edges."""

        halves = _for_rows(np.array([[0.5], [0.5]]))

        def guesses(rows: IntArray) -> FloatArray:
            start, end = self._at_ends(rows)
            return _pairs([_either(start, end), _either(end, start)], halves)

        samples, distance, learnt = self._sampled(self._on_edges(rows, MIDDLE, guesses), 0.0, learn=True)
        self.at_middles = np.append(self.at_middles, learnt.view(np.complex128)[:, 0, 0])
        return samples[:, 0], distance[:, 0]

    def follow(self, chosen: IntArray) -> None:
        """Follow the subdivision, in which the middles of some edges have become vertices."""
        self.at_vertices = np.append(self.at_vertices, self.at_middles.take(chosen))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> tuple[FloatArray, FloatArray]:
        """(e, f, 3) points at fractions of some edges' curves, and their (e, f) distances from the edges."""
        t = fractions
        shares = _for_rows(np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)]))

        def guesses(rows: IntArray) -> FloatArray:
            middle = self.at_middles.take(rows)
            start, end = (_either(value, middle) for value in self._at_ends(rows))
            return _pairs([start, middle, end], shares)

        samples, distance, _ = self._sampled(self._on_edges(rows, fractions, guesses), within)
        return samples, distance

    def _at_ends(self, rows: IntArray) -> list[Corrections]:
        return [self.at_vertices.take(ends) for ends in self.mesh.edges.ends.take(rows, axis=0).T]

    def _on_edges(self, rows: IntArray, fractions: FloatArray, guesses: Callable[[IntArray], FloatArray]) -> _Places:
        edges, d = self.mesh.edges, self.mesh.edges.parameters.shape[2]
        ends = _for_rows(np.array([1 - fractions, fractions]), d)

        def parameters(rows: IntArray) -> FloatArray:
            return np.asarray((edges.parameters.take(rows, axis=0).reshape(-1, 2 * d) @ ends).reshape(-1, d))

        def distances(rows: IntArray, samples: FloatArray) -> FloatArray:
            return to_segments(samples, *self.mesh.ends(rows))

        return _Places(
            rows, edges.patch.take(rows), edges.face.take(rows), len(fractions), parameters, guesses, distances
        )

    def inside(self, rows: IntArray, weights: FloatArray, within: float) -> FloatArray:
        """(k, w) distances of the surface at (w, 3) barycentric places from the triangles they lie in."""
        cells, a = self.mesh.cells, weights.T
        shares, of_corners = _for_rows(np.concatenate([a * (2 * a - 1), 4 * a * np.roll(a, -1, axis=0)])), _for_rows(a)

        def parameters(rows: IntArray) -> FloatArray:
            return np.asarray((cells.corners.take(rows, axis=0).reshape(-1, 6) @ of_corners).reshape(-1, 2))

        def guesses(rows: IntArray) -> FloatArray:
            sides = [self.at_middles.take(side) for side in cells.sides.take(rows, axis=0).T]
            corners = [self.at_vertices.take(vertex) for vertex in cells.cells.take(rows, axis=0).T]
            corners = [_either(corner, _either(sides[k], sides[k - 1])) for k, corner in enumerate(corners)]
            sides = [_either(side, (corners[k] + corners[k - 2]) * 0.5) for k, side in enumerate(sides)]
            return _pairs([*corners, *sides], shares)

        def distances(rows: IntArray, samples: FloatArray) -> FloatArray:
            return to_triangles(samples, *self.mesh.corners(rows))

        inner = np.full(len(rows), INTERIOR)
        places = _Places(rows, cells.patch.take(rows), inner, len(weights), parameters, guesses, distances)
        return self._sampled(places, within)[1]

    def at(self, cell: IntArray, u: FloatArray, within: float) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        inner = np.full(len(cell), INTERIOR)
        sample = self.sampler.points(self.mesh.cells.patch.take(cell), u, inner, within)
        return to_triangles(sample, *self.mesh.corners(cell))

    def _sampled(
        self, places: _Places, within: float, learn: bool = False
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, w, 3) samples, their (k, w) distances, and if asked for their (k, w, 2) corrections, where there are any.

        What guesses lead to is found in blocks; the rest after that, as points are learnt from.
        """
        rows, number, sampler = places.rows, places.number, self.sampler
        points, distances, learnt = (
            np.full((len(rows), number, *size), np.nan) for size in ((3,), (), (2 if learn else 0,))
        )

        def sample(task: tuple[int, slice | IntArray]) -> None:
            index, some = task
            own = rows[some]
            u, guesses = places.parameters(own), places.guesses(own)
            new = np.full(guesses.shape, np.nan) if learn else None
            found = sampler.neighbours[index].near(u, guesses, within, new)
            points[some] = found.reshape(-1, number, 3)
            owners = own if number == 1 else np.repeat(own, number)
            distances[some] = places.distances(owners, found).reshape(-1, number)
            if new is not None:
                learnt[some] = new.reshape(-1, number, 2)

        tasks: list[tuple[int, slice | IntArray]] = []
        for index, own in groups(places.patch) if self.mesh.is_surface else ():
            length = max(1, min(BLOCK_ROWS, block_length(len(sampler.evaluated[index].knots))) // number)
            blocks = [slice(begin, begin + length) for begin in range(0, len(own), length)]
            tasks += [(index, block if len(own) == len(rows) else own[block]) for block in blocks]
        for task in tasks:
            sample(task)
        row, place = np.divmod(np.flatnonzero(np.isnan(distances)), number)
        if len(row):
            own, patch, face = rows[row], places.patch[row], places.face[row]
            u = places.parameters(own)[np.arange(len(own)) * number + place]
            points[row, place] = sampler.points(patch, u, face, within)
            distances[row, place] = places.distances(own, points[row, place])
            if learn and self.mesh.is_surface:
                learnt[row, place] = sampler.corrections(patch, u, face)
        return points, distances, learnt


def _either(values: Corrections, others: Corrections) -> Corrections:
    """Fill in others where values are not known."""
    return np.where(np.isnan(values), others, values)


def _for_rows(shares: FloatArray, d: int = 2) -> FloatArray:
    """(cd, wd) matrix that takes rows of c points with d coordinates to rows of w sums with (c, w) shares."""
    return np.asarray((shares[:, None, :, None] * np.eye(d)[:, None]).reshape(len(shares) * d, -1))


def _pairs(values: Sequence[Corrections], shares: FloatArray) -> FloatArray:
    """(kw, 2) sums of c columns of k pairs, with shares from `_for_rows`."""
    return np.asarray((np.stack(values, axis=1).view(np.float64) @ shares).reshape(-1, 2))
