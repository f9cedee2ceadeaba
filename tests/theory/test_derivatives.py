"""Derivatives of points and of the basis against quotients of differences in 50 digits and more, and at the boundary.

In the linear parametrisation these follow by the chain rule: a parameter is μ of a toric one, at which T and μ are
differentiated.
"""

import math

import numpy as np
import pytest
from scipy.special import softmax

from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.language.loading import load_patch
from gtb_cli.theory.patch import Patch
from tests.exact import CONTEXT, Number, basis, numbers
from tests.laws import parameters
from tests.marks import mostly_long
from tests.patches import NAMES, named
from tests.shell import SPECS

# Fifty roundings of the largest derivative
DIGITS = 1e-14


def quotients(patch: Patch, u, step):
    """T, and (n, d) first and (n, d, d) second central difference quotients of it, in numbers of mpmath."""
    d, n = patch.dimension, len(patch.knots)

    def at(*moves):
        return np.array(basis(patch, [x + k * step for x, k in zip(u, moves, strict=True)]))

    one = np.eye(d, dtype=int)
    middle = at(*[0] * d)
    first = np.stack([(at(*e) - at(*-e)) / (2 * step) for e in one], axis=1)
    second = np.empty((n, d, d), dtype=object)
    for a in range(d):
        for b in range(d):
            if a == b:
                second[:, a, a] = (at(*one[a]) - 2 * middle + at(*-one[a])) / step**2
            else:
                signs = [(s, t, at(*(s * one[a] + t * one[b]))) for s in (1, -1) for t in (1, -1)]
                second[:, a, b] = sum(s * t * value for s, t, value in signs) / (4 * step**2)
    return middle, first, second


def inverse(matrix):
    if len(matrix) == 1:
        return np.array([[1 / matrix[0, 0]]])
    (a, b), (c, d) = matrix
    return np.array([[d, -b], [-c, a]]) / (a * d - b * c)


def exactly(patch: Patch, u, parametrization, depth=1.0):
    """(d,) parameter of a toric one `u`, and derivatives there of T, as floats; steps are small beside a depth."""
    step = depth * patch.domain.size * Number(10) ** -30
    middle, first, second = quotients(patch, u, step)
    if parametrization == "linear":
        knots = np.array([numbers(a) for a in patch.knots.tolist()])
        back = inverse(knots.T @ first)  # ∂u/∂p
        bend = np.einsum("nc,nab->cab", knots, second)
        u = knots.T @ middle
        first = first @ back
        second = np.einsum("nab,ai,bj->nij", second - np.einsum("nc,cab->nab", first, bend), back, back)
    return tuple(np.array(array, dtype=float) for array in (u, first, second))


def assert_same(patch, u, parametrization, expected, digits=DIGITS):
    """Derivatives of T, and of points, relative to the largest of them."""
    u = np.reshape(u, (1, -1))
    for order, values in enumerate(expected, 1):
        found = patch.basis_derivatives(u, order, parametrization)[0]
        limit = np.isfinite(found)
        size = np.abs(values).max()
        assert np.abs(found - values)[limit].max(initial=0) <= digits * size
        points = np.einsum("nk,n...->k...", patch.control_points - patch.control_points.mean(axis=0), values)
        found = patch.derivatives(u, order, parametrization)[0]
        limit = np.isfinite(found)
        bound = digits * size * np.ptp(patch.control_points, axis=0).max()
        assert np.abs(found - points)[limit].max(initial=0) <= bound


GENERAL = ["irrational_curve", "pentagon", "irrational_hexagon", "trapezoid", "repeated_knots", "bicubic", "nonagon"]


@pytest.mark.parametrize("parametrization", ["toric", "linear"])
@pytest.mark.parametrize("name", mostly_long(GENERAL, 2))
def test_derivatives_are_those_of_50_digits(name, parametrization):
    patch = named(name)
    v = patch.domain.vertices
    for share in np.random.default_rng(1).dirichlet(np.ones(len(v)), 2):
        with CONTEXT.workdps(100):
            u, *expected = exactly(patch, numbers((share @ v).tolist()), parametrization)
        assert_same(patch, u, parametrization, expected)


