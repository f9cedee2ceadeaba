"""Every example that the paper prints in numbers, and what mathematics.md says of those that do not hold."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.basis import gt_bernstein, partition_of_unity_coefficients
from gtb_cli.domain import domain
from gtb_cli.errors import DomainError
from gtb_cli.moment import linear_locations
from gtb_cli.patch import Patch
from gtb_cli.spec import load

SPECS = Path(__file__).parents[1] / "specs"
ROOT = math.sqrt(2)

ROUNDINGS = 1e-14
"""A few dozen roundings of numbers of size one."""

T = np.linspace(0.0, 1.0, 41)[1:-1]


def test_example_2_1_prints_five_functions():
    curve = load(SPECS / "example-2.1.toml")
    printed = [
        0.5 * (1 - T),
        T ** (ROOT / 4) * (1 - T) ** (1 - ROOT / 4),
        1.5 * T**0.5 * (1 - T) ** 0.5,
        0.7 * T ** (ROOT / 2) * (1 - T) ** (1 - ROOT / 2),
        0.9 * T,
    ]
    beta = gt_bernstein(curve.domain, curve.coefficients, T)
    assert np.abs(beta - np.stack(printed, axis=1)).max() < ROUNDINGS


def inside_the_pentagon() -> np.ndarray:
    u = np.random.default_rng(2).random((400, 2)) * 2
    return u[u.sum(axis=1) < 2.99]


def test_example_2_2_prints_eight_functions():
    surface = load(SPECS / "pentagon.toml")
    (u, v) = inside_the_pentagon().T
    a, b, c = 3 - u - v, 2 - u, 2 - v
    printed = [
        a * b**2 * v**2,
        b * v**2 * u,
        c ** (4 / 5) * a ** (9 / 5) * b**2 * v ** (6 / 5),
        c ** (6 / 7) * a ** (5 / 7) * b ** (6 / 7) * v ** (8 / 7) * u ** (8 / 7),
        c * v * u**2,
        c**2 * a**3 * b**2,
        c**2 * a ** (9 / 5) * b ** (4 / 5) * u ** (6 / 5),
        c**2 * a * u**2,
    ]
    beta = gt_bernstein(surface.domain, np.ones(8), np.stack([u, v], axis=1))
    assert np.abs(beta / np.stack(printed, axis=1) - 1).max() < 1e-13
    direct = np.stack(printed, axis=1) * surface.weights
    direct = direct @ surface.control_points / direct.sum(axis=1, keepdims=True)
    assert np.abs(surface.evaluate(np.stack([u, v], axis=1)) - direct).max() < ROUNDINGS * 5


def test_example_3_1_is_its_formula():
    curve = load(SPECS / "example-3.1.toml")
    knots, weights = [0, ROOT / 4, 0.5, ROOT / 2, 1], [1, 10, 20, 6, 5]
    beta = np.stack([w * T**a * (1 - T) ** (1 - a) for a, w in zip(knots, weights, strict=True)], axis=1)
    points = beta @ np.array([[0, 0], [0.4, 1.3], [2, 2], [3.7, 1.5], [4, 0]]) / beta.sum(axis=1, keepdims=True)
    assert np.abs(curve.evaluate(T)[:, :2] - points).max() < ROUNDINGS
    assert curve.evaluate([0, 1]).tolist() == [[0, 0, 0], [4, 0, 0]]


def test_the_curve_does_not_depend_on_k0_and_k1():
    """Remark 3.1: only its parameter does."""
    one = load(SPECS / "example-3.1.toml")
    other = Patch(one.knots, one.control_points, one.weights, edge_scale=[0.3, 2.5])
    # Where h_0^{k_0} / h_1^{k_1} agrees, so do the points: found by bisection.
    low, high = np.zeros_like(T), np.ones_like(T)
    for _ in range(60):
        middle = (low + high) / 2
        less = 0.3 * np.log(0.3 * middle) - 2.5 * np.log(2.5 * (1 - middle)) < np.log(T) - np.log1p(-T)
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    assert np.abs(one.evaluate(T) - other.evaluate(low)).max() < 1e-12


def test_example_4_1_linear_precision_is_not_that_of_the_real_knots():
    """mathematics.md, section 7: off by 0.40 with primitive and 0.22 with unit normals."""
    real = load(SPECS / "example-4.1.toml")
    u = np.stack(np.meshgrid(np.linspace(0, 2, 201), np.linspace(0, 2, 201)), axis=-1).reshape(-1, 2)
    u = u[u.sum(axis=1) <= 3]
    for normals, expected in (("primitive", 0.40), ("unit", 0.22)):
        patch = Patch(real.knots, real.control_points, real.weights, edge_normals=normals)
        assert np.linalg.norm(patch.basis(u) @ patch.knots - u, axis=1).max() == pytest.approx(expected, abs=0.005)


def test_example_4_1_the_integer_knots_have_it_after_a_rational_reparametrisation():
    """x and y of the surface with knots A are an invertible map of the pentagon onto itself, edge by edge."""
    surface = load(SPECS / "example-4.1-integer.toml")
    corners = surface.domain.vertices
    assert np.array_equal(surface.evaluate(corners)[:, :2], corners)
    n = 60
    t = np.linspace(0, 1, n + 1)[1:-1, None]
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        image = surface.evaluate((1 - t) * start + t * end)[:, :2]
        off = (image - start) @ np.array([[0, -1], [1, 0]]) @ (end - start)
        assert np.abs(off).max() < ROUNDINGS * 4
    u = inside_the_pentagon()
    jacobian = surface.derivatives(u)[:, :2]
    assert np.linalg.det(jacobian).min() > 0


@pytest.mark.parametrize(
    "name", ["example-4.1.toml", "hexagon.toml", "nonagon.toml", "example-3.1.toml", "bicubic.toml"]
)
def test_every_patch_has_linear_precision_in_the_linear_parametrisation(name):
    patch = load(SPECS / name)
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(len(patch.domain.vertices)), 200)
    p = shares @ patch.domain.vertices
    knots = patch.knots if patch.dimension == 2 else np.column_stack([patch.knots, 0 * patch.knots])
    same = Patch(patch.knots, knots, patch.weights, patch.coefficients)
    points = same.points_at(linear_locations(same.domain, same.log_products, p), len(p))
    assert np.abs(points[:, : patch.dimension] - p).max() < 1e-12 * patch.domain.size


def test_coefficients_of_knots_0_1_3_would_be_negative():
    """mathematics.md, section 5."""
    shape = domain([0, 1, 3])
    with pytest.raises(DomainError, match=r"\(-0\.0740741, 0\.314815, 0\.0555556\), which are not all positive"):
        partition_of_unity_coefficients(shape, [1.5, 2, 2.25])


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_coefficients_of_integer_knots_are_binomials(n):
    c = partition_of_unity_coefficients(domain(np.arange(n + 1.0)), np.linspace(0.1, n - 0.3, n + 1))
    assert c == pytest.approx([math.comb(n, i) / n**n for i in range(n + 1)], rel=1e-9)


def test_end_tangents_of_equation_302():
    """With k0 = 1/(a1 − a0) and k1 = 1/(an − an−1) the derivative at the ends is finite, and printed."""
    knots, weights = np.array([0, ROOT / 4, 0.5, ROOT / 2, 1]), np.array([1, 10, 20, 6, 5.0])
    c = np.array([0.5, 1, 1.5, 0.7, 0.9])
    points = np.array([[0, 0], [0.4, 1.3], [2, 2], [3.7, 1.5], [4, 0]])
    k0, k1 = 1 / knots[1], 1 / (1 - knots[3])
    curve = Patch(knots, points, weights, c, edge_scale=[k0, k1])
    first = c[1] * k0 * k1 ** (-k1 / k0) * weights[1] * (points[1] - points[0]) / (c[0] * weights[0])
    last = c[3] * k1 * k0 ** (-k0 / k1) * weights[3] * (points[4] - points[3]) / (c[4] * weights[4])
    # The next terms are powers of the distance below one: Richardson's limit would need them, a small step does.
    step = 1e-13
    assert curve.derivatives([step])[0, :2, 0] == pytest.approx(first, rel=1e-4)
    assert curve.derivatives([1 - 2.0**-44])[0, :2, 0] == pytest.approx(last, rel=1e-4)


def test_isoparametric_curves_of_a_rectangle_are_gt_bezier_curves():
    """Surface property (d), which mathematics.md finds true on rectangles: equal v merged, weights summed."""
    surface = load(SPECS / "bicubic.toml")
    fixed = 0.8
    v = np.linspace(0, 3, 20)
    points = surface.evaluate(np.stack([np.full_like(v, fixed), v], axis=1))
    row_weights = surface.weights * surface.coefficients * (fixed / (3 - fixed)) ** surface.knots[:, 0]
    knots = np.unique(surface.knots[:, 1])
    total = np.array([row_weights[surface.knots[:, 1] == k].sum() for k in knots])
    middle = [row_weights[surface.knots[:, 1] == k] @ surface.control_points[surface.knots[:, 1] == k] for k in knots]
    curve = Patch(knots, np.array(middle) / total[:, None], total)
    assert np.abs(curve.evaluate(v) - points).max() < ROUNDINGS * 10
