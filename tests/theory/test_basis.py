"""GT-Bernstein and rational basis: the definition, classical bases, total positivity, partition of unity."""

import math
from fractions import Fraction
from itertools import combinations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import domain
from gtb_cli.moment.torus import BLOCK_NUMBERS
from gtb_cli.theory.basis import gt_bernstein, unity_coefficients
from tests.laws import inner_parameters
from tests.patches import NAMES, bezier_triangle, bicubic, named

EPS = float(np.finfo(np.float64).eps)

# Relative error of a β of these tests: a rounding of each of up to nine logarithms, times exponents up to 20
BETA_ERROR = 1e-12

CLASSICAL_ERROR = 1e-14  # error of the values of classical bases, all at most 1, and of points of size 1

ROOTS = [0, math.sqrt(2) / 4, 0.5, math.sqrt(2) / 2, 1]  # the knots of Example 2.1


# The definition


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"large_knots", "tiny_pentagon", "far_curve"}))
def test_beta_is_the_product_of_powers(name):
    patch = named(name)
    shape = patch.domain
    u = inner_parameters(patch)
    h = shape.edge_functions(u)
    powers = patch.coefficients * (h[:, None, :] ** shape.heights[None]).prod(axis=2)
    assert gt_bernstein(shape, patch.coefficients, u) == pytest.approx(powers, rel=BETA_ERROR)


@pytest.mark.parametrize("name", NAMES)
def test_the_rational_basis_is_beta_with_weights(name):
    patch = named(name)
    u = inner_parameters(patch)
    beta = gt_bernstein(patch.domain, patch.coefficients, u) * patch.weights
    with np.errstate(invalid="ignore"):
        quotient = beta / beta.sum(axis=1, keepdims=True)
    in_range = np.isfinite(beta).all(axis=1) & (beta > 1e-290).any(axis=1)
    if name in ("beyond_floats", "large_knots"):
        assert not in_range.all()
    else:
        assert in_range.all()
    exponents = patch.domain.heights.sum(axis=1).max() + 20
    assert patch.basis(u)[in_range] == pytest.approx(quotient[in_range], rel=64 * EPS * exponents, abs=1e-290)


def test_zero_to_the_power_zero_is_one():
    shape = domain([[0, 0], [2, 0], [0, 2], [1, 0]])
    beta = gt_bernstein(shape, [1, 1, 1, 5], [[0, 0], [1, 0], [0, 2]])
    # At (0, 0): h = (0, 2, 0); knot (0, 0) has exponents (0, 2, 0).
    assert beta == pytest.approx(np.array([[4, 0, 0, 0], [1, 1, 0, 5], [0, 0, 4, 0]]), rel=BETA_ERROR, abs=0)


def test_beta_beyond_the_range_of_floats_is_infinite_or_zero():
    assert gt_bernstein(domain([0, 400, 800]), np.ones(3), [400.0]).tolist() == [[math.inf] * 3]
    assert (gt_bernstein(domain([0, 400, 800], edge_scale=1e-3), np.ones(3), [400.0]) < 1).all()
    assert gt_bernstein(domain([0, 1, 1000]), np.ones(3), [1e-320]).tolist()[0][2] == 0


def test_no_entry_of_the_rational_basis_is_subnormal():
    # Subnormal numbers are a hundred times slower; exponents here go to thousands below the largest.
    patch = named("large_knots")
    t = patch.basis(np.random.default_rng(0).dirichlet(np.full(6, 0.3), 500) @ patch.domain.vertices)
    assert (t == 0).any()
    assert t[t > 0].min() >= np.finfo(np.float64).tiny


