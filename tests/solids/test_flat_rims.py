"""Flat rims: in the planes of the surface's rims, and the wall as thick there as elsewhere."""

import math

import numpy as np
import pytest

from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.solids.thickening import side_of_wall
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.surfaces import assert_closed, octant

KNOTS = [[0, 0], [1, 0], [0, 1], [1, 1], [0, 2], [1, 2]]
DISH = [(25, 0), (50, 5), (60, 28)]
LAMP = [(40, 0), (70, 50), (25, 100)]
CONE = [(30, 0), (40, 10), (50, 20)]


def walls(profile: list[tuple[float, float]], sides: int, floor: bool = False, scale: float = 1, shift: float = 0):
    """Walls around the z axis whose profile is a parabola with these control points, radius and height."""

    def around(k: int, rows: list[tuple[float, float]]) -> np.ndarray:
        angles = 2 * math.pi / sides * np.array([k, k + 1])
        return np.array([[r * math.cos(a), r * math.sin(a), z] for r, z in rows for a in angles])

    binomial = [1, 1, 2, 2, 1, 1]
    patches = [Patch(KNOTS, scale * around(k, profile) + shift, coefficients=binomial) for k in range(sides)]
    if floor:
        ring = np.concatenate([around(k, profile[:1])[:1] for k in range(sides)])
        patches.append(Patch(ring[:, :2], scale * ring + shift))
    return Model(tuple(patches))


