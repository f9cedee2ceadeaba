"""Triangles to pixels."""

from types import SimpleNamespace

import numpy as np
import pytest

from gtb_cli.plots.look import Camera
from gtb_cli.plots.raster import NO_TRIANGLE, rasterised
from gtb_cli.plots.scene import ShadedTriangles, View, plain, space_views


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


def test_a_line_just_behind_an_outline_is_hidden_and_one_on_it_is_not():
    """Those behind were dashes along the outline of the vase."""
    square = np.array([[0.2, 0.2, 0], [0.8, 0.2, 0], [0.8, 0.8, 0], [0.2, 0.8, 0]])
    raster = rasterised(square * [100, 100, 1], np.array([[0, 1, 2], [0, 2, 3]]), 100, 100)
    view = View(SimpleNamespace(get_xlim=lambda: (0.0, 1.0), get_ylim=lambda: (0.0, 1.0)), None, raster)
    path = np.column_stack([np.linspace(0.25, 0.75, 40), np.full(40, 0.205), np.zeros(40)])
    assert view._is_shown(path, raster).all()
    assert not view._is_shown(path - [0, 0, 0.05], raster).any()
    assert not view._is_shown(path - [0, 0.01, 0.05], raster).any()  # a pixel beside the outline
    assert view._is_shown(path - [0, 0.03, 0.05], raster).all()


@pytest.mark.parametrize(("corner", "side"), [((-1, -1), "right"), ((1, -1), "left")])
def test_the_triad_stands_beside_the_surface(corner, side):
    from matplotlib.figure import Figure

    vertices = np.array([[*corner, 0], [-corner[0], corner[1], 0], [*(-x for x in corner), 0]]) * [1.0, 1.0, 0.0]
    vertices[1] = [corner[0], -corner[1], 0]  # of three corners of a square, the second is above the first
    surface = ShadedTriangles(vertices, np.array([[0, 1, 2]]), None, plain(1))
    ax = Figure(figsize=(3, 3)).add_subplot()
    (view,) = space_views([ax], Camera(-90, 90), [surface])
    view.triad()
    (x, _) = np.mean([text.xy for text in ax.texts], axis=0)
    assert ("left" if x < 100 else "right") == side
