"""The search for the points of surfaces that are farthest from other surfaces.

It starts from the points that each surface comes with: the corners of cells, where the farthest one mostly is, and
enough others. Newton's method finds the nearest points of the other surface; then the farthest points move over
their own surface as long as their distances grow.
"""

from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, groups, joined, rows_of
from gtb_cli.distances.projection import ROUNDING, projected
from gtb_cli.distances.strata import Strata, StratumPlaces, Surface
from gtb_cli.meshes.frame import Frame

RELATIVE_ERROR = 5e-4  # relative error of a distance between surfaces: three digits are right
CLOSE_SHARE = 0.9  # fraction of the largest distance from which on a point of the start may lead to a farther one
# Nearest points from which the nearest one is searched for: usually, where it matters, and for the farthest of all.
FEW_STARTS, MANY_STARTS, MOST_STARTS = 4, 24, 400


class Candidates(NamedTuple):
    """Points from which the search starts."""

    way: IntArray  # (m,) numbers of the ways from one surface to another
    point: IntArray  # (m,) numbers of points among those of all surfaces
    distance: FloatArray  # (m,) upper bound of the distance from the other surface
    nearest: IntArray  # (m,) the nearest one of the other surface's points
    like: IntArray  # (m,) the one at the most similar place in its domain: the surfaces may be nearly the same one


class LocalMaxima(NamedTuple):
    """Local maxima of the distance from the other surface: (m,) ways, places and distances."""

    way: IntArray
    stratum: IntArray
    s: FloatArray
    distance: FloatArray


