"""Thickness: closed, looking outwards, of the right volume, and folds where they are."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from gtb_cli.arrays import cross, unit
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.models.model import Model
from gtb_cli.solids.offsets import MAX_MITRE, _sheets
from gtb_cli.solids.thickening import folded_faces, thicken, thinnest_wall
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.shell import CURVE
from tests.specs import GOOD_SPECS, is_curve, load
from tests.surfaces import area, assert_closed, box, cylinder, eightfold, octant, quartic_octant, volume

DIGITS = 1e-12  # a few thousand roundings

SPHERE = 4 / 3 * math.pi

CORNERS = [[0, 0], [1, 0], [0, 1], [1, 1]]

SURFACES = [path for path in GOOD_SPECS if not is_curve(load(path))]


def square(size: float = 2.0, n: int = 4) -> Mesh:
    """A square in a plane across no axis."""
    corners = size * np.array([[0, 0, 0], [1, 2, 2], [2, 1, -2], [3, 3, 0]]) / 3
    return tessellate(Patch(CORNERS, corners), n)


def dented(mesh: Mesh) -> Mesh:
    """The same with normals turned over, and faces with them."""
    return Mesh(mesh.vertices, mesh.cells[:, ::-1], normals=-mesh.normals, groups=mesh.groups)


@pytest.mark.parametrize("thickness", [0.5, -0.5, 1e-3, 100.0])
@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
def test_a_plane_becomes_a_box(thickness, scale, shift):
    flat = square()
    flat = Mesh(scale * flat.vertices + shift, flat.cells, normals=flat.normals)
    solid = thicken(flat, scale * thickness)
    assert_closed(solid)
    # 1e7 has 9 digits after the point.
    assert volume(solid) == pytest.approx(4 * abs(thickness) * scale**3, rel=1e-5 if shift else DIGITS)
    assert len(solid.vertices) == 2 * len(flat.vertices)
    assert len(solid.cells) == 2 * len(flat.cells) + 2 * 4 * 4
    height = (solid.vertices - flat.vertices[0]) @ flat.normals[0] / scale
    expected = np.repeat([0, thickness], len(flat.vertices))
    np.testing.assert_allclose(height, expected, atol=1e-8 if shift else DIGITS * abs(thickness) + DIGITS)
    assert len(folded_faces(thicken(flat, scale * thickness))) == 0


@pytest.mark.parametrize("make", [octant, quartic_octant])
@pytest.mark.parametrize("thickness", [0.25, -0.25])
def test_a_sphere_octant_becomes_an_eighth_of_a_shell(make, thickness):
    """With an error of second order."""
    expected = abs((1 + thickness) ** 3 - 1) * SPHERE / 8
    errors = []
    for n in (8, 16, 32):
        solid = thicken(tessellate(make(), n), thickness)
        assert_closed(solid)
        assert len(solid.vertices) - len(solid.cells) / 2 == 2
        errors.append(abs(volume(solid) / expected - 1))
    assert errors[-1] < 2e-3
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 1.8).all()


def test_a_closed_body_gets_a_second_shell():
    sphere = tessellate(eightfold(quartic_octant()), 24)
    whole = SPHERE
    for mesh, thickness, expected in (
        (sphere, 0.5, (1.5**3 - 1) * whole),
        (sphere, -0.5, (1 - 0.5**3) * whole),
        (dented(sphere), 0.5, (1 - 0.5**3) * whole),
        (dented(sphere), -0.5, (1.5**3 - 1) * whole),
    ):
        solid = thicken(mesh, thickness)
        assert_closed(solid)
        assert len(solid.cells) == 2 * len(mesh.cells)
        assert volume(solid) == pytest.approx(expected, rel=5e-3)
        assert len(solid.groups) == 8


@pytest.mark.parametrize("path", mostly_long(SURFACES, 3), ids=lambda path: path.stem)
def test_every_surface_becomes_a_solid(path):
    """Its volume is about its area times the thickness, where that is small."""
    surface = tessellate(load(path), 10)
    size = float(np.ptp(surface.vertices, axis=0).max())
    for thickness in (2e-3 * size, -2e-3 * size, 0.3 * size):
        solid = thicken(surface, thickness)
        assert_closed(solid)
        if abs(thickness) < 0.1 * size:
            assert volume(solid) == pytest.approx(area(surface) * abs(thickness), rel=0.03)


@given(st.integers(0, 10**6), st.sampled_from([3, 4, 5, 7]), st.booleans())
def test_any_rim_is_closed(seed, sides, outwards):
    """Polygons of any number of sides, with random knots and control points."""
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * np.pi, sides) * 0.3 + np.arange(sides) * 2 * np.pi / sides)
    corners = np.column_stack([np.cos(angle), np.sin(angle)])
    knots = np.concatenate([corners, 0.5 * random.uniform(-1, 1, (3, 2))])
    patch = Patch(knots, random.uniform(-1, 1, (len(knots), 3)), random.uniform(0.1, 10, len(knots)))
    assert_closed(thicken(tessellate(patch, 5), 0.1 if outwards else -0.1))


@pytest.mark.parametrize("thickness", [0.25, -0.25])
def test_a_cube_stays_a_cube(thickness):
    """At its edges and corners the offset is where those of the faces meet."""
    solid = thicken(tessellate(box(), 3), thickness)
    assert_closed(solid)
    inner, outer = sorted([1.0, (1 + 2 * thickness)])
    assert volume(solid) == pytest.approx(outer**3 - inner**3, rel=DIGITS)
    np.testing.assert_allclose(
        [solid.vertices.min(axis=0), solid.vertices.max(axis=0)],
        [[min(0, -thickness)] * 3, [max(1, 1 + thickness)] * 3],
        atol=DIGITS,
    )


def roof(angle: float) -> Model:
    """Two squares of side 1 that meet at an angle, turned downwards from flat by it, in radians."""
    far = np.array([math.cos(angle), 0, -math.sin(angle)])
    left = Patch(CORNERS, [[-1, 0, 0], [0, 0, 0], [-1, 1, 0], [0, 1, 0]])
    return Model((left, Patch(CORNERS, [[0, 0, 0], far, [0, 1, 0], far + np.array([0, 1, 0])])))


@pytest.mark.parametrize("angle", [1, 10, 20, 60, 90, 140, 160, 179])
def test_a_roof_is_as_thick_as_its_sides_up_to_a_bound(angle):
    a = math.radians(angle)
    for thickness in (0.1, -0.1):
        surface = tessellate(roof(a), 8)
        solid = thicken(surface, thickness)
        assert_closed(solid)
        ridge = np.flatnonzero(np.abs(surface.vertices[:, [0, 2]]).max(axis=1) < DIGITS)
        move = solid.vertices[len(surface.vertices) + ridge] - surface.vertices[ridge]
        length = np.linalg.norm(move, axis=1) / 0.1
        np.testing.assert_allclose(length, min(1 / math.cos(a / 2), MAX_MITRE), rtol=DIGITS)
        if 15 < angle < 120:
            for normal in ([0, 0, 1], [math.sin(a), 0, math.cos(a)]):
                np.testing.assert_allclose(move @ normal, thickness, rtol=1e-9)


def test_a_spike_of_three_sides_moves_up_to_the_bound():
    base = [[2 * math.cos(a), 2 * math.sin(a), 0] for a in np.radians([0, 120, 240])]
    sides = [Patch([[0, 0], [1, 0], [0, 1]], [[0, 0, 4.9], base[k - 1], base[k]]) for k in range(3)]
    surface = tessellate(Model(tuple(sides)), 2)
    for thickness in (0.1, -0.1):
        moved = thicken(surface, thickness).vertices[len(surface.vertices) + surface.vertices[:, 2].argmax()]
        np.testing.assert_allclose(moved[2] - 4.9, MAX_MITRE * thickness, rtol=1e-9)


@pytest.mark.parametrize(("angle", "n"), mostly_long([(20, 64), (60, 16), (60, 64), (100, 32)], 0))
def test_in_a_concave_edge_faces_narrower_than_the_corner_moves_are_not_turned_over(angle, n):
    """The offset of each side ends D tan(angle / 2) before the edge."""
    a, thickness = math.radians(angle), 0.1
    solid, remarks = Recipe(n, thickness=thickness, require=("solid", "unfolded")).mesh(roof(-a))
    assert remarks == []
    assert_closed(solid)
    shorter = thickness * math.tan(a / 2)
    assert volume(solid) == pytest.approx(2 * thickness * (1 - shorter / 2), rel=1e-9)
    outer = solid.vertices[len(solid.vertices) // 2 :]
    heights = np.stack([outer[:, 2], outer @ [-math.sin(a), 0, math.cos(a)]])
    np.testing.assert_allclose(heights.min(axis=0), thickness, rtol=1e-9)


def waist() -> Model:
    """A quarter of a wall with a waist, above its floor."""
    profiles, arc = ([(20, 20), (8, 14), (9, 6), (20, 0)], [(20, 0), (10, -3), (1, -4)]), np.array([0, 0.55, 1, 1])
    sides = [[[r * arc[3 - k], r * arc[k], z] for r, z in profile for k in range(4)] for profile in profiles]
    knots = [[[i, k] for i in range(len(profile)) for k in range(4)] for profile in profiles]
    return Model(tuple(Patch(*side, coefficients="binomial") for side in zip(knots, sides, strict=True)))


def tip() -> Model:
    """Three curved panels about a corner."""
    ways = [Rotation.from_euler("z", 120 * k, degrees=True).as_matrix() for k in range(3)]
    panel = np.array([[0, 0, 20], [13, 0, 12], ways[1] @ [13, 0, 12], [20, 0, 0], [8, 14, 0], ways[1] @ [20, 0, 0]])
    knots = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]
    return Model(tuple(Patch(knots, panel @ way.T, coefficients="binomial") for way in ways))


@pytest.mark.parametrize(("model", "fineness", "most"), [(waist(), 24, 1.0015), (tip(), 6, 1.03)])
def test_beside_an_inner_corner_of_curved_sides_the_wall_is_as_thick_as_elsewhere(model, fineness, most):
    dense, surface = tessellate(model, 96), tessellate(model, fineness)
    solid = thicken(surface, -4.0)
    assert len(folded_faces(solid)) == 0
    walls = NearestCells(dense.vertices[dense.cells]).nearest(solid.vertices[len(surface.vertices) :])[0] / 4
    assert 0.9995 < walls.min() < walls.max() < most


def test_patches_with_normals_nearly_in_a_plane_do_not_tear_a_vertex_away():
    """Three facets of a roof, the middle one narrow: exactly, their offsets meet far away to the side."""
    points = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, -0.1], [-0.02, -1, -0.002], [0.02, -1, -0.002], [1, 0, -0.1]])
    cells = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1]])
    tilted = np.array([math.sin(0.5), 0, math.cos(0.5)])  # which is not that of its facets
    groups = (("left", 0, 2), ("middle", 2, 3), ("right", 3, 5))
    surface = Mesh(points, cells, normals=np.array([tilted, *[[0, 0, 1.0]] * 5]), groups=groups)
    np.testing.assert_allclose(thicken(surface, 0.1).vertices[6] / 0.1, [0, 0, 1], atol=0.02)


def test_only_seams_with_mitres_all_along_divide_a_surface():
    surface = tessellate(box(), 2)
    normals = np.zeros((len(surface.cells), 3, 3))
    on_top = surface.vertices[:, 2] == 1
    for is_mitred, count in ((~on_top, 2), (on_top & False, 1), (on_top | True, 6)):
        assert len(_sheets(surface, normals, is_mitred)) == count


def test_parts_of_a_model_stay_together():
    surface = tessellate(box(), 2)
    solid = thicken(surface, 0.1)
    assert [name for name, _, _ in solid.groups] == [name for name, _, _ in surface.groups]
    open_cube = Model(box().patches[:5])
    solid = thicken(tessellate(open_cube, 2), 0.1)
    assert_closed(solid)
    sizes = [stop - start for _, start, stop in solid.groups]
    assert sum(sizes) == 2 * 5 * 8 + 2 * 8
    assert sorted(sizes) == [16, 20, 20, 20, 20]  # the rim's quadrilaterals are of the faces beside it


def test_folds_are_where_the_curvature_exceeds_the_thickness():
    sphere = tessellate(quartic_octant(), 16)
    assert len(folded_faces(thicken(sphere, -0.98))) == 0
    assert len(folded_faces(thicken(sphere, 5.0))) == 0
    # Past the centre, where areas have their sign back, too.
    for thickness in (-1.02, -3.0):
        assert len(folded_faces(thicken(sphere, thickness))) == len(sphere.cells)
    tube = tessellate(cylinder(2.0), 32)
    assert len(folded_faces(thicken(tube, -1.98))) == 0
    assert len(folded_faces(thicken(tube, -2.02))) == len(tube.cells)


@pytest.mark.parametrize("thickness", [0.1, -0.1])
def test_a_wall_is_thinner_where_normals_turn_within_a_face(thickness):
    """Three normals at 40° from their mean are shortest in the middle of the face."""
    vertices = np.array([[0.0, 0, 0], [9, 0, 0], [0, 9, 0]])
    tilt = math.radians(40)
    around = np.array([0, 2, 4]) * math.pi / 3
    normals = np.stack([*(math.sin(tilt) * f(around) for f in (np.cos, np.sin)), np.full(3, math.cos(tilt))], axis=1)
    surface = Mesh(vertices, np.array([[0, 1, 2]]), normals=normals, exact_normals=True)
    moves = thicken(surface, thickness).vertices[3:] - vertices
    moves = np.array([*moves, *((moves + np.roll(moves, 1, axis=0)) / 2), moves.mean(axis=0)]) / thickness
    share, place = thinnest_wall(thicken(surface, thickness), thickness)
    assert share == pytest.approx(np.linalg.norm(moves, axis=1).min(), rel=DIGITS)
    np.testing.assert_allclose(place, [3, 3, 0])


def test_folds_are_found_face_by_face():
    """z = x³ has its largest curvature, 1.39, at |x| = 0.387: facets there fold first, on one side each."""
    x = [[-1, -1], [-1 / 3, 1], [1 / 3, -1], [1, 1]]
    knots = [[i, j] for j in (0, 1) for i in range(4)]
    points = [[x[i][0], j, x[i][1]] for j in (0, 1) for i in range(4)]
    patch = Patch(knots, points, coefficients=[1, 3, 3, 1] * 2)
    surface = tessellate(patch, 64)
    middle = surface.vertices[surface.cells].mean(axis=1)[:, 0]
    largest = 6 * 45**-0.25 / (1 + 9 / 45) ** 1.5  # |κ| = 6x / (1 + 9x⁴)^(3/2) at x⁴ = 1/45
    for sign, side in ((1, 1), (-1, -1)):
        assert len(folded_faces(thicken(surface, sign / (largest * 0.97)))) > 0
        assert len(folded_faces(thicken(surface, sign / (largest * 1.03)))) == 0
        folded = middle[folded_faces(thicken(surface, sign / (largest * 0.97)))]
        assert (side * folded > 0.2).all()
        assert (side * folded < 0.6).all()


def test_normals_and_attributes():
    surface = tessellate(octant(), 6)
    surface = Mesh(
        surface.vertices,
        surface.cells,
        surface.parameters,
        surface.normals,
        name="shell",
        attributes={"u": surface.parameters[:, 0]},
    )
    outer = thicken(surface, 0.5)
    count = len(outer.vertices) // 2
    assert outer.name == "shell"
    # The pole, seven vertices at one place, is one vertex now.
    assert count == len(surface.vertices) - 6
    radial = outer.vertices / np.linalg.norm(outer.vertices, axis=1, keepdims=True)
    for side, sign in ((outer.cells < count, -1), (outer.cells >= count, 1)):
        faces = side.all(axis=1)
        assert faces.sum() == len(surface.cells) - 6
        corners = radial[outer.cells[faces]]
        np.testing.assert_allclose(outer.normals[outer.normal_of[faces]], sign * corners, atol=1e-6)
    # Those of the rim are across the edges of the octant, in the planes of the coordinates, and nearly its facets'.
    rim = ((outer.cells < count).any(axis=1)) & ((outer.cells >= count).any(axis=1))
    facets = unit(
        cross(*(outer.vertices[outer.cells[rim][:, k]] - outer.vertices[outer.cells[rim][:, 0]] for k in (1, 2)))
    )
    assert np.einsum("fkd,fd->fk", outer.normals[outer.normal_of[rim]], facets).min() > 0.99
    np.testing.assert_array_equal(outer.attributes["u"], np.tile(outer.parameters[:count, 0], 2))
    np.testing.assert_array_equal(outer.parameters[:count], outer.parameters[count:])
    inner = thicken(surface, -0.5)
    own = [solid.normals[solid.normal_of[(solid.cells < count).all(axis=1)]] for solid in (inner, outer)]
    np.testing.assert_allclose(own[0][:, ::-1], -own[1], atol=DIGITS)
    np.testing.assert_array_equal(inner.vertices[:count], outer.vertices[:count])


def test_what_makes_no_solid_is_refused():
    flat = square()
    torn = Mesh(flat.vertices, np.concatenate([flat.cells, flat.cells[:1, ::-1], flat.cells[:1]]), normals=flat.normals)
    turned = Mesh(flat.vertices, np.concatenate([flat.cells[:1, ::-1], flat.cells[1:]]), normals=flat.normals)
    point = Patch([[0, 0], [1, 0], [0, 1]], np.ones((3, 3)))
    origin = point.replace(control_points=np.zeros((3, 3)))
    cases = [
        (tessellate(load(Path(CURVE)), 4), 1.0, "expected a surface; a curve takes a radius instead"),
        (flat, 1e-15, "1e-15 is below the rounding of coordinates of size 2"),
        (torn, 1.0, r"the edge between vertices \d+ and \d+ has more than two faces"),
        (turned, 1.0, r"the edge between vertices \d+ and \d+ has more than two faces, or two that do not agree"),
        (tessellate(point, 3), 1.0, "'patch' is a single point"),
        (tessellate(origin, 3), 1.0, "'patch' is a single point"),
    ]
    for mesh, thickness, message in cases:
        with pytest.raises(DomainError, match=message):
            thicken(mesh, thickness)


@pytest.mark.parametrize("tolerance", mostly_long([0.01, 0.002], 0))
def test_a_sphere_of_eight_patches_is_as_thick_at_its_poles(tolerance):
    """Slivers there stand upright, alone at their vertex in some patches: walls of 0.069 and 0.088 came of it."""
    model = eightfold(octant())
    sphere = tessellate(model, tolerance=tolerance)
    outward = (sphere.normals * sphere.vertices).sum(axis=1) / np.linalg.norm(sphere.vertices, axis=1)
    assert np.abs(outward - 1).max() < 1e-9
    wall, _ = Recipe(tolerance=tolerance, thickness=-0.1).mesh(model)
    radii = np.linalg.norm(wall.vertices, axis=1)
    assert np.abs(radii[len(sphere.vertices) :] - 0.9).max() < 1e-9
    a, b, c = (wall.vertices[corner] for corner in wall.cells.T)
    upward = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1)  # some slivers are upright
    inner = np.linalg.norm(a, axis=1) < 0.95
    assert (np.where(inner, -upward, upward) > -1e-12).all()
