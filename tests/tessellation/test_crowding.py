"""Vertices that crowd are reported, with the cure; in the default parametrisation they do not crowd."""

import numpy as np
import pytest

from gtb_cli import load, tessellate
from gtb_cli.meshes.measures import measure
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.remarks import crowding
from gtb_cli.theory.patch import Patch
from tests.shell import SPECS
from tests.specs import GOOD_SPECS

DOME = """
knots = [[22.5, 0], [67.5, 0], [90, 39], [45, 67.5], [0, 39], [45, 30]]
control_points = [[0, 0, 0], [45, 0, 0], [67.5, 38.25, 0], [22.5, 67.5, 0], [-22.5, 38.25, 0], [22.5, 29.25, 90]]
weights = [1, 1, 1, 1, 1, 5]
"""
"""A dome whose knots are in millimetres, as its control points are."""

AREA, SUMMIT = 7551.2, 45.014
"""Its area and highest point, by a toric and a linear mesh of 400 segments for each edge, with the knots divided by 45;
they agree to 4 digits."""


@pytest.fixture
def dome(tmp_path):
    path = tmp_path / "dome.toml"
    path.write_text(DOME)
    return path


def test_the_units_of_the_knots_do_not_count(dome):
    patch = load(dome)
    mesh = tessellate(patch, 16)
    assert measure(mesh).area == pytest.approx(AREA, rel=2e-3)
    assert mesh.vertices[:, 2].max() == pytest.approx(SUMMIT, rel=2e-3)
    metres = patch.replace(knots=patch.knots / 1000)
    assert np.abs(tessellate(metres, 16).vertices - mesh.vertices).max() < 1e-9 * 90
    crowded = tessellate(patch, 16, parametrization="toric")
    assert measure(crowded).area < 0.75 * AREA


def test_no_spec_crowds_by_default():
    for path in GOOD_SPECS:
        assert not any("crowd" in remark for remark in Recipe(3).mesh(load(path))[1])


def test_a_curve_and_a_model_crowd_too():
    for name in ("example-3.1", "hebesphenorotunda"):
        (remark,) = crowding(load(SPECS / f"{name}.toml"), 16)
        assert 'of the patch; leave out `parametrization="toric"`' in remark
    assert crowding(load(SPECS / "repeated-knot.toml"), 16) == []


def test_corners_at_one_place_are_told_at_any_resolution():
    ends = Patch([0, 500, 1000], [[0, 0], [1, 1], [2, 0]])
    assert crowding(ends, 2) == []
    (remark,) = crowding(ends, 8)
    assert "of 8 segments have corners at one point; leave out" in remark
