"""`Mesh`: plain arrays, and what they say of themselves."""

import io
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.formats.export import write_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.shading import Normals
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests import tiny_meshes as meshes
from tests.patches import pentagon

POLYLINE = Mesh(np.array([[0, 0, 0], [1, 0, 2], [1, 3, -1]], dtype=float), np.array([[0, 1], [1, 2]]))
TWO_TRIANGLES = Mesh(np.array([[0, 0, 0], [2, 0, 0], [2, 1, 1], [0, 1, 0]], float), np.array([[0, 1, 2], [0, 2, 3]]))


def test_a_polyline_has_edges_and_no_faces():
    assert POLYLINE.is_curve
    assert POLYLINE.edges.tolist() == [[0, 1], [1, 2]]
    assert POLYLINE.bounds.tolist() == [[0, 0, -1], [1, 3, 2]]
    with pytest.raises(DomainError, match="a curve has edges, not faces"):
        POLYLINE.faces  # noqa: B018


def test_triangles_have_faces_and_each_edge_once():
    assert not TWO_TRIANGLES.is_curve
    assert TWO_TRIANGLES.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert TWO_TRIANGLES.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]


def test_indices_have_32_bits_and_given_ones_are_not_copied():
    cells = np.array([[0, 1, 2]], dtype=np.int32)
    assert np.shares_memory(Mesh(np.eye(3), cells).cells, cells)
    same = Mesh(np.eye(3), cells.astype(np.uint64))
    assert same.cells.dtype == np.int32
    assert hash(same) == hash(Mesh(np.eye(3), cells))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": np.zeros((4, 2))}, r"vertices: expected shape \(m, 3\), got \(4, 2\)"),
        ({"vertices": np.zeros(3)}, r"vertices: expected shape \(m, 3\), got \(3,\)"),
        ({"cells": np.zeros((1, 4), dtype=int)}, r"cells: expected shape \(k, 2\) or \(k, 3\), got \(1, 4\)"),
        ({"cells": np.zeros(3, dtype=int)}, r"cells: expected shape"),
        ({"parameters": np.zeros((3, 2))}, "parameters: 3 rows for 4 vertices"),
        ({"normals": np.zeros((5, 3))}, "normals: 5 rows for 4 vertices"),
        ({"attributes": {"height": np.zeros(2)}}, "height: 2 rows for 4 vertices"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(change, message):
    arrays = {"vertices": TWO_TRIANGLES.vertices, "cells": TWO_TRIANGLES.cells} | change
    with pytest.raises(DomainError, match=f"^{message}"):
        Mesh(**arrays)


def test_trimesh_gets_the_same_vertices_faces_and_normals():
    """Of vertices that coincide, too, as on a collapsed edge, which trimesh would merge if it were let."""
    mesh = meshes.surface()
    other = mesh.to_trimesh()
    assert (other.vertices == mesh.vertices).all()
    assert (other.faces == mesh.faces).all()
    assert np.abs(other.vertex_normals - mesh.normals).max() < 1e-15
    vertices = np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    other = Mesh(vertices, np.array([[0, 2, 3], [0, 1, 2]])).to_trimesh()
    assert (other.vertices.shape, other.faces.tolist()) == ((4, 3), [[0, 2, 3], [0, 1, 2]])


@pytest.mark.parametrize(
    ("cells", "paths"),
    [([[0, 1], [1, 2]], [[0, 1, 2]]), ([[0, 1], [1, 2], [3, 4]], [[0, 1, 2], [3, 4]]),
     ([[0, 1], [1, 2], [2, 0]], [[0, 1, 2, 0]])],
)  # fmt: skip
def test_trimesh_gets_polylines_as_paths(cells, paths):
    mesh = Mesh(np.arange(15.0).reshape(5, 3), np.array(cells))
    path = mesh.to_trimesh()
    assert path.vertices.tolist() == mesh.vertices.tolist()
    assert [entity.points.tolist() for entity in path.entities] == paths


def test_normals_are_computed_when_they_are_asked_for(monkeypatch):
    asked = []
    normals_at = Patch.normals_at
    monkeypatch.setattr(Patch, "normals_at", lambda *given: (asked.append(1), normals_at(*given))[1])
    mesh = tessellate(pentagon(), 4)
    turned = mesh.with_y_up
    write_mesh(mesh, io.BytesIO(), "obj")
    assert not asked
    assert mesh.normals is mesh.normals
    assert len(asked) == 1
    assert not mesh.normals.flags.writeable
    assert (turned.normals == mesh.normals[:, [0, 2, 1]] * [1, 1, -1]).all()
    assert pickle.loads(pickle.dumps(tessellate(pentagon(), 4))) == mesh
    with pytest.raises(AttributeError, match="'Mesh' object has no attribute 'normal'"):
        _ = mesh.normal


def test_a_mesh_cannot_be_changed():
    for change in (setattr, lambda mesh, name, _: delattr(mesh, name)):
        for name in ("vertices", "normals", "other"):
            with pytest.raises(FrozenInstanceError, match=f"field '{name}'"):
                change(TWO_TRIANGLES, name, None)
    assert repr(Recipe(resolution=3)).startswith("Recipe(resolution=3, tolerance=None, ")


def test_normals_of_another_number_than_the_vertices_are_refused_when_they_come():
    mesh = replace(tessellate(pentagon(), 2), normals=lambda: Normals(np.zeros((1, 3))))
    with pytest.raises(DomainError, match="normals: 1 rows for 16 vertices"):
        _ = mesh.normals
