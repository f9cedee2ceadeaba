"""Uniform meshes of patches and models, and what holds them together."""

import math
from functools import partial

import numpy as np
import pytest

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.shading import filled_normals
from gtb_cli.models.model import Model
from gtb_cli.models.same_edges import find_joints
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.tessellation.complexes import joined_complex
from gtb_cli.tessellation.edge_splitting import Subdivision
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import long, mostly_long
from tests.patches import bicubic, collapsed_edge, pentagon
from tests.surfaces import HALF, assert_closed, eightfold, octant as sphere_octant, quartic_octant, volume

TRIANGLE = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [0, 2]]
SQUARE = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2], [2, 2]]


def octant() -> Patch:
    """A rational quadratic triangle whose edges are quarter circles."""
    a, b, c = np.eye(3)
    return Patch(TRIANGLE, [a, a + b, b, a + c, b + c, c], [1, HALF, 1, HALF, HALF, 1], [1, 2, 1, 2, 2, 1])


ball, globe = partial(eightfold, octant(), "ball"), partial(eightfold, sphere_octant(), "globe")


def assert_sphere(mesh) -> None:
    assert_closed(mesh)
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.faces) == 2
    assert volume(mesh) > 0


FINE = [{"resolution": 5, "parametrization": "toric"}, {"resolution": 7}, {"tolerance": 0.03}, {"tolerance": 0.005}]


@pytest.mark.parametrize("make", [ball, globe], ids=["ball", "globe"])
@pytest.mark.parametrize("options", [{"resolution": 2}, {"tolerance": 0.2}, *mostly_long(FINE)], ids=str)
def test_a_closed_model_is_watertight_and_looks_outwards(make, options):
    mesh = tessellate(make(), **options)
    assert_sphere(mesh)
    outward = np.einsum("ij,ij->i", mesh.split.normals, mesh.split.vertices)
    assert outward.min() > 0.5


@pytest.mark.parametrize("make", [sphere_octant, quartic_octant])
def test_a_globe_is_a_sphere_to_rounding_and_its_volume_converges(make):
    errors = []
    for resolution in (8, 16, 32):
        mesh = tessellate(eightfold(make()), resolution)
        assert_closed(mesh)
        assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 4e-16 * 4
        errors.append(4 / 3 * np.pi - volume(mesh))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx([2, 2], abs=0.05)


@long
def test_tolerance_on_the_globe_is_the_distance_from_the_sphere():
    for tolerance in (0.1, 0.01, 0.001):
        mesh = tessellate(globe(), tolerance=tolerance)
        rng = np.random.default_rng(3)
        weights = rng.dirichlet(np.ones(3), (len(mesh.faces), 20))
        points = np.einsum("kwc,kcd->kwd", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
        assert (1 - np.linalg.norm(points, axis=1)).max() <= tolerance


def test_halves_of_a_collapsed_edge_are_collapsed():
    """The pole became several vertices, cells came twice, and the whole refinement was done again, more finely."""
    shape = globe()
    start = joined_complex(shape.patches, shape.joints, 2)
    mesh = Subdivision(start, Sampler(shape.patches))
    pole = mesh.edges.middles.argmax(axis=0)[1:]
    assert mesh.edges.face[pole].all()
    marked = np.isin(np.arange(len(mesh.edges.ends)), pole)
    mesh.edges.middle[pole] = mesh.points[mesh.edges.ends[pole, 0]]
    mesh.split(pole, np.flatnonzero(mesh.has_mark(marked)))
    assert mesh.result().is_whole
    assert len(mesh.result().without_collapsed[0]) == len(start.without_collapsed[0])


def test_order_direction_and_orientation_of_patches_do_not_matter():
    rng = np.random.default_rng(5)
    straight = tessellate(ball(), 6)
    patches = list(ball().patches)
    for index in (1, 4, 6):
        patch = patches[index]
        # Mirrored knots turn the patch over; any affine map of the knots leaves the surface.
        mirrored = patch.knots @ np.array([[-1.5, 0.25], [0, 0.75]]) + np.array([3.0, -1.0])
        patches[index] = Patch(mirrored, patch.control_points, patch.weights, patch.coefficients)
    turned = tessellate(Model(tuple(patches[i] for i in rng.permutation(8))), 6)
    assert_sphere(turned)
    assert volume(turned) == pytest.approx(volume(straight), rel=1e-12)
    one, two = (np.unique(np.round(mesh.vertices, 9) + 0.0, axis=0) for mesh in (straight, turned))
    assert np.abs(one - two).max() < 2e-9


def test_a_moebius_band_is_reported_as_one_sided():
    """Three square patches in a ring, the last joined with a twist."""
    rails = []
    for turn in np.arange(4) * np.pi / 3:
        out = np.array([math.cos(2 * turn), math.sin(2 * turn), 0])
        across = (math.cos(turn) * out + math.sin(turn) * np.array([0, 0, 1])) / 2
        rails.append((2 * out - across, 2 * out + across))
    corners = [(*rails[i], *rails[i + 1]) for i in range(3)]
    joints = find_joints([Patch([[0, 0], [0, 1], [1, 0], [1, 1]], points) for points in corners])
    assert len(joints.shared) == 3
    assert len(joints.one_sided) == 1
    assert not joints.closed


def test_a_curve_model_joins_at_its_ends():
    patches = tuple(Patch([0, 1, 2], [[i, 0], [i + 0.5, 1], [i + 1, 0]]) for i in range(3))
    mesh = tessellate(Model(patches), 4)
    assert len(mesh.vertices) == 13
    assert [group[1:] for group in mesh.groups] == [(0, 4), (4, 8), (8, 12)]


@pytest.mark.parametrize("shape", [octant(), ball()], ids=["patch", "model"])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resolution": 0}, "resolution: expected a whole number of at least 1, got 0"),
        ({"resolution": 2, "parametrization": "polar"}, "parametrization: expected toric or linear, got 'polar'"),
        ({"resolution": 10**7}, "makes [18]00000000000000 faces, more than 5000000"),
        ({"resolution": 10**7, "max_faces": 10**18}, "makes [18]00000000000000 faces and needs about .* GB of memory"),
        ({"tolerance": 0.1, "parametrization": "toric"}, "parametrization: a tolerance chooses the parameters itself"),
        *(({"tolerance": wrong}, "tolerance: must be positive") for wrong in (0.0, -1.0, math.nan, math.inf)),
    ],
)
def test_numbers_that_make_no_sense_are_refused(shape, options, message):
    with pytest.raises((DomainError, ToleranceError), match=message):
        tessellate(shape, **options)


