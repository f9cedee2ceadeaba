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
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.domain import domain
from gtb_cli.moment.torus import exponents, shares


class Block(NamedTuple):
    """(n, m) shares T at m of the places, and (n, 10) powers 1, x, y, xx, …, yyy of the knots' coordinates."""

    places: IntArray
    powers: FloatArray
    t: FloatArray

    def tables(self, factors: FloatArray) -> FloatArray:
        """Return T times polynomials with (10, …, m) factors of the powers: (n, …, m)."""
        found = (self.powers @ factors.reshape(10, -1)).reshape(len(self.t), -1, self.t.shape[1])
        found *= self.t[:, None]
        return found.reshape(len(self.t), *factors.shape[1:])

    def form(self, rates: Sequence[FloatArray]) -> FloatArray:
        """Return the (n, n) matrix of the squares of a symmetric tensor, with (10, m) factors in its components."""
        factors = [rate * math.sqrt(math.comb(len(rates) - 1, k)) for k, rate in enumerate(rates)]
        table = self.tables(np.stack(factors, axis=1)).reshape(len(self.t), -1)
        return np.asarray(table @ table.T)


def blocks(knots: FloatArray, log_weights: FloatArray, s: FloatArray) -> Iterator[Block]:
    """Yield T at (2, m) torus coordinates, block by block.

    The coordinates of powers are those along and across the nearest edge from its nearer end, where most shares and
    coordinates are small: differences of sums would lose digits elsewhere.
    """
    length = 256  # number of places: seven tables of them are alive at once
    vertices = domain(knots, "unit").vertices
    sides, heights = np.roll(vertices, -1, axis=0) - vertices, vertices @ s
    corner, edge = heights.argmax(axis=0), (heights + np.roll(heights, -1, axis=0)).argmax(axis=0)
    for k, end in sorted(set(zip(edge.tolist(), corner.tolist(), strict=True))):
        way = sides[k] / np.hypot(*sides[k])
        x, y = np.array([way, [-way[1], way[0]]]) @ (knots - vertices[end]).T
        powers = np.stack([x**0, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], axis=1)
        here = np.flatnonzero((edge == k) & (corner == end))
        for places in np.split(here, range(length, len(here), length)):
            yield Block(places, powers, shares(exponents(knots, log_weights, s[:, places])))


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
    sums = block.powers.T @ block.t
    products = (block.powers[:, :, None] * points.reshape(len(points), 1, -1)).reshape(len(points), -1)
    raw = (products.T @ block.t).reshape(10, *points.shape[1:], -1)
    if points.ndim == 2:
        raw = np.concatenate([raw, np.broadcast_to(np.eye(10)[:, :, None], (10, 10, raw.shape[-1]))], axis=1)
    # Derivatives of a quotient whose denominator is 1
    (p, *rates), (_, *means) = list(raw), list(sums)
    one = _less(rates[:2], _product(means[:2], [p]))
    two = _less(rates[2:5], _product(means[2:5], [p]), _product(means[:2], one))
    three = _less(rates[5:], _product(means[5:], [p]), _product(means[2:5], one), _product(means[:2], two))
    # Coordinates whose metric is the identity
    length = np.sqrt((one[0][:3] ** 2).sum(axis=0))
    cross = np.cross(one[0][:3], one[1][:3], axis=0)
    scale = np.sqrt((cross**2).sum(axis=0))
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
    return SurfaceFrame((cross / scale, *tangents), (one, two, three), space)


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


def forms(
    knots: FloatArray,
    log_weights: FloatArray,
    s: FloatArray,
    areas: FloatArray,
    points: FloatArray,
    orders: Sequence[int],
) -> FloatArray:
    """Return (…, orders, n, n) matrices of integrals of |P_a|², |P_;ab|² or |P_;abc|² in the metric of (n, 3) points.

    Places at (2, m) torus coordinates stand for (…, m) areas of the domain.
    """
    matrices = np.zeros((*areas.shape[:-1], len(orders), len(knots), len(knots)))
    for block in blocks(knots, log_weights, s):
        found = frame(block, points)
        for zone in np.ndindex(areas.shape[:-1]):
            root = np.sqrt(areas[*zone, block.places] * found.space)
            for k, order in enumerate(orders):
                matrices[*zone, k] += block.form([rate[3:] * root for rate in found.orders[order - 1]])
    return matrices
