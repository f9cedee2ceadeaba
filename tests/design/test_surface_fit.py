"""Surfaces through points, and near them: those of the same patch are found again, others nearly."""

import math

import numpy as np
import pytest

from gtb_cli.design.fit import RESIDUAL_TOLERANCE, fit, surface_near, surface_through
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.language.loading import parse
from tests.shell import BICUBIC, CURVE, PENTAGON, gtb
from tests.specs import load


def inner_parameters(patch, count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.dirichlet(np.ones(len(patch.domain.vertices)), count) @ patch.domain.vertices


def test_points_of_a_patch_with_their_parameters_give_it_back():
    patch = load(PENTAGON)
    p = inner_parameters(patch, 200)
    points = patch.evaluate(p, "linear")
    flat = patch.replace(control_points=np.zeros((len(patch.knots), 3)))
    found = surface_near(points, flat, p, smoothing=0)
    np.testing.assert_allclose(found.patch.control_points, patch.control_points, atol=1e-6)
    assert found.distance < 1e-9
    assert surface_near(points, flat, p).distance < 1e-2


def test_points_without_parameters_are_projected():
    """A gentle bump is found from the plane; residuals are what the surface says."""
    patch = load(BICUBIC)
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    share = (patch.knots - low) / (high - low)
    plane = patch.replace(control_points=np.column_stack([share, np.zeros(len(share))]))
    xy = np.random.default_rng(5).random((300, 2))
    points = np.column_stack([xy, 0.2 * xy[:, 0] * (1 - xy[:, 0]) + 0.1 * xy[:, 1] ** 2])
    found = surface_near(points, plane)
    assert found.distance < 2e-3
    assert found.mean <= found.distance
    again = found.patch.evaluate(found.parameters, "linear")
    assert np.linalg.norm(again - points, axis=1).max() == pytest.approx(found.distance)


@pytest.mark.parametrize("name", [BICUBIC, PENTAGON, "specs/hexagon.toml"])
def test_as_many_points_as_knots_are_met(name):
    """At the knots without parameters: there the linear parametrisation gives the net of knots itself."""
    patch = load(name)
    points = np.random.default_rng(6).normal(size=(len(patch.knots), 3))
    found = surface_through(points, patch)
    np.testing.assert_allclose(found.patch.evaluate(patch.knots, "linear"), points, atol=1e-10)
    inside = patch.domain.center + 0.9 * (patch.knots - patch.domain.center)
    other = surface_through(points, patch, inside)
    np.testing.assert_allclose(other.patch.evaluate(inside, "linear"), points, atol=1e-10)


def test_rounds_of_a_cubic_triangle_are_what_bernsteins_operator_says():
    """Its least eigenvalue at the lattice is 3! / 3³ = 2/9, and each round leaves 7/9 of what is missed."""
    patch = load("specs/bezier-triangle.toml").replace(weights=np.ones(10))
    points = np.random.default_rng(7).normal(size=(10, 3))
    expected = math.log(RESIDUAL_TOLERANCE) / math.log(7 / 9)
    assert surface_through(points, patch).rounds == pytest.approx(expected, rel=0.1)


def test_knots_that_coincide_cannot_meet_two_points():
    patch = load(BICUBIC)
    knots = patch.knots.copy()
    knots[5] = knots[6]
    points = np.random.default_rng(6).normal(size=(len(knots), 3))
    with pytest.raises(ToleranceError, match="the surface still misses a point"):
        surface_through(points, patch.replace(knots=knots, coefficients=None))


def test_fit_takes_surfaces_by_what_is_given():
    patch = load(BICUBIC)
    through = fit(patch.control_points, patch=patch)
    np.testing.assert_array_equal(through.patch.evaluate(patch.domain.vertices), patch.control_points[[0, 3, 15, 12]])
    near = fit(patch.evaluate(inner_parameters(patch, 20)), patch=patch)
    assert near.distance < 0.01
    with pytest.raises(DomainError, match="knots: are for curves"):
        fit([[0, 0, 0]], [1], patch=patch)
    with pytest.raises(DomainError, match="parameters: are those of a surface"):
        fit([[0, 0, 0]], parameters=[[0, 0]])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, 0]], load(CURVE)), "this is a curve"),
        (([[0, 0]], load(BICUBIC)), "points: expected shape"),
        (([[0, 0, 0]], load(BICUBIC), [[0, 0], [1, 1]]), r"parameters: expected shape \(1, 2\)"),
        (([[0, 0, 0]], load(BICUBIC), [[50, 50]]), "outside the domain"),
        (([[0, 0, 0]], load(BICUBIC), None, -1.0), "smoothing: must not be negative"),
    ],
)
def test_what_cannot_be_fitted(arguments, message):
    with pytest.raises(DomainError, match=message):
        surface_near(*arguments)


def test_a_surface_through_points_needs_one_for_each_knot():
    with pytest.raises(DomainError, match="points: expected 16, one for each knot, got 1"):
        surface_through([[0, 0, 0]], load(BICUBIC))


def test_the_command_fits_a_surface():
    patch = load(BICUBIC)
    p = inner_parameters(patch, 60)
    rows = np.column_stack([p, patch.evaluate(p, "linear")])
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist()).encode()
    result = gtb("fit", "-", "--patch", BICUBIC, stdin=text)
    assert result.status == 0
    assert "60 points, 0 rounds" in result.err
    assert len(parse(result.text).knots) == len(patch.knots)
    net = "\n".join(" ".join(map(repr, row)) for row in patch.control_points.tolist()).encode()
    assert "16 points, " in gtb("fit", "-", "--patch", BICUBIC, stdin=net).err
    assert "expected 3 or 5 numbers, got 2" in gtb("fit", "-", "--patch", BICUBIC, stdin=b"0 0\n", status=2).err
    assert gtb("fit", "-", "--patch", "-", stdin=b"").status == 2
    assert gtb("fit", "-", "--patch", BICUBIC, "--knots", "0,1", stdin=b"").status == 2
