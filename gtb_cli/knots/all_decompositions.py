"""All regular decompositions of knots: a walk through the secondary fan, from triangulation to triangulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, read_only
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.knots.polyhedral_cones import Bits, Vector, extreme_rays, maximal, members, product_of, without_divisor
from gtb_cli.knots.upper_faces import Simplex, lifted_knots
from gtb_cli.values import by_value, grouped

TOO_NEAR = "knots are too near to each other, beside their distances from others"

Cells: TypeAlias = tuple[tuple[int, ...], ...]


@by_value
class LiftingCone:
    """All liftings that induce one regular decomposition. Made by `regular_decompositions`.

    Attributes
    ----------
    cells : tuple of tuple of int
        All knots of each cell, ascending; cells in lexicographic order.
    absent : tuple of int
        Knots that do not belong to any cell, ascending.
    lifting : (n,) float
        A lifting inside the cone. If d facets bound the cone modulo affine liftings of dimension d, the drops at all of
        them are equal: a drop is the height of a cell's plane above a lifted knot beyond its border.
    dimension : int
        The dimension of the cone: n for a triangulation, d + 1 if the liftings are all affine.
    flips : tuple of Cells
        For a triangulation, the cells of the regular triangulations that share a facet of the cone; otherwise empty.
    """

    cells: Cells
    absent: tuple[int, ...]
    lifting: FloatArray
    dimension: int
    flips: tuple[Cells, ...]

    def __repr__(self) -> str:
        return f"<LiftingCone: {len(self.cells)} cells, {self.used} knots, dimension {self.dimension}>"

    @property
    def used(self) -> int:
        """The number of knots that belong to a cell."""
        return len(self.lifting) - len(self.absent)


def regular_decompositions(knots: ArrayLike, triangulations: bool = False) -> Iterator[LiftingCone]:
    """Yield every regular decomposition of knots once, in the order of a walk along flips.

    Liftings that induce the same decomposition form a cone, and the cones form a complete fan. Its cones of full
    dimension belong to triangulations, which use some of the knots; all others are their faces (Gelfand, Kapranov and
    Zelevinsky 1994, chapter 7). With `triangulations`, these alone are yielded.

    Knots are (n, d), d = 1 or 2, or (n,) for d = 1, in any order; of repeated ones, a triangulation uses one at most.
    `DomainError` is raised as by `regular_decomposition`, and `ToleranceError` where a lifting does not induce its
    decomposition, or some are missing: knots are too near to each other.

    Knots that are multiples of 2^-32 of the largest (integers, say) are decided exactly, in integers. For others,
    knots are equal or collinear as for `regular_decomposition`, and a lifting within 100 times that tolerance of a
    facet lies on it.
    Of real knots that are nearer to each other than a hundredth of the hull's size, cones may be too thin for floats.
    So each lifting is tried, and in the end, without `triangulations`, Euler's relation: the numbers of cones of each
    dimension of a complete fan, with alternating signs, add up to 1. With `triangulations`, some may be missing.
    Memory grows with the number of decompositions yielded, and time in proportion to it: the 387 triangulations of
    3 × 3 knots take about a second. Their number grows exponentially with n.
    """
    walk = _Walk(knots)
    todo = [walk.start()]
    reached, seen, sum_of_signs = set(todo), set[frozenset[int]](), 0
    while todo:
        chamber = _Chamber(walk, todo.pop())
        reached.update(fresh := [cells for cells in chamber.flips if cells not in reached])
        todo += fresh
        faces = [(chamber.whole, walk.n)]
        for face, dimension in faces:
            sum_of_signs += (-1) ** (walk.n - dimension)
            yield chamber.cone(face, dimension)
            for smaller in maximal({face & facet for facet in chamber.facets} - {face}) if not triangulations else ():
                name = frozenset(chamber.names[ray] for ray in members(smaller))
                if name not in seen:
                    seen.add(name)
                    faces.append((smaller, dimension - 1))
    if not triangulations and sum_of_signs != 1:
        raise ToleranceError(f"knots: some decompositions are missing, as {TOO_NEAR}")


class _Circuit(NamedTuple):
    """The least affine dependence of knots with a drop: the height of a simplex's plane above a lifted knot."""

    knots: frozenset[int]
    below: frozenset[int]  # the knots that are not in all simplices of the circuit now: the drop falls if they rise
    row: Vector  # coefficients of the lifting, without the knots at which liftings of the walk are 0
    unit: float  # of the row, in units of the drop


