"""Spans of B-splines as Bézier curves."""

import numpy as np
from scipy.interpolate import BSpline

from gtb_cli.filling.bspline_spans import span_matrices
from gtb_cli.filling.sides import bernstein


def test_spans_are_those_of_scipys_splines():
    knots = np.array([0.0, 0, 0, 0, 1, 1.5, 3, 3, 4, 5, 5, 5])  # the first end is clamped
    points, t = np.random.default_rng(0).normal(size=(8, 3)), np.linspace(0, 1, 9)
    spans = span_matrices(3, knots, 8)
    assert [first for first, _ in spans] == [0, 1, 2, 4]
    for first, matrix in spans:
        start, end = knots[first + 3 : first + 5]
        expected = BSpline(knots, points, 3)(start + t * (end - start))
        np.testing.assert_allclose(bernstein(3, t) @ matrix @ points[first : first + 4], expected, atol=1e-13)
