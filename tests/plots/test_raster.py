"""Triangles to pixels."""

import numpy as np
import pytest

from gtb_cli.plots.raster import NO_TRIANGLE, rasterised


def test_pixels_whose_centres_a_triangle_covers():
    seen = rasterised(np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), np.array([[0, 1, 2]]), 4, 4)
    assert (seen.triangle == NO_TRIANGLE).tolist() == [
        [False, False, False, False],
        [False, False, False, True],
        [False, False, True, True],
        [False, True, True, True],
    ]
    assert seen.nearness[0, 0] == 0
    assert seen.nearness[3, 3] == -np.inf


def test_weights_give_back_places():
    points = np.array([[-3.0, -2, 1], [40, 5, 2], [7, 33, 3]])
    faces = np.array([[0, 1, 2]])
    seen = rasterised(points, faces, 32, 32)
    row, column = np.nonzero(seen.triangle == 0)
    places = seen.values(faces, points)
    np.testing.assert_allclose(places[:, :2], np.stack([column + 0.5, row + 0.5], axis=1), atol=1e-12)
    np.testing.assert_allclose(places[:, 2], seen.nearness[row, column], atol=1e-12)
    assert len(row) > 300


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_nearest_is_seen(order):
    points = np.array([[0.0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 1], [4, 0, 1], [0, 4, -1]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])[order]
    seen = rasterised(points, faces, 8, 8)
    assert order[seen.triangle[0, 0]] == 1  # nearer there
    assert order[seen.triangle[3, 0]] == 0  # behind there
    assert order[seen.triangle[0, 6]] == 0  # not there


def test_of_equally_near_ones_the_first():
    points = np.array([[0.0, 0, 0], [8, 0, 0], [0, 8, 0]])
    assert rasterised(points, np.array([[0, 1, 2], [0, 1, 2]]), 8, 8).triangle.max() == 0


def test_two_triangles_leave_no_gap_between_them():
    points = np.array([[0.0, 0, 0], [9.5, 0.2, 0], [9.7, 9.9, 0], [0.1, 9.3, 0]])
    seen = rasterised(points, np.array([[0, 1, 2], [0, 2, 3]]), 10, 10)
    assert (seen.triangle[1:9, 1:9] >= 0).all()


def test_what_is_outside_or_a_line_is_not_seen():
    points = np.array([[20.0, 20, 0], [30, 20, 0], [20, 30, 0], [0, 0, 0], [5, 5, 0]])
    assert (rasterised(points, np.array([[0, 1, 2], [3, 4, 3]]), 8, 8).triangle == NO_TRIANGLE).all()
