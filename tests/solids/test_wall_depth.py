"""Walls of solids: straight from a face to the other side."""

import numpy as np
import pytest

from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.solids.printability import printability
from gtb_cli.solids.wall_depth import wall_of_faces, wall_of_vertices
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from tests.patches import pentagon
from tests.surfaces import box

CUBE = tessellate(box(), 1)


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
def test_a_box_is_as_thick_as_it_is_long(scale, shift):
    mesh = tessellate(box(high=(40, 30, 2)), 1)
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    axis = np.abs(np.cross(b - a, c - a)).argmax(axis=1)
    moved = Mesh(mesh.vertices * scale + shift, mesh.cells)
    np.testing.assert_allclose(wall_of_faces(moved)[0] / scale, np.array([40, 30, 2])[axis], rtol=1e-6)
    turned = Mesh(moved.vertices, mesh.cells[:, ::-1])
    np.testing.assert_allclose(wall_of_faces(turned)[0], wall_of_faces(moved)[0], rtol=1e-12)


def test_an_open_surface_has_no_walls():
    assert wall_of_vertices(tessellate(box(high=(40, 30, 2)), 1)) == pytest.approx(np.full(8, 2.0))  # the least
    cut = Mesh(CUBE.vertices, CUBE.cells[1:])
    assert wall_of_faces(cut) is None
    assert wall_of_faces(Mesh(CUBE.vertices @ np.outer([1, 2, 4], [1, 0, 0]), CUBE.cells)) is None  # flat to a line
    assert wall_of_vertices(cut) is None
    twice = Mesh(np.eye(3), np.array([[0, 1, 2], [0, 2, 1]]))
    assert wall_of_vertices(twice) is None


def test_only_what_is_flat_on_the_bed_stands():
    found = printability(tessellate(Model((*box(), *box((3, 0, 2), (4, 1, 3)))), 1), "z", 100)
    assert (found["bed_area"], found["overhang_area"]) == (pytest.approx(1), pytest.approx(1))


def test_each_ray_ends_where_it_first_leaves():
    """Against all triangles, one ray at a time: a shell of 0.1 with a hollow box beside it."""
    shell = Recipe(8, thickness=0.1).mesh(pentagon())[0]
    outer, inner = CUBE.vertices + 5, CUBE.vertices / 2 + 5.25
    count = len(shell.vertices)
    mesh = Mesh(
        np.concatenate([shell.vertices, outer, inner]),
        np.concatenate([shell.cells, CUBE.cells + count, CUBE.cells[:, ::-1] + count + 8]),
    )
    found = wall_of_faces(mesh)[0]
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    normals = np.cross(b - a, c - a)
    for row in [*range(0, len(shell.cells), 40), *range(len(shell.cells), len(mesh.cells))]:
        start, way = (a + b + c)[row] / 3, -normals[row] / np.linalg.norm(normals[row])
        leaving = np.flatnonzero(normals @ way > 0)
        length = ((a[leaving] - start) * normals[leaving]).sum(axis=1) / (normals[leaving] @ way)
        places = start + length[:, None] * way
        corners = [each[leaving] for each in (a, b, c)]
        inside = np.min(
            [(np.cross(corners[k] - corners[k - 1], places - corners[k - 1]) * normals[leaving]).sum(axis=1)
             for k in range(3)], axis=0,
        )  # fmt: skip
        assert found[row] == pytest.approx(length[(inside > -1e-12) & (length > 0)].min(), rel=1e-9)
    assert found[len(shell.cells) :] == pytest.approx(np.full(24, 0.25))
