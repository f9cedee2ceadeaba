"""Every formula and number that the paper prints for Examples 2.1, 2.2, 3.1 to 3.3, 4.1 and 4.2."""

from fractions import Fraction
from math import sqrt

import numpy as np
import pytest

from gtb_cli.knots.face import INTERIOR
from gtb_cli.theory.basis import Location, gt_bernstein
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.patches import basis_curve, integer_pentagon, irrational_curve, pentagon

FORMULA_ERROR = 1e-14  # relative error of a printed product of powers: a few roundings, times exponents up to 3

POINT_ERROR = 1e-13  # error of points of size 5


def test_example_2_1_basis():
    t = np.linspace(0.01, 0.99, 99)
    s = 1 - t
    printed = np.array(
        [
            1 / 2 * s,
            t ** (sqrt(2) / 4) * s ** (1 - sqrt(2) / 4),
            3 / 2 * t**0.5 * s**0.5,
            7 / 10 * t ** (sqrt(2) / 2) * s ** (1 - sqrt(2) / 2),
            9 / 10 * t,
        ]
    ).T
    patch = basis_curve()
    assert gt_bernstein(patch.domain, patch.coefficients, t) == pytest.approx(printed, rel=FORMULA_ERROR)
    assert gt_bernstein(patch.domain, patch.coefficients, [0, 1]).tolist() == [[0.5, 0, 0, 0, 0], [0, 0, 0, 0, 0.9]]


@pytest.mark.parametrize("knot", [sqrt(2) / 5, 1 / 2, sqrt(5) / 3])
def test_example_2_1_a_function_is_largest_at_its_knot(knot):
    # t^a (1 − t)^(1 − a) has its maximum at t = a.
    shape = Patch([0, knot, 1], np.zeros((3, 2))).domain
    t = knot + np.array([-1e-3, -1e-6, 0, 1e-6, 1e-3])
    assert gt_bernstein(shape, np.ones(3), t)[:, 1].argmax() == 2


def test_example_2_2_basis():
    rng = np.random.default_rng(0)
    patch = pentagon()
    points = rng.dirichlet(np.ones(5), 200) @ patch.domain.vertices
    u, v = points.T
    w = 3 - u - v
    printed = np.array(
        [
            w * (2 - u) ** 2 * v**2,
            (2 - u) * v**2 * u,
            (2 - v) ** (4 / 5) * w ** (9 / 5) * (2 - u) ** 2 * v ** (6 / 5),
            (2 - v) ** (6 / 7) * w ** (5 / 7) * (2 - u) ** (6 / 7) * v ** (8 / 7) * u ** (8 / 7),
            (2 - v) * v * u**2,
            (2 - v) ** 2 * w**3 * (2 - u) ** 2,
            (2 - v) ** 2 * w ** (9 / 5) * (2 - u) ** (4 / 5) * u ** (6 / 5),
            (2 - v) ** 2 * w * u**2,
        ]
    ).T
    beta = gt_bernstein(patch.domain, np.ones(8), points)
    assert beta == pytest.approx(printed, rel=10 * FORMULA_ERROR)
    unweighted = patch.replace(weights=np.ones(8))
    expected = printed / printed.sum(axis=1, keepdims=True)
    assert unweighted.basis(points) == pytest.approx(expected, rel=10 * FORMULA_ERROR)


def test_example_3_1_curve():
    patch = irrational_curve()
    t = np.linspace(0, 1, 21)
    powers = np.array([t ** patch.knots[i, 0] * (1 - t) ** (1 - patch.knots[i, 0]) for i in range(5)]).T
    terms = powers * [1, 10, 20, 6, 5]
    b = np.array([(0, 0), (0.4, 1.3), (2, 2), (3.7, 1.5), (4, 0)])
    points = patch.evaluate(t)
    assert np.abs(points[:, :2] - terms @ b / terms.sum(axis=1, keepdims=True)).max() < POINT_ERROR
    assert (points[:, 2] == 0).all()
    assert points[[0, -1]].tolist() == [[0, 0, 0], [4, 0, 0]]