@pytest.mark.parametrize("resolution", [1, 2, 3])
def test_the_last_patch_may_lose_all_its_faces(resolution):
    knots = [(0, 0), (1, 0), (0, 1)]
    point = (0.0, 0.0, 0.0)
    corners = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    sides = [Patch(knots, [point, corners[k], corners[k - 2]]) for k in (0, 1)]
    mesh = tessellate(Model((*sides, Patch(knots, [point] * 3))), resolution)
    assert [stop - start for _, start, stop in mesh.groups] == [resolution**2, resolution**2, 0]


@pytest.mark.parametrize(("slope", "count"), [(1e-5, 8), (1e-9, 6)])
def test_normals_that_files_can_tell_apart_are_not_one(slope, count):
    sides = [
        Patch([[0, 0], [1, 0], [0, 1], [1, 1]], [[k + x, y, slope * k * x] for y in (0, 1) for x in (0, 1)])
        for k in (0, 1)
    ]
    mesh = tessellate(Model(tuple(sides)), 1)
    assert len(np.unique(mesh.normal_of)) == count


def test_missing_normals_are_the_mean_of_adjacent_faces():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, -1, 0], [5, 5, 5.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    normals = np.array([[np.nan] * 3, [0, 0, 1], [0, 1, 0], [1, 0, 0], [np.nan] * 3])
    filled = filled_normals(normals, vertices, faces)
    assert filled[0].tolist() == [0, 0, 1]
    assert filled[1:4].tolist() == normals[1:4].tolist()
    assert np.isfinite(filled).all()


@pytest.mark.parametrize("patch", [bicubic(), pentagon(), collapsed_edge()], ids=lambda patch: patch.name)
def test_normals_of_fine_meshes_are_those_of_the_patch(patch):
    """They come from interpolated places, as the points do."""
    mesh = tessellate(patch, 72)
    assert np.nanmax(np.abs(mesh.normals - patch.normals(mesh.parameters, "linear"))) < 1e-11


def test_patches_with_one_basis_are_located_together(monkeypatch):
    """A row of 20 is located by one call for all points inside, and one for each edge and corner."""
    located = []
    inverse = MomentMap.inverse
    monkeypatch.setattr(MomentMap, "inverse", lambda *args: located.append(args) or inverse(*args))
    first = Patch(SQUARE, [[x, y, x * y] for x, y in SQUARE], [1, 2, 1, 1, 3, 1, 1, 2, 1])
    step = np.array([2.0, 0.0, 0.0])
    row = Model(tuple(first.replace(control_points=first.control_points + k * step) for k in range(20)))
    mesh = tessellate(row, 6)
    assert len(located) <= 4 + 8  # edges, and charts inside, of all patches
    alone = tessellate(first, 6).vertices
    ours = mesh.vertices[np.unique(mesh.faces[mesh.groups[7][1] : mesh.groups[7][2]])] - 7 * step
    assert np.abs(ours[:, None] - alone).max(axis=2).min(axis=1).max() < 1e-12


@pytest.mark.parametrize("options", [{"resolution": 6}, {"tolerance": 0.02}])
def test_patches_with_equal_knots_are_sampled_with_their_own_weights(options):
    """All points of the row are those of its patches, which are solved together."""
    first = Patch(SQUARE, [[x, y, x * y] for x, y in SQUARE], [1, 2, 1, 1, 3, 1, 1, 2, 1])
    weights = np.where((np.array(SQUARE) == 1).all(axis=1), np.array([[1.0], [3.0], [40.0]]), first.weights)
    row = Model(tuple(first.replace(weights=w, control_points=np.add(first.control_points, [2.0 * k, 0, 0]))
                      for k, w in enumerate(weights)))  # fmt: skip
    mesh = tessellate(row, **options)
    for index, patch in enumerate(row.patches):
        own = mesh.origin.patch == index
        there = patch.evaluate(mesh.parameters[own], "linear")
        assert np.abs(there - mesh.vertices[own]).max() < 1e-12


@long
def test_a_domain_of_many_sides_is_located_in_few_charts():
    """With a chart for each of 1,000 edges, 16,000 faces took a minute."""
    angles = 2 * np.pi * np.arange(400) / 400
    knots = np.column_stack([np.cos(angles), np.sin(angles)])
    patch = Patch(knots, np.column_stack([knots, np.sin(3 * angles)]))
    assert len(tessellate(patch, 4, normals=False).cells) == 6400
    assert sum("moments" in vars(system) for system in patch.rational_basis.linear._systems) <= 4
