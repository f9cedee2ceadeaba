"""Distances of the members of a degeneration from its limit, between the surfaces themselves and not between meshes.

The search for the largest distance starts from the vertices of a coarse complex: the corners of cells, where it mostly
is, and enough others. Newton's method in torus coordinates finds the point of the other surface nearest to each; then
the farthest vertices move over their own surface as long as their distances grow.
"""

from __future__ import annotations

from itertools import count
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups, rows_of
from gtb_cli.newton import dot
from gtb_cli.sequences.continuation import Continuation, Places
from gtb_cli.sequences.feet import ROUNDING_DISTANCE, Chart
from gtb_cli.theory.patch import Patch

LIMIT_EXPONENT = 40.0
"""Least exponent by which knots outside a cell are below it on the member that stands for the limit."""

PLACE_ACCURACY = 1e-6
"""Error of the vertices' parameters, as a fraction of Δ's extents: whatever it is, they lie on the surface."""

FIRST_FEET = 8
"""Vertices of each surface that are projected first, which rules out most others as the farthest."""

FIRST_VERIFIED = 2
"""Vertices of each surface whose nearest points are first searched for from several starts; then twice as many, …."""

NEAREST_VERTICES, NEAREST_CELLS = 4, 2
"""The starts: the nearest vertices of the other surface, and the nearest vertex in each of so many cells."""

MAX_CLIMBERS = 4
"""Vertices of each surface that move, at most."""

CLOSE_SHARE = 0.9
"""Fraction of the largest distance from which on vertices move, unless a neighbour is farther."""

SHRINK_RATIO, GROWTH_RATIO = 0.8, 2.0
"""Ratios of the reach after a turn to that before: if no point tried was farther, and if one was."""

MAX_REACH = 4.0
"""Longest reach, in torus coordinates of unit knots; the first is 1."""

TRIALS = 24
"""Points tried in each turn around a point that moves."""

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
"""Angle between successive points of a spiral that spreads them evenly."""


class Spots(NamedTuple):
    """Points of surfaces.

    Attributes
    ----------
    surface : (m,) int
    row : (m,) int
        A vertex, which gives the stratum and the cell, or without a stratum the point.
    s : (m, 2) float
        Torus coordinates in the stratum; the second one is unused on an edge.
    """

    surface: IntArray
    row: IntArray
    s: FloatArray


class Separation:
    """Two-sided distances of members of a degeneration from its limit.

    Parameters
    ----------
    patch : Patch
    gaps : (n, c) float
        See `Continuation`.
    places : Places
        The vertices of a complex that follows the cells.
    cells : (k, d + 1) int
        The cells of that complex.
    anchored : (v,) bool
        Whether a vertex lies on the border of a cell but inside Δ, or inside an edge of it: on the limit, steps in s
        do not lead from there into the cell.
    accuracy : float
        Relative error of the distances.

    Attributes
    ----------
    is_whole : bool
        Whether all places can be followed; otherwise there are no distances.

    Notes
    -----
    About 3 ms for each member of Example 4.4, if many are measured together. Distances are those of actual points: one
    is too large only if a nearest point was not found, and too small only if the farthest point is on a peak or ridge
    between vertices whose distances are all below `CLOSE_SHARE` of the largest.
    On 13 patches with random knots, weights and control points, at five x each, 64 distances were within 0.02 % of the
    diagonal of those between fine meshes. One, at x = 1e5, was 0.4 % too small: a spike narrower than the cells.
    """

    def __init__(
        self, patch: Patch, gaps: FloatArray, places: Places, cells: IntArray, anchored: BoolArray, accuracy: float
    ) -> None:
        positive = gaps[gaps > 0]
        self.end = LIMIT_EXPONENT / float(positive.min()) if len(positive) else 1.0
        low, high = patch.control_points.min(axis=0), patch.control_points.max(axis=0)
        self.unit = float(np.exp2(np.frexp((high - low).max())[1]))
        self.middle = middle = low + (high - low) / 2
        solved = Continuation(patch, gaps, places, self.end)
        self.is_whole = not len(solved.left)
        self.fixed, self.points = solved.fixed, (solved.points - middle) / self.unit
        self.charts = [Chart(stratum, middle, self.unit) for stratum in solved.strata]
        self.stratum = np.full(solved.count, len(self.charts))
        for index, stratum in enumerate(solved.strata):
            self.stratum[stratum.rows] = index
        self.cell, self.accuracy = places.cell, accuracy
        self.neighbours = _neighbours(cells, ~anchored)
        self.inner = _inner(places.cell, np.flatnonzero(~anchored))

    def distances(self, logarithms: FloatArray) -> FloatArray:
        """(k,) distances of the members with (k,) values of l, in model units."""
        surfaces = _Surfaces(self, np.append(np.minimum(logarithms, self.end), self.end))
        return np.asarray(surfaces.farthest() * self.unit)


