"""Distances between surfaces: of shapes where they are known, and by dense sampling."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gtb_cli.errors import DomainError
from gtb_cli.meshes import hausdorff
from gtb_cli.meshes.hausdorff import RELATIVE_ERROR, mesh_distance
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.tessellation.tessellate import tessellate
from tests.marks import long, mostly_long
from tests.shell import SPECS
from tests.specs import load
from tests.tiny_meshes import curve, surface

ROUNDING = 1e-13  # error for meshes of size 1 to 10


def moved(mesh: Mesh, *by: float) -> Mesh:
    return Mesh(mesh.vertices + np.array(by), mesh.cells)


def flat(n: int) -> Mesh:
    mesh = surface(n)
    return Mesh(mesh.vertices * [1, 1, 0] + mesh.vertices[:, [0]] * [0, 0, 0.3], mesh.cells)


def samples(mesh: Mesh, number: int) -> np.ndarray:
    """Points of all cells on a grid, corners among them."""
    k = mesh.cells.shape[1]
    grid = [
        (i, j, number - i - j)[:k] if k == 3 else (i, number - i)
        for i in range(number + 1)
        for j in range(number + 1 - i if k == 3 else 1)
    ]
    weights = np.array(grid) / number
    return np.einsum("sk,ckx->csx", weights, mesh.vertices[mesh.cells]).reshape(-1, 3)


def sampled_distance(a: Mesh, b: Mesh, number: int = 24) -> tuple[float, float]:
    """Hausdorff distance of dense samples, and how far it can be from that of the meshes."""
    one, two = samples(a, number), samples(b, number)
    longest = max(
        np.linalg.norm(mesh.vertices[mesh.cells] - mesh.vertices[np.roll(mesh.cells, 1, axis=1)], axis=2).max()
        for mesh in (a, b)
    )
    distance = max(cKDTree(two).query(one)[0].max(), cKDTree(one).query(two)[0].max())
    return float(distance), longest / number


@pytest.mark.parametrize(("scale", "shift"), [(1e-290, 0), (1e-9, 0), (1e9, 1e7), (1, 0), (1, 1e7), (1e290, 0)])
def test_parallel_planes(scale, shift):
    one, two = flat(3), moved(flat(7), 0, 0, 0.25)
    height = 0.25 / math.hypot(1, 0.3)  # in the middle; at the boundary, the farthest points are off the plane
    one, two = (Mesh((mesh.vertices + shift) * scale, mesh.cells) for mesh in (one, two))
    found = mesh_distance(one, two)
    at_edge = 0.25  # at the upper edge the plane ends: the nearest point of the lower one is on its own edge
    assert height * scale <= found.distance <= at_edge * scale * (1 + 1e-6)
    assert found.distance <= found.bound <= found.distance * (1 + RELATIVE_ERROR) + shift * scale * 1e-12


def test_a_point_above_a_plane():
    roof = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]])
    square = Mesh(roof[:4], np.array([[0, 1, 2], [0, 2, 3]]))
    pyramid = Mesh(roof, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))
    found = mesh_distance(pyramid, square)
    assert found.forward.distance == pytest.approx(1)
    assert found.forward.at == pytest.approx((1, 1, 1))
    assert found.backward.distance == pytest.approx(math.sqrt(0.5))  # from the middle to faces of 45 degrees
    assert found.backward.at == pytest.approx((1, 1, 0), abs=1e-3)
    assert found.distance == found.forward.distance


def test_the_farthest_point_may_be_inside_a_face():
    """From the middle of the long side of a big face it is farthest to a small mesh around its corners."""
    big = Mesh(np.array([[0.0, 0, 0], [6, 0, 0], [0, 6, 0]]), np.array([[0, 1, 2]]))
    corners = Mesh(big.vertices[np.array([0, 0, 1, 1, 2, 2])], np.array([[0, 1, 1], [2, 3, 3], [4, 5, 5]]))
    found = mesh_distance(big, corners)
    assert found.forward.distance == pytest.approx(3 * math.sqrt(2), rel=2 * RELATIVE_ERROR)
    assert found.backward.distance == 0


@pytest.mark.parametrize(("m", "n"), [(3, 3), (10, 7), (5, 20), (1, 13)])
def test_other_faces_of_the_same_surface_are_not_a_difference_and_that_is_proved(m, n):
    other = flat(n)
    order = np.random.default_rng(1).permutation(len(other.cells))
    for cells in (other.cells, other.cells[order], other.cells[order, ::-1]):
        assert mesh_distance(flat(m), Mesh(other.vertices, cells)).bound <= ROUNDING


@cache
def pairs() -> dict[str, tuple[Mesh, Mesh]]:
    pentagon, hexagon = load(SPECS / "pentagon.toml"), load(SPECS / "hexagon.toml")
    rng = np.random.default_rng(7)
    cells = rng.integers(0, 30, (25, 3))
    ring = tessellate(load(SPECS / "example-3.1.toml"), 9)
    return {
        "bent": (surface(6), surface(7)),
        "pentagon": (tessellate(pentagon, 5), tessellate(pentagon, 6)),
        "parametrizations": (tessellate(pentagon, 6, parametrization="toric"), tessellate(pentagon, 6)),
        "hole": (surface(6), Mesh(surface(6).vertices, np.delete(surface(6).cells, [20, 21], axis=0))),
        "different": (tessellate(pentagon, 3), tessellate(hexagon, 3)),
        "soup": (Mesh(rng.normal(size=(30, 3)), cells), Mesh(rng.normal(size=(30, 3)), cells)),
        "curves": (ring, tessellate(load(SPECS / "example-3.1.toml"), 13)),
        "curve and surface": (ring, surface(4)),
    }


PAIRS = ["different", "curves", "bent", "pentagon", "parametrizations", "hole", "soup", "curve and surface"]


@pytest.mark.parametrize("name", mostly_long(PAIRS, 3))
def test_distance_as_by_dense_sampling(name):
    """The same both ways round; an accuracy is kept."""
    a, b = pairs()[name]
    found, other = mesh_distance(a, b), mesh_distance(b, a)
    expected, error = sampled_distance(a, b)
    assert abs(found.distance - expected) <= error
    assert found.distance <= found.bound <= found.distance * (1 + RELATIVE_ERROR) + ROUNDING
    assert (found.forward, found.backward) == (other.backward, other.forward)
    accuracy = 0.2 * found.distance
    rough = mesh_distance(a, b, accuracy)
    assert found.distance - accuracy <= rough.distance <= found.bound
    assert found.distance <= rough.bound <= rough.distance + accuracy * (1 + 1e-9)


def test_without_effort_the_bound_is_still_one(monkeypatch):
    a, b = pairs()["pentagon"]
    exact = mesh_distance(a, b)
    monkeypatch.setattr(hausdorff, "MAX_CUTS", 0)
    found = mesh_distance(a, b)
    assert found.distance <= exact.distance <= found.bound


@pytest.mark.parametrize("mesh", [flat(3), curve()])
def test_cells_that_are_repeated_are_searched_once(mesh, monkeypatch):
    searched = []
    nearest = hausdorff.NearestCells
    monkeypatch.setattr(hausdorff, "NearestCells", lambda corners: searched.append(len(corners)) or nearest(corners))
    many = Mesh(mesh.vertices, np.concatenate([mesh.cells, np.roll(mesh.cells, 1, axis=1)] * 50))
    other = moved(mesh, 0, 0, 0.1)
    assert mesh_distance(many, other) == mesh_distance(mesh, other)
    assert searched == [len(mesh.cells)] * 4


def test_what_has_no_distance():
    empty = Mesh(np.zeros((1, 3)), np.empty((0, 3), dtype=int))
    with pytest.raises(DomainError, match="has no cells"):
        mesh_distance(surface(), empty)
    with pytest.raises(DomainError, match="must be finite"):
        mesh_distance(surface(), Mesh(surface().vertices + np.inf, surface().cells))
    assert mesh_distance(curve(), curve()).bound == 0


@long
def test_small_meshes_with_lines_of_farthest_points_take_few_cuts(monkeypatch):
    """Between strips in a plane, whole lines are as far as the farthest point, and the bound falls slowly."""
    strips = np.array([[[x, 0, 0], [x, 100, 0], [x + 1e-3, 50, 0]] for x in range(9)])
    between = np.array([[[x, 0, 0], [x + 1, 0, 0], [x + 0.5, 100, 0]] for x in range(8)])
    cuts, cut = [], hausdorff.CellParts.cut
    monkeypatch.setattr(hausdorff.CellParts, "cut", lambda own, tree: cuts.append(len(own.bounds)) or cut(own, tree))
    found = mesh_distance(
        *(Mesh(part.reshape(-1, 3), np.arange(3 * len(part)).reshape(-1, 3)) for part in (between, strips))
    )
    assert 0.49 < found.distance <= 0.5 <= found.bound
    assert sum(cuts) < 50_000  # a fifth of a second
    cuts.clear()
    around = np.arange(500) * np.pi / 250
    rim = np.column_stack([np.cos(around), np.sin(around), 0 * around])
    fans = (Mesh(np.roll(rim, k, axis=0), np.array([[0, i, i + 1] for i in range(1, 499)])) for k in (0, 160))
    assert mesh_distance(*fans, 1e-9).distance < 1e-9
    assert sum(cuts) < 50_000  # of slivers that lie on each other's boxes


@long
def test_of_many_cells_those_that_are_cut_are_measured():
    one = surface(n := 300)
    (a, b, c), d = one.cells[::2].T, one.cells[1::2, 2]  # squares, of which the other has the other diagonals
    two = Mesh(one.vertices, np.concatenate([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)]))
    assert mesh_distance(one, two).distance * n**2 == pytest.approx(3, rel=0.02)


def test_cells_beside_each_other_are_no_crowd():
    mesh = surface(150)
    assert NearestCells(mesh.vertices[mesh.cells]).crowd < 20
