"""Samples of the surface over a subdivision's edges and cells, and their distances from these.

Where a point is looked for, is guessed from its neighbours (see `gtb_cli.tessellation.sampler`): vertices and edges
have guesses, these in their middles, NaN where there are none, as on the boundary of Δ.
"""

from collections.abc import Callable

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.nearest import NearestCells, cell_distances
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.subdivision import Subdivision

SIDE_STEPS = 4  # steps at which edges are sampled at least; all other numbers of steps are multiples of it
MIN_SAMPLES = 20_000  # points at which a coarse mesh is sampled, at least, by a finer lattice on each triangle


def inner_points(steps: int) -> FloatArray:
    """(k, 3) barycentric coordinates of the inner points of a triangle's lattice; of the coarsest, of the centroid."""
    steps = steps if steps > SIDE_STEPS else 3  # one point is enough where the surface is quadratic
    i, j = np.mgrid[1:steps, 1:steps]
    inner = i + j < steps
    return np.stack([i[inner], j[inner], steps - i[inner] - j[inner]], axis=1) / steps


def steps_for(width: FloatArray, samples: int) -> IntArray:
    """(k,) steps of the lattices of cells of given widths in Δ: many if cells are few or wide."""
    most = 32 / SIDE_STEPS
    few = np.clip(np.sqrt(2 * samples / len(width)) / SIDE_STEPS, 1, most)
    steps, parts = np.full(len(width), int(few)), width * most
    wide = np.flatnonzero(parts > 1)
    steps[wide] = np.maximum(steps[wide], np.exp2(np.ceil(np.log2(parts[wide]) - 1e-9)))
    return SIDE_STEPS * steps


def quadratic_heights(places: FloatArray) -> FloatArray:
    """(k, 3) factors by which heights over the middles of sides 0, 1 and 2 enter those at (k, 3) barycentric places."""
    a, b, c = places.T
    return np.asarray(4 * np.stack([a * b, b * c, c * a], axis=1))


class Sampling:
    """Samples over the edges and cells of a subdivision, by a sampler of linear parameters."""

    def __init__(self, mesh: Subdivision, sampler: Sampler) -> None:
        self.mesh, self.sampler = mesh, sampler
        self.block_rows = block_length(max(len(patch.knots) for patch in sampler.patches))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> list[FloatArray]:
        """(k, w, 3) points of some edges' curves at fractions, (k, w) distances from the edges, and right guesses."""
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

    def inside(self, rows: IntArray, weights: FloatArray, within: float) -> FloatArray:
        """(k, w) distances of the surface over some triangles, at (w, 3) barycentric places, from these."""
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

        return self._in_blocks(sample, rows, len(weights))[1]

    def at(self, cell: IntArray, u: FloatArray, within: float) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        inner = np.full(len(cell), INTERIOR)
        sample = self.sampler.points(self.mesh.cells.patch.take(cell), u, inner, within)
        return cell_distances(sample, *self.mesh.corners(cell))

    def folded_or_uncovered(self, rows: IntArray, steps_at: IntArray, within: float, tolerance: float) -> BoolArray:
        """Mark cells of a flat patch that are turned over, or have samples farther than the tolerance from all cells.

        All k cells of the patch are given, and sampled on lattices of the given steps: points may slide out of their
        cells, but all cells together must cover them.
        """
        corners = np.stack(self.mesh.corners(rows), axis=1)
        failing = _turned_over(corners)
        if failing.any():
            return failing
        places, owners = [], []
        for steps in np.unique(steps_at).tolist():
            part = np.flatnonzero(steps_at == steps)
            weights = inner_points(steps)
            places.append(np.einsum("wc,kcd->kwd", weights, self.mesh.cells.corners[rows[part]]).reshape(-1, 2))
            owners.append(np.repeat(part, len(weights)))
        u, own = np.concatenate(places), np.concatenate(owners)
        sample = self.sampler.points(self.mesh.cells.patch[rows[own]], u, np.full(len(own), INTERIOR), within)
        nearest = NearestCells(corners)
        distance = nearest.distances(sample, own)
        far = np.flatnonzero(distance > tolerance)  # from their own triangles
        if len(far):
            failing[own[far[nearest.search(sample[far], distance[far], own[far])[0] > tolerance]]] = True
        return failing

    def _near(
        self, patch: IntArray, u: FloatArray, face: IntArray, guesses: FloatArray, within: float
    ) -> tuple[FloatArray, FloatArray]:
        """(m, 3) points, and (m, 2) right guesses."""
        if not self.mesh.is_surface:
            return self.sampler.points(patch, u, face, within), guesses
        points, right = self.sampler.near(patch, u, face, guesses.T, within)
        return points, right.T

    def _in_blocks(
        self, sample: Callable[[IntArray, IntArray], list[FloatArray]], rows: IntArray, w: int
    ) -> list[FloatArray]:
        """Columns of (k, w, ...) samples of edges or cells, whose numbers are given once, and once for each place."""
        length = max(self.block_rows // w, 1)
        blocks = [rows[begin : begin + length] for begin in range(0, max(len(rows), 1), length)]
        found = [sample(block, np.repeat(block, w)) for block in blocks]
        columns = [np.concatenate(column) for column in zip(*found, strict=True)]
        return [column.reshape(len(rows), w, *column.shape[1:]) for column in columns]


def _turned_over(corners: FloatArray) -> BoolArray:
    """Mark the (k, 3, 3) triangles in a plane that face away from most of the area."""
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rounding = 1e-9  # part of the largest area: by it a triangle may be turned over
    turn = area @ area.sum(axis=0)
    return np.asarray(turn < -rounding * turn.max())


def _either(values: FloatArray, others: FloatArray) -> FloatArray:
    """Fill in others where values are not known."""
    return np.where(np.isnan(values), others, values)


def _at_shares(corners: FloatArray, shares: FloatArray) -> FloatArray:
    """(kw, d) sums of the (k, c, d) corners of k edges or cells with (c, w) shares."""
    count, number, d = corners.shape
    # One product of matrices takes less time than many small ones.
    for_rows = (shares[:, None, :, None] * np.eye(d)[:, None]).reshape(number * d, -1)
    return np.asarray((corners.reshape(count, -1) @ for_rows).reshape(-1, d))