@pytest.mark.parametrize("parametrization", ["toric", "linear"])
@pytest.mark.parametrize("depth", mostly_long([1e-10, 1e-3]))
def test_no_digits_are_lost_near_the_boundary(depth, parametrization):
    """Edges along the axes through 0: elsewhere floats cannot say how near they are."""
    for name, place in (("irrational_curve", [0.0]), ("pentagon", [0.0, 0.0]), ("pentagon", [0.7, 0.0])):
        patch = named(name)
        u = np.array(place) + depth * (patch.domain.vertices.mean(axis=0) - place)
        with CONTEXT.workdps(150):
            u, *expected = exactly(patch, numbers(u.tolist()), parametrization, Number(depth))
        assert_same(patch, u, parametrization, expected, 10 * DIGITS)


@pytest.mark.parametrize("parametrization", ["toric", "linear"])
@pytest.mark.parametrize(
    ("name", "digits"),
    mostly_long([("integer_pentagon", 15), ("pentagon", 200), ("repeated_knots", 20), ("bicubic", 15)]),
)
def test_finite_derivatives_on_the_boundary_are_limits(name, digits, parametrization):
    """So near to it that also the lowest power, 0.05 from a knot near a corner of the pentagon, is small."""
    patch = named(name)
    v = np.array([numbers(corner) for corner in patch.domain.vertices.tolist()])
    finite = 0
    for place in (0.3 * v[0] + 0.7 * v[1], 0.4 * v[1] + 0.6 * v[2], v[0]):
        with CONTEXT.workdps(3 * digits + 80):
            depth = Number(10) ** -digits
            u, *expected = exactly(patch, place + depth * (v.mean(axis=0) - place), parametrization, depth)
        for order, there in enumerate(expected, 1):
            at = patch.basis_derivatives(u, order, parametrization)
            limit = np.isfinite(at)
            finite += limit.sum()
            size = max(np.abs(there[limit]).max(initial=0), patch.domain.size**-order)
            np.testing.assert_allclose(at[limit], there[limit], rtol=0, atol=1e-9 * size)
    assert finite > 10


def test_derivatives_are_infinite_where_powers_are():
    """Knots 0, a, … have T_1 ~ t^a at 0: first derivatives need a ≥ 1, second ones a = 1 or a ≥ 2, and no 1 < b < 2."""
    rise = [[0, 0, 0], [1, 1, 0], [2, 3, 0], [3, 2, 0]]
    for knots, first, second in (
        ([0, 1, 2, 3], True, True),
        ([0, 2, 3, 4], True, True),
        ([0, 1, 1.5, 3], True, False),
        ([0, 1.25, 2, 3], True, False),
        ([0, 0.5, 2, 3], False, False),
    ):
        curve = Patch(knots, rise)
        at = [curve.derivatives(0, order)[..., 0].ravel() for order in (1, 2)]
        for derivative, limit in zip(at, (first, second), strict=True):
            assert np.isfinite(derivative[:2]).all() == limit
            assert np.isinf(derivative[:2]).all() != limit
            assert derivative[2] == 0
        assert np.isinf(curve.basis_derivatives(0, 1)[:, 0]).tolist() == [not first, not first, False, False]
        # Linear parameters are t^a to first order: the ratios of the distances count.
        assert np.isfinite(curve.derivatives(0, 1, "linear")).all()
        ratio = knots[2] / knots[1]
        assert np.isfinite(curve.derivatives(0, 2, "linear")).all() == (ratio >= 2)


def test_derivatives_along_an_edge_are_finite_where_those_across_are_not():
    patch = named("pentagon")  # its edge v = 0 has knots at 1 and 8/7, and the next inside at 1
    at = patch.replace(edge_scale=0.5).derivatives([[0.7, 0.0]])[0]
    assert np.isfinite(at[:, 0]).all()
    assert np.isinf(at[:2, 1]).all()
    curve = patch.boundary(0)
    found, expected = patch.derivatives([[0.7, 0.0]], 1, "linear"), curve.derivatives([0.7], 1, "linear")
    np.testing.assert_allclose(found[0, :, 0], expected[0, :, 0], rtol=1e-13)


