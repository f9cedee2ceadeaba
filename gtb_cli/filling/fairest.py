"""The fairest surface over a net: the best by a score that sees corners, or one led to a surface that is known."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.fairing.descent import BENDING_POWER, together
from gtb_cli.fairing.energy import Samples, energy_at
from gtb_cli.fairing.fair import LEFT_OUT
from gtb_cli.fairing.metric import Block, blocks, forms, frame
from gtb_cli.fairing.variation import Bending, bendings
from gtb_cli.filling.algebraic import ways_to_surface
from gtb_cli.filling.certificate import hundredth_inside
from gtb_cli.filling.control_points import CROSSING
from gtb_cli.filling.hole_corners import forced_curvatures
from gtb_cli.filling.tangent_rows import EdgeRows
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.theory.corners import CornerLayer, corner_layer
from gtb_cli.theory.patch import Patch

VISIBLE, NEARER = LEFT_OUT  # of the way to the middle: nearer to the boundary nothing is seen, or has a weight
MOST_CURVED = 135.0  # largest curvature near a corner, of 1 / its shorter edge, that counts as none in scores
OF_FORCED = 1.15  # or of what the planes force there, if that is more
MOST_BENT = 400.0  # largest weight of bending beside its variation, in units of 1 / area
BROKEN = 1e7  # of these, that no pull mends: rows of pulls would have no digits left


class Scored(NamedTuple):
    """A surface of (n, 3) control points, and its score, a logarithm: the smaller, the fairer."""

    score: float
    points: FloatArray
    visible: Bending  # without what is nearer to the boundary
    figures: FloatArray  # (4,) bending and variation of what is seen, and with what is not, too


class FairSearch:
    """The surfaces over a net that have the least energies, and their scores."""

    def __init__(
        self, domain: Domain, at: Samples, depths: FloatArray, least: Any, edges: Sequence[EdgeRows], is_led: bool
    ) -> None:
        self._domain, self._places, self._least = domain, at, least
        self._known = ways_to_surface(edges) if is_led else None
        self._given = {k: each.second for k, each in enumerate(edges) if each.second is not None}
        # Where curvature is given along edges, less bending is had by leaving it just inside them.
        self._power = 0 if self._given else BENDING_POWER
        forced, lengths = forced_curvatures([each.curve for each in edges], [each.normals for each in edges])
        self._most = np.maximum(MOST_CURVED, OF_FORCED * forced * lengths)
        # Two energies: of what is seen, and of what is not, too, the less the nearer it is to the boundary
        self._zones = at.areas * np.stack([depths**16, depths**4])
        parts = (np.flatnonzero(each) for each in (depths == 1, depths < 1))
        self._inside, self._outside = (list(blocks(*at[:3], part)) for part in parts)
        if self._known:
            third = slice(None, None, 3)  # of the places, all over Δ: so many distances suffice
            self._t = shares(exponents(*at[:2], at.s[:, third]))
            self._areas = 3 * self._zones[1, third]

    def scored(self, *surfaces: FloatArray) -> list[Scored]:
        """Score by powers of bending and of its variation, of what is seen and of all."""
        flat = 1e-20  # of ∫ κ₁² + κ₂²: in a plane, where all scores are rounding
        (inside,) = bendings(self._inside, self._places.areas, surfaces)
        outside = zip(*bendings(self._outside, np.stack([self._zones[0], self._places.areas]), surfaces), strict=True)
        both = [[together([seen, each]) for each in others] for seen, others in zip(inside, outside, strict=True)]
        figures = np.array([(b.energy, b.variation, d.energy, d.variation) for b, d in both])
        bent, varied, _, nearer = figures.T
        logs = np.log(np.maximum([bent, varied, nearer], 1e-300))
        scores = np.where(bent > flat, [self._power, 1, 0.5] @ logs, -math.inf)
        return [Scored(*each) for each in zip(scores.tolist(), surfaces, inside, figures, strict=True)]

    def fairest(self) -> Iterator[Scored]:
        """Yield the surface with the best score, what it was made from, and others, which may fold where it does."""
        plane = np.column_stack([self._places.knots, np.zeros(len(self._places.knots))])
        second, third = forms(self._inside + self._outside, self._zones[0], plane, (2, 3))
        energies = [third + 30 / self._places.areas.sum() * second]
        (first,) = self.scored(self._least(energies[0]))
        # In the metric of a surface, and with what is not seen, too: it varies less at the boundary, and more inside.
        # The less weight bending has, the less curvature varies, and the more some patches bend.
        inside = forms(self._inside, self._places.areas, first.points, (2, 3))  # where places are seen, of both zones
        pairs = inside + forms(self._outside, self._zones, first.points, (2, 3))
        self._stiff = pairs[1, 1]
        weighed = (0, MOST_BENT), (1, 0), (1, 100), (1, MOST_BENT)
        energies += [pairs[k, 1] + factor / first.visible.area * pairs[k, 0] for k, factor in weighed]
        found = [first, *self.scored(*map(self._least, energies[1:]))]
        best = min(range(len(found)), key=lambda k: found[k].score)
        calm, made = self._calmed(energies[best], found[best])
        surfaces = [*([] if self._given else self._again(calm, made)), calm]
        yield from self._evened(energies[best], surfaces[0]) if self._given else self._led(surfaces[0])
        yield from surfaces
        yield from self.scored(self._least(energies[best], share=0.0))  # bounds of corners make some patches fold
        yield first
        yield from self.scored(self._least(energy_at(*self._places, "thin-plate")))  # it overshoots least

    def _evened(self, energy: FloatArray, one: Scored) -> list[Scored]:
        """Return a surface and where it is led; curvature inside edges is pulled to theirs as little as is enough."""
        rounds, most_bent, of_led = 5, 1.125, 0.2  # times the bending without a pull; share of the pull where it is led
        self._strips = self._strips_of(one.points)
        found, strength = list[tuple[float, float, list[Scored]]](), 0.0
        for _ in range(rounds):
            if strength:
                even = partial(self._even, strength * energy)
                (one,) = self.scored(self._least(energy, pull=even))
                one, _ = self._calmed(energy, one, even)
            surfaces = [*self._led(one, of_led * strength), one]
            best, bent = surfaces[0], float(surfaces[0].figures[0])
            rows, ways, wanted = self._even(None, best.points)
            uneven = float(np.abs(wanted - ((rows @ best.points) * ways).sum(axis=1)).max())
            if found and bent > most_bent * found[0][1]:
                break
            found.append((best.score + 4 * math.log(max(1.0, uneven)), bent, surfaces))
            if uneven <= 1:
                break
            strength = strength * min(max(2.0, uneven), 3.0) or min(0.1 * uneven, 1.0)
        return min(found, key=itemgetter(0))[2]

    def _strips_of(self, points: FloatArray) -> tuple[list[Block], FloatArray, float]:
        """Return places a hundredth inside edges of given curvature, κ₁ + κ₂ at these, and what differs too much."""
        patch = Patch(self._places.knots, points, log_weights=self._places.log_weights)
        pairs = [hundredth_inside(patch, k, row.curve, 24) for k, row in self._given.items()]
        places = np.concatenate(pairs, axis=1)
        inside, on_edges = -2 * patch.curvature(places, "linear").mean
        none = 0.08  # difference of curvature, of the largest
        largest = [np.abs(row.bend).max() for row in self._given.values()]
        largest += [np.abs(on_edges).max() / 2, np.abs(inside).max() / 10]  # of planes and cylinders
        s = MomentMap(*self._places[:2]).inverse(places[0], 1e-10)
        return list(blocks(*self._places[:2], s)), on_edges, none * float(max(largest)) or 1.0

    def _even(self, energy: FloatArray | None, points: FloatArray) -> Sequence[FloatArray]:
        """Return rows, ways and what they should be, for κ₁ + κ₂ inside edges to be as at these; squares as energy."""
        places, wanted, much = self._strips
        rows, ways = np.zeros((len(wanted), len(points))), np.zeros((len(wanted), 3))
        for block in places:
            own = frame(block, points)
            for part, near, table in block.tables(own.orders[1][0][3:] + own.orders[1][2][3:]):
                rows[np.ix_(block.places[part], near)] = table.T
            ways[block.places] = own.axes[0].T
        stiffness = 1 / much if energy is None else np.sqrt(_value(energy, points) / len(wanted)) / much
        return rows * stiffness, ways, wanted * stiffness

    def _again(self, one: Scored, made: Any, rounds: int = 3) -> list[Scored]:
        """Return what is fairest in a sharp surface's metric, or in that one's and so on; none if a figure rises."""
        sharp, wild, gain = 4.0, 30.0, 0.01  # a sphere's curvature; bending of metrics that lead astray; of the score
        bent = one.visible
        if not rounds or bent.curvature * math.sqrt(bent.area / (4 * math.pi)) < sharp or bent.energy > wild:
            return []
        second, third = forms(self._inside + self._outside, self._zones[1], one.points, (2, 3))
        (found,) = self.scored(made(third + MOST_BENT / bent.area * second))
        found = found._replace(score=found.score + self._excess(found.points)[1])
        if found.score > one.score - gain or (found.figures > one.figures).any():
            return []
        return self._again(found, made, rounds - 1) or [found]

    def _calmed(self, energy: FloatArray, one: Scored, also: Any = None) -> tuple[Scored, Any]:
        """Return a surface, or a pulled one whose rows cross edges more at corners, and what made it of an energy."""
        # Factors of shares, and pulls, of the energy's value: three more for what is curved, and gains by pulls
        steps = (1.0, 0.03), (1.4, 0.03), (1.4, 0.1), (2.0, 0.1), (2.0, 0.3), (2.0, 1.0), (2.0, 3.0)
        made: Any = self._least
        beyond, calmer = np.zeros(len(self._domain.vertices), dtype=np.bool_), list[tuple[Scored, Any]]()
        for step in (*steps, None):
            curved, excess = self._excess(one.points)
            beyond = beyond | (curved > 1)
            calmer.append((one._replace(score=one.score + excess), made))
            is_calm = len(calmer) > 4 and curved.max() <= 1 / 1.5
            no_better = len(calmer) > 2 and calmer[-1][0].score > calmer[-2][0].score
            if step is None or not beyond.any() or curved.max() > BROKEN or is_calm or no_better:
                break
            pull = partial(self._pull, beyond, step[1] * energy, also)
            made = partial(self._least, share=CROSSING * np.where(beyond, step[0], 1), pull=pull)
            (one,) = self.scored(made(energy))
        return min(calmer, key=lambda each: each[0].score)

    def _excess(self, points: FloatArray) -> tuple[FloatArray, float]:
        """Return (r,) curvatures near corners, of those that count as none, and what the largest adds to scores."""
        layers = self._layers(points, range(len(self._domain.vertices)))
        curved = np.nan_to_num([near.curvatures.max() * near.edge for near in layers]) / self._most
        return curved, 8 * math.log(max(1.0, float(curved.max())))

    def _layers(self, points: FloatArray, corners: Iterable[int], tables: bool = False) -> list[CornerLayer]:
        """Return places near corners."""
        rates = 6 * np.sinh(np.linspace(-2, 2, 25)) / np.sinh(2)  # it peaks beside edges, too, and from .03 to .1 away
        fan = np.stack(np.meshgrid(rates, -math.log(10) * np.array([1, 1.25, 1.5, 2, 3, 4, 5, 6])))
        return [corner_layer(self._domain, self._places.log_weights, points, each, fan, tables) for each in corners]

    def _pull(self, beyond: BoolArray, energy: FloatArray, also: Any, points: FloatArray) -> Sequence[FloatArray]:
        """Return rows, ways and zeros that pull curvature near corners to 0: the more there is, the more, by κ⁴."""
        corners = np.flatnonzero(beyond).tolist()
        value, parts = _value(energy, points), [also(points)] if also else []
        for near, most in zip(self._layers(points, corners, tables=True), self._most[corners].tolist(), strict=True):
            quiet = most / 1.5  # squares have the energy's value; half of the places
            each = np.flatnonzero(near.curvatures * near.edge <= BROKEN * most)[::2]
            curved = near.curvatures[each] * near.edge / quiet
            stiffness = np.sqrt(value / len(curved)) * np.maximum(curved, 1e-3) * near.edge / quiet
            rows = (near.table[each] * stiffness[:, None, None]).reshape(-1, len(points))
            parts.append((rows, np.repeat(near.normals[each], 3, axis=0), np.zeros(len(rows))))
        return [np.concatenate(part) for part in zip(*parts, strict=True)]

    def _led(self, one: Scored, strength: float = 0.0) -> list[Scored]:
        """Return the surface moved smoothly onto one that is known and bends more; none if it ends elsewhere."""
        rounds, stiffness, worst = 3, 1e-8, math.log(2)  # beyond the fairest's score: it ends elsewhere if it has more
        if (ways := self._known) is None:
            return []
        t, led = self._t, one.points
        form = (weighted := t * np.sqrt(self._areas)) @ weighted.T + stiffness * self._stiff
        even = partial(self._even, strength * stiffness * self._stiff) if strength else None
        for _ in range(rounds):
            origin = led + np.linalg.solve(form, (t * self._areas) @ ways(t.T @ led))
            led = self._least(form, origin=origin, pull=even)
        farther = np.abs([ways(t.T @ each) for each in (led, one.points)]).max(axis=(1, 2))
        (found,) = self.scored(led)
        return [found] if farther[0] < farther[1] and found.score <= one.score + worst else []


def _value(energy: FloatArray, points: FloatArray) -> float:
    """Return the energy, or 0 where rounding of what cancels is larger."""
    return max(float(np.vdot(points, energy @ points)), 0.0)
