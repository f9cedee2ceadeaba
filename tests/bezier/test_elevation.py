"""Degree elevation against the textbook's formulas in exact fractions, and the image against itself."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from gtb_cli.bezier.elevation import MAX_ELEVATED_KNOTS, elevate, multiplier, product
from gtb_cli.checks.probe import points_at_torus
from gtb_cli.checks.properties import check_patch
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.specs import GOOD_SPECS, load, spec

ROUNDING = 1e-13  # fraction of the extent: sums of a few dozen products

PATCHES = [path.stem for path in GOOD_SPECS if isinstance(load(path), Patch)]


def torus_samples(patch: Patch) -> np.ndarray:
    """(d, m) torus coordinates from deep in one corner to deep in another."""
    steps = np.linspace(-12, 12, 9) / patch.domain.size
    return np.stack([axis.ravel() for axis in np.meshgrid(*[steps] * patch.dimension)])


def assert_same_image(patch: Patch, elevated: Patch, tolerance: float = ROUNDING):
    """Points at the same torus coordinates are the same: numerator and denominator have a common factor."""
    s = torus_samples(patch)
    extent = np.ptp(patch.control_points, axis=0).max() + np.abs(patch.control_points).max() * 1e-3
    np.testing.assert_allclose(points_at_torus(elevated, s), points_at_torus(patch, s), rtol=0, atol=tolerance * extent)


def test_a_polynomial_curve_is_elevated_by_the_textbook():
    """b*_i = i/(n + 1) b_{i−1} + (1 − i/(n + 1)) b_i, here of degree 4."""
    points = [Fraction(x) for x in (3, -1, 4, 2, 7)]
    n = len(points) - 1
    patch = Patch(range(n + 1), [[float(x), 0] for x in points], coefficients=[math.comb(n, i) for i in range(n + 1)])
    elevated = elevate(patch)
    expected = [points[0]]
    expected += [Fraction(i, n + 1) * points[i - 1] + (1 - Fraction(i, n + 1)) * points[i] for i in range(1, n + 1)]
    expected += [points[-1]]
    assert elevated.knots[:, 0].tolist() == list(range(n + 2))
    assert elevated.weights.tolist() == [math.comb(n + 1, i) for i in range(n + 2)]
    assert elevated.coefficients.tolist() == [1] * (n + 2)
    np.testing.assert_allclose(elevated.control_points[:, 0], [float(x) for x in expected], rtol=1e-15)


def test_a_tensor_product_patch_is_elevated_in_both_directions():
    elevated = elevate(spec("bicubic"))
    assert elevated.domain.vertices.tolist() == [[0, 0], [4, 0], [4, 4], [0, 4]]
    assert len(elevated.knots) == 25
    u = np.stack([axis.ravel() for axis in np.meshgrid(np.linspace(0, 3, 8), np.linspace(0, 3, 8))], axis=1)
    # With equal fractions of the domains go equal points.
    np.testing.assert_allclose(elevated.evaluate(u * 4 / 3), spec("bicubic").evaluate(u), atol=1e-14)


@pytest.mark.parametrize("name", mostly_long(PATCHES, 6))
def test_the_image_stays(name):
    patch = spec(name)
    elevated = elevate(patch)
    assert len(elevated.knots) > len(patch.knots) or name == "repeated-knot"
    assert_same_image(patch, elevated)
    assert_same_image(patch, elevate(patch, 2))
    assert check_patch(elevated).holds
    # Corners stay corners, with the same control points, exactly.
    assert len(elevated.domain.vertices) == len(patch.domain.vertices)
    np.testing.assert_array_equal(elevated.evaluate(elevated.domain.vertices), patch.evaluate(patch.domain.vertices))


def test_a_curve_keeps_its_points_at_the_same_fractions():
    patch = spec("example-3.1").replace(edge_scale=2.5)
    elevated = elevate(patch, 3)
    f = np.linspace(0, 1, 40)
    length = elevated.knots[-1, 0]
    np.testing.assert_allclose(elevated.evaluate(f * length), patch.evaluate(f), atol=1e-13)


@given(st.integers(0, 10**6))
def test_random_products_have_the_same_image(seed):
    rng = np.random.default_rng(seed)
    d = int(rng.integers(1, 3))
    n, m = int(rng.integers(d + 2, 9)), int(rng.integers(1, 5))
    knots = rng.random((n, d)) * 3
    patch = Patch(knots, rng.normal(size=(n, 3)), rng.random(n) + 0.1, rng.random(n) + 0.1)
    factor = rng.random((m, d)) * 2
    elevated = product(patch, factor)
    assert_same_image(patch, elevated, 1e-12)
    assert len(elevated.knots) == n * m
    # The denominators differ by the factor Σ e^<d, s>, computed here.
    s = torus_samples(patch)
    ours = np.exp(elevated.knots @ s + elevated.log_products[:, None]).sum(axis=0)
    theirs = np.exp(patch.knots @ s + patch.log_products[:, None]).sum(axis=0)
    np.testing.assert_allclose(ours, theirs * np.exp(factor @ s).sum(axis=0), rtol=1e-12)


def test_equal_sums_are_merged():
    patch = Patch([0, 1, 2], [[0, 0], [1, 3], [2, 0]], [1, 2, 3])
    found = product(patch, np.array([[0.0], [1.0]]))
    assert found.knots[:, 0].tolist() == [0, 1, 2, 3]
    assert found.weights.tolist() == [1, 2 + 1, 3 + 2, 3]
    np.testing.assert_allclose(found.control_points[1], np.array([1, 3, 0]) * 2 / 3, rtol=1e-15)
    tenths = product(Patch([0, 0.1, 0.2, 0.3], np.eye(4)[:, :2]), np.array([[0.0], [0.1]]))  # 0.1 + 0.2 is not 0.3
    assert len(tenths.knots) == 5


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e9])
@pytest.mark.parametrize("name", ["example-3.1", "pentagon", "bicubic"])
def test_any_size(name, scale):
    patch = spec(name)
    elevated = elevate(patch.replace(knots=patch.knots * scale, control_points=patch.control_points / scale))
    plain = elevate(patch)
    np.testing.assert_allclose(elevated.knots, plain.knots * scale, rtol=1e-14, atol=1e-14 * scale)
    np.testing.assert_allclose(elevated.control_points, plain.control_points / scale, rtol=1e-13, atol=1e-14 / scale)


def test_far_from_the_origin_sums_are_still_merged():
    patch = spec("bicubic")
    assert len(elevate(patch.replace(knots=patch.knots / 7 + 1e6)).knots) == 25


def test_weights_beyond_floats():
    patch = Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], log_weights=[0, 2000, -3000])
    elevated = elevate(patch)
    np.testing.assert_allclose(elevated.log_weights, [0, 2000, 2000, -3000])
    assert_same_image(patch, elevated)
    for weights in ([1e200, 1, 1e-200], [1, 1.5e308, 1.5e308]):  # of which sums are no floats
        huge = Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], weights)
        assert_same_image(huge, elevate(huge))


def test_settings_stay_where_they_can():
    curve = spec("example-3.1").replace(edge_scale=np.array([2.0, 3.0]), lifting=np.arange(5.0))
    assert elevate(curve).edge_scale.tolist() == [2, 3]
    assert elevate(curve).lifting is None
    assert elevate(curve).name == curve.name
    square = Patch([[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5]], np.eye(5)[:, :3], edge_normals="primitive")
    assert elevate(square).edge_normals == "primitive"
    halves = Patch([[0, 0], [0.5, 0], [1, 0], [0, 1], [0.5, 1], [1, 1]], np.eye(6)[:, :3], edge_normals="primitive")
    assert elevate(halves).edge_normals == "unit"  # its corners are (1.5, 0) and (1.5, 2)
    assert elevate(spec("pentagon").replace(edge_scale=np.arange(1.0, 6))).edge_scale.tolist() == [1, 2, 3, 4, 5]
    more = product(spec("pentagon").replace(edge_scale=np.arange(1.0, 6)), np.array([[0, 0], [0.3, -0.1]]))
    assert len(more.domain.vertices) == 7
    assert more.edge_scale == 1


def test_new_edges_are_one_point():
    more = product(spec("pentagon"), np.array([[0, 0], [0.3, -0.1]]))
    size = [np.ptp(more.boundary(edge).control_points, axis=0).max() for edge in range(7)]
    assert sum(extent < 1e-15 for extent in size) == 2
    np.testing.assert_allclose(multiplier(spec("pentagon")), spec("pentagon").domain.vertices)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: elevate(spec("pentagon"), -1), "by: expected a whole number, at least 0, got -1"),
        (lambda: elevate(spec("pentagon"), 1.5), "got 1.5"),
        (lambda: elevate(spec("pentagon"), True), "got True"),
        # 0 + 2 is 1 + 1.
        (
            lambda: product(spec("example-3.1"), np.geomspace(1, 2, 5000)[:, None]),
            f"24999, at most {MAX_ELEVATED_KNOTS} are allowed",
        ),
        (lambda: product(spec("example-3.1"), np.arange(1e6)[:, None]), "at most 2000000 are allowed"),
    ],
)
def test_what_cannot_be_elevated(call, message):
    with pytest.raises(DomainError, match=message):
        call()
