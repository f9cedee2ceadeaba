"""The quadrature over Δ against exact integrals, the rate that it states, and areas found in torus coordinates."""

from math import comb

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.moment.torus import shares
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.quadrature import quadrature
from tests.patches import NAMES, cubic_curve, named, pentagon


def measure(patch: Patch) -> float:
    v = patch.domain.vertices - patch.domain.vertices[0]
    if patch.dimension == 1:
        return float(np.ptp(v))
    return float(np.sum(v[:-1, 0] * v[1:, 1] - v[:-1, 1] * v[1:, 0]) / 2)


@pytest.mark.parametrize("name", NAMES)
def test_weights_are_positive_and_sum_to_the_measure_of_the_domain(name):
    patch = named(name)
    parameters, weights = quadrature(patch, 8)
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(measure(patch), rel=1e-7 if name.startswith("far") else 1e-13)
    assert (patch.domain.edge_functions(parameters) > 0).all()


def test_polynomials_are_exact():
    """Of degree 4 for 5 · 6 ≤ 2 · 15: ∫ u^a v^b over the square of side 3."""
    (u, v), weights = (part.T for part in quadrature(named("bicubic"), 15))
    for a, b in ((0, 0), (2, 1), (4, 0), (2, 2)):
        assert weights @ (u**a * v**b) == pytest.approx(3.0 ** (a + b + 2) / ((a + 1) * (b + 1)), rel=1e-13)


def test_products_of_bernstein_polynomials():
    """∫ B_i B_j = C(3, i) C(3, j) / (7 C(6, i + j)) on the unit interval, by Euler's beta function."""
    curve = cubic_curve().replace(weights=None)
    parameters, weights = quadrature(curve)
    t = curve.basis(parameters)
    expected = [[3 * comb(3, i) * comb(3, j) / (7 * comb(6, i + j)) for j in range(4)] for i in range(4)]
    np.testing.assert_allclose(np.einsum("m,mi,mj->ij", weights, t, t), expected, rtol=1e-13)


def test_errors_fall_with_the_stated_power_of_the_order():
    """h^α at an end of a curve: −10 (α + 1); r^β at a corner of a triangle: −10 (β + 2)."""
    curve, triangle = Patch([0, 1], [[0, 0], [1, 1]]), Patch([[0, 0], [1, 0], [0, 1]], np.eye(3))
    for patch, power, orders in (
        (curve, -0.75, (8, 12, 16)),
        (curve, -0.5, (12, 16, 24)),
        (curve, -0.35, (12, 16, 24)),
        (triangle, -1.75, (8, 12, 16)),
    ):
        rules = [quadrature(patch, order) for order in orders]
        # Of u, or u + v: ∫ is then that of w^(power + 1)
        values = [rule.weights @ rule.parameters.sum(axis=1) ** power for rule in rules]
        errors = np.abs(np.array(values) * (power + patch.dimension) - 1)
        assert np.polyfit(np.log(orders), np.log(errors), 1)[0] == pytest.approx(
            -10 * (power + patch.dimension), rel=0.1
        )


def area_in_torus_coordinates(patch: Patch, step: float, reach: float) -> float:
    """∫ |∂P/∂s_1 × ∂P/∂s_2| ds by the rule of trapezoids, whose error falls exponentially; ∂P/∂s = Σ T b (a − μ)ᵀ."""
    axis = np.arange(-reach, reach, step)
    area = 0.0
    for row in axis:
        s = np.stack([np.full(len(axis), row), axis])
        t = shares((patch.knots - patch.knots.mean(axis=0)) @ s + patch.log_products[:, None])
        a = patch.knots.T[:, :, None] - (patch.knots.T @ t)[:, None]
        first, second = (np.einsum("nm,nk,nm->km", t, patch.control_points, column) for column in a)
        area += np.linalg.norm(np.cross(first.T, second.T), axis=1).sum() * step**2
    return area


def test_the_area_of_example_4_1():
    patch = pentagon()
    parameters, weights = quadrature(patch)
    first, second = patch.derivatives(parameters, 1, "linear").transpose(2, 0, 1)
    area = weights @ np.linalg.norm(np.cross(first, second), axis=1)
    assert area == pytest.approx(area_in_torus_coordinates(patch, 0.5, 140), rel=1e-9)
    assert area == pytest.approx(8.4447212899, abs=1e-9)


@pytest.mark.parametrize("order", [0, 257, 2.5, True, "16"])
def test_other_orders_are_refused(order):
    with pytest.raises(DomainError, match="order: expected a whole number from 1 to 256, got"):
        quadrature(pentagon(), order)
