"""The domain cut into equal parts."""

import numpy as np
import pytest

from gtb_cli.knots.domain import domain
from gtb_cli.knots.even_triangulation import cell_count, central_triangulation, triangulation
from tests.patches import SHIFT, regular

EPS = float(np.finfo(np.float64).eps)

SIDES = [3, 4, 5, 6, 9]
NUMBERS = [1, 2, 3, 8]
SCALES = [1e-9, 1.0, 1e9]


def polygon(sides, scale=1.0, shift=0.0):
    """A polygon of unequal edges with no right angles."""
    corners = regular(sides, 0.4) * [1.7, 1.0] + regular(sides, 1.0) * 0.2
    return domain(scale * corners + shift, "unit")


def areas(shape, cells):
    corners = (cells.parameters - shape.center)[cells.cells]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2


def area(shape):
    v = shape.vertices - shape.center
    w = np.roll(v, -1, axis=0)
    return (v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]).sum() / 2


@pytest.mark.parametrize("make", [triangulation, central_triangulation])
@pytest.mark.parametrize("shift", [0.0, SHIFT])
@pytest.mark.parametrize("n", NUMBERS)
@pytest.mark.parametrize("sides", SIDES)
def test_triangles_tile_the_domain(sides, n, shift, make):
    shape = polygon(sides, shift=shift)
    parts = make(shape, n)
    found = areas(shape, parts)
    assert (found > 0).all()
    rounding = 64 * EPS * (1 + np.abs(shape.vertices).max() / shape.size)
    assert found.sum() == pytest.approx(area(shape), rel=n * n * rounding)
    assert sorted(set(parts.cells.ravel().tolist())) == list(range(len(parts.parameters)))


@pytest.mark.parametrize("n", NUMBERS)
@pytest.mark.parametrize("sides", SIDES)
def test_triangles_meet_edge_to_edge_and_their_number_is_known_beforehand(sides, n):
    shape = polygon(sides)
    parts = triangulation(shape, n)
    cells = {3: n * n, 4: 2 * n * n}.get(sides, sides * n * n)
    vertices = {3: (n + 1) * (n + 2) // 2, 4: (n + 1) ** 2}.get(sides, 1 + sides * n * (n + 1) // 2)
    assert len(parts.cells) == cell_count(shape, n) == cells
    assert (len(parts.parameters), parts.boundary.shape) == (vertices, (sides, n))
    assert cell_count(domain([0, 2]), n) == len(triangulation(domain([0, 2]), n).cells) == n
    edges = parts.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(edges, axis=0)) == len(edges)
    found, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    assert counts.max() <= 2
    # Euler: one piece without holes.
    assert len(parts.parameters) - len(found) + len(parts.cells) == 1
    following = np.append(parts.boundary.ravel()[1:], parts.boundary[0, 0])
    outline = np.sort(np.stack([parts.boundary.ravel(), following], axis=1), axis=1)
    assert found[counts == 1].tolist() == sorted(outline.tolist())


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shift", [0.0, SHIFT])
@pytest.mark.parametrize("n", [1, 3, 32])
@pytest.mark.parametrize("sides", SIDES)
def test_boundary_vertices_are_exactly_on_the_hull(sides, n, shift, scale):
    shape = polygon(sides, scale, shift * scale)
    parts = triangulation(shape, n)
    faces = shape.faces.at(shape.heights_of_columns(parts.parameters))
    expected = np.zeros(len(parts.parameters), dtype=int)
    expected[parts.boundary] = 1 + np.arange(sides)[:, None]
    expected[parts.boundary[:, 0]] = 1 + sides + np.arange(sides)
    assert faces.tolist() == expected.tolist()
    assert parts.parameters[parts.boundary[:, 0]].tolist() == shape.vertices.tolist()
    way = np.roll(shape.vertices, -1, axis=0) - shape.vertices
    even = shape.vertices[:, None] + way[:, None] * (np.arange(n) / n)[:, None]
    assert np.abs(parts.parameters[parts.boundary] - even).max() <= 8 * EPS * np.abs(shape.vertices).max()


@pytest.mark.parametrize("n", NUMBERS)
@pytest.mark.parametrize("sides", [3, 5, 9])
def test_a_triangle_and_each_sector_of_a_polygon_are_cut_into_similar_triangles(sides, n):
    shape = polygon(sides)
    parts = triangulation(shape, n)
    outer = parts.parameters[parts.cells] * n
    middle = shape.vertices.mean(axis=0)
    whole = [[middle, *pair] for pair in zip(shape.vertices, np.roll(shape.vertices, -1, axis=0), strict=True)]
    whole = [shape.vertices] if sides == 3 else whole
    expected, found = (
        np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
        for corners in (np.repeat(whole, n * n, axis=0), outer)
    )
    assert np.sort(found, axis=0) == pytest.approx(np.sort(expected, axis=0), abs=64 * n * EPS * shape.size)


@pytest.mark.parametrize("corners", [3, 4, 5])
@pytest.mark.parametrize("resolution", [1, 2, 5])
def test_moved_vertices_never_turn_cells_over_around_the_centre(corners, resolution):
    rng = np.random.default_rng(corners)
    turned = 0
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
        shape = domain(np.stack([np.cos(angles), 0.5 * np.sin(angles)], axis=1))
        part, usual = central_triangulation(shape, resolution), triangulation(shape, resolution)
        even = np.linspace(0, 1, resolution + 1)
        for edge, factor in enumerate(np.exp(rng.uniform(-2.5, 2.5, corners))):
            fractions = factor * even / (1 + (factor - 1) * even)
            part = part.moved(shape.vertices, edge, fractions)
            usual = usual.moved(shape.vertices, edge, fractions)
            start, end = shape.vertices[edge], shape.vertices[(edge + 1) % corners]
            expected = start + fractions[:-1, None] * (end - start)
            np.testing.assert_array_equal(part.parameters[part.side(edge)[:-1]], expected)
        assert not part.is_turned_over()
        turned += usual.is_turned_over()
    assert turned == 0 if corners == 5 or resolution == 1 else turned > 0 or resolution == 2
