"""Pointed cones {x: <row, x> >= 0}: their extreme rays by double description, and their faces."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import product
from typing import TypeAlias

Vector: TypeAlias = list[int] | list[float]  # whole numbers are computed with exactly

Bits: TypeAlias = int  # a set of small numbers: of the rows that are 0 on a ray, or of the rays of a face


def extreme_rays(rows: Sequence[Vector], size: int, rounding: float) -> list[Vector]:
    """Return the extreme rays of the cone of vectors x with <row, x> ≥ 0 for all rows, once each, largest entry 1.

    The rows span the space, so that the cone holds no line. Whole rows have rays that are whole and have no common
    divisor; a product of others, with largest entries 1, is 0 within `rounding`.
    """
    on = partial(product_of, rounding=rounding)
    lines: list[Vector] = [[int(i == k) for i in range(size)] for k in range(size)]
    rays: list[tuple[Vector, Bits]] = []  # with the rows so far that are 0 on it
    for number, row in enumerate(rows):
        here = 1 << number
        line = max(lines, key=lambda x: abs(on(row, x)), default=None)
        rise = on(row, line) if line else 0
        if line and rise:
            # All of the cone so far is moved along a line into the plane of the row, which bounds one half of the line.
            lines = [_combined(rise, x, -on(row, x), line) for x in lines if x is not line]
            rays = [(_signed(rise, _combined(rise, x, -on(row, x), line)), zeros | here) for x, zeros in rays]
            rays.append((_signed(rise, line), here - 1))
        else:
            rays = _cut(rays, [on(row, x) for x, _ in rays], here, size - len(lines) - 2)
    return [x for x, _ in rays]


def _cut(rays: list[tuple[Vector, Bits]], drops: list[float], here: Bits, least: int) -> list[tuple[Vector, Bits]]:
    """Return the rays of a cone that are not below the plane of a row, and a ray in it between neighbours across it.

    Neighbours are 0 on the same rows, at least so many, as no third ray.
    """
    pairs = list(zip(rays, drops, strict=True))
    kept = [(x, zeros if drop else zeros | here) for (x, zeros), drop in pairs if drop >= 0]
    above, below = ([(*ray, drop) for ray, drop in pairs if sign * drop > 0] for sign in (1, -1))
    for (x, x_zeros, up), (y, y_zeros, down) in product(above, below):
        common = x_zeros & y_zeros
        if common.bit_count() >= least and sum(zeros & common == common for _, zeros in rays) == 2:
            kept.append((_combined(up, y, -down, x), common | here))
    return kept


def product_of(a: Vector, b: Vector, rounding: float) -> float:
    """Return the scalar product, or 0 if it is rounding."""
    total = sum(x * y for x, y in zip(a, b, strict=True))
    return 0 if abs(total) <= rounding and isinstance(total, float) else total


def without_divisor(vector: Vector) -> Vector:
    """Scale a vector but for 0: a whole one to no common divisor, any other to a largest entry of 1."""
    if all(isinstance(x, int) for x in vector):
        divisor = math.gcd(*vector) or 1
        return [x // divisor for x in vector]
    largest = max(map(abs, vector)) or 1.0
    return [x / largest for x in vector]


def _combined(a: float, x: Vector, b: float, y: Vector) -> Vector:
    return without_divisor([a * s + b * t for s, t in zip(x, y, strict=True)])


def _signed(sign: float, x: Vector) -> Vector:
    return x if sign > 0 else [-s for s in x]


def maximal(sets: Iterable[Bits]) -> list[Bits]:
    """Return the sets that are not part of others, once each."""
    found: list[Bits] = []
    for candidate in sorted(set(sets), key=lambda x: (-x.bit_count(), x)):
        if not any(candidate & larger == candidate for larger in found):
            found.append(candidate)
    return found


def members(bits: Bits) -> Iterator[int]:
    """Yield the numbers in a set, ascending."""
    while bits:
        lowest = bits & -bits
        yield lowest.bit_length() - 1
        bits ^= lowest
