"""Where refinement samples the surface over edges and cells, and how far mesh and surface are apart there.

Points are found sooner from guesses (see `gtb_cli.tessellation.sampler`), which are interpolated between guesses at the
vertices and in the middles of edges; NaN where there are none, as on the boundary of Δ.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross, groups, planar_cross
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.nearest import NearestCells, cell_distances
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.edge_splitting import Cells, Edges, Subdivision
from gtb_cli.tessellation.sampler import Sampler

SIDE_STEPS = 4  # steps at which edges are sampled at least; all other numbers of steps are multiples of it
MIN_SAMPLES = 20_000  # points at which a coarse mesh is sampled, at least, by a finer lattice on each triangle


def inner_points(steps: int) -> FloatArray:
    """Return the barycentric coordinates of the inner points of a triangle's lattice, (k, 3); the coarsest has one."""
    steps = steps if steps > SIDE_STEPS else 3  # one point is enough where the surface is quadratic
    i, j = np.mgrid[1:steps, 1:steps]
    inner = i + j < steps
    return np.stack([i[inner], j[inner], steps - i[inner] - j[inner]], axis=1) / steps


class Sampling:
    """Samples over the edges and cells of a subdivision, by a sampler of linear parameters."""

    def __init__(self, mesh: Subdivision, sampler: Sampler) -> None:
        self.mesh, self.sampler = mesh, sampler
        self.block_rows = block_length(max(len(patch.knots) for patch in sampler.patches))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> list[FloatArray]:
        """Sample edges' curves at fractions: points, (k, w, 3), distances from the edges, (k, w), and right guesses."""
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
        """Measure the distances, (k, w), of some triangles from the surface over their (w, 3) barycentric places."""
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

    def folded_or_uncovered(self, rows: IntArray, steps_at: IntArray, within: float, tolerance: float) -> BoolArray:
        """Mark cells of a flat patch that are turned over, or have samples farther than the tolerance from all cells.

        All k cells of the patch are given: samples may slide out of their own cells, but not out of all.
        """
        corners = np.stack(self.mesh.corners(rows), axis=1)
        area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rounding = 1e-9  # part of the largest area: by it a triangle may face away from most of the area
        turn = area @ area.sum(axis=0)
        failing = np.asarray(turn < -rounding * turn.max())
        if failing.any():
            return failing
        places, owners = [], []
        for steps, part in groups(steps_at):
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
        """Return the points, (m, 3), and right guesses, (m, 2)."""
        if not self.mesh.is_surface:
            return self.sampler.points(patch, u, face, within), guesses
        points, right = self.sampler.near(patch, u, face, guesses.T, within)
        return points, right.T

    def _in_blocks(
        self, sample: Callable[[IntArray, IntArray], list[FloatArray]], rows: IntArray, w: int
    ) -> list[FloatArray]:
        """Sample edges or cells block by block, by a function of their numbers, once each and once for each place."""
        length = max(self.block_rows // w, 1)
        blocks = [rows[begin : begin + length] for begin in range(0, max(len(rows), 1), length)]
        found = [sample(block, np.repeat(block, w)) for block in blocks]
        columns = [np.concatenate(column) for column in zip(*found, strict=True)]
        return [column.reshape(len(rows), w, *column.shape[1:]) for column in columns]


def _either(values: FloatArray, others: FloatArray) -> FloatArray:
    """Return values, and others where they are NaN."""
    return np.where(np.isnan(values), others, values)


def _at_shares(corners: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the sums, (kw, d), of the (k, c, d) corners of edges or cells with (c, w) shares."""
    count, number, d = corners.shape
    # One large product of matrices takes less time than many small products.
    for_rows = (shares[:, None, :, None] * np.eye(d)[:, None]).reshape(number * d, -1)
    return np.asarray((corners.reshape(count, -1) @ for_rows).reshape(-1, d))


class PeakParameters:
    """Parameters, inside the domains of surfaces and on their edges, near which samples may miss a peak.

    They are the knots, whose weights may be extreme, the middles between neighbouring knots, which may crowd, and
    places between knots in a narrow layer at an edge; found once for all domains of one kind, see `kinds_of`.
    """

    def __init__(self, domains: Sequence[Domain], kinds: IntArray) -> None:
        self.kinds = kinds
        self.of_kind = {kind: _peaks_of(domains[kind]) for kind in np.unique(kinds).tolist()}

    def along(self, edges: Edges) -> tuple[IntArray, FloatArray]:
        """Find peaks between the ends of edges on the boundary of Δ: (q,) edges, and (q, 2) parameters."""
        return self._held(np.flatnonzero(edges.face != INTERIOR), edges.patch, edges.face, edges.parameters)

    def inside(self, cells: Cells) -> tuple[IntArray, FloatArray]:
        """Find peaks inside triangles: (q,) triangles, and (q, 2) parameters."""
        return self._held(np.arange(len(cells.patch)), cells.patch, np.full(len(cells.patch), INTERIOR), cells.corners)

    def _held(
        self, rows: IntArray, patch: IntArray, face: IntArray, corners: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Find peaks in some edges or cells, on one face of their patches, with (k, c, 2) corners."""
        found, peaks = [rows[:0]], [corners[:0, 0]]
        for kind, own in groups(self.kinds[patch[rows]]):
            for number, members in groups(face[rows[own]]):
                some, places = rows[own[members]], self.of_kind[kind][number]
                x = corners[some, :, 0]
                low, high = x.min(axis=1)[:, None], x.max(axis=1)[:, None]
                cell, peak = np.nonzero((low <= places[:, 0]) & (places[:, 0] <= high))
                held = (_is_between if number else _is_inside)(corners[some[cell]], places[peak])
                found.append(some[cell[held]])
                peaks.append(places[peak[held]])
        return np.concatenate(found), np.concatenate(peaks)


def _peaks_of(domain: Domain) -> list[FloatArray]:
    """Return the parameters inside Δ, then on each edge."""
    knots = domain.knots
    inner = np.unique(knots[~domain.incidence.any(axis=1)], axis=0)
    middles, length = [], block_length(len(knots))
    for begin in range(0, len(inner), length):
        block = inner[begin : begin + length]
        apart = sum(np.subtract.outer(x, y) ** 2 for x, y in zip(block.T, knots.T, strict=True))
        middles.append((block + knots[np.where(apart > 0, apart, np.inf).argmin(axis=1)]) / 2)
    peaks = [np.concatenate([inner, *middles, *map(partial(_peaks_of_layer, domain), range(len(domain.vertices)))])]
    for edge in range(len(domain.vertices)):
        ordered = knots[domain.edge_knots(edge)]
        peaks.append(np.concatenate([ordered, (ordered[1:] + ordered[:-1]) / 2]))
    return peaks


def _peaks_of_layer(domain: Domain, edge: int) -> FloatArray:
    """Return parameters between neighbouring knots near an edge, where the surface may turn in a thin layer."""
    slope = 0.1  # height over the edge of the farther end of such a segment, by its length
    height, place = domain.heights[:, edge] / domain.normal_lengths[edge], domain.along(edge, domain.knots)
    on = domain.edge_knots(edge)
    near = np.setdiff1d(np.flatnonzero(height < slope * np.ptp(place[on])), on)
    found = [np.empty((0, 2))]
    for knot in near.tolist():
        for others in (on, np.setdiff1d(np.union1d(on, near), knot)):
            for side in (-1, 1):
                gaps = side * (place[others] - place[knot])
                if (gaps > 0).any():
                    other = others[np.where(gaps > 0, gaps, np.inf).argmin()]
                    if max(height[knot], height[other]) < slope * gaps[gaps > 0].min():
                        share = np.arange(1, 16)[:, None] / 16
                        found.append((1 - share) * domain.knots[knot] + share * domain.knots[other])
    return np.unique(np.concatenate(found), axis=0)


def _is_between(ends: FloatArray, peak: FloatArray) -> BoolArray:
    start, end = np.moveaxis(ends, 1, 0)
    along = ((peak - start) * (end - start)).sum(axis=1)
    return np.asarray((along > 0) & (along < ((end - start) ** 2).sum(axis=1)))


def _is_inside(corners: FloatArray, peak: FloatArray) -> BoolArray:
    a, b, c = np.moveaxis(corners, 1, 0)
    signs = np.stack([planar_cross(b - a, peak - a), planar_cross(c - b, peak - b), planar_cross(a - c, peak - c)])
    return np.asarray((signs > 0).all(axis=0) | (signs < 0).all(axis=0))
