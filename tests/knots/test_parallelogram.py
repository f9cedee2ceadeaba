"""Values at the vertices of a parallelogram's mesh, from few of them."""

from __future__ import annotations

import numpy as np
import pytest

from gtb_cli.knots.domain import domain
from gtb_cli.knots.parallelogram import MEASURED_PLACES, fill
from gtb_cli.knots.triangulation import triangulation

RESOLUTION = 160
CORNERS = np.array([[0, 0], [3, 1], [2.5, 3], [-0.5, 2]])
KNOT = [1.234, 1.567]

ROUNDING = 1e-13
"""Error of polynomials of high degree with values of size 1."""


def smooth(p):
    return np.stack([np.sin(p[:, 0]) / (2 + p[:, 1]), np.exp(p[:, 1] - 3)], axis=1)


def filled(function, corners=CORNERS, shift=0.0):
    """Whether it was filled, the result, the vertices inside, and at how many points the function was asked for."""
    asked = []
    shape = domain(np.concatenate([corners, [KNOT]]))
    part = triangulation(shape, RESOLUTION)
    inner = np.flatnonzero(part.faces(shape.faces) == 0)
    result = np.full((len(part.parameters), 2), np.nan)

    def counted(p):
        asked.append(len(p))
        assert (shape.heights_of_columns(p) > 0).all()
        return function(p)

    done = fill(result, counted, shape, part.parameters + shift, inner, RESOLUTION)
    assert np.isnan(np.delete(result, inner, axis=0)).all()
    return done, result[inner], part.parameters[inner], sum(asked)


@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_smooth_values_are_those_of_a_polynomial(offset):
    done, values, p, asked = filled(lambda p: smooth(p) + offset)
    assert done
    assert asked < len(p) / 12
    np.testing.assert_allclose(values, smooth(p) + offset, atol=ROUNDING, rtol=1e-14)


@pytest.mark.parametrize(
    "rough",
    [
        lambda p: np.abs(p[:, :1] - 1),
        lambda p: 1e-9 * np.abs(p[:, :1] - 1),
        lambda p: np.exp(-1e5 * ((p - KNOT) ** 2).sum(axis=1, keepdims=True)),  # between the points, but at a knot
        lambda p: np.full((len(p), 1), np.nan),
    ],
)
def test_nothing_is_filled_with_what_is_not_smooth(rough):
    done, values, _, asked = filled(lambda p: smooth(p) + rough(p))
    assert not done
    assert np.isnan(values).all()
    assert asked > MEASURED_PLACES


@pytest.mark.parametrize(
    ("corners", "shift"), [(CORNERS[:3], 0.0), (CORNERS + np.eye(4, 2) * 1e-9, 0.0), (CORNERS, 1e-9)]
)
def test_other_vertices_are_left_alone(corners, shift):
    done, _, _, asked = filled(smooth, corners, shift)
    assert not done
    assert not asked
