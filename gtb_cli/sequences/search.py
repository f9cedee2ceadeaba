"""Distances between surfaces themselves and not between meshes.

The search for the largest distance starts from the vertices of a coarse complex: the corners of cells, where it mostly
is, and enough others. Newton's method in torus coordinates finds the point of the other surface nearest to each; then
the farthest vertices move over their own surface as long as their distances grow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, column_dot, groups, rows_of
from gtb_cli.sequences.feet import ROUNDING_DISTANCE, Chart
from gtb_cli.values import frozen

PLACE_ACCURACY = 1e-6
"""Error of the vertices' parameters, as a fraction of Δ's extents: whatever it is, they lie on the surface."""

FIRST_FEET = 8
"""Vertices of each surface that are projected first, which rules out most others as the farthest."""

FIRST_VERIFIED = 2
"""Vertices of each surface whose nearest points are first searched for from several starts; then twice as many, …."""

NEAREST_VERTICES, NEAREST_CELLS = 4, 2
"""The starts: the nearest vertices of the other surface, and the nearest vertex in each of so many cells."""

MANY_VERTICES = 24
"""The nearest vertices for points that would be farther than all before."""

MAX_CLIMBERS = 4
"""Vertices of each surface that move, at most."""

CLOSE_SHARE = 0.9
"""Fraction of the largest distance from which on vertices move, unless a neighbour is farther."""

SHRINK_RATIO, GROWTH_RATIO = 0.6, 2.0
"""Ratios of the reach after a turn to that before: if no point tried was farther, and if one was."""

SAME_HEIGHT = 1e-9
"""Difference of distances, as a fraction of the largest, below which two vertices are one place in two charts."""

WORTHY_GAIN = 0.02
"""Gain of a turn, as a fraction of the accuracy, below which the reach shrinks: towards a corner, which is infinitely
far, gains never end."""

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


@frozen
class Search:
    """The search for the largest distances between surfaces, scaled by their size about their middle.

    Attributes
    ----------
    points : (k, v, 3) float
        The vertices of each surface.
    s : (k, v, 2) float
        Their torus coordinates.
    chart : (k, v) int
        Their charts; the number of charts for a vertex that is a point of its own.
    charts : sequence of Chart
    columns : callable
        What tells a chart at which points it is to be evaluated, in addition to their torus coordinates.
    neighbours : (v, w) int
    groups : (g, w) int
        Vertices near to each other.
    accuracy : float
    """

    points: FloatArray
    s: FloatArray
    chart: IntArray
    charts: Sequence[Chart]
    columns: Callable[[Any, Spots], Any]
    neighbours: IntArray
    groups: IntArray
    accuracy: float

    def farthest(self, first: IntArray, second: IntArray) -> FloatArray:
        """(k,) two-sided distances between k pairs of surfaces."""
        k = len(first)
        ways = np.arange(2 * k)
        source, target = np.append(first, second), np.append(second, first)
        bounds, near = self.nearest_vertices(first, second)

        def bound(way: IntArray, row: IntArray) -> None:
            """Bound distances by those of the feet found from one start."""
            foot = near[way, row]
            feet = Spots(target[way], foot, self.s[target[way], foot])
            bounds[way, row] = np.minimum(
                bounds[way, row], self.feet(self.points[source[way], row], feet, np.zeros(len(row)))[0]
            )

        likely = np.argsort(-bounds, axis=1)[:, :FIRST_FEET]
        bound(np.repeat(ways, likely.shape[1]), likely.ravel())
        guess = _of_both(np.take_along_axis(bounds, likely, axis=1).max(axis=1))
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
            lower = CLOSE_SHARE * low[way]
            spots = Spots(source[way], row, self.s[source[way], row])
            found, _ = self.distances(spots, target[way], lower, MANY_VERTICES)
            bounds[way, row] = np.minimum(bounds[way, row], found)
            verified[way, row] = True
            np.maximum.at(low, way, bounds[way, row])
            low = _of_both(low)
        heights = np.where(verified, bounds, 0.0)
        way, row = np.nonzero((heights >= CLOSE_SHARE * low[:, None]) & (low[:, None] > ROUNDING_DISTANCE))
        top = heights[way[:, None], self.neighbours[row]].max(axis=1) <= heights[way, row]
        way, row = way[top], row[top]
        order = np.lexsort((-heights[way, row], way))
        way, row = way[order], row[order]
        same = (np.diff(way, prepend=-1) == 0) & (-np.diff(heights[way, row], prepend=np.inf) <= SAME_HEIGHT * low[way])
        way, row = way[~same], row[~same]
        few = np.arange(len(way)) - np.searchsorted(way, way) < MAX_CLIMBERS
        way, row = way[few], row[few]
        spots = Spots(source[way], row, self.s[source[way], row])
        np.maximum.at(low, way, self.climbed(spots, heights[way, row], target[way]))
        return np.where(_of_both(low) > ROUNDING_DISTANCE, _of_both(low), 0.0)[:k]

    def nearest_vertices(self, first: IntArray, second: IntArray) -> tuple[FloatArray, IntArray]:
        """(2 k, v) distances of vertices from the nearest ones of the other surface, and which these are."""
        found = []
        for one, other in zip(first.tolist(), second.tolist(), strict=True):
            squares = _squares_between(self.points[one], self.points[other])
            found.append([(squares.min(axis=axis), squares.argmin(axis=axis)) for axis in (1, 0)])
        pairs = [pair for side in zip(*found, strict=True) for pair in side]
        return np.sqrt(np.stack([each for each, _ in pairs])), np.stack([row for _, row in pairs])

    def distances(
        self,
        spots: Spots,
        surface: IntArray,
        enough: FloatArray,
        number: int = NEAREST_VERTICES,
        guess: Spots | None = None,
    ) -> tuple[FloatArray, Spots]:
        """(m,) distances of points from other surfaces, and their feet there, searched for from several starts.

        The starts are a guess, if there is one, the points with the same coordinates, `number` nearest vertices, and
        others; where a distance is at most `enough` (m,), the search ends.
        """
        points = self.positions(spots)
        distances = np.full(len(points), np.inf)
        feet = Spots(surface, np.zeros(len(points), dtype=np.int64), np.zeros((len(points), 2)))

        def improve(chosen: IntArray, starts: Spots) -> None:
            """Search from the same number of starts for each of some points."""
            place = np.repeat(chosen, len(starts.row) // max(len(chosen), 1))
            found, s = self.feet(points[place], starts, enough[place])
            order = np.lexsort((found, place))
            first = order[np.flatnonzero(np.diff(place[order], prepend=-1))]
            better = first[found[first] < distances[place[first]]]
            rows = place[better]
            distances[rows], feet.row[rows], feet.s[rows] = found[better], starts.row[better], s[better]

        far = np.arange(len(points))
        if guess is not None:
            improve(far, guess)
            far = np.flatnonzero(distances > enough)
        rows = np.empty((len(far), number + min(NEAREST_CELLS, len(self.groups))), dtype=np.int64)
        for index, chosen in groups(surface[far]):
            rows[chosen] = self.starts(points[far[chosen]], self.points[index], number)
        rows = np.column_stack([spots.row[far], rows])
        s = self.s[surface[far, None], rows]
        s[:, 0] = spots.s[far]
        for columns in (slice(2), slice(2, None)) if guess is not None else (slice(None),):
            open_ = distances[far] > enough[far]
            row = rows[open_, columns]
            target = np.repeat(surface[far[open_]], row.shape[1])
            improve(far[open_], Spots(target, row.ravel(), s[open_, columns].reshape(-1, 2)))
        return distances, feet

    def starts(self, points: FloatArray, vertices: FloatArray, number: int) -> IntArray:
        """(m, w) vertices near (m, 3) points: the nearest of all, and the nearest one in each of the nearest cells."""
        squares = _squares_between(points, vertices)
        inner = squares[:, self.groups]
        nearest = inner.argmin(axis=2)
        cells = np.argpartition(inner.min(axis=2), min(NEAREST_CELLS, inner.shape[1]) - 1, axis=1)[:, :NEAREST_CELLS]
        inside = self.groups[cells, np.take_along_axis(nearest, cells, axis=1)]
        nearest = np.argpartition(squares, [0, number - 1], axis=1)[:, :number]
        return np.column_stack([nearest, inside])

    def climbed(self, spots: Spots, distances: FloatArray, target: IntArray) -> FloatArray:
        """(m,) distances from target surfaces that points reach by moving over their own."""
        distances, s, reach = distances.copy(), spots.s.copy(), np.ones(len(spots.row))
        _, feet = self.distances(spots, target, np.zeros(len(target)), MANY_VERTICES)
        turn = 0
        while len(going := np.flatnonzero(reach > np.sqrt(self.accuracy))):
            rows = np.repeat(going, TRIALS)
            trial = (s[going, None] + reach[going, None, None] * _disc(turn)).reshape(-1, 2)
            tried = rows_of(spots, rows)._replace(s=trial)
            lower = (1 - 2 * self.accuracy) * distances[rows]
            found, _ = self.distances(tried, target[rows], lower, guess=rows_of(feet, rows))
            found = found.reshape(len(going), -1)
            best = np.arange(len(rows)).reshape(found.shape)[np.arange(len(going)), found.argmax(axis=1)]
            best_found, places = found.max(axis=1), trial[best]
            likely = np.flatnonzero(best_found > distances[going])
            best_found[likely], new = self.distances(
                rows_of(tried, best[likely]), target[going[likely]], distances[going[likely]], MANY_VERTICES
            )
            # A smaller gain is not worth a turn.
            better = best_found > (1 + WORTHY_GAIN * self.accuracy) * distances[going]
            distances[going[better]] = best_found[better]
            s[going[better]] = places[better]
            kept = better[likely]
            feet.row[going[likely[kept]]], feet.s[going[likely[kept]]] = new.row[kept], new.s[kept]
            # A point in the corner of a cell stays there.
            stays = np.abs(found - distances[going, None]).max(axis=1) <= self.accuracy * distances[going]
            reach[going] *= np.where(better, GROWTH_RATIO, np.where(stays, 0.0, SHRINK_RATIO))
            np.minimum(reach, MAX_REACH, out=reach)
            turn += 1
        return distances

    def positions(self, spots: Spots) -> FloatArray:
        """(m, 3) points."""
        result = self.points[spots.surface, spots.row]
        for index, rows in groups(self.chart[spots.surface, spots.row]):
            if index < len(self.charts):
                chart = self.charts[index]
                result[rows] = chart.points(
                    spots.s[rows, : chart.dimension].T, self.columns(chart, rows_of(spots, rows))
                ).T
        return result

    def feet(self, points: FloatArray, starts: Spots, enough: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(m,) distances of (m, 3) points from their feet, found from given starts, and (m, 2) coordinates of these.

        The search ends where a distance is at most `enough` (m,).
        """
        distances, s = np.empty(len(points)), starts.s.copy()
        for index, rows in groups(self.chart[starts.surface, starts.row]):
            own = rows_of(starts, rows)
            if index == len(self.charts):
                apart = (points[rows] - self.points[own.surface, own.row]).T
                distances[rows] = np.sqrt(column_dot(apart, apart))
            else:
                chart = self.charts[index]
                start = np.ascontiguousarray(own.s[:, : chart.dimension].T)
                squares, feet = chart.least_squares(
                    points[rows].T, start, self.columns(chart, own), 0.1 * self.accuracy, enough[rows] ** 2
                )
                distances[rows], s[rows, : chart.dimension] = np.sqrt(squares), feet.T
        return distances, s


def _disc(turn: int) -> FloatArray:
    """(t, 2) points spread evenly over the unit disc, along a spiral that starts elsewhere in each turn.

    Distances have ridges, where two points are equally near; only a few directions lead upwards along a ridge.
    """
    k = np.arange(TRIALS)
    radius, angle = np.sqrt((k + 0.5) / TRIALS), GOLDEN_ANGLE * k + turn
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def neighbours_of(cells: IntArray, free: BoolArray) -> IntArray:
    """(v, w) free vertices that share a cell with each vertex; the vertex itself fills the row."""
    corners = range(cells.shape[1])
    pairs = np.concatenate([cells[:, [i, j]] for i in corners for j in corners if i != j])
    return _table(pairs[free[pairs[:, 1]]], np.arange(len(free)))


def members_of(cell: IntArray, free: IntArray) -> IntArray:
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
