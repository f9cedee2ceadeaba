"""Derivatives of functions on a surface in its own metric, and integrals of their squares.

T of a knot is W / ΣW with W = c ω e^<a, s>, so that its derivatives in s are T times polynomials of its coordinates:
sums over knots, and tables for all of them, are products of matrices with the powers of these.

At each place we take linear combinations of the torus coordinates in which the metric g is the identity. With Γ^d_ab =
⟨P_d, P_ab⟩ a function f on the surface has second and, symmetrised, third derivatives

    ``f_;ab = f_ab − Γ^d_ab f_d``,    ``f_;abc = f_abc − 3 Γ^d_(ab f_;c)d − ⟨P_d, P_abc⟩ f_d``.

For f = P they are II_ab N and (∇II)_abc N, so that ``∫ |P_;ab|² = ∫ κ₁² + κ₂²`` and ``∫ |P_;abc|² = ∫ |∇II|²``; with
the metric of a surface that is known, they are quadratic forms of the control points of the next (G. Greiner,
Variational design and fairing of spline surfaces, 1994).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, distinct
from gtb_cli.knots.domain import domain
from gtb_cli.moment.torus import exponents, shares


class Block(NamedTuple):
    """Some of the places, in parts: a slice, k knots with shares there, (k, m) T and (k, 10) powers 1, x, y, …, yyy."""

    places: IntArray
    parts: list[tuple[slice, IntArray, FloatArray, FloatArray]]

    def among(self, members: IntArray) -> "Block":
        """Return what is left of some knots, known by their numbers among these."""
        kept = []
        for part, near, t, powers in self.parts:
            own, numbers = np.nonzero(near[:, None] == members)
            kept.append((part, numbers, t[own], powers[own]))
        return Block(self.places, kept)

    def sums(self, values: FloatArray) -> FloatArray:
        """Return sums over all knots of T times powers times (n, …) values: (10, …, m)."""
        flat = values.reshape(len(values), 1, -1)
        found = [(p[:, :, None] * flat[near]).reshape(len(p), -1).T @ t for _, near, t, p in self.parts]
        return np.concatenate(found, axis=1).reshape(10, *values.shape[1:], -1)

    def tables(self, factors: FloatArray) -> Iterator[tuple[slice, IntArray, FloatArray]]:
        """Yield, for each part and its knots, T times polynomials with (10, …, m) factors of the powers: (k, … · m)."""
        for part, near, t, powers in self.parts:
            found = (powers @ factors[..., part].reshape(10, -1)).reshape(len(t), -1, t.shape[1])
            found *= t[:, None]
            yield part, near, found.reshape(len(t), *factors.shape[1:-1], -1)

    def add_form(self, matrix: FloatArray, rates: Sequence[FloatArray]) -> None:
        """Add the squares of a symmetric tensor, with (10, m) factors in its components, to an (n, n) matrix."""
        factors = [rate * math.sqrt(math.comb(len(rates) - 1, k)) for k, rate in enumerate(rates)]
        for _, near, table in self.tables(np.stack(factors, axis=1)):
            square = (flat := table.reshape(len(table), -1)) @ flat.T
            matrix[... if np.array_equal(near, np.arange(len(matrix))) else np.ix_(near, near)] += square


def blocks(
    knots: FloatArray, log_weights: FloatArray, s: FloatArray, members: IntArray | slice = slice(None)
) -> Iterator[Block]:
    """Yield T at all of (2, m) torus coordinates, or at some members, block by block.

    The coordinates of powers are those along and across the nearest edge from its nearer end, where most shares and
    coordinates are small: differences of sums would lose digits elsewhere.
    """
    length, most = 2048, 1024  # of blocks, and of parts: up to four tables of these are alive at once
    nothing = 1e-20  # shares of knots that are left out: near a corner, third derivatives are of the order of 1e-9
    vertices = domain(knots, "unit").vertices
    sides, heights = np.roll(vertices, -1, axis=0) - vertices, vertices @ s
    near = len(sides) * (heights + np.roll(heights, -1, axis=0)).argmax(axis=0) + heights.argmax(axis=0)
    powers = {}
    for number in distinct(near).tolist():
        k, end = divmod(number, len(sides))
        way = sides[k] / np.hypot(*sides[k])
        x, y = np.array([way, [-way[1], way[0]]]) @ (knots - vertices[end]).T
        powers[number] = np.stack([x**0, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], axis=1)
    order = np.arange(len(near))[members]
    order = order[np.argsort(near[order], kind="stable")]
    for places in np.split(order, range(length, len(order), length)):
        cuts = [0, *(np.flatnonzero(np.diff(near[places])) + 1).tolist(), len(places)]
        parts = [slice(i, min(i + most, end)) for start, end in pairwise(cuts) for i in range(start, end, most)]
        t, own = shares(exponents(knots, log_weights, s[:, places])), []
        for part in parts:
            there = np.flatnonzero(t[:, part].max(axis=1) > nothing)
            own.append((part, there, t[there, part], powers[int(near[places[part.start]])][there]))
        yield Block(places, own)


class SurfaceFrame(NamedTuple):
    """A surface P at m places, in coordinates X = a x and Y = b x + c y whose metric is the identity.

    `axes` are its (3, m) unit vectors N, P_X and P_Y. `orders` have f_a, f_;ab and f_;abc, by the number of Y: (3, m)
    of P and then, of T, (10, m) factors of the powers. `space` is the area per area of the domain.
    """

    axes: tuple[FloatArray, FloatArray, FloatArray]
    orders: tuple[list[FloatArray], list[FloatArray], list[FloatArray]]
    space: FloatArray

    def normal_parts(self, order: int) -> list[FloatArray]:
        """Return II_ab for order 2, and (∇II)_abc for 3."""
        return [(rate[:3] * self.axes[0]).sum(axis=0) for rate in self.orders[order - 1]]


def frame(block: Block, points: FloatArray) -> SurfaceFrame:
    """Return the surface of (n, 3) control points, or several, without T, of (n, 3, c)."""
    sums, raw = block.sums(np.ones(len(points))), block.sums(points)
    if points.ndim == 2:
        raw = np.concatenate([raw, np.broadcast_to(np.eye(10)[:, :, None], (10, 10, raw.shape[-1]))], axis=1)
    # Derivatives of a quotient whose denominator is 1
    (p, *rates), (_, *means) = list(raw), list(sums)
    one = _less(rates[:2], _product(means[:2], [p]))
    two = _less(rates[2:5], _product(means[2:5], [p]), _product(means[:2], one))
    three = _less(rates[5:], _product(means[5:], [p]), _product(means[2:5], one), _product(means[:2], two))
    # Coordinates whose metric is the identity
    length = np.sqrt((one[0][:3] ** 2).sum(axis=0))
    across = cross(one[0][:3], one[1][:3], 0)
    scale = np.sqrt((across**2).sum(axis=0))
    a, b, c = 1 / length, -(one[0][:3] * one[1][:3]).sum(axis=0) / (length * scale), length / scale
    one, two, three = (
        [a ** (n - k) * sum(math.comb(k, j) * b ** (k - j) * c**j * r[j] for j in range(k + 1)) for k in range(n + 1)]
        for n, r in enumerate((one, two, three), 1)
    )
    tangents = [axis[:3] for axis in one]
    slopes, drifts = ([[(rate[:3] * axis).sum(axis=0) for rate in r] for axis in tangents] for r in (two, three))
    two = _less(two, *([rate * one[d] for rate in slopes[d]] for d in range(2)))
    three = _less(three, *([rate * one[d] for rate in drifts[d]] for d in range(2)))
    three = _less(three, *(_product(slopes[d], two[d : d + 2]) for d in range(2)))
    x, y, xx, xy, yy = means[:5]
    space = scale / ((xx - x * x) * (yy - y * y) - (xy - x * y) ** 2)
    return SurfaceFrame((across / scale, *tangents), (one, two, three), space)


def _less(values: Sequence[FloatArray], *others: Sequence[FloatArray]) -> list[FloatArray]:
    return [np.asarray(value - sum(parts)) for value, *parts in zip(values, *others, strict=True)]


def _product(of_one: Sequence[FloatArray], of_other: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the sum, over all ways to divide the indices, of products such as c_ab v_c."""
    i, j = len(of_one) - 1, len(of_other) - 1
    ways = [[math.comb(k, q) * math.comb(i + j - k, i - q) for q in range(i + 1)] for k in range(i + j + 1)]
    return [
        np.asarray(sum(count * of_one[q] * of_other[k - q] for q, count in enumerate(counts) if 0 <= k - q <= j))
        for k, counts in enumerate(ways)
    ]


def forms(blocks: Iterable[Block], areas: FloatArray, points: FloatArray, orders: Sequence[int]) -> FloatArray:
    """Return (…, orders, n, n) matrices of integrals of |P_a|², |P_;ab|² or |P_;abc|² in the metric of (n, 3) points.

    Places stand for (…, m) areas of the domain.
    """
    matrices = np.zeros((*areas.shape[:-1], len(orders), len(points), len(points)))
    for block in blocks:
        found = frame(block, points)
        for zone in np.ndindex(areas.shape[:-1]):
            root = np.sqrt(areas[*zone, block.places] * found.space)
            for k, order in enumerate(orders):
                block.add_form(matrices[*zone, k], [rate[3:] * root for rate in found.orders[order - 1]])
    return matrices
