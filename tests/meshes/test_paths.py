"""Polylines as paths from end to end, or around."""

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.paths import paths

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]])


def found(*segments: tuple[int, int], points: np.ndarray = POINTS) -> list:
    return list(paths(Mesh(points, np.array(segments))))


def test_segments_in_any_order_and_direction_are_one_path():
    (path,) = found((2, 1), (0, 1), (2, 3))
    assert path.vertices.tolist() == [0, 1, 2, 3]
    assert path.segments.tolist() == [1, 0, 2]
    assert path.directions[:, 0].tolist() == [[1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    assert not path.closed


def test_a_ring_is_closed():
    (path,) = found((0, 1), (1, 2), (2, 3), (3, 0))
    assert path.closed
    assert path.vertices.tolist() == [0, 1, 2, 3]
    assert path.points.tolist() == POINTS[[0, 1, 2, 3, 0]].tolist()


def test_a_branching_ends_paths():
    assert [path.vertices.tolist() for path in found((0, 1), (1, 2), (1, 3))] == [[0, 1], [1, 2], [1, 3]]


def test_a_segment_without_length_is_passed_over():
    points = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    (path,) = found((0, 1), (1, 2), points=points)
    assert path.segments.tolist() == [1]
    assert path.points.tolist() == [[0, 0, 0], [1, 0, 0]]
    with pytest.raises(DomainError, match="is a single point"):
        found((0, 1), points=points)


def test_a_tangent_across_its_segment_does_not_count():
    mesh = Mesh(POINTS, np.array([[0, 1]]))
    slanted = np.array([[[0.8, 0.6, 0], [0, 1, 0]]])
    (path,) = paths(mesh, slanted)
    assert path.directions[0].tolist() == [[0.8, 0.6, 0], [1, 0, 0]]