def test_endpoint_tangents_of_equation_302():
    # The scales k_0 = 1 / (a_1 − a_0), k_1 = 1 / (a_n − a_{n−1}); one-sided quotients in 300 digits.
    patch = irrational_curve()
    a, b = patch.knots[:, 0], patch.control_points
    w, c = patch.weights, np.array([1, 1.5, 1, 0.5, 2])
    k0, k1 = 1 / (a[1] - a[0]), 1 / (a[4] - a[3])
    scaled = patch.replace(edge_scale=[k0, k1], coefficients=c)
    length = a[4] - a[0]
    at_start = c[1] * k0 * k1 ** (-k1 / k0) * length ** (-k1 / k0) * w[1] * (b[1] - b[0]) / (c[0] * w[0])
    at_end = c[3] * k1 * k0 ** (-k0 / k1) * length ** (-k0 / k1) * w[3] * (b[4] - b[3]) / (c[4] * w[4])
    with exact.CONTEXT.workdps(300):
        step = exact.Number(10) ** -150
        start = [(x - y) / step for x, y in zip(exact.point(scaled, [step]), b[0], strict=True)]
        end = [(y - x) / step for x, y in zip(exact.point(scaled, [1 - step]), b[4], strict=True)]
    assert [float(x) for x in start] == pytest.approx(at_start, rel=1e-12)
    assert [float(x) for x in end] == pytest.approx(at_end, rel=1e-12)
    ends = scaled.derivatives([0, 1])[:, :, 0]
    assert ends[0] == pytest.approx(at_start, rel=1e-12)
    assert ends[1] == pytest.approx(at_end, rel=1e-12)


def linear_precision_error(patch):
    """Largest distance of (x, y) of a point from its parameters, on a grid of the pentagon."""
    u = np.array([[x, y] for x in np.linspace(0, 2, 81) for y in np.linspace(0, 2, 81) if x + y <= 3])
    return np.linalg.norm(patch.evaluate(u)[:, :2] - u, axis=1).max()


def test_example_4_1_real_knots_have_no_linear_precision_as_they_stand():
    # mathematics.md, section 7: 0.40 with primitive normals, 0.22 with unit ones.
    assert linear_precision_error(pentagon()) == pytest.approx(0.40, abs=0.005)
    assert linear_precision_error(pentagon().replace(edge_normals="unit")) == pytest.approx(0.22, abs=0.005)


def rational_reparametrization(u, v):
    """e^s at which the integer pentagon with tuned control points is over (u, v): solved by hand, k is linear."""
    k = ((2 - u) * (2 - v) + 2 * (2 - u) + 2 * (2 - v)) / (2 * (3 - u - v))
    return k / (2 - u) - 1, k / (2 - v) - 1


def test_example_4_1_integer_knots_have_linear_precision_after_a_rational_reparametrization():
    """García-Puente & Sottile: Σ ω x^a y^b = (1 + x)(1 + y)(3 + 2x + 2y), and (u, v) has a rational inverse."""
    patch = integer_pentagon()
    grid = [(Fraction(i, 7), Fraction(j, 7)) for i in range(1, 14) for j in range(1, 14) if i + j < 21]
    coordinates = [rational_reparametrization(u, v) for u, v in grid]
    knots = patch.knots.astype(int).tolist()
    points = [(Fraction(x), Fraction(y)) for x, y in (("0", "2"), ("1", "2"), ("0", "6/5"), ("8/7", "8/7"))]
    points += [(Fraction(x), Fraction(y)) for x, y in (("2", "1"), ("0", "0"), ("6/5", "0"), ("2", "0"))]
    for (u, v), (x, y) in zip(grid, coordinates, strict=True):
        terms = [int(w) * x**i * y**j for w, (i, j) in zip(patch.weights, knots, strict=True)]
        assert sum(terms) == (1 + x) * (1 + y) * (3 + 2 * x + 2 * y)
        assert sum(t * b[0] for t, b in zip(terms, points, strict=True)) / sum(terms) == u
        assert sum(t * b[1] for t, b in zip(terms, points, strict=True)) / sum(terms) == v
    s = np.log(np.array(coordinates, dtype=np.float64)).T
    where = [Location(slice(0, len(grid)), patch.domain.faces[INTERIOR], patch.knots - patch.domain.center, s)]
    found = patch.points_at(where, len(grid))[:, :2]
    assert np.abs(found - np.array(grid, dtype=np.float64)).max() < POINT_ERROR
