"""Faces of Δ: numbers, values, and what lies on them."""

import numpy as np
import pytest

from gtb_cli.knots.domain import domain
from gtb_cli.knots.face import INTERIOR
from tests.patches import pentagon

SQUARE = domain([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [0.5, 0.5]])
SEGMENT = domain([0, 1, 3])


def test_a_surface_has_its_interior_edges_and_corners():
    kinds = [(face.dimension, face.index) for face in SQUARE.faces]
    assert kinds == [(2, 0), *((1, j) for j in range(4)), *((0, k) for k in range(4))]
    assert [face.number for face in SQUARE.faces] == list(range(9))
    assert len(SQUARE.faces) == 9
    assert SQUARE.faces[INTERIOR].is_interior
    assert SQUARE.faces[INTERIOR].knots.all()
    assert SQUARE.faces.edge(0).knots.tolist() == [True, True, False, False, True, False]
    assert SQUARE.faces.corner(1).knots.tolist() == [False, True, False, False, False, False]
    assert SQUARE.faces.corner(0).facets.tolist() == [0, 3]


def test_the_ends_of_a_curve_are_corners():
    assert [(face.dimension, face.index) for face in SEGMENT.faces] == [(1, 0), (0, 0), (0, 1)]
    assert SEGMENT.faces.edge(1) is SEGMENT.faces.corner(1)
    assert SEGMENT.faces.corner(1).is_corner


@pytest.mark.parametrize("shape", [SQUARE, SEGMENT, pentagon().domain], ids=["square", "segment", "pentagon"])
def test_numbers_name_faces(shape):
    for k, corner in enumerate(shape.vertices):
        assert shape.faces.at(shape.heights_of_columns(corner[None])).tolist() == [shape.faces.corner(k).number]
    for face in shape.faces:
        assert (shape.heights[face.knots][:, face.facets] == 0).all()
        assert face.knots.tolist() == (shape.heights[:, face.facets] == 0).all(axis=1).tolist()


def test_the_smallest_face_holds_all_of_some_knots():
    faces = SQUARE.faces
    assert faces.smallest([0, 4]) is faces.edge(0)
    assert faces.smallest(4) is faces.edge(0)
    assert faces.smallest(1) is faces.corner(1)
    assert faces.smallest([0, 2]).is_interior
    assert faces.smallest(np.array([5])).is_interior
