"""Distances of surfaces with moving knots from their limit, between the surfaces themselves and not between meshes.

All surfaces and the limit have the same vertices and the same charts: Δ, and its edges. Limits with films are not
measured in this way, since the layers that become films have too few vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.starts import extents_of
from gtb_cli.sequences.feet import MovingChart
from gtb_cli.sequences.search import PLACE_ACCURACY, Search, Spots, members_of, neighbours_of
from gtb_cli.tessellation.complex import Complex
from gtb_cli.theory.knot_limit import KnotLimit
from gtb_cli.theory.patch import Patch

ABSENT_EXPONENT = -1e6
"""Logarithm of the weight of a knot that does not count on a surface."""

BLOCKS = 4
"""Blocks along each axis into which Δ is cut: points search for their feet in the nearest ones."""


LEAST_LAYER = 0.1
"""Width of a layer between an edge and a knot, as a fraction of that of Δ, in which vertices of Δ find nearest points.
With layers below 0.05, some were missed."""


def has_wide_layers(limit: KnotLimit) -> bool:
    """Whether the vertices of `Motion` reach all layers along the edges of Δ.

    If not, nearest points may be missed, and distances be several times too large. Layers that become
    films are not reached: of 69 random limits one film came out too far, by 2.8 % of the diagonal.
    """
    shape = limit.patch.domain
    depths = shape.heights[limit.targets] / shape.heights.max(axis=0)
    inside = ~shape.incidence[limit.targets]
    return not limit.films and float(depths.min(initial=np.inf, where=inside)) >= LEAST_LAYER


class _Chart(NamedTuple):
    """The (2, n, k) knots and (n, k) logarithms of weights of k surfaces in a `MovingChart`.

    Edges use the first coordinate only.
    """

    knots: FloatArray
    log_weights: FloatArray


class Motion:
    """Two-sided distances of surfaces with moving knots from the merged one.

    Nearest points may be missed in thin layers: see `has_wide_layers`.

    Parameters
    ----------
    limit : KnotLimit
    patches : sequence of Patch
        The surfaces.
    start : Complex
        Its vertices and the middles of its cells, on Δ, are where the search starts.
    accuracy : float
        Relative error of the distances.

    Raises
    ------
    ToleranceError
        A linear parametrisation was not found.
    """

    def __init__(self, limit: KnotLimit, patches: Sequence[Patch], start: Complex, accuracy: float) -> None:
        self.limit, self.accuracy = limit, accuracy
        self.shape = shape = limit.patch.domain
        self.surfaces = [*patches, limit.merged]
        b = limit.patch.control_points
        low, high = b.min(axis=0), b.max(axis=0)
        self.unit = float(np.exp2(np.frexp((high - low).max())[1]))
        self.control_points = ((b - low - (high - low) / 2) / self.unit).T
        self.extents, self.start = extents_of(shape.knots), start
        merged = limit.patch.knots[limit.targets]
        self.knots = np.stack([*(patch.knots for patch in patches), merged], axis=-1)
        ends = shape.incidence[limit.targets]
        self.incidence = np.stack([*(patch.domain.incidence for patch in patches), ends], axis=-1)

    def distances(self) -> FloatArray:
        """(k,) distances of k members from the limit."""
        count = len(self.surfaces) - 1
        return self._search().farthest(np.arange(count), np.full(count, count)) * self.unit

    def _search(self) -> Search:
        count = len(self.surfaces)
        vertices, cells = len(self.start.patch), len(self.start.cells)
        u = np.concatenate([self.start.parameters, self.start.corners.mean(axis=1)])
        face = np.concatenate([self.start.face, np.zeros(cells, dtype=np.int64)])
        charts, s = [self._inner_chart()], np.zeros((count, len(u), 2))
        chart = np.zeros((count, len(u)), dtype=np.int64)
        corners: list[tuple[int, IntArray]] = []
        for number, rows in groups(face):
            one = self.shape.faces[number]
            if one.is_interior:
                s[:, rows] = self._inner_coordinates(u[rows])
            elif one.is_corner:
                corners.append((one.index, rows))
            else:
                t = self.shape.along(one.index, u[rows])
                s[:, rows, 0], chart[:, rows] = self._coordinates_along(one.index, t), len(charts)
                charts.append(self._edge_chart(one.index))
        together = np.column_stack([self.start.cells, vertices + np.arange(cells)])
        block = (BLOCKS * (u - u.min(axis=0)) / np.ptp(u, axis=0)).astype(np.int64).clip(0, BLOCKS - 1) @ [BLOCKS, 1]
        # One chart for all: small batches would take longer.
        column = count * chart + np.arange(count)[:, None]
        knots, logs = (np.concatenate(each, axis=-1) for each in zip(*charts, strict=True))
        whole = MovingChart(knots, logs, self.control_points)
        points = whole.points(s.reshape(-1, 2).T, column.ravel()).T.reshape(*column.shape, 3)
        own = np.zeros_like(chart)
        for corner, rows in corners:
            points[:, rows], own[:, rows] = self._corner_points(corner)[:, None], 1
        free = np.ones(len(block), dtype=bool)
        inner = members_of(block, np.flatnonzero(free))

        def columns(_: MovingChart, spots: Spots) -> IntArray:
            return column[spots.surface, spots.row]

        return Search(points, s, own, [whole], columns, neighbours_of(together, free), inner, self.accuracy)

    def _inner_chart(self) -> _Chart:
        knots = (self.knots - self.shape.center[:, None]) / self.extents[:, None]
        logs = np.repeat(self.limit.patch.log_products[:, None], len(self.surfaces), axis=1)
        return _Chart(np.moveaxis(knots, 1, 0), logs)

    def _inner_coordinates(self, u: FloatArray) -> FloatArray:
        """(k, m, 2) torus coordinates of (m, 2) points inside Δ."""
        p = (u - self.shape.center) / self.extents
        found = [
            MomentMap((one.knots - self.shape.center) / self.extents, one.log_products).inverse(p, PLACE_ACCURACY)
            for one in self.surfaces
        ]
        return np.stack([s.T for s in found])

    def _edge_chart(self, edge: int) -> _Chart:
        knots = np.zeros((2, *self.incidence[:, edge].shape))
        for k in range(len(self.surfaces)):
            knots[0, :, k] = self.shape.along(edge, self.knots[:, :, k]) / self._length(edge)
        logs = np.where(self.incidence[:, edge], self.limit.patch.log_products[:, None], ABSENT_EXPONENT)
        return _Chart(knots, logs)

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
