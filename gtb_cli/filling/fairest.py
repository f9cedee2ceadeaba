"""The fairest surface over a net: the best by a score that sees corners, or one led to a surface that is known."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import compress
from operator import itemgetter
from typing import Any

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.fairing.descent import BENDING_POWER
from gtb_cli.fairing.energy import Samples
from gtb_cli.fairing.fair import LEFT_OUT
from gtb_cli.fairing.metric import Block, blocks, forms, frame
from gtb_cli.fairing.variation import bendings
from gtb_cli.filling.algebraic import AlgebraicSurface
from gtb_cli.filling.certificate import edge_of, hundredth_inside
from gtb_cli.filling.osculation import SecondRow
from gtb_cli.filling.rows import CROSSING
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.theory.corners import CornerLayer, corner_layer
from gtb_cli.theory.patch import Patch

VISIBLE, NEARER = LEFT_OUT
"""Of the way to the middle: what is nearer to the boundary is not seen; and down to where the energy has a weight."""

MOST_CURVED = 150.0
"""Largest curvature near a corner, of 1 / its shorter edge, that counts as none in scores."""

UNEVEN = 0.08
"""Difference of curvature at an edge where it is given and a hundredth inside, of the largest, that counts as none."""

STRENGTHS = (1.0, 3.0, 10.0)
LED = 1.0


class FairSearch:
    """The surfaces over a net that have the least energies, and their scores: the smaller, the fairer."""

    def __init__(
        self, domain: Domain, at: Samples, depths: FloatArray, least: Callable[..., Any], given: Mapping[int, SecondRow]
    ) -> None:
        self._domain, self._places, self._least, self._given = domain, at, least, given
        # Where curvature is given along edges, less bending is had by leaving it just inside them.
        self._power = 0 if given else BENDING_POWER
        # Two energies: of what is seen, and of what is not, too, the less the nearer it is to the boundary
        self._zones = at.areas * np.stack([depths**16, depths**4])
        parts = (np.flatnonzero(each) for each in (depths == 1, depths < 1))
        self._inside, self._outside = (list(blocks(*at[:3], part)) for part in parts)

    def scores(self, surfaces: Sequence[FloatArray]) -> list[float]:
        """Return products of powers of bending and of its variation in both zones."""
        flat = 1e-20  # of ∫ κ₁² + κ₂²: in a plane, where all scores are rounding
        zones = np.stack([self._zones[0], self._places.areas])
        both = zip(*bendings(self._inside + self._outside, zones, surfaces), strict=True)
        return [b.energy**self._power * b.variation * math.sqrt(d.variation) * (b.energy > flat) for b, d in both]

    def fairest(self, surface: AlgebraicSurface | None) -> list[tuple[float, FloatArray]]:
        """Return the surface with the best score, without the bounds of corners too, and that of the first metric."""
        plane = np.column_stack([self._places.knots, np.zeros(len(self._places.knots))])
        second, third = forms(self._inside + self._outside, self._zones[0], plane, (2, 3))
        energies = [third + 30 / self._places.areas.sum() * second]
        found = [self._least(energies[0])]
        energies += self._energies(found[0])
        found += [self._least(energy) for energy in energies[1:]]
        scored = self.scores(found)
        best = int(np.argmin(scored))
        pairs = [(scored[best], found[best])]
        unbound = self._least(energies[best], share=0.0)  # the bounds make some patches bend more, or fold
        if not np.array_equal(unbound, found[best]):
            pairs = sorted([*pairs, (self.scores([unbound])[0], unbound)], key=itemgetter(0))
        calmed = partial(self._calmed, energies[best], bound=0.0 if pairs[0][1] is unbound else CROSSING)
        pairs[0] = calmed(*pairs[0])
        pairs += [(scored[0], found[0])] * (best > 0)
        if self._given:
            return self._evened(energies[best], pairs[0], calmed, surface) + pairs
        return self._led_to(surface, *pairs[0]) + pairs

    def _evened(
        self,
        energy: FloatArray,
        first: tuple[float, FloatArray],
        calmed: Callable[..., tuple[float, FloatArray]],
        surface: AlgebraicSurface | None,
    ) -> list[tuple[float, FloatArray]]:
        """Return a surface, or one whose curvature a hundredth inside edges is pulled to theirs, and where it is led."""
        self._strips = self._strips_of(first[1])
        found = list[tuple[float, list[tuple[float, FloatArray]]]]()
        for strength in (0.0, *STRENGTHS):
            even = partial(self._even, strength * energy) if strength else None
            if even:
                points = self._least(energy, share=calmed.keywords["bound"], pull=even)
                first = calmed(*self.scores([points]), points, also=even)
            surfaces = [*self._led_to(surface, *first, LED if strength else 0.0), first]
            uneven = self._unevenness(surfaces[0][1])
            found.append((self.scores([surfaces[0][1]])[0] * max(1.0, uneven / UNEVEN) ** 4, surfaces))
            if uneven <= UNEVEN:
                break
        return min(found, key=itemgetter(0))[1]

    def _strips_of(self, points: FloatArray) -> tuple[list[Block], FloatArray, float]:
        """Return places a hundredth inside edges with given curvatures, κ₁ + κ₂ at these edges, and the largest given."""
        count = 24  # a side
        patch = Patch(self._places.knots, points, log_weights=self._places.log_weights)
        pairs = [hundredth_inside(patch, edge_of(patch, k), row.curve, count) for k, row in self._given.items()]
        inside, on_edges = np.concatenate(pairs, axis=1)
        s = MomentMap(*self._places[:2]).inverse(inside, 1e-10)
        largest = max(np.abs(row.bend).max() for row in self._given.values())
        there, bends = -2 * patch.curvature(np.stack([inside, on_edges]), "linear").mean
        largest = max(largest, np.abs(bends).max() / 2, np.abs(there).max() / 10)  # of planes and cylinders, too
        return list(blocks(*self._places[:2], s)), bends, float(largest or 1.0)

    def _unevenness(self, points: FloatArray) -> float:
        """Return the largest difference of κ₁ + κ₂ at edges and a hundredth inside, of the largest curvature given."""
        places, bends, largest = self._strips
        inside = [frame(block, points).normal_parts(2) for block in places]
        order = np.concatenate([block.places for block in places])
        return float(np.abs(np.concatenate([xx + yy for xx, _, yy in inside]) - bends[order]).max() / largest)

    def _even(self, energy: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return rows, ways and what they should be, for which κ₁ + κ₂ a hundredth inside edges is as at these."""
        places, bends, largest = self._strips
        rows, ways = np.zeros((len(bends), len(points))), np.zeros((len(bends), 3))
        for block in places:
            own = frame(block, points)
            for part, table in block.tables(own.orders[1][0][3:] + own.orders[1][2][3:]):
                rows[block.places[part]] = table.T
            ways[block.places] = own.axes[0].T
        stiffness = np.sqrt(np.vdot(points, energy @ points) / len(bends)) / (UNEVEN * largest)
        return rows * stiffness, ways, bends * stiffness

    def _calmed(
        self, energy: FloatArray, score: float, points: FloatArray, bound: float, also: Any = None
    ) -> tuple[float, FloatArray]:
        """Return a surface, or a pulled one whose rows cross edges more at corners, where scores see curvature, too."""
        steps = (1.0, 0.03), (1.4, 0.03), (1.4, 0.1), (2.0, 0.1)  # factors of shares, and pulls, of the energy's value
        beyond, calmer = np.zeros(len(self._domain.vertices), dtype=np.bool_), list[tuple[float, FloatArray]]()
        for step in (*steps, None):
            curved = np.nan_to_num([near.curvatures.max() * near.edge for near in self._layers(points)])
            beyond |= curved > MOST_CURVED
            calmer.append((score * max(1.0, curved.max() / MOST_CURVED) ** 4, points))
            if step is None or not beyond.any() or (len(calmer) > 2 and calmer[-1][0] > calmer[-2][0]):
                break
            share = np.where(beyond, np.maximum(step[0] * bound, (step[0] - 1) * CROSSING), bound)
            points = self._least(energy, share=share, pull=partial(self._pull, beyond, step[1] * energy, also))
            (score,) = self.scores([points])
        return min(calmer, key=itemgetter(0))

    def _layers(self, points: FloatArray) -> list[CornerLayer]:
        corners = range(len(self._domain.vertices))
        return [corner_layer(self._domain, self._places.log_weights, points, corner) for corner in corners]

    def _pull(
        self, beyond: BoolArray, energy: FloatArray, also: Any, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return rows and ways that pull curvature near corners to 0: the more there is, the more, by |κ|³."""
        quiet, each = MOST_CURVED / 1.5, slice(None, None, 2)  # squares have the energy's value; half of the places
        value, rows, ways = np.vdot(points, energy @ points), [], []
        for near in compress(self._layers(points), beyond):
            curved = near.curvatures[each] * near.edge / quiet
            stiffness = np.sqrt(value * np.maximum(curved, 1e-3) / len(curved)) * near.edge / quiet
            rows.append((near.table[each] * stiffness[:, None, None]).reshape(-1, len(points)))
            ways.append(np.repeat(near.normals[each], 3, axis=0))
        zeros = np.zeros(sum(map(len, rows)))
        own = np.concatenate(rows), np.concatenate(ways), zeros
        return tuple(map(np.concatenate, zip(own, also(points), strict=True))) if also else own

    def _energies(self, points: FloatArray) -> list[FloatArray]:
        """Return energies in the metric of a surface, those of what is seen first.

        The less weight bending has, the less curvature varies, and the more some patches bend. With what is not seen,
        it varies less at the boundary, and more inside.
        """
        areas = self._places.areas  # where places are seen, both zones have them
        ((found,),) = bendings(self._inside + self._outside, self._zones[0], [points])
        pairs = forms(self._inside, areas, points, (2, 3)) + forms(self._outside, self._zones, points, (2, 3))
        self._stiff = pairs[1, 1]
        return [third + factor / found.area * second for second, third in pairs for factor in (0, 100, 400)]

    def _led_to(
        self, surface: AlgebraicSurface | None, score: float, fairest: FloatArray, strength: float = 0.0
    ) -> list[tuple[float, FloatArray]]:
        """Return the fairest, moved smoothly onto a surface that is known and bends more; none if it ends elsewhere."""
        rounds, stiffness, worst = 3, 1e-8, 2.0  # worst score, of the fairest's: it ends elsewhere if it has more
        if surface is None:
            return []
        t, led = shares(exponents(*self._places[:3])), fairest
        form = (t * self._zones[1]) @ t.T + stiffness * self._stiff
        even = partial(self._even, strength * stiffness * self._stiff) if strength else None
        for _ in range(rounds):
            origin = led + np.linalg.solve(form, (t * self._zones[1]) @ surface.ways(t.T @ led))
            led = self._least(form, origin=origin, pull=even)
        farther = np.abs([surface.ways(t.T @ each) for each in (led, fairest)]).max(axis=(1, 2))
        is_nearer = farther[0] < farther[1] and self.scores([led])[0] <= worst * score
        return [(score, led)] if is_nearer else []
