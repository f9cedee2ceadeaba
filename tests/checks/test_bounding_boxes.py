"""Bounds of curves and surfaces: beside fine meshes, and where they are known."""

import numpy as np
import pytest

from gtb_cli.checks.bounding_boxes import bounds
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.patches import NAMES, named

ROUNDING = 1e-12


@pytest.mark.parametrize("name", mostly_long(sorted(NAMES, key="sixty_knots".__eq__), 12))
def test_they_are_those_of_a_fine_mesh(name):
    patch = named(name)
    mesh, found = tessellate(patch, 96), bounds([patch])
    size = np.ptp(patch.control_points, axis=0).max()
    beyond = np.array([found[0] - mesh.bounds[0], mesh.bounds[1] - found[1]])
    narrow = 3e-3 if name == "sixty_knots" else 1e-8  # random heights at random knots have the narrowest extrema
    assert beyond.max() < narrow * size  # no vertex lies outside
    assert beyond.min() > -4e-3 * size  # and they are reached, but for the mesh's own distance: weights may be steep
    outside = np.array([patch.control_points.min(axis=0) - found[0], found[1] - patch.control_points.max(axis=0)])
    assert outside.max() < ROUNDING * size


def test_a_circle_reaches_its_radius_between_its_control_points():
    """The control points of these arcs lie 1.15 radii from the centre."""
    turns = np.radians([[90, 150, 210], [210, 270, 330], [330, 30, 90]])
    arcs = []
    for turn in turns:
        points = np.column_stack([np.cos(turn), np.sin(turn)]) * [[1], [2], [1]]
        arcs.append(Patch([0, 1, 2], points, weights=[1, 0.5, 1], coefficients="binomial"))
    assert bounds(arcs) == pytest.approx(np.array([[-1, -1, 0], [1, 1, 0]]), abs=1e-8)


def test_a_paraboloid_has_its_top_between_the_samples():
    """z = 1 − (x − 1/π)² − (y − 1/e)² over the unit square."""
    x, y = (np.array([0, 0.5, 1]) for _ in range(2))
    heights = [[-(c**2), -(c**2) + c, -(c**2) + 2 * c - 1] for c in (1 / np.pi, 1 / np.e)]
    points = [(x[i], y[j], 1 + heights[0][i] + heights[1][j]) for j in range(3) for i in range(3)]
    knots = [(i, j) for j in range(3) for i in range(3)]
    assert bounds([Patch(knots, points, coefficients="binomial")])[1] == pytest.approx([1, 1, 1], abs=1e-9)


def test_a_peak_at_a_knot_in_a_thin_layer_is_found():
    """At a distance of 1e-5 from an edge the surface is 0.68 high, and flat a little farther away."""
    knots = [(0, 0), (1, 0), (1, 1), (0, 1), (0.3, 1e-5), (0.3, 2e-5)]
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.3, 0, 1), (0.3, 0, -1)]
    patch = Patch(knots, points, weights=[1, 1, 1, 1, 100, 100])
    found = bounds([patch])
    there = patch.evaluate(patch.knots, "linear")
    assert (found[0] <= there.min(axis=0)).all()
    assert (found[1] >= there.max(axis=0)).all()