class _Walk:
    """Knots, and what all their triangulations have in common."""

    def __init__(self, knots: ArrayLike) -> None:
        lifted = lifted_knots(knots, np.zeros(len(np.atleast_1d(knots))))
        self.points, self.n, self.d = lifted.points, len(lifted.points), lifted.dimension
        self.is_exact = not any(lifted.rounding)
        self._at = [lifted.exact[place][: self.d] for place in lifted.places]
        self._size = max(max(column) - min(column) for column in zip(*self._at, strict=True))
        self._tolerance = lifted.tolerance / (self._size / (1 << lifted.bits))
        self.rounding = 100 * self._tolerance  # sums of products of coordinates are as much less certain
        self.numbers: dict[Cells, int] = {}  # of the rays' decompositions
        self.volume, self.circuit = cache(self._volume), cache(self._circuit)
        base = max(combinations(range(self.n), self.d + 1), key=lambda knots: abs(self.volume(knots)))
        self.free = [i for i in range(self.n) if i not in base]

    def start(self) -> Cells:
        """Return a regular triangulation."""
        random = np.random.default_rng(0)
        while True:
            cells = regular_decomposition(self.points, random.random(self.n)).cells
            if all(len(cell) == self.d + 1 for cell in cells):
                return cells

    def _volume(self, knots: Simplex) -> float:
        """Return the determinant of d + 1 knots: 0 if they are collinear, or equal, within the tolerance."""
        if self.d == 1:
            (a,), (b,) = (self._at[i] for i in knots)
            return b - a if self.is_exact else (b - a) / self._size
        (ax, ay), (bx, by), (cx, cy) = (self._at[i] for i in knots)
        volume = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        width, height = max(ax, bx, cx) - min(ax, bx, cx), max(ay, by, cy) - min(ay, by, cy)
        if abs(volume) / self._size**2 <= 2 * self._tolerance * math.hypot(width / self._size, height / self._size):
            return 0
        return volume if self.is_exact else volume / self._size**2

    def _circuit(self, simplex: Simplex, knot: int) -> _Circuit:
        whole = self.volume(simplex)
        sign = 1 if whole > 0 else -1
        shares = {i: sign * self.volume(tuple(knot if j == i else j for j in simplex)) for i in simplex}
        shares[knot] = -abs(whole)
        full = without_divisor([shares.get(i, 0) for i in range(self.n)])
        knots = frozenset(i for i, share in shares.items() if share)
        below = frozenset(i for i in knots if shares[i] < 0)
        return _Circuit(knots, below, [full[i] for i in self.free], -min(full))


