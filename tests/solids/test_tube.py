"""Tubes and tangents: closed, round, without twist, and of the right volume."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import cell_distances
from gtb_cli.models.model import Model
from gtb_cli.solids.tube import RING_SIDES, folded_segments, ring_size, tube
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.normals import tangents
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.marks import mostly_long
from tests.shell import PENTAGON
from tests.specs import GOOD_SPECS, SPECS, is_curve, load
from tests.surfaces import area, assert_closed, volume

DIGITS = 1e-12  # a few thousand roundings

CURVES = [path for path in GOOD_SPECS if is_curve(load(path))]


def polygon_area(radius: float, sides: int = RING_SIDES) -> float:
    return sides / 2 * math.sin(2 * math.pi / sides) * radius**2


def segments(*points: list[float]) -> Model:
    """A curve of straight pieces."""
    return Model(tuple(Patch([0, 1], ends) for ends in pairwise(points)))


def polyline(points: np.ndarray, closed: bool = False) -> Mesh:
    steps = np.arange(len(points) - (not closed))
    return Mesh(points, np.column_stack([steps, (steps + 1) % len(points)]))


def helix(n: int, turns: float = 1.5, pitch: float = 0.3) -> tuple[Mesh, np.ndarray, np.ndarray]:
    """A polyline on a helix of radius 1, its unit tangents at the vertices, and the angles."""
    angle = np.linspace(0, 2 * np.pi * turns, n + 1)
    points = np.column_stack([np.cos(angle), np.sin(angle), pitch * angle])
    t = np.column_stack([-np.sin(angle), np.cos(angle), np.full_like(angle, pitch)]) / math.hypot(1, pitch)
    return polyline(points), t, angle


def knot(n: int) -> tuple[Mesh, np.ndarray]:
    """A trefoil: a closed curve whose frame does not meet itself."""
    t = 2 * np.pi * np.arange(n) / n
    points = np.column_stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    d = np.column_stack([np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3 * np.cos(3 * t)])
    return polyline(points, closed=True), d / np.linalg.norm(d, axis=1, keepdims=True)


def circle() -> Patch:
    """The whole unit circle as one rational quintic: both ends at (1, 0)."""
    points = [[1, 0], [1, 4], [-3, 2], [-3, -2], [1, -4], [1, 0]]
    return Patch(np.arange(6), points, [1, 0.2, 0.2, 0.2, 0.2, 1], [1, 5, 10, 10, 5, 1])


def swept(patch: Patch, n: int, radius: float, parametrization: str = "linear", **options) -> Mesh:
    mesh = tessellate(patch, n, parametrization=parametrization)
    return tube(mesh, radius, tangents=tangents(patch, mesh.parameters, parametrization)[mesh.cells], **options)


@pytest.mark.parametrize("path", CURVES, ids=lambda path: path.stem)
def test_tangents_are_those_of_difference_quotients(path):
    patch = load(path)
    low, high = patch.domain.vertices[:, 0]
    for t in (0.1, 0.37, 0.9):
        u = low + t * (high - low)
        derivative = exact.derivative(patch, [u])[:, 0]
        # Difference quotients with a step of 1e-15 of the domain in 50 digits.
        np.testing.assert_allclose(tangents(patch, [u])[0], derivative / np.linalg.norm(derivative), atol=1e-13)
        for scale, shift in ((1e-9, 0), (1e9, 0), (1, 1e7)):  # shifted, knots and points keep 8 or 9 digits
            knots, points = scale * patch.knots + shift, scale * patch.control_points + shift
            moved = Patch(knots, points, log_weights=patch.log_products)
            there = tangents(moved, [scale * u + shift], "linear")
            np.testing.assert_allclose(there, tangents(patch, [u], "linear"), atol=1e-6)


def test_tangents_at_ends_with_repeated_knots_and_points():
    """Also of knots that are equal within rounding: 0.1 + 0.2 is not 0.3."""
    points = [[0, 0, 0], [0, 0, 0], [0, 0, 2], [4, 0, 2], [1, 1, 1]]
    patch = Patch([0, 1, 2, 2, 3], points, [1, 1, 1, 3, 1])
    # From the knot at 0, and its copy at 1, to the mean (3, 0, 2) of both at 2; from there to the last.
    expected = np.array([[3, 0, 2], [1 - 3, 1, 1 - 2]])
    expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(tangents(patch, [0, 3]), expected, atol=DIGITS)
    points = [[0, 0, 0], [0, 1, 0], [2, 1, 0], [3, 0, 1]]
    copies, nearly = (Patch([0.3, end, 1, 2], points) for end in (0.3, 0.1 + 0.2))
    t = 0.3 + 10.0 ** -np.arange(2, 15)
    np.testing.assert_allclose(tangents(nearly, t, "linear"), tangents(copies, t, "linear"), atol=1e-6)


def test_there_is_no_tangent_where_the_derivative_vanishes():
    there_and_back = Patch([0, 1, 2], [[0, 0, 0], [1, 2, 3], [0, 0, 0]])
    t = tangents(there_and_back, [0, 0.5, 1, 1.5, 2])
    assert np.isnan(t[2]).all()
    np.testing.assert_allclose(t[[0, 1, 3, 4]], np.outer([1, 1, -1, -1], [1, 2, 3]) / 14**0.5, atol=DIGITS)
    assert np.isnan(tangents(Patch([0, 1], [[1, 1, 1], [1, 1, 1]]), [0, 0.5, 1])).all()


@pytest.mark.parametrize("path", CURVES, ids=lambda path: path.stem)
@pytest.mark.parametrize("parametrization", ["toric", "linear"])
def test_the_tube_of_every_curve_is_closed(path, parametrization):
    for n in (1, 2, 33):
        mesh = swept(load(path), n, 0.05, parametrization)
        assert_closed(mesh)
        assert volume(mesh) > 0
        assert len(mesh.vertices) - len(mesh.cells) / 2 == 2  # a ball, by Euler


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
def test_a_straight_tube_is_a_prism(scale, shift):
    start, end = scale * np.array([0, 1, 2.0]) + shift, scale * np.array([3, -1, 2.5]) + shift
    mesh = swept(Patch([0, 1, 3], [start, (start + end) / 2, end]), 5, 0.2 * scale, sides=7)
    assert_closed(mesh)
    assert len(mesh.vertices) == 6 * 7 + 2
    assert len(mesh.cells) == 2 * 7 * 5 + 2 * 7
    # 1e7 has 9 digits after the point.
    expected = polygon_area(0.2 * scale, 7) * np.linalg.norm(end - start)
    assert volume(mesh) == pytest.approx(expected, rel=1e-7 if shift else DIGITS)
    axis = (end - start) / np.linalg.norm(end - start)
    normals = mesh.normals[: len(mesh.vertices)]
    np.testing.assert_allclose(normals[-2:], [-axis, axis], atol=1e-8 if shift else DIGITS)
    caps = mesh.normals[mesh.normal_of[-14:]].reshape(2, 21, 3)
    np.testing.assert_allclose(caps - np.array([-axis, axis])[:, None], 0, atol=1e-8 if shift else DIGITS)
    rings = mesh.vertices[:-2] - start
    radial = rings - np.outer(rings @ axis, axis)
    np.testing.assert_allclose(radial / (0.2 * scale), normals[:-2], atol=1e-7 if shift else DIGITS)


def test_vertices_are_on_the_pipe_around_the_curve():
    line, t, _ = helix(50)
    mesh = tube(line, 0.2, sides=9, tangents=t[line.cells])
    offset = (mesh.vertices[:-2].reshape(-1, 9, 3) - line.vertices[:, None]) / 0.2
    np.testing.assert_allclose(np.linalg.norm(offset, axis=2), 1, atol=DIGITS)
    np.testing.assert_allclose(np.einsum("ijk,ik->ij", offset, t), 0, atol=DIGITS)
    np.testing.assert_allclose(mesh.normals[: 51 * 9].reshape(-1, 9, 3), offset, atol=DIGITS)
    assert_closed(mesh)


@pytest.mark.parametrize("given", [True, False])
def test_the_volume_of_a_helix_converges(given):
    """To the area of the polygon times the length, as by Pappus and Guldin; with an error of second order."""
    errors = []
    for n in (40, 80, 160):
        line, t, angle = helix(n)
        mesh = tube(line, 0.2, tangents=t[line.cells] if given else None)
        errors.append(abs(volume(mesh) - polygon_area(0.2) * math.hypot(1, 0.3) * angle[-1]))
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 1.9).all()
    assert errors[-1] < 1e-3 * polygon_area(0.2) * angle[-1]


def test_a_closed_curve_makes_a_torus():
    """One patch whose ends meet: no caps, and the volume of Pappus."""
    np.testing.assert_allclose(np.linalg.norm(circle().evaluate(np.linspace(0, 5, 50)), axis=1), 1, atol=DIGITS)
    errors = []
    for n in (32, 64):
        mesh = swept(circle(), n, 0.3, sides=16)
        assert_closed(mesh)
        assert len(mesh.vertices) == 16 * n
        assert len(mesh.vertices) - len(mesh.cells) / 2 == 0  # a torus, by Euler
        errors.append(abs(volume(mesh) - 2 * math.pi * polygon_area(0.3, 16)))
    assert math.log2(errors[0] / errors[1]) > 1.9
    assert errors[1] < 0.01 * 2 * math.pi * polygon_area(0.3)


def test_the_frame_does_not_rotate():
    """On a helix the angle to the principal normal is −τ s; double reflection misses it by an error of fourth order."""
    errors = []
    for n in (32, 64, 128):
        line, t, angle = helix(n)
        mesh = tube(line, 0.1, tangents=t[line.cells])
        start = (mesh.vertices[:-2].reshape(-1, RING_SIDES, 3)[:, 0] - line.vertices) / 0.1
        normal = np.column_stack([-np.cos(angle), -np.sin(angle), np.zeros_like(angle)])
        phase = np.unwrap(
            np.arctan2(np.einsum("ij,ij->i", start, np.cross(t, normal)), np.einsum("ij,ij->i", start, normal))
        )
        torsion, length = 0.3 / (1 + 0.3**2), math.hypot(1, 0.3) * angle
        errors.append(np.abs(phase - phase[0] + torsion * length).max())
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.8).all()
    assert errors[-1] < 1e-5


@pytest.mark.parametrize("sides", [3, 5, 24])
def test_a_closed_tube_closes_without_a_seam(sides):
    line, t = knot(200)
    mesh = tube(line, 0.2, sides=sides, tangents=t[line.cells])
    assert_closed(mesh)
    assert len(mesh.vertices) == 200 * sides
    rings = (mesh.vertices.reshape(-1, sides, 3) - line.vertices[:, None]) / 0.2
    # The edges along the tube, wherever the last ring is joined to the first.
    along = np.stack([mesh.cells[1::2, 0], mesh.cells[1::2, 2]], axis=1)
    start, end = (rings.reshape(-1, 3)[column] for column in along.T)
    before, after = (t[column // sides] for column in along.T)
    # Turned back by the least rotation, only the twist is left: the same at every segment, by its length.
    axis = before + after
    back = end - (np.einsum("ij,ij->i", end, axis) / (1 + np.einsum("ij,ij->i", before, after)))[:, None] * axis
    back += 2 * np.einsum("ij,ij->i", end, after)[:, None] * before
    twist = np.arctan2(np.einsum("ij,ij->i", np.cross(start, back), before), np.einsum("ij,ij->i", start, back))
    lengths = np.linalg.norm(np.roll(line.vertices, -1, axis=0) - line.vertices, axis=1)
    rate = twist.reshape(200, sides) / lengths[:, None]
    # The whole miss is at most half a side.
    assert np.abs(rate).max() * lengths.sum() <= 1.05 * math.pi / sides
    np.testing.assert_allclose(rate, rate.mean(), atol=0.02 * math.pi / sides / lengths.sum() + 1e-4)


def test_a_right_angle_is_mitred():
    line = tessellate(segments([0, 0, 0], [4, 0, 0], [4, 3, 0]), 2)
    mesh = tube(line, 0.5, sides=8)
    assert_closed(mesh)
    assert volume(mesh) == pytest.approx(polygon_area(0.5, 8) * 7, rel=DIGITS)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [4.5, 3, 0.5], atol=DIGITS)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [0, -0.5, -0.5], atol=DIGITS)
    corner = mesh.vertices[np.linalg.norm(mesh.vertices - [4, 0, 0], axis=1) < 0.8]
    assert len(corner) == 8
    np.testing.assert_allclose(corner @ [1, 1, 0], 4, atol=DIGITS)  # in the plane half-way


def test_a_closed_polygon_has_mitres_all_around():
    square = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [0, 0, 0]]
    mesh = tube(tessellate(segments(*square), 1), 0.5)
    assert_closed(mesh)
    assert len(mesh.vertices) == 4 * RING_SIDES
    assert volume(mesh) == pytest.approx(polygon_area(0.5) * 16, rel=DIGITS)
    # Out of the plane, too, where the frame misses itself.
    bent = [[0, 0, 0], [4, 0, 1], [4, 4, 0], [0, 4, 2], [0, 0, 0]]
    mesh = tube(tessellate(segments(*bent), 3), 0.4)
    assert_closed(mesh)
    length = sum(math.dist(a, b) for a, b in pairwise(bent))
    # The twist that closes it takes a little away.
    assert volume(mesh) == pytest.approx(polygon_area(0.4) * length, rel=1e-3)


@pytest.mark.parametrize("turn", [100, 135, 170, 179.9999, 180])
@pytest.mark.parametrize("sides", [4, 7, 24])
def test_sharp_turns_are_bounded(turn, sides):
    """The joint stays within √2 radii, and both tubes are whole."""
    a = math.radians(turn)
    line = tessellate(segments([-5, 0, 0], [0, 0, 0], [5 * math.cos(a), 5 * math.sin(a), 0]), 1)
    mesh = tube(line, 0.5, sides=sides)
    assert_closed(mesh)
    joint = mesh.vertices[np.abs(np.linalg.norm(mesh.vertices, axis=1) - 5) > 1]
    assert (np.linalg.norm(joint, axis=1) <= 0.5 * math.sqrt(2) * (1 + DIGITS)).all()
    assert volume(mesh) > 0.99 * polygon_area(0.5, sides) * 10
    assert area(mesh) < 1.2 * 10 * 2 * math.pi * 0.5
    corners = mesh.vertices[mesh.cells]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.min() > 1e-4 if turn < 175 else areas.min() > 0


def test_cusps_and_ends_that_face_each_other():
    """A tangent turns by 180° between two vertices, or at one; the way from end to start is across both directions."""
    assert_closed(tube(polyline(np.array([[0, 0, 0], [0, 2, 0], [1, -2, 0], [1, 0, 0.0]])), 0.1))
    cusp = Patch(np.arange(4), [[0, 0, 0], [2, 1, 0], [0, 1, 0], [2, 0, 0]], coefficients=[1, 3, 3, 1])
    for n in (7, 8, 64):
        mesh = swept(cusp, n, 0.05, "toric")
        assert_closed(mesh)
        assert volume(mesh) > 0
        assert np.abs(mesh.vertices[:, 2]).max() <= 0.05 * math.sqrt(2)


def test_curves_that_follow_each_other_make_one_tube():
    """Whichever way each of them runs."""
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 1, 0], [2, 2, 1.0]])
    pieces = [Patch([0, 1], points[pair]) for pair in ([0, 1], [2, 1], [2, 3])]
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        mesh = tube(tessellate(Model(tuple(pieces[k] for k in order)), 4), 0.2)
        assert_closed(mesh)
        assert mesh.groups == ()
        # Mitred joints keep the volume, the more so as no cap is inside.
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        assert volume(mesh) == pytest.approx(polygon_area(0.2) * length, rel=1e-3)


def test_segments_may_run_backwards_and_keep_name_and_attributes():
    line, t, angle = helix(20)
    given = t[line.cells]
    cells, turned = line.cells.copy(), given.copy()
    cells[5:12] = cells[5:12, ::-1]
    turned[5:12] = -turned[5:12, ::-1]
    order = np.random.default_rng(0).permutation(20)
    order = order[np.argsort(order != 0, kind="stable")]  # the first one says where the tube begins
    named = Mesh(line.vertices, cells[order], name="spring", attributes={"u": angle})
    mesh = tube(named, 0.1, sides=4, tangents=turned[order])
    np.testing.assert_array_equal(mesh.vertices, tube(line, 0.1, sides=4, tangents=given).vertices)
    assert mesh.name == "spring"
    np.testing.assert_array_equal(mesh.attributes["u"], [*angle.repeat(4), angle[0], angle[-1]])


def test_branches_and_separate_curves_make_a_tube_each():
    center = [0.0, 0, 0]
    arms = [Patch([0, 1], [center, tip], name=name) for name, tip in zip("abc", np.eye(3), strict=True)]
    away = Patch([0, 1], [[5, 5, 5], [6, 6, 6]], name="d")
    mesh = tube(tessellate(Model((*arms, away)), 3), 0.1)
    assert_closed(mesh)
    assert [name for name, _, _ in mesh.groups] == list("abcd")
    assert volume(mesh) == pytest.approx(polygon_area(0.1) * (3 + math.sqrt(3)), rel=1e-9)


def test_rings_are_as_fine_as_the_tolerance_asks():
    assert ring_size(1.0) == RING_SIDES
    for radius in (1e-9, 1.0, 1e9):
        for n in range(3, 200):
            exactly = radius * 2 * math.sin(math.pi / n / 2) ** 2
            assert ring_size(radius, exactly * (1 + 1e-9)) == n
            assert ring_size(radius, exactly * (1 - 1e-9)) == n + 1
    assert ring_size(1.0, 10.0) == 3
    assert ring_size(1.0, 1e-12) == math.ceil(math.pi / math.sqrt(2e-12))
    line = polyline(np.linspace([0, 0, 0], [3, 4, 5], 11))
    assert len(tube(line, 0.5, tolerance=0.01).vertices) == 11 * ring_size(0.5, 0.01) + 2


def pipe(patch: Patch, radius: float, n: int, sides: int) -> np.ndarray:
    """Points of the surface at a distance of the curve, from the formula."""
    u = np.linspace(*patch.domain.vertices[:, 0], n)
    center, t = patch.evaluate(u), tangents(patch, u)
    first = np.cross(t, [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    angle = np.linspace(0, 2 * np.pi, sides)
    around = np.cos(angle)[:, None, None] * first + np.sin(angle)[:, None, None] * np.cross(t, first)
    return (center + radius * around).reshape(-1, 3)


TUBES = [("example-3.1", 0.2, 0.03), ("cubic-bezier", 0.01, 0.1)]
TUBES += [("cubic-bezier", 0.3, 0.01), ("example-2.1", 0.05, 0.01)]


@pytest.mark.parametrize(("name", "radius", "tolerance"), mostly_long(TUBES, 2))
def test_the_tolerance_is_that_of_the_tube(name, radius, tolerance):
    patch = load(SPECS / f"{name}.toml")
    mesh = Recipe(tolerance=tolerance, radius=radius).mesh(patch)[0]
    points = pipe(patch, radius, 61, 11)
    distance = np.full(len(points), np.inf)
    for a, b, c in mesh.vertices[mesh.cells]:
        distance = np.minimum(distance, cell_distances(points, *(np.broadcast_to(x, points.shape) for x in (a, b, c))))
    assert distance.max() <= tolerance
    assert distance.max() > tolerance / 10 or radius < tolerance


@pytest.mark.parametrize(
    ("axis", "weights"),
    [
        ([[0, 0, 0], [0.3, 0.6, 0.3], [1, 0, 1]], [1, 1e-6, 1]),
        ([[0, 0, 0], [0, 1, 0], [1, 1, 0]], [1, 1e12, 1]),
        ([[0, 0, 0], [1, 0, 0], [0.1, 0.3, 0]], [1, 1e12, 1]),
    ],
    ids=["a hook within the tolerance at an end", "a corner", "a hairpin"],
)
def test_a_tube_is_neither_thin_nor_thick_at_hooks(axis, weights):
    radius, tolerance = 0.05, 0.05 / 40
    mesh = Recipe(tolerance=tolerance, radius=radius).mesh(Patch([0, 1, 2], axis, weights))[0]
    assert_closed(mesh)
    faces = mesh.vertices[mesh.cells[: -2 * ring_size(radius, tolerance / 3)]]
    points = np.concatenate([faces.mean(axis=1), faces[:, [0, 1]].mean(axis=1), faces[:, 0]])
    # The curve is nearly its control polygon, or its chord; the nearest one of many points of it will do.
    legs = np.array(axis, dtype=float)[:: 2 if weights[1] < 1 else 1]
    line = np.concatenate([np.linspace(start, end, 4000) for start, end in pairwise(legs)])
    distance, _ = cKDTree(line).query(points)
    assert distance.max() <= radius + tolerance
    # In a hairpin, rings of one leg end inside the other one.
    assert distance.min() >= radius - tolerance or legs[-1, 0] == 0.1


def test_folds_are_where_the_bend_is_too_sharp():
    unit = polyline(np.column_stack([np.cos(a := np.arange(40) * 2 * np.pi / 40), np.sin(a), 0 * a]), closed=True)
    assert len(folded_segments(unit, 0.99)) == 0
    assert len(folded_segments(unit, 1.01)) == 40
    hook = polyline(np.array([[0, 0, 0], [5, 0, 0], [5.1, 0.1, 0], [5.1, 5, 0], [5.1, 9, 0.0]]))
    np.testing.assert_array_equal(folded_segments(hook, 0.5), [1])
    np.testing.assert_array_equal(folded_segments(hook, 0.01), [])
    patch = load(SPECS / "example-3.1.toml")
    line = tessellate(patch, 64, parametrization="linear")
    given = tangents(patch, line.parameters, "linear")[line.cells]
    assert 0 < len(folded_segments(line, 1.0, tangents=given)) < 64
    assert len(folded_segments(line, 0.1, tangents=given)) == 0


def test_vertices_that_coincide_do_no_harm():
    line = polyline(np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [1 + 1e-15, 0, 0], [2, 0, 0], [2, 0, 0.0]]))
    mesh = tube(line, 0.1)
    assert_closed(mesh)
    assert volume(mesh) == pytest.approx(2 * polygon_area(0.1), rel=DIGITS)
    numbered = Mesh(line.vertices, line.cells, attributes={"u": np.arange(6.0)})
    np.testing.assert_array_equal(tube(numbered, 0.1).attributes["u"][[0, -2, -1]], [0, 0, 5])
    heavy = Patch(np.arange(4), [[0, 0], [1, 3], [2, -3], [3, 0]], [1, 1e-9, 1e9, 1])
    for n in (5, 300):  # nearly all vertices are at one control point
        assert_closed(swept(heavy, n, 0.1, "toric"))


def test_what_makes_no_tube_is_refused():
    line, _, _ = helix(4)
    cases = [
        (tessellate(load(PENTAGON), 2), 1.0, "expected a curve"),
        (Mesh(line.vertices + 1e12, line.cells), 1e-3, "below the rounding of coordinates of size 1e\\+12"),
        (polyline(np.ones((4, 3))), 0.1, r"is a single point at \(1, 1, 1\)"),
    ]
    for mesh, radius, message in cases:
        with pytest.raises(DomainError, match=message):
            tube(mesh, radius)
    with pytest.raises(ToleranceError, match="would have 14000 faces, 1000 around and 7 along, more than 7999"):
        tube(line, 1.0, sides=1000, max_faces=7999)
