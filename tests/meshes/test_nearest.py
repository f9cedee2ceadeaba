"""Distances from segments and triangles, and the nearest of many: as trimesh and brute force find them."""

import numpy as np
import pytest
from trimesh.triangles import closest_point

from gtb_cli.meshes.nearest import BLOCK_POINTS, NearestCells, cell_distances

ROUNDING = 1e-12  # error for coordinates of size 1 to 10


def triangles(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Points, and triangles of all shapes."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 3)), rng.normal(size=(count, 3, 3)) * rng.choice([0.01, 1, 3], (count, 1, 1))


@pytest.mark.parametrize("count", [0, 1, BLOCK_POINTS - 1, BLOCK_POINTS, BLOCK_POINTS + 1, 2 * BLOCK_POINTS + 17])
def test_distances_from_triangles_as_trimesh_finds_them(count):
    points, corners = triangles(count)
    expected = np.linalg.norm(closest_point(corners, points) - points, axis=1) if count else np.empty(0)
    found = cell_distances(points, *np.moveaxis(corners, 1, 0))
    assert found.shape == (count,)
    assert np.allclose(found, expected, rtol=0, atol=ROUNDING)


def test_flat_triangles_are_segments_and_points():
    points, corners = triangles(200)
    corners[:, 2] = corners[:, 0] + np.linspace(-0.5, 1.5, 200)[:, None] * (corners[:, 1] - corners[:, 0])
    found = cell_distances(points, *np.moveaxis(corners, 1, 0))
    t = np.linspace(0, 1, 2001)[:, None, None]
    ends = np.linspace(-0.5, 1.5, 200)[:, None]
    low, high = np.minimum(ends, 0), np.maximum(ends, 1)
    line = corners[:, 0] + (low + t * (high - low)) * (corners[:, 1] - corners[:, 0])
    sampled = np.linalg.norm(line - points, axis=2).min(axis=0)
    step = np.linalg.norm(np.ptp(corners, axis=1), axis=1) / 2000
    assert (found <= sampled + ROUNDING).all()
    assert (found >= sampled - step).all()
    corners[:] = corners[:, [0]]
    expected = np.linalg.norm(points - corners[:, 0], axis=1)
    assert np.allclose(cell_distances(points, *np.moveaxis(corners, 1, 0)), expected, rtol=1e-15, atol=0)
    assert np.allclose(cell_distances(points, corners[:, 0], corners[:, 1]), expected, rtol=1e-15, atol=0)


@pytest.mark.parametrize("kind", [2, 3])
@pytest.mark.parametrize("count", [1, 7, 8, 9, 500])
def test_the_nearest_of_all_cells(kind, count):
    points, corners = triangles(count)
    corners = corners[:, :kind]
    points = np.random.default_rng(2).normal(size=(60, 3))
    cells = NearestCells(corners)
    every = np.array([cell_distances(np.broadcast_to(p, (count, 3)), *np.moveaxis(corners, 1, 0)) for p in points])
    start, first = cells.start(points)
    assert np.array_equal(start, every[np.arange(60), first])
    found, nearest = cells.search(points, start, first)
    assert np.allclose(found, every.min(axis=1), rtol=1e-12)
    assert np.array_equal(found, every[np.arange(60), nearest])
