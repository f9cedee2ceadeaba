"""Binomial coefficients of lattice patches, against products of polynomials; layers of knots over an edge."""

import random
import re
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.importers.trp import edge_coefficients
from gtb_cli.knots.domain import domain, layers
from gtb_cli.knots.lattice import MAX_BINOMIAL_DEGREE, binomial_coefficients
from tests.tables import cases

ROUNDING = 1e-14
"""Relative: the coefficients are rounded once."""

AFFINE = [
    (np.eye(2), np.zeros(2)),
    (np.diag([1 / 3, 1 / 7]), np.array([0.1, -5.0])),
    (np.diag([-1e4, 1e-4]), np.zeros(2)),
    (np.array([[2.0, 1.0], [-1.0, 3.0]]), np.array([1e7, -1e7])),
    (np.array([[0.6, -0.8], [0.8, 0.6]]), np.array([np.pi, np.e])),
]
"""Scaled, mirrored, sheared, turned, far away."""


def power(terms: int, degree: int) -> Counter[tuple[int, ...]]:
    """Coefficients of (x_0 + … + x_{terms−1})^degree, by repeated multiplication."""
    result = Counter({(0,) * terms: 1})
    for _ in range(degree):
        product: Counter[tuple[int, ...]] = Counter()
        for exponents, value in result.items():
            for k in range(terms):
                product[tuple(e + (j == k) for j, e in enumerate(exponents))] += value
        result = product
    return result


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 7, 20])
@pytest.mark.parametrize(("scale", "shift"), [(1, 0), (1 / 3, 0), (1e-9, 0), (1e9, 0), (-1, 5), (1, 1e7)])
def test_curves(degree: int, scale: float, shift: float) -> None:
    expected = power(2, degree)
    order = random.Random(degree).sample(range(degree + 1), degree + 1)
    shape = domain([scale * i + shift for i in order])
    np.testing.assert_allclose(binomial_coefficients(shape), [expected[i, degree - i] for i in order], rtol=ROUNDING)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize(("matrix", "shift"), AFFINE)
def test_triangles(degree: int, matrix: np.ndarray, shift: np.ndarray) -> None:
    expected = power(3, degree)
    places = random.Random(degree).sample(sorted(expected), len(expected))
    knots = np.array([(i, j) for i, j, _ in places]) @ matrix.T + shift
    found = binomial_coefficients(domain(knots))
    np.testing.assert_allclose(found, [expected[place] for place in places], rtol=ROUNDING)


@pytest.mark.parametrize("degrees", [(1, 1), (3, 3), (1, 4), (5, 2)])
@pytest.mark.parametrize(("matrix", "shift"), AFFINE)
def test_parallelograms(degrees: tuple[int, int], matrix: np.ndarray, shift: np.ndarray) -> None:
    across, along = (power(2, degree) for degree in degrees)
    places = [(i, j) for i in range(degrees[0] + 1) for j in range(degrees[1] + 1)]
    random.Random(1).shuffle(places)
    expected = [across[i, degrees[0] - i] * along[j, degrees[1] - j] for i, j in places]
    knots = np.array(places) @ matrix.T + shift
    np.testing.assert_allclose(binomial_coefficients(domain(knots)), expected, rtol=ROUNDING)


@pytest.mark.parametrize(("matrix", "shift"), AFFINE)
def test_other_polygons_have_the_binomials_of_their_edges_and_1_inside(matrix: np.ndarray, shift: np.ndarray) -> None:
    """The convention of .trp files, and also where the polygon is not one of whole numbers."""
    trapezoid = [[0, 0], [1, 0], [2, 0], [3, 0], [2, 1], [0, 1], [1, 0.5]]
    pentagon = [[2, 1], [0, 0], [1, 0], [2, 0], [2, 2], [0, 2], [0, 1], [1, 1], [1, 3], [1, 1]]
    for knots, expected in ((trapezoid, [1, 3, 3, 1, 1, 1, 1]), (pentagon, [2, 1, 2, 1, 1, 1, 2, 1, 1, 1])):
        shape = domain(np.array(knots) @ matrix.T + shift)
        assert binomial_coefficients(shape).tolist() == expected
    assert edge_coefficients(domain(np.array(pentagon))).tolist() == expected


def test_largest_degree() -> None:
    middle = Fraction(1)
    for k in range(MAX_BINOMIAL_DEGREE // 2):
        middle *= Fraction(MAX_BINOMIAL_DEGREE - k, k + 1)
    assert binomial_coefficients(domain(np.arange(MAX_BINOMIAL_DEGREE + 1.0))).max() == float(middle)
    with pytest.raises(DomainError, match=r"coefficients: binomial goes up to degree 1029, got 1030"):
        binomial_coefficients(domain(np.arange(MAX_BINOMIAL_DEGREE + 2.0)))


@pytest.mark.parametrize(("knots", "message"), cases("knots/refused", "lattice"))
def test_other_knots_are_refused(knots: list, message: str) -> None:
    with pytest.raises(DomainError, match=f"coefficients: binomial needs .*({message})"):
        binomial_coefficients(domain(knots))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_knots_equally_far_to_rounding_are_one_layer(scale):
    heights = np.array([1.0, 0.0, 0.3, 0.1 * 3, 1 + 1e-12, 2.0, 2 + 1e-7]) * scale
    assert [layer.tolist() for layer in layers(heights)] == [[2, 3], [0, 4], [5], [6]]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e7])
def test_the_knot_that_is_missing_is_named(scale: float) -> None:
    slanted = np.array([[2.0, 1.0], [1.0, 3.0]]) * scale
    cubic = [(i, j) for i in range(4) for j in range(4 - i)]
    grid = [(i, j) for i in range(4) for j in range(3)]
    for places, corners in ((cubic, [(0, 0), (3, 0), (0, 3)]), (grid, [(0, 0), (3, 0), (0, 2), (3, 2)])):
        knots = np.array(places) @ slanted + scale
        for index, place in enumerate(places):
            if place in corners:
                continue
            with pytest.raises(DomainError, match=rf"each of {len(places)} lattice knots once") as caught:
                binomial_coefficients(domain(np.delete(knots, index, axis=0)))
            named = re.search(r"without \((.*), (.*)\)", str(caught.value))
            assert [float(named[1]), float(named[2])] == pytest.approx(knots[index].tolist(), rel=1e-5)
            with pytest.raises(DomainError, match=rf"once.*: knots\[{len(places)}\] repeats knots\[{index}\]"):
                binomial_coefficients(domain(np.vstack([knots, knots[index]])))
