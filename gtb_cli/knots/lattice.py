"""Lattices of knots, and the coefficients that make a patch on them a classical Bézier patch."""

import math
from collections.abc import Iterator
from itertools import islice, product
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray, distinct, read_only
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.values import frozen, grouped

LATTICE_TOLERANCE = 1e-6  # of a step, by which knots may be off their lattice: thirds typed with seven digits pass
MAX_BINOMIAL_DEGREE = 1029  # largest degree whose binomial coefficients are all floats


@frozen
class Direction:
    """A direction of a lattice: the only one of a segment or triangle, or one of the two of a parallelogram."""

    degree: int
    shares: FloatArray  # (n, e) barycentric coordinates of the knots in a segment (e = 2) or triangle (e = 3)
    steps: FloatArray  # (e − 1, d) from a knot to its neighbours towards the other corners

    @property
    def places(self) -> IntArray:
        """Whole numbers i with sum k, (n, e), such that the knots have the barycentric coordinates i/k."""
        return np.rint(self.degree * self.shares).astype(np.int64)

    @property
    def offsets(self) -> FloatArray:
        """Distance of each knot from the lattice, (n,), in steps."""
        scaled = self.degree * self.shares
        return np.asarray(np.abs(scaled - np.rint(scaled)).max(axis=1))


def lattice_of(domain: Domain) -> tuple[Direction, ...] | None:
    """Find the directions of a lattice: one for a curve or triangle, two, along edges 0 and 3, for a parallelogram.

    None if the knots are not all points of such a lattice, each once, within `LATTICE_TOLERANCE`. See the remarks after
    Def. 2.1 and Def. 2.2.
    """
    return None if lattice_fault(domain) else _directions(domain)


def binomial_coefficients(domain: Domain) -> FloatArray:
    """Return the (n,) coefficients that make a patch on a lattice a classical Bézier curve, triangle or tensor product.

    ``k!/∏ i_j!`` if the knots are all ``(i_0, …, i_d)/k`` in barycentric coordinates of a segment or triangle; ``C(k,
    i) C(l, j)`` if they are all ``(i/k, j/l)`` of a parallelogram, in any order (the remarks after Def. 2.1 and Def.
    2.2). On any other polygon C(k, i) along each edge, so that this is a Bézier curve, and 1 inside, as in ``.trp``
    files. Raises `DomainError` for a curve, triangle or parallelogram without a lattice (see `lattice_of`), for edges
    whose knots are not equally spaced, and for coefficients beyond the range of floats.
    """
    directions = _directions(domain)
    if not directions:
        coefficients = np.ones(len(domain.knots))
        for edge, (members, fractions, _) in enumerate(domain.edge_fractions):
            degree = _representable(len(members) - 1)
            if np.abs(degree * fractions - np.arange(degree + 1)).max() > LATTICE_TOLERANCE:
                places = " ".join(f"{fraction:.4g}" for fraction in fractions[:8])
                found = f"those of edge {edge} are at {places}{' ...' * (len(members) > 8)} of it"
                raise DomainError(f"coefficients: binomial needs equally spaced knots along each edge, {found}")
            coefficients[members] = [math.comb(degree, k) for k in range(degree + 1)]
        return read_only(coefficients)
    if fault := lattice_fault(domain):
        raise DomainError(f"coefficients: binomial needs {fault}")
    degree = _representable(max(direction.degree for direction in directions))
    values = [1] * len(domain.knots)
    for direction in directions:
        for knot, row in enumerate(direction.places.tolist()):
            values[knot] *= math.factorial(direction.degree) // math.prod(map(math.factorial, row))
    try:
        return read_only([float(value) for value in values])
    except OverflowError:
        raise DomainError(f"coefficients: binomial of degree {degree} is beyond the range of floats") from None


def _representable(degree: int) -> int:
    if degree > MAX_BINOMIAL_DEGREE:
        raise DomainError(f"coefficients: binomial goes up to degree {MAX_BINOMIAL_DEGREE}, got {degree}")
    return degree


def _directions(domain: Domain) -> tuple[Direction, ...]:
    """Return the directions that a lattice with this shape and number of knots would have; none for other shapes."""
    v, n = domain.vertices, len(domain.knots)
    # An edge function divided by its maximum is the share of the opposite corner or edge.
    shares = domain.heights / domain.heights.max(axis=0)
    if len(v) == 2:
        return (Direction(n - 1, shares[:, [1, 0]], (v[1:] - v[0]) / (n - 1)),)
    knots_on = domain.incidence.sum(axis=0).tolist()  # each edge: where one is missing, another edge tells how many
    if len(v) == 3:
        degree = max(knots_on) - 1
        return (Direction(degree, shares[:, [1, 2, 0]], (v[1:] - v[0]) / degree),)
    if len(v) > 4 or np.abs(shares[:, :2] + shares[:, 2:] - 1).max() > LATTICE_TOLERANCE:
        return ()
    along, across = (max(knots_on[edge], knots_on[edge + 2]) - 1 for edge in (0, 1))
    return (
        Direction(along, shares[:, [1, 3]], (v[1] - v[0])[None] / along),
        Direction(across, shares[:, [2, 0]], (v[3] - v[0])[None] / across),
    )


def lattice_fault(domain: Domain) -> str:
    """Say what is missing for a lattice; empty if nothing is."""
    n, directions = len(domain.knots), _directions(domain)
    if not directions:
        return f"a curve, triangle or parallelogram, got {len(domain.vertices)} edges"
    for direction in directions:
        if direction.offsets.max() > LATTICE_TOLERANCE:
            if repeat := _repeat(domain.knots):
                return f"each lattice knot once: {repeat}"
            return f"equally spaced knots, knots[{int(direction.offsets.argmax())}] is off"
    # A row of e shares counts the points of its simplex: C(degree + e − 1, e − 1).
    expected = math.prod(math.comb(d.degree + len(d.steps), len(d.steps)) for d in directions)
    places = np.column_stack([direction.places for direction in directions])
    if n == expected and len(distinct(places)) == n:
        return ""
    once = f"each of {expected} lattice knots once, got {n} knots"
    if repeat := _repeat(places):
        return f"{once}: {repeat}"
    found = {*map(tuple, places.tolist())}
    rows = (islice(_points(d.degree, len(d.steps) + 1), n + 1) for d in directions)
    missing = next(place for parts in product(*rows) if (place := sum(parts, ())) not in found)
    steps = np.concatenate([np.vstack([np.zeros(domain.knots[:1].shape), d.steps]) for d in directions])
    knot = domain.vertices[0] + np.array(missing) @ steps
    return f"{once} without ({', '.join(f'{x:.6g}' for x in knot)})"


def repeated(rows: NDArray[Any]) -> tuple[tuple[int, ...], ...]:
    """Return groups of indices of equal rows, ascending, in the order of the first of each."""
    groups = grouped((tuple(row), index) for index, row in enumerate(rows.tolist()))
    return tuple(tuple(group) for group in groups.values() if len(group) > 1)


def _repeat(rows: NDArray[Any]) -> str:
    """Name the first row that repeats an earlier one, as knots; empty if none does."""
    first, again = min((group[:2] for group in repeated(rows)), key=itemgetter(1), default=(0, 0))
    return f"knots[{again}] repeats knots[{first}]" if again else ""


def _points(degree: int, width: int) -> Iterator[tuple[int, ...]]:
    """Yield all rows of whole numbers from 0 that add up to the degree."""
    starts = product(range(degree, -1, -1), repeat=width - 1)
    return ((*start, degree - sum(start)) for start in starts if sum(start) <= degree)
