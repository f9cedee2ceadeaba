"""The patch in 50-digit arithmetic, straight from Definitions 2.1 to 4.1: no logarithms shared with the program.

Floats are taken at their exact values. What the program decides once (which knots lie on which edge) is taken from
it; `test_domain.py` tests that decision. So is the length of the normals.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from gtb_cli.knots.domain import Domain
from gtb_cli.theory.patch import Patch

CONTEXT = mpmath.mp.clone()
CONTEXT.dps = 50

Number: Any = CONTEXT.mpf
Vector = list[Any]


def numbers(values: Sequence[Any]) -> Vector:
    """Floats, fractions or numbers of mpmath as numbers of 50 digits, exactly."""
    return [
        Number(value.numerator) / value.denominator
        if hasattr(value, "denominator") and not isinstance(value, float)
        else Number(value)
        for value in values
    ]


def height(domain: Domain, edge: int, u: Vector) -> Any:
    """h_j(u) from the corners of the hull: |s_j ξ_j| times the distance from the line through two corners."""
    if domain.dimension == 1:
        return Number(float(domain.normals[edge, 0])) * (u[0] - Number(float(domain.vertices[edge, 0])))
    start = numbers(domain.vertices[edge].tolist())
    end = numbers(domain.vertices[(edge + 1) % len(domain.vertices)].tolist())
    ex, ey = end[0] - start[0], end[1] - start[1]
    cross = ex * (u[1] - start[1]) - ey * (u[0] - start[0])
    scale = CONTEXT.hypot(*(Number(float(x)) for x in domain.normals[edge]))
    return scale * cross / CONTEXT.hypot(ex, ey)


def terms(patch: Patch, u: Sequence[Any]) -> Vector:
    """c_i ω_i β_i(u) / c_i: the numerators of the rational basis, with 0⁰ = 1."""
    domain = patch.domain
    point = numbers(u)
    edges = range(len(domain.vertices))
    heights = [height(domain, j, point) for j in edges]
    result = []
    for i, knot in enumerate(domain.knots.tolist()):
        value = CONTEXT.exp(Number(float(patch.log_products[i])))
        for j in edges:
            if not domain.incidence[i, j]:
                value *= heights[j] ** height(domain, j, numbers(knot)) if heights[j] > 0 else 0
        result.append(value)
    return result


def basis(patch: Patch, u: Sequence[Any]) -> Vector:
    """T_i(u)."""
    values = terms(patch, u)
    total = sum(values)
    return [value / total for value in values]


def point(patch: Patch, u: Sequence[Any]) -> Vector:
    """P(u)."""
    t = basis(patch, u)
    return [sum(t[i] * Number(b[k]) for i, b in enumerate(patch.control_points.tolist())) for k in range(3)]


def derivative(patch: Patch, u: Sequence[Any]) -> NDArray[np.float64]:
    """(3, d) ∂P/∂u, by the central difference quotient of 50-digit points."""
    step = Number(10) ** -15 * Number(patch.domain.size)
    columns = []
    for axis in range(patch.dimension):
        ahead, behind = numbers(u), numbers(u)
        ahead[axis] += step
        behind[axis] -= step
        columns.append(
            [float((a - b) / (2 * step)) for a, b in zip(point(patch, ahead), point(patch, behind), strict=True)]
        )
    return np.array(columns).T


def normal(patch: Patch, u: Sequence[Any]) -> NDArray[np.float64]:
    """(3,) unit normal inside Δ, a sum over all triples of knots.

    By the theorem of Cauchy and Binet the cross product of the columns of ∂P/∂s = Σ T_i (b_i − P)(a_i − μ)ᵀ is
    Σ_{i<j<k} T_i T_j T_k det(a_j − a_i, a_k − a_i) (b_j − b_i) × (b_k − b_i), in which nothing cancels by itself.
    Three knots on one edge have determinant 0, though rounding may have put them a little beside it.
    """
    return normal_of(patch, basis(patch, u))


def normal_of(patch: Patch, t: Vector) -> NDArray[np.float64]:
    """(3,) `normal` at T_i, or at multiples of them."""
    knots = [numbers(a) for a in patch.knots.tolist()]
    points = [numbers(b) for b in patch.control_points.tolist()]
    total = [Number(0)] * 3
    for i, j, k in combinations(range(len(knots)), 3):
        if patch.domain.incidence[[i, j, k]].all(axis=0).any():
            continue
        first, second = _difference(knots[j], knots[i]), _difference(knots[k], knots[i])
        share = t[i] * t[j] * t[k] * (first[0] * second[1] - first[1] * second[0])
        (ax, ay, az), (bx, by, bz) = _difference(points[j], points[i]), _difference(points[k], points[i])
        cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        total = [x + share * y for x, y in zip(total, cross, strict=True)]
    length = CONTEXT.sqrt(sum(x * x for x in total))
    return np.array([float(x / length) for x in total])


def _difference(a: Vector, b: Vector) -> Vector:
    return [x - y for x, y in zip(a, b, strict=True)]