class _Chamber:
    """The liftings that induce one triangulation, as a cone: facets, and names of rays that all chambers share."""

    def __init__(self, walk: _Walk, cells: Cells) -> None:
        self._walk, self._cells = walk, cells
        conditions = grouped((condition[1].knots, condition) for condition in self._conditions()).values()
        self._joints = [[joint for joint, _ in each] for each in conditions]
        self._circuits = [each[0][1] for each in conditions]
        rows = [circuit.row for circuit in self._circuits]
        self._rays = extreme_rays(rows, len(walk.free), walk.rounding)
        self._drops = [[product_of(row, ray, walk.rounding) for row in rows] for ray in self._rays]
        on = [sum(1 << k for k, drops in enumerate(self._drops) if not drops[i]) for i in range(len(rows))]
        self.whole: Bits = (1 << len(self._rays)) - 1
        self.facets = maximal(on)
        self.flips = tuple(sorted(self._flipped(self._circuits[on.index(facet)]) for facet in self.facets))
        self.names = [walk.numbers.setdefault(self._joined(1 << k), len(walk.numbers)) for k in range(len(self._rays))]

    def _conditions(self) -> Iterator[tuple[tuple[int, int, int], _Circuit]]:
        """Yield what bounds the chamber: a simplex, by number, and a knot that stays below its plane.

        A third number is the simplex of that knot, beside the first, or the first itself for a knot that is in none.
        """
        circuit, used = self._walk.circuit, {i for cell in self._cells for i in cell}
        beside: dict[Simplex, tuple[int, int]] = {}  # the first simplex at a side, and its opposite knot
        for number, simplex in enumerate(self._cells):
            for i in simplex:
                side = tuple(j for j in simplex if j != i)
                if side in beside:
                    other, knot = beside[side]
                    yield (number, knot, other), circuit(simplex, knot)
                beside[side] = number, i
            for knot in range(self._walk.n):
                if knot not in used and (found := circuit(simplex, knot)).below == {knot}:
                    yield (number, knot, number), found

    def _flipped(self, circuit: _Circuit) -> Cells:
        old = [circuit.knots - {i} for i in circuit.below]
        new = [circuit.knots - {i} for i in circuit.knots - circuit.below]
        links = {frozenset(cell) - part for cell in self._cells for part in old if part.issubset(cell)}
        kept = [cell for cell in self._cells if not any(part.issubset(cell) for part in old)]
        return tuple(sorted([*kept, *(tuple(sorted(part | link)) for part in new for link in links)]))

    def _joined(self, face: Bits) -> Cells:
        """Return the cells of liftings inside a face."""
        group = list(range(len(self._cells)))
        flat = [row for row in range(len(self._joints)) if not any(self._drops[ray][row] for ray in members(face))]
        joints = [joint for row in flat for joint in self._joints[row]]
        for number, _, other in joints:
            a, b = group[number], group[other]
            group = [a if x == b else x for x in group]
        inner = [(group[number], (knot,)) for number, knot, _ in joints]
        parts = grouped([*zip(group, self._cells, strict=True), *inner]).values()
        return tuple(sorted(tuple(sorted(set().union(*cells))) for cells in parts))

    def cone(self, face: Bits, dimension: int) -> LiftingCone:
        """Return the cone of a face; its lifting adds up the rays, each so long that its largest drop is 1."""
        walk, rays = self._walk, list(members(face))
        number = Fraction if walk.is_exact else float
        units = [number(circuit.unit) for circuit in self._circuits]
        largest = [max(number(drop) / unit for drop, unit in zip(self._drops[ray], units, strict=True)) for ray in rays]
        scale = math.lcm(*(drop.numerator for drop in largest if isinstance(drop, Fraction)))
        lengths = [int(scale / drop) if walk.is_exact else float(1 / drop) for drop in largest]
        parts = [(length, self._rays[ray]) for length, ray in zip(lengths, rays, strict=True)]
        inner = without_divisor([sum(length * ray[k] for length, ray in parts) for k in range(len(walk.free))])
        lifting = np.zeros(walk.n)
        lifting[walk.free] = inner
        cells = self._joined(face)
        is_certain = walk.is_exact and lifting[walk.free].tolist() == inner
        if not is_certain and regular_decomposition(walk.points, lifting).cells != cells:
            raise ToleranceError(f"knots: the lifting for {cells} does not induce them, as {TOO_NEAR}")
        absent = tuple(sorted(set(range(walk.n)).difference(*cells)))
        return LiftingCone(cells, absent, read_only(lifting), dimension, self.flips if face == self.whole else ())