def cast(mesh: Mesh, points: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distance to the first triangle along each ray, and that triangle."""
    a, b, c = (mesh.vertices[corner] for corner in mesh.cells.T)
    normals, away = np.cross(b - a, c - a), points[:, None] - a
    slope = np.einsum("fk,pk->pf", normals, ways)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = -np.einsum("fk,pfk->pf", normals, away) / slope
        moment = np.cross(away, ways[:, None])
        first = -np.einsum("fk,pfk->pf", c - a, moment) / slope
        second = np.einsum("fk,pfk->pf", b - a, moment) / slope
        hits = (np.minimum(first, second) >= 0) & (first + second <= 1) & (way > 1e-6)
    way = np.where(hits, way, np.inf)
    return way.min(axis=1), way.argmin(axis=1)


def wall_near_rims(solid: Mesh, thickness: float, heights: list[float]) -> np.ndarray:
    """Thicknesses, along the normals of facets, in points of both sides no farther from a rim than four times it."""
    corners = solid.vertices[solid.cells]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    above = np.abs(corners[:, :, 2, None] - heights).min(axis=2)
    is_wall = above.max(axis=1) > 1e-9
    faces = np.flatnonzero(is_wall & (above.min(axis=1) < 4 * abs(thickness)))
    random = np.random.default_rng(0)
    faces = random.choice(faces, 150, p=(area := np.linalg.norm(normals[faces], axis=1)) / area.sum())
    points = np.einsum("pi,pik->pk", random.dirichlet([1, 1, 1], len(faces)), corners[faces])
    ways = -normals[faces] / np.linalg.norm(normals[faces], axis=1)[:, None]
    distance, hit = cast(solid, points, ways)
    assert is_wall[hit].mean() > 0.6
    return distance[is_wall[hit]]


SHAPES = {"dish": (walls(DISH, 5, floor=True), [28]), "lamp": (walls(LAMP, 6), [0, 100])}
SHAPES["cone"] = (walls(CONE, 24), [0, 20])
CASES = [("dish", 2, 12), ("lamp", -5, 8), ("dish", -2, 12), ("lamp", 2, 12), ("lamp", -3, 16), ("cone", 5, 4),
         ("cone", -3, 6)]  # fmt: skip


@pytest.mark.parametrize(("name", "thickness", "n"), mostly_long(CASES, 2))
def test_a_flat_rim_lies_in_its_plane_and_keeps_the_wall(name, thickness, n):
    """Up to the sagitta of facets."""
    model, heights = SHAPES[name]
    solid, remarks = Recipe(n, thickness=thickness, rim="flat").mesh(model)
    assert remarks == []
    assert_closed(solid)
    sides = (solid.cells < len(solid.vertices) // 2).sum(axis=1)
    rim = solid.vertices[solid.cells[(sides > 0) & (sides < 3)]][:, :, 2]
    np.testing.assert_allclose(np.abs(rim[:, :, None] - heights).min(axis=2), 0, atol=1e-12)
    extreme = [solid.vertices[:, 2].min(), solid.vertices[:, 2].max()]
    assert extreme[1] == pytest.approx(heights[-1], abs=1e-12)
    assert wall_near_rims(solid, thickness, heights).min() > 0.985 * abs(thickness)


@pytest.mark.parametrize(("scale", "shift"), mostly_long([(1.0, 1e7), (1e-9, 0.0), (1e9, 0.0)]))
def test_a_flat_rim_has_any_size_and_place(scale, shift):
    solid, remarks = Recipe(3, thickness=2 * scale, rim="flat").mesh(walls(DISH, 5, False, scale, shift))
    assert [line[:59] for line in remarks] == ["the flat rim meets the wall at 24 degrees, a knife edge, ne"]
    assert_closed(solid)
    assert (solid.vertices[:, 2].max() - shift) / scale == pytest.approx(28, abs=1e-12 if not shift else 1e-8)
    assert side_of_wall(solid, "") == "outwards, away from its middle"
    plain, _ = Recipe(3, thickness=2, rim="flat").mesh(walls(DISH, 5))
    np.testing.assert_array_equal(solid.cells, plain.cells)


def test_faces_beyond_the_plane_become_parts_of_the_rim():
    """With a thick wall and small faces there are many; their normals are the rim's."""
    solid, remarks = Recipe(5, thickness=6, rim="flat", normals=True).mesh(walls(CONE, 24))
    assert remarks == []
    count = len(solid.vertices) // 2
    corners = solid.vertices[solid.cells]
    in_plane = (np.ptp(corners[:, :, 2], axis=1) < 1e-9) & (solid.cells >= count).all(axis=1)
    assert in_plane.sum() > 50
    up = np.where(corners[in_plane, 0, 2] > 10, 1.0, -1.0)
    normals = solid.normals[solid.normal_of[in_plane]]
    np.testing.assert_allclose(normals[:, :, 2], np.tile(up[:, None], 3), atol=1e-12)


def test_parts_beyond_the_plane_of_a_rim_that_do_not_reach_it_stay_where_they_are():
    apart = Model((*walls(DISH, 5, floor=True), *walls(CONE, 5, shift=200)))
    assert Recipe(3, thickness=2, rim="flat").mesh(apart)[1] == []


def test_a_wall_that_looks_to_and_from_the_middle_is_on_a_side_of_its_axis():
    trumpet = walls([(100, 0), (10, 20), (10, 100)], 6)
    words = [side_of_wall(Recipe(3, thickness=thickness).mesh(trumpet)[0], "") for thickness in (1, -1)]
    assert words == ["outwards, away from its axis", "inwards, towards its axis"]


@pytest.mark.parametrize("thickness", [2, -2])
def test_around_a_hole_in_a_floor_the_rim_stays_along_the_normals(thickness):
    floor = walls([(8, 0), (16, 0), (25, 0)], 5)
    solid, remarks = Recipe(6, thickness=thickness, rim="flat").mesh(Model(walls(DISH, 5).patches + floor.patches))
    assert remarks == []
    assert_closed(solid)
    surface, offset = np.split(solid.vertices, 2)
    hole, lip = np.hypot(*surface[:, :2].T) < 8.0001, surface[:, 2] > 27.9999
    np.testing.assert_allclose(np.abs(offset[hole] - surface[hole]), np.tile([0, 0, 2], (30, 1)), atol=1e-9)
    np.testing.assert_allclose(offset[lip, 2], 28, atol=1e-12)


def test_at_a_corner_of_a_patch_the_rim_leaves_the_plane_smoothly_and_never_goes_below():
    grid = np.stack(np.mgrid[:3, :3], axis=-1).reshape(-1, 2)
    pillow = Patch(grid, np.column_stack([10.0 * grid, 30.0 * (grid == 1).all(axis=1)]), coefficients="binomial")
    solid, remarks = Recipe(24, thickness=0.5, rim="flat").mesh(pillow)
    along = "the surface lies in the plane of a rim, which is along the normals in part near (0, 0, 0)"
    thin = "beside a rim the wall is 85% of the thickness near (-0.01875, 18.8, 0.4339): more faces make it thicker"
    assert (*remarks[:2], remarks[2][:46]) == (along, thin, "the flat rim meets the wall at 24 degrees, a k")
    assert_closed(solid)
    surface, offset = np.split(solid.vertices, 2)
    edge = np.flatnonzero(surface[:, 1] == 0)
    heights = offset[edge[np.argsort(surface[edge, 0])], 2]
    assert heights.min() > -1e-12
    assert heights[[0, -1]] == pytest.approx(0.5)
    assert np.abs(heights[7:-7]).max() < 1e-12
    assert (np.diff(heights[:8]) < 1e-12).all()
    assert np.linalg.norm(offset - surface, axis=1).max() < 1.0


def test_what_has_no_flat_rim_is_refused():
    grid = np.stack(np.mgrid[:4, :4], axis=-1).reshape(-1, 2)
    inside = np.all((grid > 0) & (grid < 3), axis=1)
    bowl = Patch(grid, np.column_stack([grid, np.where(inside, -3.0, 0.0)]))
    cases = [
        (octant(), 0.1, "a rim leaves its plane by 0.159 near"),
        (bowl, 0.1, r"plane near \(.*\), as a patch does at a corner between two edges, .* `thickness` -0.1 does not"),
        (walls([(40, 0), (42, 1), (44, 2)], 6), 3.0, "reaches another rim"),
        (walls([(40, 0), (44, 4), (60, -20)], 6), 3.0, "goes to both sides"),
    ]
    for model, thickness, message in cases:
        with pytest.raises(DomainError, match=f"^rim: .*{message}"):
            Recipe(6, thickness=thickness, rim="flat").mesh(model)
    for options, message in [({"rim": "flat"}, "needs a thickness"), ({"rim": "round"}, ".*one of normal, flat")]:
        with pytest.raises(DomainError, match=f"^rim: {message}"):
            Recipe(**options)
