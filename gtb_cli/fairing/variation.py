"""Curvature and its variation in a surface's own metric: integrals, and quadratic forms of the control points.

At each place we take linear combinations of the torus coordinates in which the metric g is the identity. With Γ^d_ab =
⟨P_d, P_ab⟩ a function f on the surface has second and, symmetrised, third derivatives

    ``f_;ab = f_ab − Γ^d_ab f_d``,    ``f_;abc = f_abc − 3 Γ^d_(ab f_;c)d − ⟨P_d, P_abc⟩ f_d``.

For f = P they are II_ab N and (∇II)_abc N, so that ``∫ |P_;ab|² = ∫ κ₁² + κ₂²`` and ``∫ |P_;abc|² = ∫ |∇II|²``; with
the metric of a surface that is known, they are quadratic forms of the control points of the next (G. Greiner,
Variational design and fairing of spline surfaces, 1994). Each is T times a polynomial of the knots' coordinates.

If P changes by δ, with n_a = ⟨N, δ_a⟩ and s_ab = (⟨P_a, δ_b⟩ + ⟨P_b, δ_a⟩)/2, then in a frame that stays orthonormal
II_ab √dA and 2H_c √dA change by √dA times

    ``⟨N, δ_;ab⟩ − s_ad II_bd − s_bd II_ad + s_dd II_ab / 2``,
    ``⟨N, δ_;aac⟩ − 2 (H II_cd + II_ca II_ad) n_d − II_cd ⟨P_d, δ_;aa⟩ − 2 II_ad ⟨P_a, δ_;dc⟩ − 2 s_ad II_ad;c
    − 2 s_cd H_d + s_dd H_c``:

the first derivatives with which the method of Gauss and Newton finds the least ∫ κ₁² + κ₂² and ∫ |∇H|² themselves.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.fairing.energy import CentralMoments, central_moments
from gtb_cli.values import frozen


@frozen
class Bending:
    """Integrals over the places at which a surface was sampled.

    Attributes
    ----------
    area : float
    energy : float
        ∫ κ₁² + κ₂² dA, which does not depend on the unit of length.
    variation : float
        The area times ∫ |∇H|² dA, which does not depend on it either.
    curvature : float
        Largest absolute value of a principal curvature.
    """

    area: float
    energy: float
    variation: float
    curvature: float

    def scaled(self, size: float) -> "Bending":
        """Return the integrals of the surface times a size."""
        return Bending(self.area * size * size, self.energy, self.variation, self.curvature / size)


class _Frame(NamedTuple):
    """A surface at m places, in coordinates X = a x and Y = b x + c y whose metric is the identity.

    `axes` are its (m, 3) unit vectors N, P_X and P_Y. Derivatives are listed by the number of Y in them: the normal
    parts of P_;ab and P_;abc, Γ^d_ab and ⟨P_d, P_abc⟩. `scale` is the area of the surface per area in the coordinates
    x, y.
    """

    change: tuple[FloatArray, FloatArray, FloatArray]
    axes: tuple[FloatArray, FloatArray, FloatArray]
    scale: FloatArray
    second: list[FloatArray]
    third: list[FloatArray]
    slopes: list[list[FloatArray]]
    drifts: list[list[FloatArray]]


def _frame(block: CentralMoments, points: FloatArray) -> _Frame:
    """Return the surface of (n, 3) control points."""
    p = block.t.T @ points
    one = [table.T @ points for table in block.first]
    two = [table.T @ points - c[:, None] * p for table, c in zip(block.second, block.covariance, strict=True)]
    three = [table.T @ points - k[:, None] * p for table, k in zip(block.third, block.skewness, strict=True)]
    for k in range(4):
        three[k] -= _mixed(k, *([c[:, None] * axis for c in block.covariance] for axis in one))
    length = np.linalg.norm(one[0], axis=1)
    shear = (one[0] * one[1]).sum(axis=1) / length
    cross = np.cross(*one)
    scale = np.linalg.norm(cross, axis=1)
    normal, width = cross / scale[:, None], scale / length
    change = 1 / length, -shear / (length * width), 1 / width
    columns = [each[:, None] for each in change]
    one, two, three = (_changed(rates, *columns) for rates in (one, two, three))
    second, third = ([(rate * normal).sum(axis=1) for rate in rates] for rates in (two, three))
    slopes, drifts = ([[(rate * tangent).sum(axis=1) for rate in r] for tangent in one] for r in (two, three))
    third = [
        rate - sum(_mixed(k, *([g * second[d + e] for g in slopes[d]] for e in range(2))) for d in range(2))
        for k, rate in enumerate(third)
    ]
    return _Frame(change, (normal, *one), scale, second, third, slopes, drifts)


def _rows(
    block: CentralMoments, frame: _Frame, members: IntArray | slice = slice(None)
) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
    """Return (k, m) coefficients of k control points in each P_a, P_;ab and P_;abc."""
    a, b, c = frame.change
    t, x, y = block.t[members], block.x[members], block.y[members]
    x, y = a * x, b * x + c * y
    covariance, skewness = (_changed(sums, a, b, c) for sums in (block.covariance, block.skewness))
    squares = [x * x, x * y, y * y]
    second = [
        square - moment - rate * x - other * y
        for square, moment, rate, other in zip(squares, covariance, *frame.slopes, strict=True)
    ]
    third = []
    for k, cube in enumerate([squares[0] * x, squares[0] * y, squares[2] * x, squares[2] * y]):
        row = cube - skewness[k] - frame.drifts[0][k] * x - frame.drifts[1][k] * y
        row -= _mixed(k, *([moment * axis for moment in covariance] for axis in (x, y)))
        for d in range(2):
            row -= _mixed(k, *([g * second[d + e] for g in frame.slopes[d]] for e in range(2)))
        third.append(row * t)
    return [x * t, y * t], [row * t for row in second], third


def _mixed(k: int, of_x: Sequence[FloatArray], of_y: Sequence[FloatArray]) -> FloatArray:
    """Return 3 c_(ab v_c) for three indices of which k are y, from the products c_ab v_x and c_ab v_y."""
    if k == 0:
        return np.asarray(3 * of_x[0])
    return np.asarray(3 * of_y[2] if k == 3 else (3 - k) * of_x[k] + k * of_y[k - 1])


def _changed(values: Sequence[FloatArray], a: FloatArray, b: FloatArray, c: FloatArray) -> list[FloatArray]:
    """Return derivatives, or moments, in x and y in the coordinates X = a x and Y = b x + c y."""
    n = len(values) - 1
    return [
        np.asarray(a ** (n - k) * sum(math.comb(k, j) * b ** (k - j) * c**j * values[j] for j in range(k + 1)))
        for k in range(n + 1)
    ]


def bendings(
    knots: FloatArray, log_weights: FloatArray, s: FloatArray, areas: FloatArray, surfaces: Sequence[FloatArray]
) -> list[Bending]:
    """Integrate over places at (2, m) torus coordinates, which stand for (m,) areas of the domain.

    All surfaces have these knots and weights; each has its (n, 3) control points.
    """
    sums, largest = np.zeros((len(surfaces), 3)), np.zeros(len(surfaces))
    for block, places in central_moments(knots, log_weights, s):
        for k, points in enumerate(surfaces):
            frame = _frame(block, points)
            xx, xy, yy = frame.second
            squares = xx**2 + 2 * xy**2 + yy**2
            changes = (frame.third[0] + frame.third[2]) ** 2 + (frame.third[1] + frame.third[3]) ** 2
            sums[k] += np.array([np.ones_like(xx), squares, changes / 4]) @ _spaces(block, frame, areas[places])
            largest[k] = max(largest[k], (np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)).max())
    return [
        Bending(area, energy, area * variation, most)
        for (area, energy, variation), most in zip(sums.tolist(), largest.tolist(), strict=True)
    ]


def variation_matrices(
    knots: FloatArray, log_weights: FloatArray, s: FloatArray, areas: FloatArray, points: FloatArray
) -> FloatArray:
    """Return the (…, 2, n, n) matrices of ``∫ |P_;ab|²`` and ``∫ |P_;abc|²`` in the metric that (n, 3) points give.

    They are those of each of the (…, m) areas.
    """
    matrices = np.zeros((*areas.shape[:-1], 2, len(knots), len(knots)))
    for block, places in central_moments(knots, log_weights, s):
        frame = _frame(block, points)
        roots = np.sqrt(_spaces(block, frame, areas[..., places]))
        _, *orders = _rows(block, frame)
        for k, (rows, multiples) in enumerate(zip(orders, ((1, 2, 1), (1, 3, 3, 1)), strict=True)):
            for zone in np.ndindex(areas.shape[:-1]):
                parts = [row * (math.sqrt(n) * roots[zone]) for row, n in zip(rows, multiples, strict=True)]
                table = np.concatenate(parts, axis=1)
                matrices[*zone, k] += table @ table.T
    return matrices


class Linearisation(NamedTuple):
    """The dependence of the area, ∫ κ₁² + κ₂² and ∫ |∇H|² on the coordinates of k control points.

    They are the `values`, (3,), with (3, 3 k) halves of their gradients. Of the latter two the method of Gauss and
    Newton has (2, 3 k, 3 k) `squares`, and `variation_matrices` are (2, k, k).
    """

    values: FloatArray
    slopes: FloatArray
    squares: FloatArray
    matrices: FloatArray


def linearisation(
    knots: FloatArray, log_weights: FloatArray, s: FloatArray, areas: FloatArray, points: FloatArray, members: IntArray
) -> Linearisation:
    """Return how integrals over a surface depend on the (k,) members of its (n, 3) control points."""
    k = len(members)
    values, slopes = np.zeros(3), np.zeros((3, 3 * k))
    squares, matrices = np.zeros((2, 3 * k, 3 * k)), np.zeros((2, k, k))
    for block, places in central_moments(knots, log_weights, s):
        frame = _frame(block, points)
        space = _spaces(block, frame, areas[places])
        root = np.sqrt(space)
        rows = [[row * root for row in order] for order in _rows(block, frame, members)]
        *rates, spread = _rates(frame, *rows)
        values[0] += space.sum()
        slopes[0] += spread @ root / 2
        for i, (order, multiples) in enumerate(zip(rows[1:], ((1, 2, 1), (1, 3, 3, 1)), strict=True)):
            residuals = np.concatenate([value * root for value, _ in rates[i]])
            table = np.concatenate([rate for _, rate in rates[i]], axis=1)
            values[i + 1] += residuals @ residuals
            slopes[i + 1] += table @ residuals
            squares[i] += table @ table.T
            table = np.concatenate([row * math.sqrt(n) for row, n in zip(order, multiples, strict=True)], axis=1)
            matrices[i] += table @ table.T
    return Linearisation(values, slopes, squares, matrices)


Rates: TypeAlias = list[tuple[FloatArray, FloatArray]]
"""(m,) components of a tensor, and the (3 k, m) rates at which they change with the coordinates of k control points."""


def _rates(
    frame: _Frame, first: Sequence[FloatArray], second: Sequence[FloatArray], third: Sequence[FloatArray]
) -> tuple[Rates, Rates, FloatArray]:
    """Return the components of II and of ∇H with their rates, and the (3 k, m) rates of log dA.

    Given are the (k, m) coefficients of control points in the derivatives of P, by the number of Y in them.
    """
    bend = np.array([frame.second[:2], frame.second[1:]])
    mean = bend[0, 0] + bend[1, 1]  # 2 H
    slope = np.array([frame.third[c] + frame.third[c + 2] for c in (0, 1)]) / 2
    unit, laplacian = np.eye(2)[:, :, None], second[0] + second[2]
    axes = [np.ascontiguousarray(axis.T) for axis in frame.axes]

    def rate(*parts: FloatArray) -> FloatArray:
        """(3 k, m) rates with parts along N, P_X and P_Y."""
        return np.asarray(sum(part[:, None] * axis for part, axis in zip(parts, axes, strict=True))).reshape(
            -1, len(mean)
        )

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
        varied = np.array([frame.third[c : c + 2], frame.third[c + 1 : c + 3]])
        along = strain(unit * slope[c] / 2 - varied - unit[c][:, None] * slope)
        for a in (0, 1):
            along[a] -= bend[c, a] / 2 * laplacian + sum(bend[a, d] * second[d + c] for d in (0, 1))
        of_slope.append((slope[c], rate((third[c] + third[c + 2]) / 2 - inward, *along)))
    return of_bend, of_slope, rate(np.zeros_like(first[0]), *first)


def _spaces(block: CentralMoments, frame: _Frame, areas: FloatArray) -> FloatArray:
    """Return the areas of the surface for areas of the domain, which the covariance maps to those of x and y."""
    xx, xy, yy = block.covariance
    return np.asarray(areas * frame.scale / (xx * yy - xy**2))