class _Surfaces:
    """Some members, and the limit last; points are scaled by the control points' extent about their middle."""

    def __init__(self, of: Separation, logarithms: FloatArray) -> None:
        self.of, self.logarithms = of, logarithms
        shape = len(logarithms), len(of.stratum)
        self.points, self.s = np.empty((*shape, 3)), np.zeros((*shape, 2))
        self.points[:, of.fixed] = of.points
        for chart in of.charts:
            rows = chart.stratum.rows
            s, points, _ = chart.stratum.solutions(logarithms, PLACE_ACCURACY)
            self.s[:, rows, : len(s)] = np.moveaxis(s.reshape(len(s), len(logarithms), -1), 0, -1)
            self.points[:, rows] = (points - of.middle) / of.unit

    def farthest(self) -> FloatArray:
        """(k,) two-sided distances of k members from the limit."""
        k = len(self.points) - 1
        ways = np.arange(2 * k)
        source, target = np.append(ways[:k], np.full(k, k)), np.append(np.full(k, k), ways[:k])
        bounds, near = self.nearest_vertices()

        def bound(way: IntArray, row: IntArray) -> None:
            """Bound distances by those of the feet found from one start."""
            foot = near[way, row]
            feet = Spots(target[way], foot, self.s[target[way], foot])
            bounds[way, row] = np.minimum(bounds[way, row], self.feet(self.points[source[way], row], feet))

        first = np.argsort(-bounds, axis=1)[:, :FIRST_FEET]
        bound(np.repeat(ways, first.shape[1]), first.ravel())
        guess = _of_both(np.take_along_axis(bounds, first, axis=1).max(axis=1))
        bound(*np.nonzero(bounds > CLOSE_SHARE * guess[:, None]))
        verified = np.zeros(bounds.shape, dtype=bool)
        low = np.zeros(len(ways))
        for turn in count():
            waiting = np.where(verified, -1.0, bounds)
            number = min(FIRST_VERIFIED << turn, bounds.shape[1])
            row = np.argpartition(-waiting, number - 1, axis=1)[:, :number]
            chosen = np.take_along_axis(waiting, row, axis=1) > CLOSE_SHARE * low[:, None]
            if not chosen.any():
                break
            way, row = np.repeat(ways, number)[chosen.ravel()], row[chosen]
            found = self.distances(self.points[source[way], row], target[way])
            bounds[way, row] = np.minimum(bounds[way, row], found)
            verified[way, row] = True
            np.maximum.at(low, way, bounds[way, row])
            low = _of_both(low)
        heights = np.where(verified, bounds, 0.0)
        way, row = np.nonzero((heights >= CLOSE_SHARE * low[:, None]) & (low[:, None] > ROUNDING_DISTANCE))
        top = heights[way[:, None], self.of.neighbours[row]].max(axis=1) <= heights[way, row]
        way, row = way[top], row[top]
        order = np.lexsort((-heights[way, row], way))
        way, row = way[order], row[order]
        few = np.arange(len(way)) - np.searchsorted(way, way) < MAX_CLIMBERS
        way, row = way[few], row[few]
        spots = Spots(source[way], row, self.s[source[way], row])
        np.maximum.at(low, way, self.climbed(spots, heights[way, row], target[way]))
        return np.where(_of_both(low) > ROUNDING_DISTANCE, _of_both(low), 0.0)[:k]

    def nearest_vertices(self) -> tuple[FloatArray, IntArray]:
        """(2 k, v) distances of vertices from the nearest ones of the other surface, and which these are."""
        limit, found = self.points[-1], []
        for points in self.points[:-1]:
            squares = _squares_between(points, limit)
            found.append([(squares.min(axis=axis), squares.argmin(axis=axis)) for axis in (1, 0)])
        pairs = [pair for side in zip(*found, strict=True) for pair in side]
        return np.sqrt(np.stack([each for each, _ in pairs])), np.stack([row for _, row in pairs])

    def distances(self, points: FloatArray, surface: IntArray) -> FloatArray:
        """(m,) distances of (m, 3) points from surfaces, searched for from several starts."""
        if not len(points):
            return np.empty(0)
        rows = [self.starts(points[members], self.points[index]) for index, members in groups(surface)]
        number = rows[0].shape[1]
        row = np.empty((len(points), number), dtype=np.int64)
        row[np.argsort(surface, kind="stable")] = np.concatenate(rows)
        target = np.repeat(surface, number)
        starts = Spots(target, row.ravel(), self.s[target, row.ravel()])
        return np.asarray(self.feet(np.repeat(points, number, axis=0), starts).reshape(-1, number).min(axis=1))

    def starts(self, points: FloatArray, vertices: FloatArray) -> IntArray:
        """(m, w) vertices near (m, 3) points: the nearest of all, and the nearest one in each of the nearest cells."""
        squares = _squares_between(points, vertices)
        inner = squares[:, self.of.inner]
        nearest = inner.argmin(axis=2)
        cells = np.argpartition(inner.min(axis=2), min(NEAREST_CELLS, inner.shape[1]) - 1, axis=1)[:, :NEAREST_CELLS]
        inside = self.of.inner[cells, np.take_along_axis(nearest, cells, axis=1)]
        return np.column_stack([np.argpartition(squares, NEAREST_VERTICES - 1, axis=1)[:, :NEAREST_VERTICES], inside])

    def climbed(self, spots: Spots, distances: FloatArray, target: IntArray) -> FloatArray:
        """(m,) distances from target surfaces that points reach by moving over their own."""
        distances, s, reach = distances.copy(), spots.s.copy(), np.ones(len(spots.row))
        turn = 0
        while len(going := np.flatnonzero(reach > np.sqrt(self.of.accuracy))):
            rows = np.repeat(going, TRIALS)
            trial = (s[going, None] + reach[going, None, None] * _disc(turn)).reshape(-1, 2)
            found = self.distances(self.positions(rows_of(spots, rows)._replace(s=trial)), target[rows])
            found = found.reshape(len(going), -1)
            best = found.argmax(axis=1)
            best_found = found[np.arange(len(going)), best]
            # A smaller gain is not worth a turn.
            better = best_found > (1 + 1e-3 * self.of.accuracy) * distances[going]
            distances[going[better]] = best_found[better]
            s[going[better]] = trial.reshape(*found.shape, 2)[better, best[better]]
            # A point in the corner of a cell stays there.
            stays = np.abs(found - distances[going, None]).max(axis=1) <= self.of.accuracy * distances[going]
            reach[going] *= np.where(better, GROWTH_RATIO, np.where(stays, 0.0, SHRINK_RATIO))
            np.minimum(reach, MAX_REACH, out=reach)
            turn += 1
        return distances

    def positions(self, spots: Spots) -> FloatArray:
        """(m, 3) points."""
        result = self.points[spots.surface, spots.row]
        for index, rows in groups(self.of.stratum[spots.row]):
            if index < len(self.of.charts):
                chart = self.of.charts[index]
                weights = self.weights(chart, rows_of(spots, rows))
                result[rows] = chart.points(spots.s[rows, : chart.dimension].T, weights).T
        return result

    def feet(self, points: FloatArray, starts: Spots) -> FloatArray:
        """(m,) distances of (m, 3) points from the nearest points of surfaces that are found from given starts."""
        distances = np.empty(len(points))
        for index, rows in groups(self.of.stratum[starts.row]):
            own = rows_of(starts, rows)
            if index == len(self.of.charts):
                apart = (points[rows] - self.points[own.surface, own.row]).T
                distances[rows] = np.sqrt(dot(apart, apart))
            else:
                chart = self.of.charts[index]
                start = np.ascontiguousarray(own.s[:, : chart.dimension].T)
                squares = chart.least_squares(points[rows].T, start, self.weights(chart, own), 0.1 * self.of.accuracy)
                distances[rows] = np.sqrt(squares)
        return distances

    def weights(self, chart: Chart, spots: Spots) -> FloatArray:
        """(n, m) logarithms of the weights at points."""
        return chart.stratum.exponents(self.logarithms[spots.surface], self.of.cell[spots.row])


