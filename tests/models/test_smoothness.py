"""Seams of models, and what may be required: angles, creases, folds, open edges."""

import itertools
import math
import re

import numpy as np
import pytest
import trimesh

from gtb_cli.errors import DomainError, RequirementError
from gtb_cli.formats.export import held
from gtb_cli.language.writer import dump
from gtb_cli.models.model import Model
from gtb_cli.models.smoothness import bends
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import requirements
from tests.shell import PENTAGON, SPECS, gtb
from tests.specs import load

CUBE = SPECS / "rounded-cube.toml"


def sheet(points, name: str) -> Patch:
    """A Bézier patch of degree 2 × 1 along y, from rows of three points."""
    knots = np.array([[i, j] for j in range(2) for i in range(3)], dtype=float)
    return Patch(knots, np.array(points, dtype=float), coefficients="binomial", name=name)


def roof(degrees: float) -> Model:
    """Two parabolic sheets that meet along the y axis at an angle."""
    slope = math.tan(math.radians(degrees))
    left = sheet([[-1, y, 0] if i == 0 else [(i - 2) / 2, y, 0] for y in (0, 1) for i in range(3)], "left")
    right = sheet([[i / 2, y, i / 2 * slope] for y in (0, 1) for i in range(3)], "right")
    return Model((left, right), "roof")


@pytest.mark.parametrize("degrees", [0.0, 1e-7, 0.5, 30.0, 89.0])
def test_the_angle_of_a_roof(degrees):
    (seam,) = roof(degrees).seams
    assert seam.angle == pytest.approx(degrees, rel=1e-8, abs=1e-12)
    assert abs(seam.place[0]) < 1e-12
    assert seam.name(roof(degrees)) == "left edge 1 and right edge 3"


def test_the_difference_of_curvatures_of_two_parabolas():
    """z = x² beside z = −3 x²: 2 + 6 = 8 at x = 0."""
    left = sheet([[x, y, z] for y in (0, 1) for x, z in ((-1, 1), (-0.5, 0), (0, 0))], "left")
    right = sheet([[x, y, z] for y in (0, 1) for x, z in ((0, 0), (0.5, 0), (1, -3))], "right")
    for other in (right, right.replace(knots=right.knots[:, ::-1], coefficients=right.coefficients)):
        (seam,) = Model((left, other)).seams
        assert seam.angle < 1e-12
        assert seam.bend == pytest.approx(8, rel=1e-12)


def test_the_largest_difference_of_curvatures_does_not_depend_on_how_many_places_are_measured(monkeypatch):
    """Towards corners of a fill curvature grows without bounds: 22 became 57 with twice as many places.

    The nearest place of both is 2.1 or 2.3 % away from the corner.
    """
    model = load(SPECS / "box-corner.toml")
    few = max(bends(model.seams))[0]
    monkeypatch.setattr("gtb_cli.models.smoothness.SEAM_PLACES", 98)
    assert few == pytest.approx(max(bends(model.replace().seams))[0], rel=0.1)


def test_curves_have_no_seams():
    assert Model((load(SPECS / "cubic-bezier.toml"),)).seams == ()


def test_the_rounded_cube_is_closed_and_smooth(tmp_path):
    model = load(CUBE)
    assert model.joints.closed
    assert max(seam.angle for seam in model.seams) < 1e-6
    everything = ["watertight", "smooth:0.001deg", "unfolded"]
    options = [part for word in everything for part in ("--require", word)]
    assert gtb("mesh", CUBE, "-n", "4", *options, "-o", tmp_path / "cube.stl").status == 0
    vertices = Recipe(6).mesh(model)[0].vertices
    # Distance from the inner cube: 1 but for the corners, which are nearly spheres.
    distance = np.linalg.norm(np.maximum(np.abs(vertices) - 2, 0), axis=1)
    assert np.abs(distance - 1).max() < 0.02


@pytest.mark.parametrize("fineness", [{"resolution": 1}, {"tolerance": 100.0}])
def test_a_fold_between_the_vertices_of_a_coarse_mesh_is_found(fineness):
    """Two triangles do not fold, and the patch, whose middle control point is far outside, does."""
    knots = [(x, y) for x in range(3) for y in range(3)]
    points = [(x, y) if (x, y) != (1, 1) else (9, 1) for x, y in knots]
    with pytest.raises(RequirementError, match="not unfolded: patch turns back on itself"):
        Recipe(**fineness, require="unfolded").mesh(Patch(knots, points))


