"""Surfaces whose shape is known, parameters to look at them, and what a closed mesh is."""

from collections.abc import Sequence
from itertools import product as product_of
from math import factorial

import numpy as np

from gtb_cli.fairing.energy import energy_matrix
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from tests.specs import SPECS, load

HALF = 2**-0.5
QUARTER = [[1, 0], [1, 1], [0, 1]]  # control points of a quarter of the unit circle, of weights 1, √½, 1


def product(rows: list[list[list[float]]], weights: list[float], other: list[float], **options) -> Patch:
    """A biquadratic rational tensor product patch; control points by rows."""
    binomial = [1, 2, 1]
    knots = [[i, j] for j in range(3) for i in range(3)]
    w = [weights[i] * other[j] for j in range(3) for i in range(3)]
    c = [binomial[i] * binomial[j] for j in range(3) for i in range(3)]
    return Patch(knots, [b for row in rows for b in row], w, c, **options)


def octant(radius: float = 1.0, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Patch:
    """An eighth of a sphere; the edge v = 2 is its pole. Normals outwards."""
    rows = [[[x * r, y * r, z] for x, y in QUARTER] for r, z in QUARTER]
    points = radius * np.array(rows) + np.array(center)
    return product(points.tolist(), [1, HALF, 1], [1, HALF, 1])


def torus(big: float = 3.0, small: float = 1.0) -> Patch:
    """The outer upper sixteenth of a torus: a quarter around, a quarter of the circle across."""
    rows = [[[(big + small * r) * x, (big + small * r) * y, small * z] for x, y in QUARTER] for r, z in QUARTER]
    return product(rows, [1, HALF, 1], [1, HALF, 1])


def cylinder(radius: float = 2.0) -> Patch:
    rows = [[[radius * x, radius * y, height] for x, y in QUARTER] for height in (0.0, 1.0, 5.0)]
    return product(rows, [1, HALF, 1], [1, 1, 1])


def plane(weight: float = 3.0) -> Patch:
    """A flat pentagon with real knots, in a plane across no axis."""
    patch = load(SPECS / "pentagon.toml")
    x, y = patch.knots.T
    points = np.column_stack([x + y, 2 * x - y, 0.3 * x + 0.7 * y])
    return Patch(patch.knots, points, np.linspace(1, weight, len(points)))


def quartic_octant() -> Patch:
    """The octant as a rational Bézier triangle of degree 4 without a pole: Farin, Piegl and Worsey, 1987."""
    a, b = (3**0.5 - 1) / 3**0.5, (3**0.5 + 1) / (2 * 3**0.5)
    g = 1 - (5 - 2**0.5) * (7 - 3**0.5) / 46
    corner, edge, middle = 4 * 3**0.5 * (3**0.5 - 1), 3 * 2**0.5, 4.0
    inner = (2 / 3) ** 0.5 * (3 + 2 * 2**0.5 - 3**0.5)
    # Rows from the pole z = 1 to the equator, each from x to y.
    rows = [
        [((0, 0, 1), corner)],
        [((a, 0, 1), edge), ((0, a, 1), edge)],
        [((b, 0, b), middle), ((g, g, 1), inner), ((0, b, b), middle)],
        [((1, 0, a), edge), ((1, g, g), inner), ((g, 1, g), inner), ((0, 1, a), edge)],
        [((1, 0, 0), corner), ((1, a, 0), edge), ((b, b, 0), middle), ((a, 1, 0), edge), ((0, 1, 0), corner)],
    ]
    entries = [(row - k, k, *entry) for row, line in enumerate(rows) for k, entry in enumerate(line)]
    c = [24 / (factorial(i) * factorial(k) * factorial(4 - i - k)) for i, k, _, _ in entries]
    return Patch([(i, k) for i, k, _, _ in entries], [b for *_, b, _ in entries], [w for *_, w in entries], c)


def eightfold(part: Patch, name: str | None = None) -> Model:
    """A patch and its seven mirror images in the planes of the coordinates."""
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    return Model(tuple(part.replace(control_points=part.control_points * sign) for sign in signs), name)


def box(low: Sequence[float] = (0, 0, 0), high: Sequence[float] = (1, 1, 1), name: str = "box") -> Model:
    """Six flat patches with faces outwards."""
    square, faces = [[0, 0], [1, 0], [1, 1], [0, 1]], []
    for axis, side in product_of(range(3), (0, 1)):
        places = [np.roll([side, *uv[:: 2 * side - 1]], axis) for uv in square]
        faces.append(Patch(square, np.add(low, places * np.subtract(high, low)), name=f"{name}-{axis}{side}"))
    return Model(tuple(faces), name)


def inside(patch: Patch, count: int, seed: int = 0, depth: float = 0.0) -> np.ndarray:
    """Random parameters, not nearer to the boundary than a fraction of the domain."""
    corners = patch.domain.vertices
    shares = np.random.default_rng(seed).dirichlet(np.ones(len(corners)), count)
    return (1 - depth) * shares @ corners + depth * corners.mean(axis=0)


def diagonal(shape: Patch) -> float:
    return float(np.linalg.norm(np.ptp(shape.control_points, axis=0)))


def rim(patch: Patch) -> np.ndarray:
    """Corners and places on edges."""
    corners = patch.domain.vertices
    following = np.roll(corners, -1, axis=0)
    return np.concatenate([corners, *(corners + t * (following - corners) for t in (0.5, 0.25, 0.875))])


def volume(mesh: Mesh) -> float:
    """By the divergence theorem, from the middle of the mesh."""
    a, b, c = (mesh.vertices[corner] - mesh.vertices.mean(axis=0) for corner in mesh.cells.T)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[corner] for corner in mesh.cells.T)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def away(points: np.ndarray, mesh: Mesh) -> float:
    """The largest distance of points from a mesh."""
    return float(NearestCells(mesh.vertices[mesh.cells]).nearest(points)[0].max())


def assert_closed(mesh: Mesh) -> None:
    """Each edge of two faces, in opposite directions; every vertex used; no face with a vertex twice; unit normals."""
    edges = mesh.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert (edges[:, 0] != edges[:, 1]).all()
    once, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).all()
    np.testing.assert_array_equal(once, np.unique(edges[:, ::-1], axis=0))
    np.testing.assert_array_equal(np.unique(mesh.cells), np.arange(len(mesh.vertices)))
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-12)
    if mesh.groups:
        assert mesh.groups[0][1] == 0
        assert mesh.groups[-1][2] == len(mesh.cells)
        assert all(one[2] == other[1] for one, other in zip(mesh.groups, mesh.groups[1:], strict=False))


def energy(patch: Patch, kind: str = "thin-plate", resolution: int = 64) -> float:
    return np.trace(patch.control_points.T @ energy_matrix(patch, kind, resolution) @ patch.control_points)
