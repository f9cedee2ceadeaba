"""Curvature and its variation in a surface's own metric: integrals, and how they depend on the control points.

If P changes by δ, with n_a = ⟨N, δ_a⟩ and s_ab = (⟨P_a, δ_b⟩ + ⟨P_b, δ_a⟩)/2, then in a frame that stays orthonormal
II_ab √dA and 2H_c √dA change by √dA times

    ``⟨N, δ_;ab⟩ − s_ad II_bd − s_bd II_ad + s_dd II_ab / 2``,
    ``⟨N, δ_;aac⟩ − 2 (H II_cd + II_ca II_ad) n_d − II_cd ⟨P_d, δ_;aa⟩ − 2 II_ad ⟨P_a, δ_;dc⟩ − 2 s_ad II_ad;c
    − 2 s_cd H_d + s_dd H_c``:

the first derivatives with which the method of Gauss and Newton finds the least ∫ κ₁² + κ₂² and ∫ |∇H|² themselves.
"""

import math
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.fairing.metric import Block, SurfaceFrame, frame
from gtb_cli.values import frozen


@frozen
class Bending:
    """Integrals over the places at which a surface was sampled; energy and variation do not depend on its size."""

    area: float
    energy: float  # ∫ κ₁² + κ₂² dA
    variation: float  # the area times ∫ |∇H|² dA
    curvature: float  # largest absolute value of a principal curvature

    def scaled(self, size: float) -> "Bending":
        """Return the integrals of the surface times a size."""
        return Bending(self.area * size * size, self.energy, self.variation, self.curvature / size)


def bendings(blocks: Iterable[Block], areas: FloatArray, surfaces: Sequence[FloatArray]) -> list[list[Bending]]:
    """Integrate surfaces, (n, 3) control points, over places that stand for (m,) areas, or any of (z, m), of Δ."""
    points, zones = np.stack(surfaces, axis=2), np.atleast_2d(areas)
    sums, largest = np.zeros((len(zones), 3, len(surfaces))), np.zeros(len(surfaces))
    for block in blocks:
        found = frame(block, points)
        (xx, xy, yy), (xxx, xxy, xyy, yyy) = found.normal_parts(2), found.normal_parts(3)
        integrands = np.ones_like(xx), xx**2 + 2 * xy**2 + yy**2, ((xxx + xyy) ** 2 + (xxy + yyy) ** 2) / 4
        sums += np.moveaxis((np.stack(integrands) * found.space) @ zones[:, block.places].T, 2, 0)
        largest = np.maximum(largest, (np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)).max(axis=1))
    return [
        [Bending(a, energy, a * varied, most) for (a, energy, varied), most in zip(zone, largest.tolist(), strict=True)]
        for zone in sums.swapaxes(1, 2).tolist()
    ]


def linearisation(
    blocks: Iterable[Block], areas: FloatArray, points: FloatArray, members: IntArray
) -> tuple[FloatArray, ...]:
    """Return how integrals over a surface depend on the coordinates of k members of its (n, 3) control points.

    They are the (3,) area, ∫ κ₁² + κ₂² and ∫ |∇H|², (3, 3 k) halves of their gradients and, of the latter two, the (2,
    3 k, 3 k) squares of the method of Gauss and Newton and the (2, k, k) `forms`.
    """
    k = len(members)
    values, slopes = np.zeros(3), np.zeros((3, 3 * k))
    squares, matrices = np.zeros((2, 3 * k, 3 * k)), np.zeros((2, k, k))
    for block in blocks:
        found = frame(block, points)
        root = np.sqrt(areas[block.places] * found.space)
        block = block.among(members)
        factors = [[rate[3:] * root for rate in order] for order in found.orders]
        *rates, spread = _rates(found, *factors)
        values[0] += root @ root
        for part, near, table in block.tables(spread):
            slopes[0].reshape(k, 3)[near] += table @ root[part] / 2
        for i, order in enumerate(factors[1:]):
            residuals = np.stack([value * root for value, _ in rates[i]])
            values[i + 1] += (residuals**2).sum()
            for part, near, table in block.tables(np.stack([rate for _, rate in rates[i]], axis=2)):
                own, table = (3 * near[:, None] + np.arange(3)).ravel(), table.reshape(3 * len(near), -1)
                slopes[i + 1, own] += table @ residuals[:, part].ravel()
                squares[i][np.ix_(own, own)] += table @ table.T
            block.add_form(matrices[i], order)
    return values, slopes, squares, matrices


# (m,) components of a tensor, and (10, 3, m) factors of powers in the rates at which they change with coordinates
Rates: TypeAlias = list[tuple[FloatArray, FloatArray]]


def _rates(
    surface: SurfaceFrame, first: Sequence[FloatArray], second: Sequence[FloatArray], third: Sequence[FloatArray]
) -> tuple[Rates, Rates, FloatArray]:
    """Return the components of II and of ∇H with their rates, and those of log dA, (10, 3, m).

    Given are (10, m) factors in the derivatives of T, by the number of Y in them.
    """
    own, varying = surface.normal_parts(2), surface.normal_parts(3)
    bend = np.array([own[:2], own[1:]])
    mean = bend[0, 0] + bend[1, 1]  # 2 H
    slope = np.array([varying[c] + varying[c + 2] for c in (0, 1)]) / 2
    unit, laplacian = np.eye(2)[:, :, None], second[0] + second[2]

    def rate(*parts: FloatArray) -> FloatArray:
        """(10, 3, m) rates with parts along N, P_X and P_Y."""
        return np.asarray(sum(part[:, None] * axis for part, axis in zip(parts, surface.axes, strict=True)))

    def strain(factors: FloatArray) -> list[FloatArray]:
        """s_ab times (2, 2, m) factors, as parts along P_X and P_Y."""
        return [sum((factors[a, b] + factors[b, a]) / 2 * first[b] for b in (0, 1)) for a in (0, 1)]

    of_bend, of_slope = [], []
    for a, b, multiple in ((0, 0, 1.0), (0, 1, math.sqrt(2)), (1, 1, 1.0)):
        turned = unit[a][:, None] * bend[b] + unit[b][:, None] * bend[a]
        parts = multiple * second[a + b], *strain(multiple * (unit * bend[a, b] / 2 - turned))
        of_bend.append((multiple * bend[a, b], rate(*parts)))
    square = np.einsum("abm,bcm->acm", bend, bend)
    for c in (0, 1):
        inward = sum((mean * bend[c, d] / 2 + square[c, d]) * first[d] for d in (0, 1))
        varied = np.array([varying[c : c + 2], varying[c + 1 : c + 3]])
        along = strain(unit * slope[c] / 2 - varied - unit[c][:, None] * slope)
        for a in (0, 1):
            along[a] -= bend[c, a] / 2 * laplacian + sum(bend[a, d] * second[d + c] for d in (0, 1))
        of_slope.append((slope[c], rate((third[c] + third[c + 2]) / 2 - inward, *along)))
    return of_bend, of_slope, rate(np.zeros_like(first[0]), *first)