class FarthestSearch:
    """The search among some surfaces, in a frame around them, for the points farthest on some ways (from, to).

    Ways w and w + `count` are both ways between two surfaces: only the larger distance is looked for.
    """

    def __init__(self, surfaces: Sequence[Surface], ways: Sequence[tuple[int, int]], count: int) -> None:
        from scipy.spatial import cKDTree

        self.frame, self.count = Frame.around(*(surface.points for surface in surfaces)), count
        self.surfaces = surfaces = [surface.seen_from(self.frame) for surface in surfaces]
        self.trees = [cKDTree(surface.points) for surface in surfaces]
        self.relatives = [cKDTree(surface.relative) for surface in surfaces]
        self.source, self.target = np.array(ways).T
        self.first = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
        columns = np.cumsum([0, *(surface.strata.log_weights.shape[1] for surface in surfaces)])
        self.strata = Strata.joined([surface.strata for surface in surfaces])
        self.points = np.concatenate([surface.points for surface in surfaces])
        own = zip((surface.places for surface in surfaces), columns, strict=False)
        self.places = joined([places._replace(stratum=places.stratum + column) for places, column in own])
        cells = [surface.cells + first for surface, first in zip(surfaces, self.first, strict=False)]
        beside = [part[:, pair] for part in cells for pair in map(list, permutations(range(part.shape[1]), 2))]
        self.beside, self.others = np.concatenate(beside).T

    def farthest(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the distances of all ways or pairs of ways, (k,), points that are so far, (k, 3), and errors, (k,).

        Where a further search for nearest points lowers a distance, others may be missed, too: the error is then all
        that was lost, or the whole distance.
        """
        peaks = self.peaks(self.verified(self.bounded(self.candidates())))
        top = joined([peaks, self.climbed(peaks)])
        positions = self.strata.points(StratumPlaces(top.stratum, top.s))
        checked = np.minimum(top.distance, self.distances(positions, top.way, 0 * top.distance, MOST_STARTS)[0])
        found, at = np.zeros(self.count), np.zeros((self.count, 3))
        order = np.argsort(checked, kind="stable")
        pair = top.way[order] % self.count
        found[pair], at[pair] = checked[order], positions[order]  # the last one, which is the largest, stays
        lost = self.largest(peaks.way % self.count, peaks.distance) - found
        missed = lost > RELATIVE_ERROR * found + ROUNDING
        found = np.where(found > ROUNDING, found, 0.0)
        errors = RELATIVE_ERROR * found + np.where(missed, np.maximum(lost, found), 0.0)
        return self.frame.length(found), self.frame.outside(at), self.frame.length(errors)

    def candidates(self) -> Candidates:
        """Return all points of the start, at the distances of the nearest points of the other surface."""
        rows = []
        for way, (one, other) in enumerate(zip(self.source.tolist(), self.target.tolist(), strict=True)):
            here, first = self.surfaces[one], self.first[other]
            apart, nearest = map(np.asarray, self.trees[other].query(here.points))
            like = first + np.asarray(self.relatives[other].query(here.relative)[1])
            points = self.first[one] + np.arange(len(apart))
            rows.append(Candidates(np.full(len(points), way), points, apart, first + nearest, like))
        return joined(rows)

    def bounded(self, candidates: Candidates) -> Candidates:
        """Lower the bounds of candidates that may be farthest, by the distances found from two starts."""
        bounds = candidates.distance.copy()

        def lower(rows: IntArray) -> None:
            for start in (candidates.nearest, candidates.like):
                rows = rows[bounds[rows] > ROUNDING]
                points, (stratum, s) = self.points[candidates.point[rows]], rows_of(self.places, start[rows])
                found, _ = projected(self.strata, points, stratum, s, RELATIVE_ERROR, np.zeros(len(rows)))
                bounds[rows] = np.minimum(bounds[rows], found)

        likely = _highest(candidates.way, bounds, 8)  # rule out most others
        lower(likely)
        pair = candidates.way % self.count
        lower(np.flatnonzero(bounds > CLOSE_SHARE * self.largest(pair[likely], bounds[likely])[pair]))
        return candidates._replace(distance=bounds)

    def verified(self, candidates: Candidates) -> Candidates:
        """Return the candidates about as far as the farthest, with distances that are found from many starts.

        The farthest are searched for once more, from most starts, until they stay the farthest.
        """
        number, few = 2, 4  # candidates of each way that are verified at first, then twice as many; and once more
        rounds = 1 + 1000 // len(self.strata.log_weights)  # so much patience with distances that are not yet certain
        way, point, bounds = candidates[:3]
        pair, effort = way % self.count, np.zeros(len(way), dtype=np.int64)
        while True:
            low = self.largest(pair, np.where(effort > 0, bounds, 0.0))
            close = bounds > np.maximum(CLOSE_SHARE * low[pair], ROUNDING)
            rows, starts = np.flatnonzero(close & (effort == 0)), MANY_STARTS
            if not len(rows):
                if (effort[close & (bounds == low[pair])] == MOST_STARTS).all() or not rounds:
                    return rows_of(candidates._replace(distance=bounds), effort > 0)
                rows, starts, number = np.flatnonzero(close & (effort < MOST_STARTS)), MOST_STARTS, few
                rounds -= 1
            rows = rows[_highest(way[rows], bounds[rows], number)]
            enough = np.zeros(len(rows)) if starts == MOST_STARTS else CLOSE_SHARE * low[pair[rows]]
            found, _ = self.distances(self.points[point[rows]], way[rows], enough, starts)
            bounds[rows], effort[rows] = np.minimum(bounds[rows], found), starts
            number *= 2

    def largest(self, pair: IntArray, heights: FloatArray) -> FloatArray:
        """Return the largest of (m,) heights of each pair, (k,)."""
        low = np.zeros(self.count)
        np.maximum.at(low, pair, heights)
        return low

    def peaks(self, candidates: Candidates) -> LocalMaxima:
        """Return the local maxima of the distance, a few of the largest of each way."""
        same_height = 1e-9  # relative difference of distances of one place in two strata
        heights = np.zeros((len(self.source), len(self.points)))
        heights[candidates.way, candidates.point] = candidates.distance
        low = self.largest(candidates.way % self.count, candidates.distance)[np.arange(len(heights)) % self.count]
        high = heights.copy()
        for row, own in zip(high, heights, strict=True):
            np.maximum.at(row, self.beside, own[self.others])
        chosen = candidates.distance >= np.maximum(high[candidates[:2]], CLOSE_SHARE * low[candidates.way])
        high_ones = rows_of(candidates, chosen)
        way, point, distance = rows_of(high_ones, _highest(high_ones.way, high_ones.distance, len(chosen)))[:3]
        again = (np.diff(way, prepend=-1) == 0) & (-np.diff(distance, prepend=np.inf) <= same_height * low[way])
        way, point, distance = way[~again], point[~again], distance[~again]
        rows = _highest(way, distance, 8)
        return LocalMaxima(way[rows], *rows_of(self.places, point[rows]), distance[rows])

    def climbed(self, peaks: LocalMaxima) -> LocalMaxima:
        """Move local maxima over their own surface as long as distances grow."""
        trials, longest_reach = 24, 4.0
        shrink, growth = 0.6, 2.0  # of the reach, after a turn without and with a gain
        worthy_gain = 0.02 * RELATIVE_ERROR  # a smaller one counts as none: towards a corner, gains never end
        way, stratum, s, distance = peaks.way, peaks.stratum, peaks.s.copy(), peaks.distance.copy()
        reach = np.ones(len(way))
        _, nearest = self.distances(self.strata.points(StratumPlaces(stratum, s)), way, np.zeros(len(way)), MANY_STARTS)
        turn = 0
        while len(going := np.flatnonzero(reach > np.sqrt(RELATIVE_ERROR))):
            trial = s[going, None] + reach[going, None, None] * _disc(trials, turn)
            places = StratumPlaces(np.repeat(stratum[going], trials), trial.reshape(-1, 2))
            rows = np.repeat(going, trials)
            enough = (1 - 2 * RELATIVE_ERROR) * distance[rows]
            found, _ = self.distances(self.strata.points(places), way[rows], enough, FEW_STARTS, rows_of(nearest, rows))
            heights = found.reshape(-1, trials)
            best, height = heights.argmax(axis=1), heights.max(axis=1)
            likely = np.flatnonzero(height > distance[going])
            chosen = rows_of(places, trials * likely + best[likely])
            at, enough = going[likely], distance[going[likely]]
            height[likely], there = self.distances(self.strata.points(chosen), way[at], enough, MANY_STARTS)
            better = height > (1 + worthy_gain) * distance[going]
            kept = better[likely]
            up = going[likely[kept]]
            distance[up], s[up] = height[likely[kept]], chosen.s[kept]
            nearest.stratum[up], nearest.s[up] = there.stratum[kept], there.s[kept]
            # A point in the corner of a cell stays there.
            stays = np.abs(heights - distance[going, None]).max(axis=1) <= RELATIVE_ERROR * distance[going]
            reach[going] *= np.where(better, growth, np.where(stays, 0.0, shrink))
            np.minimum(reach, longest_reach, out=reach)
            turn += 1
        return LocalMaxima(way, stratum, s, distance)

    def distances(
        self, points: FloatArray, way: IntArray, enough: FloatArray, starts: int, guess: StratumPlaces | None = None
    ) -> tuple[FloatArray, StratumPlaces]:
        """Find how far (m, 3) points are from the surfaces to which their ways lead, (m,), and their nearest points.

        The search starts from a guess, if there is one, then from so many points of the other surface, and a few that
        are farther, not all in one small patch; it ends where a distance is at most `enough`, (m,).
        """
        found = np.full(len(points), np.inf)
        nearest = StratumPlaces(np.zeros(len(points), dtype=np.int64), np.zeros((len(points), 2)))

        def search(rows: IntArray, stratum: IntArray, s: FloatArray) -> None:
            """Search from (r, w) places for each of r points."""
            again = np.repeat(rows, stratum.shape[1])
            places = stratum.ravel(), s.reshape(-1, 2)
            distance, s = projected(self.strata, points[again], *places, RELATIVE_ERROR, enough[again])
            best = np.arange(len(rows)) * stratum.shape[1] + distance.reshape(stratum.shape).argmin(axis=1)
            better = distance[best] < found[rows]
            rows, best = rows[better], best[better]
            found[rows], nearest.stratum[rows], nearest.s[rows] = distance[best], stratum.ravel()[best], s[best]

        if guess is not None:
            search(np.arange(len(points)), guess.stratum[:, None], guess.s[:, None])
        far = np.flatnonzero(found > enough)
        starts = min(starts, *(len(surface.points) for surface in self.surfaces))
        near = np.empty((len(far), starts + starts // 6), dtype=np.int64)
        for index, rows in groups(self.target[way[far]]):
            order = np.append(np.arange(1, starts + 1), np.geomspace(starts, self.trees[index].n, starts // 6))
            near[rows] = self.first[index] + self.trees[index].query(points[far[rows]], order.astype(int))[1]
        search(far, *rows_of(self.places, near))
        return found, nearest


def _disc(count: int, turn: int) -> FloatArray:
    """Spread points evenly over the unit disc, (t, 2), along a spiral that starts elsewhere in each turn."""
    # Only a few directions lead upwards along a ridge of the distance, where two points are equally near.
    golden_angle = np.pi * (3 - np.sqrt(5))
    k = np.arange(count)
    radius, angle = np.sqrt((k + 0.5) / count), golden_angle * k + turn
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def _highest(way: IntArray, heights: FloatArray, number: int) -> IntArray:
    """Return the rows of the highest of each way, at most `number`, the highest first."""
    order = np.lexsort((-heights, way))
    ways = way[order]
    return order[np.arange(len(way)) - np.searchsorted(ways, ways) < number]