def _disc(turn: int) -> FloatArray:
    """(t, 2) points spread evenly over the unit disc, along a spiral that starts elsewhere in each turn.

    Distances have ridges, where two points are equally near; only a few directions lead upwards along a ridge.
    """
    k = np.arange(TRIALS)
    radius, angle = np.sqrt((k + 0.5) / TRIALS), GOLDEN_ANGLE * k + turn
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def _neighbours(cells: IntArray, free: BoolArray) -> IntArray:
    """(v, w) free vertices that share a cell with each vertex; the vertex itself fills the row."""
    corners = range(cells.shape[1])
    pairs = np.concatenate([cells[:, [i, j]] for i in corners for j in corners if i != j])
    return _table(pairs[free[pairs[:, 1]]], np.arange(len(free)))


def _inner(cell: IntArray, free: IntArray) -> IntArray:
    """(c, w) free vertices of each cell; the first one fills the row."""
    number, first = np.unique(cell[free], return_index=True)
    return _table(np.column_stack([np.searchsorted(number, cell[free]), free]), free[first])


def _of_both(distances: FloatArray) -> FloatArray:
    """(2 k,) the larger of the one-sided distances of k members, for both directions."""
    return np.tile(distances.reshape(2, -1).max(axis=0), 2)


def _table(pairs: IntArray, filling: IntArray) -> IntArray:
    """(k, w): in row i the j of all pairs (i, j), then `filling`."""
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    number = np.bincount(pairs[:, 0], minlength=len(filling))
    table = np.repeat(filling[:, None], max(int(number.max(initial=0)), 1), axis=1)
    table[pairs[:, 0], np.arange(len(pairs)) - np.repeat(np.cumsum(number) - number, number)] = pairs[:, 1]
    return table


def _squares_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m, n) squared distances of (m, 3) points from (n, 3) points, up to rounding."""
    columns = np.column_stack([-2 * b, np.ones(len(b)), np.einsum("ij,ij->i", b, b)])
    return np.asarray(np.maximum(np.column_stack([a, np.einsum("ij,ij->i", a, a), np.ones(len(a))]) @ columns.T, 0.0))
