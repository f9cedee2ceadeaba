"""`distance`: of surfaces that are known to be the same, or so far apart, and beside dense samples."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gtb_cli import DomainError, Model, Patch, diff, distance, elevate, load, tessellate, write_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.verdicts.verdict import Verdict
from tests.marks import long, mostly_long
from tests.patches import NAMES, bumps, named, pentagon
from tests.shell import SPECS
from tests.surfaces import diagonal, octant

THREE_DIGITS = 5e-4
SAMPLED = 1e-3
"""Error of a distance between samples 1 % of the size apart: they are off the surface by its curvature only."""


@pytest.mark.parametrize("name", mostly_long(NAMES, 3))
def test_a_patch_is_where_its_other_descriptions_are(name):
    """Raised in degree, with weights that are e^<a, s> times the others, and in any order of the knots."""
    whole = named(name)
    patch = whole.part(np.arange(min(len(whole.knots), 16)))
    tilted = patch.log_weights + (patch.knots - patch.domain.center) @ np.ones(patch.dimension) / patch.domain.size
    same = [(patch, patch.replace(log_weights=tilted)), (patch, patch.part(np.arange(len(patch.knots))[::-1]))]
    few = patch.part(np.arange(min(len(patch.knots), 6)))  # when they are raised, they are many more
    same += [(few, elevate(few))] * bool(np.ptp(few.log_weights) < 700)  # steeper ones take as many seconds each
    for one, other in same:
        found = distance(one, other)
        assert found.distance <= found.error
        assert not found.is_proved


@pytest.mark.parametrize("scale", mostly_long([1e-9, 1e9, 1.0]))
def test_the_distance_of_a_flat_patch_from_a_copy_above_it(scale):
    patch = pentagon()
    flat = patch.replace(control_points=scale * (patch.control_points * [1, 1, 0] + [3, 5, 7]))
    found = distance(flat, flat.replace(control_points=flat.control_points + np.array([0, 0, 0.3 * scale])))
    for way in (found.forward, found.backward, found):
        assert way.distance == pytest.approx(0.3 * scale, rel=THREE_DIGITS)
    assert float(found) == found.distance
    assert found.error <= 2 * THREE_DIGITS * found.distance
    assert found.forward.at[2] == pytest.approx(7 * scale)


@long
def test_the_distance_of_two_spheres():
    assert distance(octant(), octant(1.2)).distance == pytest.approx(0.2, rel=THREE_DIGITS)


def test_the_error_of_a_mesh_beside_its_patch_is_a_thousandth_of_its_size_and_what_is_not_proved():
    found = distance(tessellate(pentagon(), 3), pentagon())
    assert found.error < 2e-3 * diagonal(pentagon())


def random_patch(seed: int, sides: int) -> Patch:
    rng = np.random.default_rng(seed)
    angles = 2 * math.pi * np.arange(sides) / sides
    knots = np.concatenate([np.column_stack([np.cos(angles), np.sin(angles)]), rng.uniform(-0.4, 0.4, (4, 2))])
    return Patch(knots, bumps(knots) + 0.3 * rng.normal(size=(len(knots), 3)), np.exp(rng.normal(size=len(knots))))


@pytest.mark.parametrize("seed", mostly_long(range(6), 0))
def test_two_surfaces_beside_their_samples(seed):
    a, b = random_patch(seed, 3 + seed % 4), random_patch(100 + seed, 4 + seed % 3)
    found = distance(a, b)
    size = np.linalg.norm(np.ptp(a.control_points, axis=0))
    here, back = (tessellate(each, 100, normals=False).vertices for each in (a, b))
    for way, points, others in ((found.forward, here, back), (found.backward, back, here)):
        there = cKDTree(others)
        assert way.distance == pytest.approx(there.query(points)[0].max(), abs=SAMPLED * size)
        assert there.query(way.at)[0] == pytest.approx(way.distance, abs=SAMPLED * size)


@pytest.mark.parametrize("count", mostly_long([8, 12], 0))
def test_weights_far_apart_do_not_keep_a_nearest_point_from_being_reached(count):
    """With weights from 1e-12 to 1e12, surfaces end in thin layers along edges, many steps away."""
    patch = named("sixty_knots").part(np.arange(count))
    found = diff(patch, elevate(patch), kind="surface")
    assert found.same
    assert found.bound <= found.tolerance


@long
def test_far_from_the_origin_the_same_surface_is_still_the_same():
    patch = pentagon()
    far = patch.replace(control_points=patch.control_points + 1e7)
    found = diff(far, elevate(far), kind="surface")
    assert found.same
    assert found.bound <= 5 * found.tolerance
    assert not diff(far, far.replace(control_points=far.control_points + np.array([0, 0, 1e-6])), kind="surface").same


@long
def test_a_surface_beside_itself_needs_no_search(monkeypatch):
    monkeypatch.setattr("gtb_cli.distances.strata.Strata.derivatives", None)
    assert distance(*[load(SPECS / "box-corner.toml")] * 2).distance == 0


def test_models_and_curves():
    box = Model(load(SPECS / "box-corner.toml").patches[1:4])
    parts = Model(tuple(elevate(patch) for patch in box.patches))
    found = distance(box, parts)
    assert found.distance <= found.error
    curve = load(SPECS / "example-3.1.toml")
    assert distance(curve, elevate(curve)).distance <= 1e-12
    ends = distance(curve, curve.replace(control_points=curve.control_points * [1, 0, 0]))
    assert ends.distance == pytest.approx(tessellate(curve, 4000).bounds[1, 1], rel=THREE_DIGITS)


@long
def test_meshes_files_and_patches(tmp_path):
    patch = pentagon()
    mesh = tessellate(patch, 12)
    write_mesh(mesh, tmp_path / "mesh.obj")
    exact = distance(patch, patch)
    assert (exact.distance, exact.is_proved) == (0, False)
    proved = distance(mesh, tessellate(patch, 13))
    assert proved.is_proved
    assert proved.error <= THREE_DIGITS * 2 * proved.distance
    assert distance(tmp_path / "mesh.obj", mesh).distance < 1e-8
    fine = distance(tessellate(patch, 100), mesh).distance
    mixed = distance(mesh, patch)
    assert abs(mixed.distance - fine) <= mixed.error
    assert not mixed.is_proved
    with pytest.raises(DomainError, match="expected a Patch"):
        distance(3, mesh)


def test_the_same_surface_within_a_loose_bound_is_not_called_so_without_it():
    found = diff(pentagon(), pentagon(), kind="surface")
    assert not found.limits
    loose = replace(found, bound=0.0101, is_searched=True)
    assert loose.limits == ("nothing farther apart than 0 was found, but it is not proved: it could be 0.0101",)
    text = Verdict("", ("a.toml", "b.toml"), "same", loose).text
    assert "surfaces 0 apart where they were looked at, themselves (by a search, not proved: at most 0.0101)" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "misspelt"}, "kind: expected auto or vertices or surface, got 'misspelt'"),
        ({"ignore": ["orientation", "x"]}, "ignore: expected orientation or connectivity or attributes, got 'x'"),
        *(({"tolerance": value}, "tolerance: expected a number from 0, or a percentage")
          for value in ("1e-6", "nan%", "1_0%", -1, math.inf, [1])),
    ],
)  # fmt: skip
def test_what_diff_does_not_understand_it_refuses(options, message):
    with pytest.raises(DomainError, match=message):
        diff(pentagon(), pentagon(), **options)


def test_one_aspect_may_be_ignored_by_its_name():
    mesh = tessellate(pentagon(), 2)
    turned = Mesh(mesh.vertices, mesh.cells[:, ::-1])
    assert not diff(mesh, turned).same
    assert diff(mesh, turned, ignore="orientation").same


def test_what_diff_compares():
    patch = load(SPECS / "bezier-triangle.toml")
    raised = elevate(patch)
    found = diff(patch, raised)
    assert (found.same, found.method, found.is_proved, found.distance) == (True, "patches", True, found.bound)
    assert found.bound < 1e-13
    assert diff(patch, raised, kind="vertices").distance == pytest.approx(0.0747, abs=1e-4)
    assert not diff(patch, load(SPECS / "example-3.1.toml"), "1000%", kind="surface").same
    meshes = tessellate(patch, 3), tessellate(patch, 3)
    assert [diff(*meshes, kind=kind).method for kind in ("auto", "vertices", "surface")] == [
        *("vertices", "vertices", "surface")
    ]
    with pytest.raises(DomainError, match="different faces"):
        diff(meshes[0], tessellate(patch, 4), kind="vertices")
