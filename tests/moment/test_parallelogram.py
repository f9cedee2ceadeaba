"""Values at the vertices of a parallelogram's mesh, from few of them."""

from __future__ import annotations

import numpy as np
import pytest

from gtb_cli.arrays import EPS
from gtb_cli.knots.domain import domain
from gtb_cli.knots.triangulation import triangulation
from gtb_cli.moment.parallelogram import INTERPOLATION_ERROR, MAX_LEFT_SHARE, PART_VALUES, fill

RESOLUTION = 300
CORNERS = np.array([[0, 0], [3, 1], [2.5, 3], [-0.5, 2]])
KNOT = [1.734, 1.567]

ROUNDING = 1e-13
"""Error of polynomials of high degree with values of size 1."""

ULPS = 32
"""The same in units in the last place, where values are far from 0."""

WORST_PLACE = 4
"""Largest error as a multiple of the measured one."""

START_ERROR = 1e-2
"""Of a quarter's starts, which are those of a polynomial of the whole."""


def smooth(p):
    return np.stack([np.sin(p[:, 0]) / (2 + p[:, 1]), np.exp(p[:, 1] - 3)], axis=1)


def filled(function, corners=CORNERS, shift=0.0):
    """Rows left, the result, the vertices inside, and at how many points the function was asked for."""
    asked = []
    shape = domain(np.concatenate([corners, [KNOT]]))
    part = triangulation(shape, RESOLUTION)
    inner = np.flatnonzero(part.faces(shape.faces) == 0)
    result = np.full((len(part.parameters), 2), np.nan)

    def counted(p, start):
        asked.append(len(p))
        assert (shape.heights_of_columns(p) > 0).all()
        assert start is None or np.abs(start - np.cos(p)).max() < START_ERROR
        return np.column_stack([np.cos(p), function(p)])

    left = fill(result, counted, shape, part.parameters + shift, inner, RESOLUTION)
    assert np.isnan(np.delete(result, inner, axis=0)).all()
    assert np.isnan(result[inner] if left is None else result[left]).all()
    return left, result, part.parameters, sum(asked)


@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_smooth_values_are_those_of_polynomials(offset):
    left, values, p, asked = filled(lambda p: smooth(p) + offset)
    assert not len(left)
    assert asked < len(p) / 12
    there = ~np.isnan(values[:, 0])
    assert there.sum() == (RESOLUTION - 1) ** 2
    assert np.abs(values - smooth(p) - offset)[there].max() < ROUNDING + ULPS * EPS * offset


@pytest.mark.parametrize(
    "rough",
    [
        lambda p: 1e-9 * np.abs(p[:, :1] - p[:, 1:]),
        lambda p: np.sin(300 * p[:, :1]),
        lambda p: np.full((len(p), 1), np.nan),
        lambda p: np.where(p[:, :1] > 1, np.nan, 0.0),
        lambda p: np.full((len(p), 1), 1e7),  # whose rounding would be multiplied
    ],
)
def test_nothing_is_filled_with_what_is_not_smooth(rough):
    left, _, _, asked = filled(lambda p: smooth(p) + rough(p))
    assert left is None
    assert asked >= PART_VALUES


@pytest.mark.parametrize("width", [0.01, 0.001])
def test_parts_that_are_not_smooth_are_left(width):
    """Such as around a knot, even if it is between all other places."""
    left, values, p, _ = filled(lambda p: smooth(p) + np.exp(-(((p - KNOT) / width) ** 2).sum(axis=1, keepdims=True)))
    assert 0 < len(left) < MAX_LEFT_SHARE * len(p)
    distance = np.sqrt(((p - KNOT) ** 2).sum(axis=1))
    assert set(np.flatnonzero(distance < 6 * width)) <= set(left)
    there = ~np.isnan(values[:, 0])
    assert np.abs(values - smooth(p))[there].max() < ROUNDING


@pytest.mark.parametrize("height", [1e-10, 2e-10, 1e-9])
def test_values_that_are_steep_in_a_corner_are_measured_there(height):
    """Most of the part is nearly a polynomial."""
    sides = np.linalg.inv([CORNERS[1] - CORNERS[0], CORNERS[3] - CORNERS[0]])

    def steep(p):
        x, y = np.clip((p - CORNERS[0]) @ sides, 0.0, 1.0).T
        return np.stack([x + height * (x * y) ** 80, y], axis=1)

    _, values, p, _ = filled(steep)
    there = ~np.isnan(values[:, 0])
    assert there.sum() > len(p) / 2
    assert np.abs(values - steep(p))[there].max() < WORST_PLACE * INTERPOLATION_ERROR


@pytest.mark.parametrize(
    ("corners", "shift"), [(CORNERS[:3], 0.0), (CORNERS + np.eye(4, 2) * 1e-9, 0.0), (CORNERS, 1e-9)]
)
def test_other_vertices_are_left_alone(corners, shift):
    left, _, _, asked = filled(smooth, corners, shift)
    assert left is None
    assert not asked
