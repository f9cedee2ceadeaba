"""Distances of surfaces with moving knots from their limit, between the surfaces themselves and not between meshes.

All surfaces, and the limit with and without its films, have the same vertices and the same charts: Δ, its edges, and a
chart for each film, in whose coordinates the layer of a member that becomes the film is as wide as the film.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.knots.hulls import extents_of
from gtb_cli.sequences.feet import MovingChart
from gtb_cli.sequences.knot_limit import Film, KnotLimit
from gtb_cli.sequences.search import ABSENT, PLACE_ACCURACY, Search, Spots, members_of, neighbours_of
from gtb_cli.tessellation.complex import Complex
from gtb_cli.theory.moment import MomentMap
from gtb_cli.theory.patch import Patch

ABSENT_EXPONENT = -1e6
"""Logarithm of the weight of a knot that does not count on a surface."""

LEVELS = 8
"""Steps of the levels z of the vertices of films, from 1 to 0."""

LAST_LEVEL = 1e-7
"""The level that stands for 0, where τ is infinite."""

END_EXPONENT = 16.0
"""Exponent by which the knots at the end of an edge exceed the others at the vertices of films that stand for it."""

LAYER_EXPONENT = 20.0
"""The same for the knots on a face and all others at level 1 of the layer of a member."""

BLOCKS = 4
"""Blocks along each axis into which Δ is cut: points search for their feet in the nearest ones."""


LEAST_LAYER = 0.1
"""Width of a layer between an edge and a knot, as a fraction of that of Δ, in which vertices of Δ find nearest points.
With layers below 0.05, some were missed."""


def has_wide_layers(limit: KnotLimit) -> bool:
    """Whether the vertices of `Motion` reach all layers along the edges of Δ.

    If not, nearest points may be missed, and distances be several times too large. Films are never reached well enough:
    among 69 random limits with wide layers one film came out too far, by 2.8 % of the diagonal.
    """
    shape = limit.patch.domain
    depths = shape.heights[limit.targets] / shape.heights.max(axis=0)
    inside = ~shape.incidence[limit.targets]
    return not limit.films and float(depths.min(initial=np.inf, where=inside)) >= LEAST_LAYER


class _Chart(NamedTuple):
    """The (2, n, k) knots, (n, k) logarithms of weights and (2, k) least coordinates of k surfaces in a `MovingChart`.

    Edges use the first coordinate only.
    """

    knots: FloatArray
    log_weights: FloatArray
    floors: FloatArray


class Motion:
    """Two-sided distances of surfaces with moving knots from the merged one, and from this one with its films.

    Nearest points may be missed in thin layers: see `has_wide_layers`.

    Parameters
    ----------
    limit : KnotLimit
    patches : sequence of Patch
        The surfaces.
    steps : sequence of float
        Those at which they are.
    start : Complex
        Its vertices and the middles of its cells, on Δ, are where the search starts.
    accuracy : float
        Relative error of the distances.

    Raises
    ------
    ToleranceError
        A linear parametrisation was not found.
    """

    def __init__(
        self, limit: KnotLimit, patches: Sequence[Patch], steps: Sequence[float], start: Complex, accuracy: float
    ) -> None:
        self.limit, self.accuracy, self.films = limit, accuracy, limit.films
        self.shape = shape = limit.patch.domain
        self.surfaces = [*patches, limit.merged, limit.merged]
        self.steps = np.array(steps)
        b = limit.patch.control_points
        low, high = b.min(axis=0), b.max(axis=0)
        self.unit = float(np.exp2(np.frexp((high - low).max())[1]))
        self.control_points = ((b - low - (high - low) / 2) / self.unit).T
        self.extents, self.start = extents_of(shape.knots), start
        merged = limit.patch.knots[limit.targets]
        self.knots = np.stack([*(patch.knots for patch in patches), merged, merged], axis=-1)
        ends = shape.incidence[limit.targets]
        self.incidence = np.stack([*(patch.domain.incidence for patch in patches), ends, ends], axis=-1)

    def distances(self) -> FloatArray:
        """(k + 1, 2) distances of k members, and of the limit, from the limit without and with its films."""
        count = len(self.steps)
        members = np.arange(count)
        first, second = members, np.full(count, count)
        if self.films:
            first, second = np.append(first, np.arange(count + 1)), np.append(second, np.full(count + 1, count + 1))
        found = self._search().farthest(first, second) * self.unit
        plain = np.append(found[:count], 0.0)
        return np.column_stack([plain, found[count:] if self.films else plain])

    def _search(self) -> Search:
        count = len(self.surfaces)
        vertices, cells = len(self.start.patch), len(self.start.cells)
        u = np.concatenate([self.start.parameters, self.start.corners.mean(axis=1)])
        face = np.concatenate([self.start.face, np.zeros(cells, dtype=np.int64)])
        charts, s = [self._inner_chart()], np.zeros((count, len(u), 2))
        chart = np.zeros((count, len(u)), dtype=np.int64)
        corners: list[tuple[int, IntArray]] = []
        edges = {}
        for number, rows in groups(face):
            one = self.shape.faces[number]
            if one.is_interior:
                s[:, rows] = self._inner_coordinates(u[rows])
            elif one.is_corner:
                corners.append((one.index, rows))
            else:
                t = self.shape.along(one.index, u[rows])
                rows = rows[np.argsort(t)]
                edges[one.index] = along = self._coordinates_along(one.index, np.sort(t))
                s[:, rows, 0], chart[:, rows] = along, len(charts)
                charts.append(self._edge_chart(one.index))
        together = [np.column_stack([self.start.cells, vertices + np.arange(cells)])]
        block = (BLOCKS * (u - u.min(axis=0)) / np.ptp(u, axis=0)).astype(np.int64).clip(0, BLOCKS - 1) @ [BLOCKS, 1]
        for film in self.films:
            where, quads = self._film_coordinates(film, edges)
            together.append(quads + s.shape[1])
            block = np.append(block, np.full(len(where), block.max() + 1))
            s = np.concatenate([s, np.broadcast_to(where, (count, *where.shape))], axis=1)
            chart = np.concatenate([chart, np.full((count, len(where)), len(charts))], axis=1)
            charts.append(self._film_chart(film))
        # One chart for all: small batches would take longer.
        column = count * chart + np.arange(count)[:, None]
        knots, logs, floors = (np.concatenate(each, axis=-1) for each in zip(*charts, strict=True))
        whole = MovingChart(knots, logs, floors, self.control_points)
        points = whole.points(s.reshape(-1, 2).T, column.ravel()).T.reshape(*column.shape, 3)
        points[-2, len(u) :] = ABSENT
        own = np.zeros_like(chart)
        for corner, rows in corners:
            points[:, rows], own[:, rows] = self._corner_points(corner)[:, None], 1
        free = np.ones(len(block), dtype=bool)
        inner = members_of(block, np.flatnonzero(free))

        def columns(_: MovingChart, spots: Spots) -> IntArray:
            return column[spots.surface, spots.row]

        return Search(
            points, s, own, [whole], columns, neighbours_of(np.concatenate(together), free), inner, self.accuracy
        )

    def _inner_chart(self) -> _Chart:
        knots = (self.knots - self.shape.center[:, None]) / self.extents[:, None]
        logs = np.repeat(self.limit.patch.log_products[:, None], len(self.surfaces), axis=1)
        return _Chart(np.moveaxis(knots, 1, 0), logs, np.full((2, len(self.surfaces)), -np.inf))

    def _inner_coordinates(self, u: FloatArray) -> FloatArray:
        """(k, m, 2) torus coordinates of (m, 2) points inside Δ."""
        p = (u - self.shape.center) / self.extents
        found = [
            MomentMap((one.knots - self.shape.center) / self.extents, one.log_products).inverse(p, PLACE_ACCURACY)
            for one in self.surfaces[:-1]
        ]
        return np.stack([s.T for s in (*found, found[-1])])

    def _edge_chart(self, edge: int) -> _Chart:
        knots = np.zeros((2, *self.incidence[:, edge].shape))
        for k in range(len(self.surfaces)):
            knots[0, :, k] = self.shape.along(edge, self.knots[:, :, k]) / self._length(edge)
        logs = np.where(self.incidence[:, edge], self.limit.patch.log_products[:, None], ABSENT_EXPONENT)
        return _Chart(knots, logs, np.full((2, len(self.surfaces)), -np.inf))

    def _length(self, edge: int) -> float:
        return float(self.shape.along(edge, np.roll(self.shape.vertices, -1, axis=0)[edge][None])[0])

    def _coordinates_along(self, edge: int, t: FloatArray) -> FloatArray:
        """(k, m) torus coordinates of points inside an edge."""
        length, known = self._length(edge), dict[bytes, FloatArray]()
        found = []
        for one in self.surfaces:
            on = one.domain.incidence[:, edge]
            knots = self.shape.along(edge, one.knots[on])[:, None] / length
            logs = one.log_products[on]
            key = knots.tobytes() + logs.tobytes()
            if key not in known:
                known[key] = MomentMap(knots, logs).inverse(t[:, None] / length, PLACE_ACCURACY)[0]
            found.append(known[key])
        return np.stack(found)

    def _corner_points(self, corner: int) -> FloatArray:
        """(k, 3) points of the surfaces at a corner of Δ."""
        found = []
        for k in range(len(self.surfaces)):
            on = self.incidence[:, corner, k] & self.incidence[:, corner - 1, k]
            logs = self.limit.patch.log_products[on]
            shares = np.exp(logs - logs.max())
            found.append(self.control_points[:, on] @ shares / shares.sum())
        return np.stack(found)

    def _film_coordinates(self, film: Film, edges: dict[int, FloatArray]) -> tuple[FloatArray, IntArray]:
        """(m, 2) torus coordinates of the vertices of a film, and (q, 4) their cells."""
        z = np.append(np.arange(LEVELS, 0, -1) / LEVELS, LAST_LEVEL)
        if film.along is None:
            one, other = np.meshgrid(*(-np.log(z) * scale for scale in film.speeds.max(axis=0)), indexing="ij")
        else:
            edge, place = film.face.index, np.unique(film.along)
            far = END_EXPONENT * self._length(edge) / np.diff(place)[[0, -1]]
            before, after = edges[edge][0], edges[edge][-1]
            one = after + (before - after) * (1 - z[:, None])
            one = np.column_stack([np.full(len(z), -far[0]), one, np.full(len(z), far[1])])
            other = np.broadcast_to(-np.log(z)[:, None] * film.speeds.max(), one.shape)
        number = np.arange(one.size).reshape(one.shape)
        quads = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]], axis=-1).reshape(-1, 4)
        return np.column_stack([one.ravel(), other.ravel()]), quads

    def _film_chart(self, film: Film) -> _Chart:
        """The chart of a film and of the layers that become it: torus coordinates along the edge, and scaled ones out
        of Δ."""
        shape, facets, rows = self.shape, film.face.facets, film.members
        logs = np.repeat(self.limit.patch.log_products[:, None], len(self.surfaces), axis=1)
        knots = np.zeros((2, *logs.shape))
        floors = np.full((2, len(self.surfaces)), -np.inf)
        first = 2 - len(facets)
        if first:
            for k in range(len(self.surfaces)):
                knots[0, :, k] = shape.along(film.face.index, self.knots[:, :, k]) / self._length(film.face.index)
        others = np.setdiff1d(np.arange(len(logs)), rows)
        logs[others, -2:] = ABSENT_EXPONENT
        for j, facet in enumerate(facets.tolist()):
            speeds = film.speeds[:, j]
            distances = shape.heights[rows, facet] / shape.normal_lengths[facet]
            nearness = (1 - self.steps) * distances[speeds > 0].min()
            for k, patch in enumerate(self.surfaces[:-2]):
                depths = patch.domain.heights[:, facet] / shape.normal_lengths[facet]
                depths[rows] = 0.0
                layer = depths.min(initial=np.inf, where=depths > 0) / LAYER_EXPONENT
                depths[rows] = speeds * nearness[k]
                knots[first + j, :, k] = -depths / (nearness[k] * speeds.max())
                logs[:, k] -= depths / layer
            knots[first + j, rows, -2:] = -(speeds / speeds.max())[:, None]
            floors[first + j, -2:] = 0.0
        return _Chart(knots, logs, floors)
