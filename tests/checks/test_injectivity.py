"""Injectivity of planar patches: known cases, certificates that fold, and the sign of the Jacobian by differences."""

import re

import numpy as np
import pytest

from gtb_cli.checks import injectivity
from gtb_cli.checks.injectivity import for_all_weights, jacobian_sign, planar
from gtb_cli.checks.probe import Probe
from gtb_cli.checks.properties import check_patch
from gtb_cli.checks.report import Finding
from gtb_cli.theory.patch import Patch
from tests.patches import integer_pentagon

SQUARE = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2], [2, 2]], dtype=float)  # nine knots

BENT = SQUARE.copy()
BENT[4] = [2.5, 1.5]
"""Control points whose middle has left the square."""


def verdict(patch: Patch) -> Finding:
    return for_all_weights(Probe(patch))


def jacobian(patch: Patch) -> Finding:
    return jacobian_sign(Probe(patch))


@pytest.mark.parametrize("matrix", [np.eye(2), [[2, 1], [0, 3]], [[0, 1], [1, 0]], 1e-9 * np.eye(2), 1e9 * np.eye(2)])
@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_affine_images_of_the_knots_are_injective(matrix: object, shift: float) -> None:
    patch = Patch(SQUARE, SQUARE @ np.array(matrix) + shift)
    found = verdict(patch)
    assert found.status == "measured"
    assert found.value == 1.0
    straight = "8 on lines to rounding do not count"
    alike = "all 76 triples of knots turn their control points the same way"
    assert found.reason == f"yes, inside the domain: {alike}; {straight}"
    assert jacobian(patch).value == 0.0


def test_a_plane_in_space() -> None:
    points = np.column_stack([SQUARE[:, 0], SQUARE[:, 1], 2 * SQUARE[:, 0] - SQUARE[:, 1] + 5])
    assert verdict(Patch(SQUARE, points)).value == 1.0
    assert planar(points[[0, 1, 3, 4]] + [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1e-3]]) is None


def test_the_certificate_folds_with_some_weights() -> None:
    """Weights of the triple in question grow without bound: near it the patch is a triangle that is turned over."""
    patch = Patch(SQUARE, BENT)
    found = verdict(patch)
    assert found.value == 0.0
    numbers = [int(k) for k in re.findall(r"\d+", found.reason)]
    first, second = numbers[:3], numbers[3:]
    signs = set()
    for triple in (first, second):
        knots, points = (np.column_stack([np.ones(3), rows[triple]]) for rows in (SQUARE, BENT))
        signs.add(np.sign(np.linalg.det(knots) * np.linalg.det(points)))
        # A lifting that is 0 on the triangle's plane and negative elsewhere makes it a cell of the limit.
        weights = np.full(9, 1e-9)
        weights[triple] = 1.0
        heavy = patch.replace(weights=weights)
        inside = knots[:, 1:].mean(axis=0)
        areas = np.linalg.det(heavy.derivatives(inside[None])[0, :2])
        assert np.sign(areas) == np.sign(np.linalg.det(knots) * np.linalg.det(points))
    assert signs == {-1.0, 1.0}


def test_the_jacobian_is_measured_for_the_given_weights() -> None:
    assert jacobian(Patch(SQUARE, BENT)).value == 0.0
    assert jacobian(Patch(SQUARE, SQUARE @ [[1, 1], [1, 1 + 1e-12]])).value == 0.0
    weights = np.ones(9)
    weights[4] = 50.0
    folded = jacobian(Patch(SQUARE, BENT, weights))
    assert 0 < folded.value < 0.5
    assert "the patch folds: the Jacobian is positive at" in folded.reason
    assert "negative" in jacobian(Patch(SQUARE, SQUARE * [1, -1])).reason


def test_degenerate_control_points() -> None:
    line = Patch(SQUARE, np.column_stack([SQUARE[:, 0], SQUARE[:, 0]]))
    assert verdict(line).reason == "no: the control points are on a line"
    assert jacobian(line).value is None
    assert verdict(Patch(SQUARE, np.ones((9, 2)))).value == 0.0


def test_many_knots_have_bounded_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(injectivity, "MAX_TRIPLES", 100_000)
    places = np.array([[i, j] for i in range(20) for j in range(20)], dtype=float)
    found = verdict(Patch(places, places))
    assert found.value is None
    assert found.reason.startswith("not decided: 100000 of 10586800 triples")
    bent = places.copy()
    bent[210] = [40, 40]
    assert verdict(Patch(places, bent)).value == 0.0


def test_space_patches_are_not_asked_and_no_status_changes() -> None:
    assert verdict(integer_pentagon()).status == "not applicable"
    report = check_patch(Patch(SQUARE, BENT))
    assert report.holds
    assert {found.name: found.status for found in report.findings}["injective for all weights"] == "measured"