def test_blocks_join_without_a_seam():
    patch = named("pentagon")
    count = 2 * BLOCK_NUMBERS // 8 + 100
    u = np.random.default_rng(1).dirichlet(np.ones(5), count) @ patch.domain.vertices
    u[::1000] = patch.domain.vertices[2]
    u[::777] = [0.7, 0]
    points = patch.evaluate(u)
    some = np.r_[:50, BLOCK_NUMBERS // 8 - 50 : BLOCK_NUMBERS // 8 + 50, count - 50 : count]
    assert np.abs(points[some] - np.concatenate([patch.evaluate(u[i][None]) for i in some])).max() < 1e-13
    assert patch.evaluate(u).tobytes() == points.tobytes()


def test_a_parameter_outside_is_named_by_its_index_in_any_block():
    patch = named("pentagon")
    u = np.full((2 * BLOCK_NUMBERS // 8, 2), 0.5)
    u[BLOCK_NUMBERS // 8 + 17] = [9, 9]
    with pytest.raises(DomainError, match=rf"parameters\[{BLOCK_NUMBERS // 8 + 17}\]: \(9.0, 9.0\) is outside"):
        patch.evaluate(u)


# Classical bases


@pytest.mark.parametrize(
    ("degree", "length"), [*((degree, degree) for degree in (1, 2, 5, 12)), *((degree, 1) for degree in (2, 3, 7))]
)
def test_equally_spaced_knots_give_the_bernstein_basis(degree, length):
    """On [0, n] as they stand; on [0, 1] after Remark 2.1: a_i = i/n and k_0 = k_1 = n."""
    from scipy.interpolate import BPoly

    shape = domain(length * np.arange(degree + 1) / degree, edge_scale=degree / length)
    c = np.array([math.comb(degree, i) for i in range(degree + 1)]) / float(degree) ** degree
    t = np.linspace(0, length, 33)
    bernstein = BPoly(np.eye(degree + 1)[:, None, :], [0, 1])(t / length)
    assert np.abs(gt_bernstein(shape, c, t) - bernstein).max() < CLASSICAL_ERROR


def test_a_bicubic_patch_is_scipys_rational_tensor_product():
    from scipy.interpolate import NdBSpline

    patch = bicubic()
    clamped = np.repeat([0.0, 3.0], 4)
    homogeneous = np.column_stack([patch.control_points, np.ones(16)]) * patch.weights[:, None]
    spline = NdBSpline((clamped, clamped), homogeneous.reshape(4, 4, 4), k=3)
    u = np.random.default_rng(2).random((200, 2)) * 3
    u[:20, 0], u[20:40, 1] = 0, 3
    found = spline(u[:, ::-1])  # knots run through v row by row
    assert np.abs(patch.evaluate(u) - found[:, :3] / found[:, 3:]).max() < 4 * CLASSICAL_ERROR


def test_a_bezier_triangle_has_exact_values():
    patch = bezier_triangle()
    knots = patch.knots.astype(int).tolist()
    thirds = [Fraction(k, 7) for k in range(8)]
    places = [(3 * a, 3 * b) for a in thirds for b in thirds if a + b <= 1]
    u = np.array([[float(x) for x in place] for place in places])
    points = patch.evaluate(u)
    for (x, y), point in zip(places, points, strict=True):
        barycentric = (x / 3, y / 3, 1 - (x + y) / 3)
        terms = []
        for (i, j), c, weight in zip(knots, patch.coefficients, patch.weights, strict=True):
            powers = barycentric[0] ** i * barycentric[1] ** j * barycentric[2] ** (3 - i - j)
            terms.append(Fraction(c) * Fraction(weight) * powers)
        for axis in range(3):
            exact = sum(t * Fraction(b) for t, b in zip(terms, patch.control_points[:, axis].tolist(), strict=True))
            assert abs(point[axis] - float(exact / sum(terms))) < 4 * CLASSICAL_ERROR


# Total positivity


def minors(matrix):
    """All minors of a matrix, of numbers of any kind."""
    n = len(matrix)
    for size in range(1, n + 1):
        for rows in combinations(range(n), size):
            for columns in combinations(range(n), size):
                yield mpmath.det(mpmath.matrix([[matrix[i][j] for j in columns] for i in rows]))


@pytest.mark.parametrize(
    ("knots", "parameters"),
    [(ROOTS, [0.1, 0.3, 0.55, 0.7, 0.9]), ([0, 1, 3], [0.25, 1.5, 2.75]), ([0, 0.5, 4, 5], [0.5, 1, 3, 4.5])],
)
def test_collocation_matrices_are_strictly_totally_positive_inside(knots, parameters):
    # Thm 2.2, for interior parameters and distinct knots; entries of the program, minors in 50 digits.
    matrix = gt_bernstein(domain(knots), np.ones(len(knots)), parameters)
    with mpmath.workdps(50):
        places = [mpmath.mpf(t) for t in parameters]
        exact = [[t ** mpmath.mpf(a) * (knots[-1] - t) ** (knots[-1] - mpmath.mpf(a)) for a in knots] for t in places]
        assert all(minor > 0 for minor in minors(exact))
        for row, exact_row in zip(matrix.tolist(), exact, strict=True):
            assert row == pytest.approx([float(x) for x in exact_row], rel=4 * EPS * 10)
        # Minors are alternating sums, so that small ones are below the rounding of the entries.
        found = [float(minor) for minor in minors(matrix.tolist())]
    scale = max(found)
    assert min(found) > -64 * EPS * scale
    assert sum(minor > 0 for minor in found) >= 0.95 * len(found)


def test_collocation_at_an_end_is_only_totally_positive():
    # mathematics.md, section 7: the paper's "strictly" fails for t_0 = a_0.
    matrix = gt_bernstein(domain(ROOTS), np.ones(5), [0, 0.3, 0.5, 0.8, 1]).tolist()
    found = [float(minor) for minor in minors(matrix)]
    assert min(found) > -1e-17
    assert found.count(0.0) > 0


# Partition of unity of β


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("seed", range(3))
def test_integer_knots_have_the_binomial_coefficients_for_every_choice_of_parameters(degree, seed):
    t = degree * (np.arange(degree + 1) + np.random.default_rng(seed).uniform(0.2, 0.8, degree + 1)) / (degree + 1)
    expected = [math.comb(degree, i) / degree**degree for i in range(degree + 1)]
    shape = domain(range(degree + 1))
    assert unity_coefficients(shape, t) == pytest.approx(expected, rel=1e-9)
    assert unity_coefficients(shape) == pytest.approx(expected, rel=1e-9)


def test_a_solution_that_is_not_positive_is_refused_with_its_values():
    with pytest.raises(DomainError, match=r"would need \(-0.0740741, 0.314815, 0.0555556\), which are not all"):
        unity_coefficients(domain([0, 1, 3]), [1.5, 2, 2.25])


@pytest.mark.parametrize("scale", [0.5, 1.5])
@given(seed=st.integers(0, 10**6))
@settings(max_examples=20)
def test_example_2_1s_knots_have_no_positive_solution_at_other_scales(scale, seed):
    t = np.sort(np.random.default_rng(seed).uniform(0.02, 0.98, 5))
    if np.diff(t).min() < 0.02:
        t = np.linspace(t[0], t[-1] + 0.01, 5)
    with pytest.raises(DomainError, match="not all positive"):
        unity_coefficients(domain(ROOTS, edge_scale=scale), t)


def test_a_solution_is_one_at_its_parameters():
    t = np.array([0.2, 0.8, 1.4, 2.8])
    shape = domain([0, 1, 1.9, 3])
    c = unity_coefficients(shape, t)
    assert (c > 0).all()
    assert gt_bernstein(shape, c, t).sum(axis=1) == pytest.approx(1, rel=1e-13)


def test_a_lattice_square_has_a_solution():
    # (h_0 + h_2)² (h_1 + h_3)² / 16 = 1: coefficients C(2, i) C(2, j) / 16.
    knots = [(i, j) for j in range(3) for i in range(3)]
    expected = [math.comb(2, i) * math.comb(2, j) / 16 for i, j in knots]
    assert unity_coefficients(domain(knots)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("shape", "t", "message"),
    [
        (domain([0, 1, 2]), [0.5, 1.5], "parameters: expected 3, one per knot, got 2"),
        (domain([0, 1, 1, 2]), None, "no unique solution to rounding"),
        (domain([0, 1, 2]), [0.5, 0.5, 1.5], "no unique solution to rounding"),
        (domain(range(60)), None, "no unique solution to rounding"),
        (domain([0, 300, 900]), None, "so large that β is beyond the range of floats"),
        (domain([0, 1, 2]), [0.5, 1, 3], "outside the domain"),
    ],
)
def test_partition_of_unity_that_cannot_be_solved_is_refused(shape, t, message):
    with pytest.raises(DomainError, match=message):
        unity_coefficients(shape, t)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_coefficients_that_are_zero_to_rounding_are_not_positive(unit):
    with pytest.raises(DomainError, match=r"would need \(\S+, 0, \S+, \S+\), which are not all positive"):
        unity_coefficients(domain([0, unit, 2 * unit, 4 * unit], edge_scale=1 / unit))


def test_tiny_coefficients_are_positive():
    c = unity_coefficients(domain([0, 1, 2, 3], edge_scale=30))
    assert (c > 0).all()
    assert c.max() < 1e-40
    np.testing.assert_allclose(c / c[0], [1, c[1] / c[0], c[1] / c[0], 1], rtol=1e-9)
