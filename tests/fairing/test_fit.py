"""Curves and surfaces through points, and surfaces near them; the iteration converges as its matrix says."""

import math

import numpy as np
import pytest

from gtb_cli.checks.properties import check_patch
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.fairing.fit import MAX_POINTS, RESIDUAL_TOLERANCE, fit
from gtb_cli.language.loading import from_dict
from gtb_cli.language.writer import to_dict
from gtb_cli.tessellation.tessellate import tessellate


def helix(n: int) -> np.ndarray:
    return np.array([[math.cos(t), math.sin(t), t / 5] for t in np.linspace(0, 6, n)])


@pytest.mark.parametrize("n", [2, 3, 10, 70, MAX_POINTS])
def test_a_curve_passes_its_points(n):
    found = fit(helix(n))
    size = np.abs(helix(n)).max()
    assert found.distance <= RESIDUAL_TOLERANCE * size
    np.testing.assert_allclose(found.curve.evaluate(found.parameters), helix(n), atol=2 * RESIDUAL_TOLERANCE * size)
    assert found.curve.evaluate(found.curve.domain.vertices).tolist() == helix(n)[[0, -1]].tolist()
    assert (np.diff(found.parameters) > 0).all()


def test_more_points_of_a_circle_make_a_better_circle():
    errors = []
    for n in (10, 20, 40):
        curve = fit(helix(n)).curve
        points = curve.evaluate(np.linspace(*curve.domain.vertices[:, 0], 1000))
        errors.append(np.abs(np.hypot(points[:, 0], points[:, 1]) - 1).max())
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3


def test_parameters_are_spread_evenly():
    """With equal steps of the parameter, no step along the curve is much longer than another."""
    curve = fit(helix(50)).curve
    points = curve.evaluate(np.linspace(*curve.domain.vertices[:, 0], 2000))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.max() < 3 * steps.mean()


def test_rounds_are_what_the_eigenvalues_say():
    """Each round shrinks what is missed by the spectral radius of I − C, in the end."""
    found = fit(helix(12))
    radius = np.abs(1 - np.linalg.eigvals(found.curve.basis(found.parameters))).max()
    expected = math.log(RESIDUAL_TOLERANCE) / math.log(radius)
    assert 0.6 * expected < found.rounds < 1.2 * expected
    assert fit(helix(50)).rounds < 1.5 * fit(helix(12)).rounds


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e9])
def test_any_size(scale):
    found, plain = fit(helix(9) * scale), fit(helix(9))
    np.testing.assert_allclose(
        found.curve.control_points, plain.curve.control_points * scale, rtol=1e-9, atol=1e-11 * scale
    )
    np.testing.assert_allclose(found.parameters, plain.parameters * scale, rtol=1e-12)


@pytest.mark.parametrize(
    ("points", "knots"),
    [
        (np.random.default_rng(3).normal(size=(7, 2)).tolist(), [0, 1, 1.5, 3, 3.2, 5, 8]),
        ([[0, 0], [1, 1], [2, 1], [3, 0]], [0, 1e-12, 1, 2]),
        ([[0, 0], [1, 1], [2, 0], [1, 1], [0, 0]], None),
    ],
)
def test_knots_may_be_given_and_points_may_come_back(points, knots):
    found = fit(points, knots)
    assert knots in (None, found.curve.knots[:, 0].tolist())
    np.testing.assert_allclose(found.curve.evaluate(found.parameters)[:, :2], points, atol=1e-11)
    is_extreme = knots is not None and 1e-12 in knots  # nearly a repeated knot
    assert is_extreme or check_patch(found.curve).holds


@pytest.mark.parametrize("seed", range(8))
def test_points_may_be_uneven(seed):
    """Chords from 0.01 to 10: weights beyond floats, and basis functions that are nearly the same."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(10.0 ** rng.uniform(-2, 1, (int(rng.integers(5, 40)), 2)), axis=0)
    found = fit(points)
    np.testing.assert_allclose(found.curve.evaluate(found.parameters)[:, :2], points, atol=1e-11 * points.max())
    assert from_dict(to_dict(found.curve)) == found.curve


@pytest.mark.parametrize("seed", range(4))
def test_curves_through_very_uneven_points_can_be_meshed(seed):
    """Chords from a billionth to 1: with knots as uneven, rounding of the weights was more than meshes bear."""
    rng = np.random.default_rng(seed)
    chords = 10.0 ** rng.uniform(-9, 0, 12)[:, None] * [[0.6, 0.8]] * rng.choice([-1, 1], (12, 2))
    assert len(tessellate(fit(np.cumsum(chords, axis=0)).curve, resolution=200).vertices) == 201


@pytest.mark.parametrize(
    ("points", "knots", "message"),
    [
        ([[0, 0]], None, "points: expected 2 to 100, got 1"),
        (np.arange(202).reshape(101, 2), None, "got 101"),
        ([[0, 0], [1, 1], [1, 1]], None, "points: 1 and 2 coincide"),
        ([0, 1, 2], None, r"points: expected shape \(n, 3\) or \(n, 2\)"),
        ([[0, 0], [1, math.nan]], None, r"points\[1\]\[1\]: must be finite"),
        ([[0, 0], [1, 1]], [0, 1, 2], "knots: expected 2, one for each point, got 3"),
        ([[0, 0], [1, 1], [2, 1]], [0, 1, 1], "knots: must ascend, got 1 before 1"),
        ([[0, 0], [1, 1], [2, 1]], [0, 2, 1], "knots: must ascend, got 2 before 1"),
    ],
)
def test_what_has_no_curve(points, knots, message):
    with pytest.raises(DomainError, match=message):
        fit(points, knots)


def test_an_iteration_that_does_not_end_is_an_error(monkeypatch):
    monkeypatch.setattr("gtb_cli.fairing.fit.MAX_ROUNDS", 5)
    with pytest.raises(ToleranceError, match=r"still misses a point by .* after 5 rounds"):
        fit(helix(9))
