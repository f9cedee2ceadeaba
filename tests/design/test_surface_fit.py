"""Surfaces near points: those of the same patch are found again, others nearly."""

from __future__ import annotations

import numpy as np
import pytest

from gtb_cli.design.surface_fit import fit_surface
from gtb_cli.errors import DomainError
from gtb_cli.spec.loading import load, parse
from tests.shell import BICUBIC, CURVE, PENTAGON, gtb


def inner_parameters(patch, count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    return rng.dirichlet(np.ones(len(patch.domain.vertices)), count) @ patch.domain.vertices


def test_points_of_a_patch_with_their_parameters_give_it_back():
    patch = load(PENTAGON)
    p = inner_parameters(patch, 200)
    points = patch.evaluate(p, "linear")
    flat = patch.replace(control_points=np.zeros((len(patch.knots), 3)))
    found = fit_surface(points, flat, p, smoothing=0)
    np.testing.assert_allclose(found.patch.control_points, patch.control_points, atol=1e-6)
    assert found.distance < 1e-9
    assert fit_surface(points, flat, p).distance < 1e-2


def test_points_without_parameters_are_projected():
    """A gentle bump is found from the plane; residuals are what the surface says."""
    patch = load(BICUBIC)
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    share = (patch.knots - low) / (high - low)
    plane = patch.replace(control_points=np.column_stack([share, np.zeros(len(share))]))
    xy = np.random.default_rng(5).random((300, 2))
    points = np.column_stack([xy, 0.2 * xy[:, 0] * (1 - xy[:, 0]) + 0.1 * xy[:, 1] ** 2])
    found = fit_surface(points, plane)
    assert found.distance < 2e-3
    assert found.mean <= found.distance
    again = found.patch.evaluate(found.parameters, "linear")
    assert np.linalg.norm(again - points, axis=1).max() == pytest.approx(found.distance)


def test_as_many_points_as_knots_are_met():
    patch = load(BICUBIC)
    p = patch.domain.center + 0.9 * (patch.knots - patch.domain.center)
    points = np.random.default_rng(6).normal(size=(len(p), 3))
    assert fit_surface(points, patch, p, smoothing=0).distance < 1e-6


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
        fit_surface(*arguments)


def test_the_command_fits_a_surface():
    patch = load(BICUBIC)
    p = inner_parameters(patch, 60)
    rows = np.column_stack([p, patch.evaluate(p, "linear")])
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist()).encode()
    result = gtb("fit", "-", "--patch", BICUBIC, stdin=text)
    assert result.status == 0
    assert "60 points, 0 rounds" in result.err
    assert len(parse(result.text).knots) == len(patch.knots)
    assert "three or five coordinates, got 2" in gtb("fit", "-", "--patch", BICUBIC, stdin=b"0 0\n").err
    assert gtb("fit", "-", "--patch", "-", stdin=b"").status == 2
    assert gtb("fit", "-", "--patch", BICUBIC, "--knots", "0,1", stdin=b"").status == 2
