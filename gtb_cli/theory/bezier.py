"""Coefficients with which a lattice patch is a classical Bézier patch."""

from __future__ import annotations

import math

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, read_only
from gtb_cli.errors import DomainError
from gtb_cli.theory.domain import Domain

LATTICE_TOLERANCE = 1e-6
"""Fraction of a step by which knots may be off their lattice: thirds typed with seven digits pass."""

MAX_DEGREE = 1029
"""Largest degree whose binomial coefficients are all floats."""


def binomial_coefficients(domain: Domain) -> FloatArray:
    """Return the coefficients that make a lattice patch a classical Bézier curve, triangle or tensor product.

    ``k!/∏ i_j!`` where the knots are all ``(i_0, …, i_d)/k`` in barycentric coordinates of a segment or triangle;
    ``C(k, i) C(l, j)`` where they are all ``(i/k, j/l)`` of a rectangle or any other parallelogram.

    Parameters
    ----------
    domain : Domain
        Its knots in any order, at any place and scale.

    Returns
    -------
    (n,) float

    Raises
    ------
    DomainError
        The knots are not all points of such a lattice, each once, within `LATTICE_TOLERANCE`; or the coefficients
        are beyond the range of floats.

    References
    ----------
    The remarks after Def. 2.1 and Def. 2.2.
    """
    knots, edges = domain.heights.shape
    shares = domain.heights / domain.heights.max(axis=0)
    if edges == domain.dimension + 1:
        degree = knots - 1 if edges == 2 else (math.isqrt(8 * knots + 1) - 3) // 2
        directions = [(degree, shares)]
        expected = math.comb(degree + edges - 1, edges - 1)
    elif edges == 4 and np.abs(shares[:, :2] + shares[:, 2:] - 1).max() <= LATTICE_TOLERANCE:
        # Heights over edge 0 grow along edge 1, those over edge 3 along edge 0.
        across, along = (int(domain.incidence[:, edge].sum()) - 1 for edge in (1, 0))
        directions = [(across, shares[:, [0, 2]]), (along, shares[:, [3, 1]])]
        expected = (across + 1) * (along + 1)
    else:
        raise DomainError(f"coefficients: binomial needs a curve, triangle or parallelogram, got {edges} edges")

    values = [1] * knots
    places: list[IntArray] = []
    for degree, part in directions:
        place = np.rint(degree * part)
        off = np.abs(degree * part - place).max(axis=1)
        if off.max() > LATTICE_TOLERANCE:
            raise DomainError(f"coefficients: binomial needs equally spaced knots, knots[{int(off.argmax())}] is off")
        if degree > MAX_DEGREE:
            raise DomainError(f"coefficients: binomial goes up to degree {MAX_DEGREE}, got {degree}")
        places.append(place.astype(np.int64))
        values = [value * _multinomial(row) for value, row in zip(values, places[-1].tolist(), strict=True)]
    if knots != expected or len(np.unique(np.column_stack(places), axis=0)) < knots:
        raise DomainError(f"coefficients: binomial needs each of {expected} lattice knots once, got {knots} knots")
    try:
        return read_only([float(value) for value in values])
    except OverflowError:
        raise DomainError(f"coefficients: binomial of degree {degree} is beyond the range of floats") from None


def _multinomial(index: list[int]) -> int:
    value, left = 1, sum(index)
    for part in index:
        value *= math.comb(left, part)
        left -= part
    return value
