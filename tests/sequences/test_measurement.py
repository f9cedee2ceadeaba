"""Distances of members from their limit, against dense samples of both surfaces."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

from gtb_cli import (
    Patch,
    ToleranceError,
    convergence_rate,
    degenerate,
    load,
    move_knots,
    regular_control_surface,
    regular_decomposition,
    tessellate,
)
from gtb_cli.limits.knot_limit import knot_limit
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.sequences.family import approaching, film_mesh
from gtb_cli.sequences.measurement import Accuracy, Measurement
from gtb_cli.sequences.sequence import degeneration, knot_sequence
from tests.marks import long, mostly_long
from tests.shell import SPECS

THREE_DIGITS = 5e-4
SAMPLES = 200  # along each side: neighbours are 1 % of the size apart, and distances 0.1 % too large
ROUGH = 3e-3
CELLS = 30  # of meshes, likewise, whose nearest points are searched for in cells


@pytest.mark.parametrize("x", mostly_long([100, 5, 600, 1e8]))
def test_the_corner_of_the_limit_is_farthest(x):
    """The nearest point of a member is beside its own top, up to 6 % nearer to the corner than that."""
    patch = load(SPECS / "pentagon.toml")
    member, corner = degenerate(patch, x), patch.control_points[3]
    angle, size = np.meshgrid(np.arange(0, 2 * np.pi, 0.02), np.geomspace(1e-9, 0.5, 200))
    u = patch.knots[3] + np.stack([size * np.cos(angle), size * np.sin(angle)], axis=-1)
    nearest = np.linalg.norm(member.evaluate(u, "linear") - corner, axis=-1).min()
    distance = degeneration(patch, [x], resolution=1).distances[0]
    assert distance == pytest.approx(nearest, rel=3 * THREE_DIGITS)


def grid(patch):
    """Points all over a patch, as dense as `SAMPLES` say along each edge of the rectangle around its domain."""
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    u = np.stack(np.meshgrid(*np.linspace(low, high, SAMPLES).T, indexing="ij"), axis=-1).reshape(-1, 2)
    heights = (u - patch.domain.vertices[:, None]) @ patch.domain.normals[:, :, None]
    inside = (heights[..., 0] >= 0).all(axis=0)
    edges = np.linspace(patch.domain.vertices, np.roll(patch.domain.vertices, -1, axis=0), SAMPLES).reshape(-1, 2)
    return patch.evaluate(np.concatenate([u[inside], edges]), "linear")


@pytest.mark.parametrize(("seed", "x"), mostly_long([(3, 30), (3, 1.5)], 0))
def test_points_between_vertices_may_be_farthest(seed, x):
    """On ridges, where two points of the other surface are equally near."""
    rng = np.random.default_rng(seed)
    knots = np.stack(np.meshgrid(np.arange(3.0), np.arange(4.0), indexing="ij"), axis=-1).reshape(-1, 2)
    patch = Patch(knots, rng.normal(size=(12, 3)), np.exp(rng.normal(size=12)), lifting=rng.integers(0, 4, size=12))
    limit = np.concatenate([grid(cell) for cell in regular_control_surface(patch).patches])
    distance = degeneration(patch, [x], resolution=1).distances[0]
    member = grid(degenerate(patch, x))
    there, back = cKDTree(limit).query(member)[0].max(), cKDTree(member).query(limit)[0].max()
    assert distance == pytest.approx(max(there, back), rel=ROUGH)


def figures(patch, scale=1.0):
    """Distances of a degeneration, of a knot limit and of its film, in units of the scale."""
    large = patch.replace(knots=scale * (patch.knots + 7), control_points=scale * (patch.control_points + 1e3))
    rough = Accuracy(chord_error=1e-2, cells=256, points_in_all=1000)  # of meshes; what they are is what matters
    moving = knot_sequence(large, {6: 3}, [0.5], resolution=1, accuracy=rough)
    going = degeneration(large, [5, 100], np.arange(8) % 3, resolution=1)
    return [distance / scale for distance in (*going.distances, *moving.distances, *moving.film_distances)]


@long
def test_units_do_not_matter():
    expected = figures(inner_knots())
    for scale in (1e-9, 1e9):
        assert figures(inner_knots(), scale) == pytest.approx(expected, rel=THREE_DIGITS)


def inner_knots():
    """A patch with two inner knots, edges and corners to move them to."""
    rng = np.random.default_rng(6)
    knots = [[0, 0], [3, 0], [0, 3], [1, 0], [0, 2], [1.5, 1.5], [0.6, 0.9], [1, 0.5]]
    return Patch(knots, rng.normal(size=(8, 3)), np.exp(rng.normal(size=8)))


@pytest.mark.parametrize(("moves", "step"), mostly_long([({6: 7}, 0.3), ({6: 1}, 0.95), ({6: 3, 7: 1}, 0)], 0))
def test_moving_knots_against_dense_samples(moves, step):
    assert_distances_of_dense_samples(inner_knots(), moves, step)


@long
def test_a_layer_of_a_knot_near_an_edge_is_not_missed():
    """Vertices all over Δ are too far from there: the film would be 0.06 away, and not 0.021."""
    rng = np.random.default_rng(0)
    knots = [[0, 0], [3, 0], [0, 3], [1.5, 0.04], [0.05, 1.2], [1, 0.7], [1.2, 1.1]]
    patch = Patch(knots, rng.normal(size=(7, 3)), np.exp(rng.normal(size=7)))
    assert_distances_of_dense_samples(patch, {3: 0}, 0.5)


def crowded_at_edges(patch):
    """A mesh of rings around the middle of Δ, the nearer to edges and corners the denser, up to 1e-7 of its size."""
    layer, v = np.append(0, np.geomspace(1e-7, 0.02, CELLS // 3 - 1)), patch.domain.vertices
    half, ring = np.append(layer, np.linspace(0.04, 0.5, CELLS)), 1 - np.append(layer, np.linspace(0.03, 0.99, 50))
    along = np.append(half, 1 - half[-2::-1])
    outer = v[:, None] + along[:, None] * (np.roll(v, -1, axis=0) - v)[:, None]
    u = v.mean(axis=0) + ring[:, None, None] * (outer - v.mean(axis=0))[:, None]
    return Mesh(patch.evaluate(u.reshape(-1, 2), "linear"), Delaunay(u.reshape(-1, 2)).simplices)


def assert_distances_of_dense_samples(patch, moves, step):
    """Film and merged patch are sampled by themselves, and the member up to a thousandth of its layer."""
    limit, member = knot_limit(patch, moves), move_knots(patch, moves, step)
    there = crowded_at_edges(member)
    merged = tessellate(limit.merged, CELLS)
    found = knot_sequence(patch, moves, [step], resolution=2).members[0]
    assert found.doubt == ""
    size = np.linalg.norm(np.ptp(patch.control_points, axis=0))
    away, back = distances(there, merged), distances(merged, there).max()
    assert found.distance == pytest.approx(max(away.max(), back), abs=2e-3 * size)
    assert abs(found.distance - max(away.max(), back)) <= found.distance_error + 1e-3 * size  # that of the samples
    assert found.distance_error <= 3e-3 * size
    if limit.films:
        film = film_mesh(limit)
        farthest = np.minimum(away, distances(there, film)).max(), back, distances(film, there).max()
        assert found.film_distance == pytest.approx(max(farthest), abs=2e-3 * size)


def test_a_limit_that_is_not_fine_enough_is_in_doubt(monkeypatch):
    found = Measurement(approaching(knot_limit(inner_knots(), {6: 3}), [0.5]), Accuracy(1e-2, 64, 1000))
    doubts = {found.family.samplers[0]: "", found.family.limit: "coarse"}
    monkeypatch.setattr(found, "refined", lambda mosaic, sampler: (mosaic, doubts[sampler]))
    assert found.between_meshes(0)[2:] == (None, "coarse")


def distances(mesh, other):
    """Distances of the vertices of a mesh from the cells of another one."""
    return NearestCells(other.vertices[other.cells]).nearest(mesh.vertices)[0]


def test_the_film_alone_is_measured():
    """Without a step there is only the merged patch, from which the film reaches as far as ever."""
    patch = inner_knots()
    ends = [knot_sequence(patch, {6: 3}, steps, resolution=1).members[-1] for steps in ([], [0.5])]
    assert 0.4 < ends[0].film_distance == pytest.approx(ends[1].film_distance, rel=2 * THREE_DIGITS)
    assert ends[0].distance_error < 3e-3 * np.linalg.norm(np.ptp(patch.control_points, axis=0))


@pytest.mark.parametrize("seed", mostly_long((3, 6, 9, 11, 24), 0))
def test_small_distances_are_as_exact_as_said(seed):
    """Of knots inside that move onto others or corners, by points of meshes and the nearest ones, found from grids."""
    rng = np.random.default_rng(seed)
    sides = int(rng.integers(3, 7))
    angles = 2 * np.pi * (np.arange(sides) + rng.uniform(-0.2, 0.2, sides)) / sides
    knots = np.concatenate([np.column_stack([np.cos(angles), np.sin(angles)]), rng.uniform(-0.35, 0.35, (4, 2))])
    heights = rng.uniform(0.1, 1) * rng.normal(size=(sides + 4, 3))
    patch = Patch(knots, np.column_stack([knots, np.zeros(sides + 4)]) + heights, np.exp(rng.normal(size=sides + 4)))
    knot = sides + int(rng.integers(4))
    inside = [other for other in range(sides, sides + 4) if other != knot]
    moves = {knot: int(rng.choice(inside) if rng.integers(3) < 2 else rng.integers(sides))}
    step = float(rng.choice([0.5, 0.9, 0.97, 0.99, 0.997]))
    found = knot_sequence(patch, moves, [step], resolution=2).members[0]
    pair = move_knots(patch, moves, step), knot_limit(patch, moves).merged
    known = max(farthest_refined(*pair), farthest_refined(*pair[::-1]))
    assert known <= found.distance + found.distance_error
    assert known >= 0.9 * found.distance - found.distance_error  # the farthest point may be between vertices


def farthest_refined(patch, other):
    """The largest distance of some vertices of a patch, those that are far, from another patch."""
    vertices, mesh = tessellate(patch, 60, normals=False).vertices, tessellate(other, 60)
    tree = NearestCells(mesh.vertices[mesh.cells])
    rough = tree.nearest(vertices)[0]
    return refined(vertices[np.argsort(-rough)[:200:20]], other, mesh).max()


def refined(points, patch, mesh):
    """Distances of points from a patch, by smaller and smaller grids around the parameters of near vertices."""
    offsets = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 2), axis=-1).reshape(-1, 2)
    near = mesh.parameters[cKDTree(mesh.vertices).query(points, 4)[1]]
    for reach in 0.05 * 0.6 ** np.arange(28):
        u = near[..., None, :] + reach * offsets
        heights = np.einsum("kpgvx,vx->kpgv", u[..., None, :] - patch.domain.vertices, patch.domain.normals)
        u = np.where((heights >= 0).all(axis=-1)[..., None], u, near[..., None, :])
        away = np.linalg.norm(patch.evaluate(u, "linear") - points[:, None, None], axis=-1)
        near = np.take_along_axis(u, away.argmin(axis=2)[..., None, None], axis=2)[:, :, 0]
    return away.min(axis=(1, 2))


@pytest.mark.parametrize(("seed", "dimension"), mostly_long([(0, 2), (5, 1), (1, 2), (4, 2)]))
def test_distances_fall_as_the_lifting_says(seed, dimension):
    """The second exponent of these is far enough from the first."""
    rng = np.random.default_rng(seed)
    patch = Patch(
        rng.random((5, dimension)), rng.normal(size=(5, 3)), np.exp(rng.normal(size=5)), lifting=rng.random(5)
    )
    rate = convergence_rate(regular_decomposition(patch.knots, patch.lifting))
    found = degeneration(patch, np.exp(np.array([8, 9.5, 11]) / rate), resolution=1)
    assert found.predicted_rate == rate
    assert np.log(found.distances[1] / found.distances[2]) == pytest.approx(1.5, rel=THREE_DIGITS)


def test_knots_merge_linearly():
    found = knot_sequence(load(SPECS / "example-3.1.toml"), {1: 2}, [0.9, 0.99, 0.999], resolution=1)
    assert found.predicted_rate == 1
    assert np.log10(found.distances[1] / found.distances[2]) == pytest.approx(1, rel=0.01)


def test_a_degeneration_from_1_on_goes_upwards():
    found = degeneration(load(SPECS / "example-3.4.toml"), [5, 1], resolution=1, distances=False)
    assert found.values == (1, 5, np.inf)


def test_what_does_not_converge_has_no_rate_and_faces_of_all_meshes_count():
    patch = load(SPECS / "example-3.4.toml")
    assert degeneration(patch, [5], np.zeros(5), resolution=1, distances=False).predicted_rate is None
    with pytest.raises(ToleranceError, match="6 faces in 3 meshes, more than 5"):
        degeneration(patch, [3, 5], resolution=1, max_faces=5)
