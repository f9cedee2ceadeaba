"""Isoparametric curves against the surface, in 50 digits and by command."""

import numpy as np
import pytest

from gtb_cli.bezier.isocurve import isocurve
from gtb_cli.errors import DomainError
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.patches import bicubic, cubic_curve, pentagon, repeated_knots

# A rectangle of real knots, two of them at the same height, with edges of different scale
REAL = Patch(
    [[0, 0], [2, 0], [2, 1.5], [0, 1.5], [0.3, 0.7], [1.9, 0.7], [1, 0]],
    [[0, 0, 0], [4, 0, 1], [4, 3, 0], [0, 3, 2], [1, 1, 5], [3, 1, -2], [2, 0, 3]],
    [1, 2, 3, 1, 5, 0.5, 2],
    edge_scale=[1, 2, 0.5, 1],
)


@pytest.mark.parametrize("patch", [bicubic(), REAL, repeated_knots()])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.9, 1.0])
def test_they_are_curves_of_the_surface(patch: Patch, axis: int, fraction: float) -> None:
    agreement = 1e-13
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    value = float(low[axis] + fraction * (high[axis] - low[axis]))
    curve = isocurve(patch, axis, value)
    assert curve.dimension == 1
    assert len(np.unique(curve.knots)) == len(curve.knots)
    for t in np.linspace(low[1 - axis], high[1 - axis], 5):
        u = [value, t] if axis == 0 else [t, value]
        expected = [float(x) for x in exact.point(patch, u)]
        assert np.abs(curve.evaluate([t])[0] - expected).max() <= agreement * 10


@pytest.mark.parametrize(
    ("patch", "axis", "value", "message"),
    [
        (pentagon(), 0, 1.0, "is not a rectangle along the axes: isoparametric curves are not GT-Bézier curves"),
        (cubic_curve(), 0, 1.0, "is a curve"),
        (bicubic(), 1, 3.5, "v: expected 0 to 3, got 3.5"),
        (bicubic(), 0, float("nan"), "u: expected 0 to 3, got nan"),
    ],
)
def test_the_reason_where_there_are_none(patch: Patch, axis: int, value: float, message: str) -> None:
    with pytest.raises(DomainError, match=message):
        isocurve(patch, axis, value)
