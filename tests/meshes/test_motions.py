"""The words for what was done to a mesh."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gtb_cli.meshes.motions import told_motion

POINTS = np.random.default_rng(5).uniform(0, 4, (30, 3))
Z, X, DIAGONAL = np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.ones(3) / np.sqrt(3)


def about(axis, degrees):
    return Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()


@pytest.mark.parametrize(
    ("matrix", "shift", "words"),
    [
        (np.eye(3), [3, 0, 0], ["moved by (3, 0, 0)"]),
        (25.4 * np.eye(3), [0, 0, 0], ["25.4 times as large (1 in for 1 mm)"]),
        (25.41 * np.eye(3), [0, 0, 0], ["25.41 times as large"]),
        (np.eye(3) / 1000, [0, 0, 0], ["0.001 times as large (1 mm for 1 m)"]),
        (2 * np.eye(3), [0, 0, 0], ["2 times as large"]),
        (np.diag([1, -1, 1]), [0, 0, 0], ["mirrored in y"]),
        (np.diag([1, -1, 1]), [0, 10, 0], ["mirrored in y", "moved by (0, 10, 0)"]),
        (-np.eye(3), [0, 0, 0], ["mirrored in a point"]),
        (np.eye(3) - 2 * np.outer(DIAGONAL, DIAGONAL), [0, 0, 0], ["mirrored in (0.57735, 0.57735, 0.57735)"]),
        (about(Z, 90), [0, 0, 0], ["turned by 90° about z"]),
        (about(X, -30), [0, 0, 0], ["turned by -30° about x"]),
        (about(-X, 180), [0, 0, 0], ["turned by 180° about x"]),
        (about(DIAGONAL, 50), [0, 0, 1], ["turned by 50° about (0.57735, 0.57735, 0.57735)", "moved by (0, 0, 1)"]),
        (about(Z, 33) @ np.diag([1, 1, -1]), [0, 0, 0], ["mirrored in z", "turned by 33° about z"]),
        (np.diag([1, 1, 1.01]), [0, 0, 0], []),  # not a similarity
        (np.diag([1, 0, 1]), [0, 0, 0], []),
    ],
)  # fmt: skip
def test_words(matrix, shift, words):
    assert [*told_motion(POINTS, POINTS @ np.transpose(matrix) + np.array(shift), 1e-9)] == words


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_words_at_any_size_and_place(size):
    points = size * POINTS + 1e7 * size
    found = told_motion(points, points @ about(Z, 90).T + [size, 0, 0], 1e-7 * size)
    assert found[0] == "turned by 90° about z"
    assert told_motion(points, 25.4 * points, 1e-6 * size) == ("25.4 times as large (1 in for 1 mm)",)


def test_what_lies_in_a_plane_or_on_a_line_has_the_simplest_words():
    flat = POINTS * [1, 1, 0]
    assert told_motion(flat, flat @ about(Z, 90).T, 1e-9) == ("turned by 90° about z",)
    assert told_motion(flat, flat * [-1, 1, 1], 1e-9) == ("mirrored in x",)
    line = POINTS * [1, 0, 0]
    assert told_motion(line, line + np.array([0, 2, 0]), 1e-9) == ("moved by (0, 2, 0)",)
    assert told_motion(0 * line, line, 1e-9) == ()


def test_a_motion_is_said_only_if_every_point_follows():
    moved = POINTS + np.array([3, 0, 0])
    moved[7, 1] += 1e-6
    assert told_motion(POINTS, moved, 1e-7) == ()
    assert told_motion(POINTS, moved, 1e-5) == ("moved by (3, 0, 0)",)
