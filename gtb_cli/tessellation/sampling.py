"""Samples of the surface over a subdivision's edges and cells, and their distances from these.

Where a point is looked for, is guessed from its neighbours (see `gtb_cli.tessellation.sampler.Nets.near`): vertices and
edges have guesses, these in their middles, NaN where there are none, as on the boundary of Δ.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.nearest import cell_distances
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision


class Samples(NamedTuple):
    """Samples at w places of each of k edges or cells.

    Attributes
    ----------
    points : (k, w, 3) float
    distances : (k, w) float
        From the edge or cell.
    guesses : (k, w, 2) float
        Right ones, for points beside these.
    """

    points: FloatArray
    distances: FloatArray
    guesses: FloatArray


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
        self.block_rows = block_length(max(len(patch.knots) for patch in sampler.evaluated))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> Samples:
        """Sample the curves of some edges at fractions."""
        mesh, t = self.mesh, fractions
        ends, quadratic = np.array([1 - t, t]), np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])

        def sample(own: IntArray, each: IntArray) -> list[FloatArray]:
            edges, u = mesh.edges, _at_shares(mesh.edges.parameters.take(own, axis=0), ends)
            start, end = (mesh.vertices.guess.take(vertex, axis=0) for vertex in edges.ends.take(own, axis=0).T)
            middle = _either(edges.guess.take(own, axis=0), (_either(start, end) + _either(end, start)) / 2)
            guesses = _at_shares(np.stack([_either(start, middle), middle, _either(end, middle)], axis=1), quadratic)
            points, right = self._near(edges.patch.take(each), u, edges.face.take(each), guesses, within)
            return [points, cell_distances(points, *mesh.ends(each)), right]

        return self._in_blocks(sample, rows, len(t))

    def inside(self, rows: IntArray, weights: FloatArray, within: float) -> Samples:
        """Sample the surface over some triangles at (w, 3) barycentric places."""
        mesh, a = self.mesh, weights.T
        quadratic = np.concatenate([a * (2 * a - 1), 4 * a * np.roll(a, -1, axis=0)])

        def sample(own: IntArray, each: IntArray) -> list[FloatArray]:
            cells, u = mesh.cells, _at_shares(mesh.cells.corners.take(own, axis=0), a)
            sides = [mesh.edges.guess.take(side, axis=0) for side in cells.sides.take(own, axis=0).T]
            corners = [mesh.vertices.guess.take(vertex, axis=0) for vertex in cells.cells.take(own, axis=0).T]
            corners = [_either(corner, _either(sides[k], sides[k - 1])) for k, corner in enumerate(corners)]
            sides = [_either(side, (corners[k] + corners[k - 2]) / 2) for k, side in enumerate(sides)]
            guesses = _at_shares(np.stack([*corners, *sides], axis=1), quadratic)
            points, right = self._near(cells.patch.take(each), u, np.full(len(each), INTERIOR), guesses, within)
            return [points, cell_distances(points, *mesh.corners(each)), right]

        return self._in_blocks(sample, rows, len(weights))

    def at(self, cell: IntArray, u: FloatArray, within: float) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        inner = np.full(len(cell), INTERIOR)
        sample = self.sampler.points(self.mesh.cells.patch.take(cell), u, inner, within)
        return cell_distances(sample, *self.mesh.corners(cell))

    def _near(
        self, patch: IntArray, u: FloatArray, face: IntArray, guesses: FloatArray, within: float
    ) -> tuple[FloatArray, FloatArray]:
        """(m, 3) points, and (m, 2) right guesses."""
        if not self.mesh.is_surface:
            return self.sampler.points(patch, u, face, within), guesses
        points, right = self.sampler.near(patch, u, face, guesses.T, within)
        return points, right.T

    def _in_blocks(self, sample: Callable[[IntArray, IntArray], list[FloatArray]], rows: IntArray, w: int) -> Samples:
        """Sample edges or cells, whose numbers are given once, and as often as they have places."""
        length = max(self.block_rows // w, 1)
        blocks = [rows[begin : begin + length] for begin in range(0, max(len(rows), 1), length)]
        columns = zip(*(sample(block, np.repeat(block, w)) for block in blocks), strict=True)
        points, distances, guesses = map(np.concatenate, columns)
        shape = len(rows), w
        return Samples(points.reshape(*shape, 3), distances.reshape(shape), guesses.reshape(*shape, 2))


def _either(values: FloatArray, others: FloatArray) -> FloatArray:
    """Fill in others where values are not known."""
    return np.where(np.isnan(values), others, values)


def _at_shares(corners: FloatArray, shares: FloatArray) -> FloatArray:
    """(kw, d) sums of the (k, c, d) corners of k edges or cells with (c, w) shares."""
    count, number, d = corners.shape
    # One product of matrices takes less time than many small ones.
    for_rows = (shares[:, None, :, None] * np.eye(d)[:, None]).reshape(number * d, -1)
    return np.asarray((corners.reshape(count, -1) @ for_rows).reshape(-1, d))