@pytest.mark.parametrize("name", mostly_long(["pentagon", "far_curve", *sorted({*NAMES} - {"beyond_floats"})], 2))
def test_linear_parameters_have_linear_precision(name):
    """With the knots for control points the first derivatives are the identity, and the second ones 0."""
    patch = named(name)
    points = np.zeros((len(patch.knots), 3))
    points[:, : patch.dimension] = patch.knots
    patch = patch.replace(control_points=points)
    u = parameters(patch)
    assert np.abs(patch.derivatives(u, 1, "linear") - np.eye(3)[:, : patch.dimension]).max() < 1e-10
    far = 1 + np.abs(patch.knots).max() / patch.domain.size
    slopes = np.abs(patch.basis_derivatives(u, 2, "linear"))
    slopes[~np.isfinite(slopes)] = 0
    rounding = 1e-11 * far * (slopes.max(axis=(1, 2, 3)) + 1 / patch.domain.size**2) * np.abs(points).max()
    assert (np.abs(patch.derivatives(u, 2, "linear")).max(axis=(1, 2, 3)) <= rounding).all()


@pytest.mark.parametrize(("scale", "shift"), [(1e9, 0.0), (1e-9, 0.0), (1.0, 1e7)])
def test_derivatives_follow_units(scale, shift):
    patch = named("integer_pentagon").replace(edge_normals="unit", edge_scale=1 / scale)
    moved = patch.replace(knots=scale * patch.knots + shift)
    u = np.array([[0.5, 1.5], [1, 0], [2, 1], [1.2, 0.7]])
    for parametrization in ("toric", "linear"):
        for order in (1, 2):
            one = patch.replace(edge_scale=1.0).basis_derivatives(u, order, parametrization)
            other = moved.basis_derivatives(scale * u + shift, order, parametrization) * scale**order
            np.testing.assert_allclose(other, one, rtol=1e-7 if shift else 1e-12, atol=1e-8 if shift else 1e-12)


@pytest.mark.parametrize(
    ("name", "angle"), mostly_long([("pentagon", 0.3), ("trapezoid", 0.3), ("nonagon", 0), ("bicubic", 0.3)], 2)
)
@pytest.mark.parametrize("parametrization", mostly_long(["linear", "toric"]))
def test_knots_off_their_edges_by_rounding_count_as_on_them(name, angle, parametrization):
    patch, (c, s) = load_patch(SPECS / f"{name}.toml"), (math.cos(angle), math.sin(angle))
    near = patch.replace(knots=patch.knots @ [[c, s], [-s, c]])
    far = patch.replace(knots=near.knots + 1e7)
    u, v = (triangulation(each.domain, 6).parameters for each in (near, far))
    for order in (1, 2):
        one, other = near.derivatives(u, order, parametrization), far.derivatives(v, order, parametrization)
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-5 * np.abs(one[np.isfinite(one)]).max())


def test_steep_weights_nearer_to_an_edge_than_the_solver_is_exact():
    knots, logs = np.array([[-1.62, 0], [0, 0], [0.3, 2.9], [-0.86, 0.0007]]), np.array([21, 2, 15, -2])
    patch = Patch(knots, np.eye(4)[:, :3], weights=np.exp(logs))
    s = np.stack(np.meshgrid(np.linspace(22, 24, 9), np.linspace(-18.5, -17, 9)), axis=-1).reshape(-1, 2)
    all_shares = softmax(logs + s @ knots.T, axis=1)
    for shares, found in zip(all_shares, patch.derivatives(all_shares @ knots, 1, "linear"), strict=True):
        away = knots - shares @ knots
        expected = np.linalg.solve((away.T * shares) @ away, (away.T * shares) @ patch.control_points).T
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("parametrization", ["toric", "linear"])
def test_many_places_have_the_derivatives_of_each(parametrization):
    """They are made in blocks of some thousand numbers."""
    patch, places = named("pentagon"), np.random.default_rng(1).dirichlet([2, 2, 2], 8000) @ [[0, 0], [2, 0], [0, 2]]
    found, some = patch.derivatives(places, 1, parametrization), [0, 1364, 1366, 4000, 7999]
    one_by_one = [patch.derivatives(places[[k]], 1, parametrization)[0] for k in some]
    np.testing.assert_allclose(found[some], one_by_one, rtol=1e-12, atol=1e-14)