def test_a_square_with_two_knots_swapped_is_no_solid():
    """Its two halves look up and down, and meet in a point."""
    bow = Patch([[0, 0], [0, 1], [1, 0], [1, 1]], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh, _ = Recipe(thickness=2).mesh(bow)
    number = np.unique(mesh.vertices, axis=0, return_inverse=True)[1].reshape(-1)[mesh.faces]  # one for each place
    collapsed = sum(len(set(row)) < 3 for row in number.tolist())
    assert 60 < collapsed < 80  # the last digits of a processor decide
    with pytest.raises(RequirementError, match=f"not watertight: faces collapse, {collapsed} of 4352 faces"):
        Recipe(thickness=2, require="watertight").mesh(bow)


def test_parts_that_look_into_a_solid_fail_it():
    inner = [patch.replace(control_points=patch.control_points / 2, name=f"inner {patch.name}") for patch in load(CUBE)]
    with pytest.raises(RequirementError, match="not solid: faces look into the solid, 176 of 352 faces"):
        Recipe(2, require="solid").mesh(Model((*load(CUBE), *inner)))


def test_faces_that_collapse_in_a_file_are_not_watertight_and_others_may_meet_there():
    """As trimesh says of the vertices that an STL file holds."""
    flat = Patch([[0, 0], [4, 0], [4, 4], [0, 4]], np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]) + 1e7)
    beside = Model((flat, flat.replace(control_points=flat.control_points + np.array([4.2, 0, 0]), name="beside")))
    for spec, made, fault in (
        (flat, {"resolution": 8, "thickness": 4}, "faces collapse, "),
        (beside, {"resolution": 1, "thickness": 4}, r"\d+ sides of faces fall upon others"),
    ):
        mesh = Recipe(**made, require="watertight").mesh(spec)[0]
        stored = held(mesh, "stl")[0]
        assert [trimesh.Trimesh(each.vertices, each.cells).is_watertight for each in (mesh, stored)] == [True, False]
        with pytest.raises(RequirementError, match=f"not watertight: {fault}.*: the numbers of STL"):
            Recipe(**made, require="watertight").mesh(spec, held=lambda mesh: held(mesh, "stl"))


@pytest.mark.parametrize(
    ("far", "thickness", "suffix", "is_closed"),
    [(1e7, 0.2, "stl", False), (1e7, 0.2, "obj", True), (1e5, 3, "stl", True), (0, 1e-10, "obj", False)],
)
def test_a_line_that_says_closed_speaks_of_the_numbers_in_the_file(tmp_path, far, thickness, suffix, is_closed):
    points = np.array([[0, 0, 0], [4, 0, 1], [4, 4, 0], [0, 4, 1]]) + far
    spec, out = tmp_path / "far.toml", tmp_path / f"x.{suffix}"
    spec.write_text(dump(Patch([[0, 0], [4, 0], [4, 4], [0, 4]], points)), encoding="utf-8")
    line = gtb("mesh", spec, "--thickness", thickness, "-n", 4, "-o", out).err.splitlines()[-1]
    assert (", closed, " in line) == is_closed
    file = trimesh.load(out, force="mesh")
    assert file.is_watertight == is_closed
    assert not is_closed or float(re.search(r"volume (\S+),", line)[1]) == pytest.approx(file.volume, rel=1e-3)


def test_a_tube_whose_faces_collapse_in_a_file_is_not_called_closed(tmp_path):
    curve, out = tmp_path / "far.toml", tmp_path / "x.stl"
    curve.write_text(dump(Patch([0, 1], [[1e5, 1e5, 1e5], [1e5 + 1, 1e5, 1e5]])), encoding="utf-8")
    for radius, is_closed in ((0.004, False), (1, True)):
        line = gtb("mesh", curve, "--radius", radius, "-n", 4, "-o", out).err.splitlines()[-1]
        assert (", closed, " in line) == trimesh.load(out, force="mesh").is_watertight == is_closed


@pytest.mark.parametrize("word", ["smooth", "smooth:", "smooth:x", "smooth:-1", "smooth:nan", "smooth:1_0", "tight"])
def test_requirements_that_are_none(word):
    with pytest.raises(DomainError, match="require: expected"):
        requirements([word])
    assert gtb("mesh", PENTAGON, "--require", word).status == 2
    with pytest.raises(DomainError, match="require: expected"):
        Recipe(require=(word,))


def test_requirements_in_python():
    assert requirements(["watertight", "smooth:0.5deg"]) == {"watertight": 0.0, "smooth": 0.5}
    with pytest.raises(RequirementError, match="not smooth"):
        Recipe(2, require="smooth:1deg").mesh(roof(3.0))


def test_sides_that_are_measured_together_are_as_those_measured_alone():
    """Patches of one basis are measured at once; some here have no normal on an edge, or are flipped."""
    random = np.random.default_rng(3)
    rows = random.normal(size=(8, 2, 3)) + [3, 0, 0] * np.arange(8)[:, None, None]
    rows[2, 0] = rows[2, 1]
    patches = []
    for k, (first, second) in enumerate(itertools.pairwise(rows)):
        net = [row for y in (0, 1) for row in (first[y], (first[y] + second[y]) / 2 + [0, 0, k], second[y])]
        patch = sheet(net, "")
        patches.append(patch if k % 3 else patch.replace(control_points=patch.control_points[::-1]))
    together = Model(tuple(patches)).seams
    assert len(together) == 5
    for k, seam in enumerate(together):
        index = sorted((seam.first[0], seam.second[0]))
        (alone,) = Model(tuple(patches[i] for i in index)).seams
        np.testing.assert_equal([seam.angle, bends(together)[k][0]], [alone.angle, alone.bend])
