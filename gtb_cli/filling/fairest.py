"""The fairest surface over a net: the best by a score that sees corners, or one led to a surface that is known."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import compress
from operator import itemgetter
from typing import Any

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.fairing.energy import Samples
from gtb_cli.fairing.fair import LEFT_OUT
from gtb_cli.fairing.metric import blocks, forms
from gtb_cli.fairing.variation import bendings
from gtb_cli.filling.algebraic import AlgebraicSurface
from gtb_cli.filling.rows import CROSSING
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.theory.corners import CornerLayer, corner_layer

VISIBLE, NEARER = LEFT_OUT
"""Of the way to the middle: what is nearer to the boundary is not seen; and down to where the energy has a weight."""

MOST_CURVED = 150.0
"""Largest curvature near a corner, of 1 / its shorter edge, that counts as none in scores."""


class FairSearch:
    """The surfaces over a net that have the least energies, and their scores: the smaller, the fairer."""

    def __init__(self, domain: Domain, at: Samples, depths: FloatArray, least: Callable[..., Any], power: int) -> None:
        self._domain, self._places, self._least, self._power = domain, at, least, power
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

    def fairest(self) -> list[tuple[float, FloatArray]]:
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
        pairs[0] = self._calmed(energies[best], *pairs[0], 0.0 if pairs[0][1] is unbound else CROSSING)
        return pairs + [(scored[0], found[0])] * (best > 0)

    def _calmed(self, energy: FloatArray, score: float, points: FloatArray, bound: float) -> tuple[float, FloatArray]:
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
            points = self._least(energy, share=share, pull=partial(self._pull, beyond, step[1] * energy))
            (score,) = self.scores([points])
        return min(calmer, key=itemgetter(0))

    def _layers(self, points: FloatArray) -> list[CornerLayer]:
        corners = range(len(self._domain.vertices))
        return [corner_layer(self._domain, self._places.log_weights, points, corner) for corner in corners]

    def _pull(self, beyond: BoolArray, energy: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rows and ways that pull curvature near corners to 0: the more there is, the more, by |κ|³."""
        quiet, each = MOST_CURVED / 1.5, slice(None, None, 2)  # squares have the energy's value; half of the places
        value, rows, ways = np.vdot(points, energy @ points), [], []
        for near in compress(self._layers(points), beyond):
            curved = near.curvatures[each] * near.edge / quiet
            stiffness = np.sqrt(value * np.maximum(curved, 1e-3) / len(curved)) * near.edge / quiet
            rows.append((near.table[each] * stiffness[:, None, None]).reshape(-1, len(points)))
            ways.append(np.repeat(near.normals[each], 3, axis=0))
        return np.concatenate(rows), np.concatenate(ways)

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

    def led_to(self, surface: AlgebraicSurface, score: float, fairest: FloatArray) -> list[tuple[float, FloatArray]]:
        """Return the fairest, moved smoothly onto a surface that is known and bends more; none if it ends elsewhere."""
        rounds, stiffness, worst = 3, 1e-8, 2.0  # worst score, of the fairest's: it ends elsewhere if it has more
        t, led = shares(exponents(*self._places[:3])), fairest
        form = (t * self._zones[1]) @ t.T + stiffness * self._stiff
        for _ in range(rounds):
            led = self._least(form, origin=led + np.linalg.solve(form, (t * self._zones[1]) @ surface.ways(t.T @ led)))
        farther = np.abs([surface.ways(t.T @ each) for each in (led, fairest)]).max(axis=(1, 2))
        is_nearer = farther[0] < farther[1] and self.scores([led])[0] <= worst * score
        return [(score, led)] if is_nearer else []
