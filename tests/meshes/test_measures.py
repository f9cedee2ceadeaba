"""Area, volume, length and topology: of shapes that are known, and as trimesh measures them."""

import json
import math

import numpy as np
import pytest
import trimesh

from gtb_cli.errors import DomainError
from gtb_cli.meshes.measures import measure, moments
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.tessellate import tessellate
from tests.specs import GOOD_SPECS, is_curve, load
from tests.tiny_meshes import curve, model, plane, surface

ROUNDING = 1e-12  # relative; sums of up to some thousand terms


def of(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(shape.vertices), np.array(shape.faces))


BOX = of(trimesh.creation.box(extents=(1, 2, 3)))


def test_a_box():
    found = measure(BOX)
    assert found.area == pytest.approx(22, rel=ROUNDING)
    assert found.volume == pytest.approx(6, rel=ROUNDING)
    assert (found.vertices, found.cells, found.open_edges, found.boundary_length) == (8, 12, 0, 0)
    assert (found.components, found.euler_characteristic, found.open_edges, found.crowded_edges) == (1, 2, 0, 0)
    assert found.bounds == ((-0.5, -1, -1.5), (0.5, 1, 1.5))


@pytest.mark.parametrize("scale", [1e-200, 1e-9, 1e9, 1e200])
def test_at_any_size(scale):
    found = measure(Mesh(BOX.vertices * scale, BOX.cells))
    with np.errstate(over="ignore", under="ignore"):
        assert found.area == pytest.approx(np.float64(22) * scale * scale, rel=ROUNDING)
        assert found.volume == pytest.approx(np.float64(6) * scale * scale * scale, rel=ROUNDING)
    assert found.euler_characteristic == 2


def test_far_from_the_origin_and_as_a_soup():
    found = measure(Mesh(BOX.vertices + 1e7, BOX.cells))
    assert found.volume == pytest.approx(6, rel=1e-8)  # the coordinates themselves are rounded to 2e-9
    soup = Mesh(BOX.vertices[BOX.cells.ravel()], np.arange(36).reshape(-1, 3))
    found, expected = measure(soup), measure(BOX)
    assert (found.volume, found.euler_characteristic, found.components) == (expected.volume, 2, 1)


def test_holes_and_parts():
    found = measure(Mesh(BOX.vertices, BOX.cells[1:]))
    corners = BOX.vertices[BOX.cells[0]]
    assert (found.volume, found.open_edges, found.euler_characteristic) == (None, 3, 1)
    assert found.boundary_length == pytest.approx(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())
    torus = of(trimesh.creation.torus(2, 0.5))
    assert measure(torus).euler_characteristic == 0
    two = Mesh(np.vstack([BOX.vertices, torus.vertices + 9]), np.vstack([BOX.cells, torus.cells + 8]))
    assert (measure(two).components, measure(two).euler_characteristic) == (2, 2)
    assert measure(two).volume == pytest.approx(6 + measure(torus).volume)


def test_mean_squares_of_a_segment_and_a_rectangle():
    assert moments(Mesh(np.array([[-1.0, 0, 0], [1, 0, 0]]), np.array([[0, 1]])))[1] == pytest.approx([1 / 3, *[0] * 5])
    centroid, squares = moments(plane(4))
    assert (centroid, squares) == (pytest.approx([0.5, 1, 0]), pytest.approx([1 / 12, 1 / 3, *[0] * 4]))


def test_what_is_turned_has_no_volume():
    inwards = Mesh(BOX.vertices, BOX.cells[:, ::-1])
    assert measure(inwards).volume == pytest.approx(-6)
    cells = BOX.cells.copy()
    cells[3] = cells[3, ::-1]
    assert measure(Mesh(BOX.vertices, cells)).volume is None


def test_a_moebius_strip():
    angle = np.linspace(0, 2 * math.pi, 20, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    up = np.stack([np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)], axis=1)
    vertices = np.vstack([ring - 0.3 * up, ring + 0.3 * up])
    low, high = np.arange(20), np.arange(20) + 20
    next_low, next_high = np.append(low[1:], 20), np.append(high[1:], 0)
    cells = np.vstack([np.stack([low, next_low, high], axis=1), np.stack([next_low, next_high, high], axis=1)])
    found = measure(Mesh(vertices, cells))
    assert (found.euler_characteristic, found.components, found.open_edges, found.crowded_edges) == (0, 1, 40, 0)


def test_crowded_edges_and_collapsed_faces():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, 0]])
    cells = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 5, 1]])
    found = measure(Mesh(vertices, cells))
    assert (found.crowded_edges, found.collapsed, found.components) == (1, 1, 1)


def test_curves():
    found = measure(curve(10))
    steps = np.linalg.norm(np.diff(curve(10).vertices, axis=0), axis=1)
    assert found.length == pytest.approx(steps.sum(), rel=ROUNDING)
    assert (found.area, found.volume, found.boundary_length) == (None, None, None)
    assert (found.open_edges, found.components, found.euler_characteristic) == (2, 1, 1)
    square = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1], [1, 2], [2, 3], [3, 0]]))
    assert (measure(square).length, measure(square).open_edges, measure(square).euler_characteristic) == (4, 0, 0)


@pytest.mark.parametrize("path", GOOD_SPECS, ids=lambda path: path.stem)
def test_specs_as_trimesh_measures_them(path):
    if is_curve(load(path)):
        return
    mesh = tessellate(load(path), 3)
    theirs = trimesh.Trimesh(mesh.vertices, mesh.cells, process=False)
    theirs.merge_vertices(digits_vertex=15)
    found = measure(mesh)
    assert found.area == pytest.approx(theirs.area, rel=1e-9)
    assert found.euler_characteristic == theirs.euler_number
    assert (found.open_edges == 0) == theirs.is_watertight
    assert found.components == theirs.body_count
    if found.volume is not None:
        assert found.volume == pytest.approx(theirs.volume, rel=1e-9)


def test_nothing_to_measure():
    with pytest.raises(DomainError, match="has no cells"):
        measure(Mesh(np.zeros((3, 3)), np.empty((0, 3), dtype=int)))
    with pytest.raises(DomainError, match="must be finite"):
        measure(Mesh(surface().vertices * np.nan, surface().cells))
    assert measure(model()).components == 2


def test_a_record_is_json_at_any_size():
    for scale in (1e-200, 1.0, 1e200):
        with np.errstate(over="ignore"):
            found = json.loads(
                json.dumps(measure(Mesh(BOX.vertices * scale, BOX.cells)).record()), parse_constant=pytest.fail
            )
        assert (found["area"] is None) == (scale > 1)
        assert found["bounds"][1][0] == 0.5 * scale
    assert measure(curve()).record()["segments"] == 10
