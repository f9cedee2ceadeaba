"""Control nets and lines along surfaces."""

import numpy as np
import pytest

from gtb_cli.plots.net_lines import net_of
from gtb_cli.theory.patch import Patch

SQUARE = np.array([[i, j] for j in range(3) for i in range(4)], dtype=float)
PLACES = [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)]


@pytest.mark.parametrize(("scale", "shift"), PLACES)
def test_a_tensor_product_has_a_grid(scale, shift):
    patch = Patch(SQUARE * scale + shift, np.pad(SQUARE, ((0, 0), (0, 1))))
    joined = {tuple(np.abs(SQUARE[b] - SQUARE[a]).astype(int).tolist()) for a, b in net_of(patch)}
    assert joined == {(1, 0), (0, 1)}
    assert len(net_of(patch)) == 3 * 3 + 4 * 2


@pytest.mark.parametrize(("scale", "shift"), PLACES)
def test_a_bezier_triangle_has_three_directions(scale, shift):
    triangle = np.array([[i, j] for j in range(4) for i in range(4 - j)], dtype=float)
    patch = Patch(triangle * scale + shift, np.pad(triangle, ((0, 0), (0, 1))))
    joined = {tuple((triangle[b] - triangle[a]).astype(int).tolist()) for a, b in net_of(patch)}
    assert joined == {(1, 0), (0, 1), (-1, 1)}
    assert len(net_of(patch)) == 3 * 6


def test_a_slanted_parallelogram_has_a_grid():
    knots = SQUARE @ np.array([[1.0, 0.3], [2.7, 1.1]])
    assert len(net_of(Patch(knots, np.pad(SQUARE, ((0, 0), (0, 1)))))) == 17


def test_a_curve_has_its_polygon_and_a_lifting_counts():
    knots = np.array([0.0, 0.3, 0.5, 1.0])
    points = np.zeros((4, 3))
    assert net_of(Patch(knots, points)) == [(0, 1), (1, 2), (2, 3)]
    assert net_of(Patch(knots, points, lifting=[0, 0, 1, 0])) == [(0, 2), (2, 3)]
    assert net_of(Patch(knots, points), [0, 1, 0, 0]) == [(0, 1), (1, 3)]
