"""Lengths, areas and volumes of shapes for which they are known."""

import math

import numpy as np
import pytest

from gtb_cli.distances.areas_and_volumes import _integrals, extents
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.quadrature import quadrature
from tests.marks import mostly_long
from tests.specs import SPECS, load
from tests.surfaces import cylinder, octant, plane, quartic_octant

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def box(size: float = 1.0) -> Model:
    """A box of size 1 × 2 × 3 with a curved lid: its inner control point is 4 higher than the others."""
    corners = size * np.array([[x, y, z] for z in (0, 3) for y in (0, 2) for x in (0, 1)])
    sides = [[0, 2, 3, 1], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]]
    grid = [[x, y] for y in range(3) for x in range(3)]
    lid = [[size * x / 2, size * y, size * (3 + 4 * (x == y == 1))] for x, y in grid]
    binomial = [1, 2, 1, 2, 4, 2, 1, 2, 1]
    return Model((*(Patch(SQUARE, corners[side]) for side in sides), Patch(grid, lid, coefficients=binomial)))


@pytest.mark.parametrize(
    ("shape", "exact"),
    [
        (octant(), math.pi / 2),
        (octant(1e-200, (1e-198, 0, 0)), 0.0),
        (quartic_octant(), math.pi / 2),
        (cylinder(), 5 * math.pi),
        (plane(30.0), 3.5 * math.sqrt(1.7**2 + 0.4**2 + 3**2)),
    ],
)
def test_areas_are_those_of_the_shape(shape, exact):
    (area,) = extents(shape).values()
    assert abs(area.value - exact) <= area.error
    assert area.error <= 1e-6 * exact


def test_the_length_of_an_arc():
    (length,) = extents(load(SPECS / "cubic-bezier.toml")).values()
    assert abs(length.value - math.pi) <= length.error <= 1e-6


@pytest.mark.parametrize("size", [1e-60, 1.0, 1e60])
def test_the_volume_in_closed_patches(size):
    """Below the lid it is 4 times the integral of the middle basis function, (1/3)², over an area of 2."""
    volume = extents(box(size))["volume"]
    assert abs(volume.value / size**3 - (6 + 4 * 2 / 9)) <= volume.error / size**3 <= 1e-5


@pytest.mark.parametrize(("seed", "fine"), mostly_long([(3, 7.885258), (4, 3.70528)]))
def test_steep_weights_make_no_false_digits(seed, fine):
    """Beside the sums of meshes within 1e-8 and 3e-4: they were 268 and 4 times as far away as was said."""
    random = np.random.default_rng(seed)
    knots = np.sort(random.uniform(size=5)) if seed == 3 else random.uniform(size=(8, 2)).round(2)
    points = random.normal(size=(5, 3)) if seed == 3 else np.column_stack([3 * knots, random.normal(size=8)])
    (found,) = extents(Patch(knots, points, 10 ** random.normal(scale=seed, size=len(knots)))).values()
    assert abs(found.value - fine) <= found.error < 0.01 * fine


@pytest.mark.parametrize("span", mostly_long([2, 8], 0))
def test_areas_have_the_digits_that_are_said_beside_finer_rules(span):
    """The pentagon's, by rules of order 64 to 192, which agree; and with weights from 1e-8 to 1e8."""
    pentagon = load(SPECS / "pentagon.toml")
    (area,) = extents(pentagon).values()
    assert abs(area.value - 8.4447212898530) <= area.error <= 1e-9
    steep = pentagon.replace(weights=10.0 ** (span * np.random.default_rng(6).uniform(-1, 1, (3, 8))[span // 3]))
    (area,) = extents(steep).values()
    rule = quadrature(steep, 64)
    slopes = np.moveaxis(steep.derivatives(rule.parameters, 1, "linear"), 2, 0)
    fine = np.linalg.norm(np.cross(*slopes), axis=1) @ rule.weights
    assert abs(area.value - fine) <= area.error <= 0.02 * fine


def test_an_area_of_few_places_has_its_error():
    found, error = _integrals(octant(), octant().control_points[None], 1)
    assert abs(found[0, 0] - math.pi / 2) <= error[0, 0]


def test_what_overflows_is_left_out():
    assert extents(octant(1e200)) == {}
