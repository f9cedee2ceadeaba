"""A recipe makes for Python what `gtb mesh` makes, and refuses the same."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from gtb_cli.errors import DomainError, RequirementError, ToleranceError
from gtb_cli.formats.export import encode_mesh
from gtb_cli.language.writer import dump
from gtb_cli.models.model import Model
from gtb_cli.tessellation.doubtful_corners import doubtful_corners
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.remarks import sharpest_bend
from gtb_cli.tessellation.solid_making import _smaller
from gtb_cli.theory.patch import Patch
from tests.marks import long
from tests.shell import PENTAGON, SPECS, gtb
from tests.specs import load
from tests.surfaces import box

CASES = [
    ("pentagon", Recipe(2, thickness=-0.1), ["-n", "2", "--thickness=-0.1"]),
    ("example-3.1", Recipe(8, radius=0.05), ["-n", "8", "--radius", "0.05"]),
    ("pentagon", Recipe(tolerance="5%"), ["--tolerance", "5%"]),
    (
        "pentagon",
        Recipe(4, attributes=("u", "mean_curvature")),
        ["-n", "4", "--attribute", "u", "--attribute", "mean_curvature"],
    ),
    ("box-corner", Recipe(3, normals=True), ["-n", "3", "--normals"]),
]


@pytest.mark.parametrize(("spec", "recipe", "options"), CASES)
def test_a_recipe_makes_what_the_command_makes(spec, recipe, options):
    path = SPECS / f"{spec}.toml"
    mesh, remarks = recipe.mesh(load(path))
    result = gtb("mesh", path, "-f", "ply", "--ascii", *options, status=0)
    assert b"".join(encode_mesh(mesh, "ply", ascii=True, normals=recipe.normals)) == result.out
    assert len(remarks) == result.err.count("warning")


def test_remarks_say_where_a_solid_folds():
    _, remarks = Recipe(4, thickness=5.0).mesh(load(SPECS / "pentagon.toml"))
    assert "the offset folds" in remarks[0]
    assert remarks[1].startswith("the solid passes through itself")


def test_the_sharpest_bend_of_patches_with_one_basis_is_that_of_the_one_that_bends():
    bent = load(SPECS / "bicubic.toml")
    flat = bent.replace(control_points=bent.control_points * [1, 1, 0])
    radius, place = sharpest_bend(bent, SimpleNamespace(cells=range(200), origin=None), 9.0)
    for number in (0, 2):
        patches = [flat, flat, flat]
        patches[number] = bent
        mesh = SimpleNamespace(cells=range(600), origin=SimpleNamespace(turned=np.arange(3) == number))
        found = sharpest_bend(Model(tuple(patches)), mesh, -9.0)
        np.testing.assert_allclose(found[0], radius, rtol=1e-9)
        np.testing.assert_allclose(found[1], place, rtol=1e-9)


def test_an_edge_between_two_equal_points_may_be_a_loop():
    knots, points = [[0, 0], [2, 0], [0, 1], [2, 1]], [[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 1]]
    assert len(doubtful_corners(Patch(knots, points))) == 2
    assert len(doubtful_corners(Patch(knots, [*points[:3], [0, 1e-12, 1]]))) == 1
    assert doubtful_corners(Patch([*knots, [1, 0], [1, 1]], [*points, [1, 1, 0], [1, 1, 1]])) == []


def test_a_percentage_is_of_the_size():
    patch = load(SPECS / "pentagon.toml")
    low, high = Recipe(16).mesh(patch)[0].bounds
    assert Recipe(tolerance="2%").tolerance_for(patch) == pytest.approx(0.02 * math.dist(low, high), rel=1e-12)


def test_a_solid_whose_distant_parts_meet_says_so():
    """A sheet bent to a drop, its ends 0.2 apart: half of the thickness of each side that meets the other."""
    profile = [(0, -0.1), (3, -3), (6, 0), (3, 3), (0, 0.1)]
    drop = Patch(
        [[i, j] for j in range(2) for i in range(5)],
        [[x, y, z] for y in (0, 3) for x, z in profile],
        coefficients=[1, 4, 6, 4, 1] * 2,
    )
    for thickness in (0.05, -0.2):
        assert Recipe(12, thickness=thickness).mesh(drop)[1] == []
    (remark,) = Recipe(12, thickness=0.2).mesh(drop)[1]
    assert remark.startswith("the solid passes through itself: ")
    assert "; `thickness` 0.135 was tried and is solid" in remark  # they touch from 0.1 / cos(atan(2.9/3)) on
    assert remark.endswith("is solid; on the other side `thickness` -0.2 is solid")
    with pytest.raises(RequirementError, match="not unfolded: the solid passes through itself"):
        Recipe(12, thickness=0.2, require=("unfolded",)).mesh(drop)


@long
def test_a_refused_thickness_names_one_that_is_solid(tmp_path):
    """A dome of radius about 1.25 whose offset to the inside folds, and the pentagon, whose corner bends with 0.06."""
    height = {(0, 0): 2}
    dome = Patch(
        [[i, j] for j in (-1, 0, 1) for i in (-1, 0, 1)],
        [[i, j, height.get((i, j), 0)] for j in (-1, 0, 1) for i in (-1, 0, 1)],
        coefficients=[1, 2, 1, 2, 4, 2, 1, 2, 1],
        name="dome",
    )
    spec = tmp_path / "dome.toml"
    spec.write_text(dump(dome), encoding="utf-8")
    for path, thickness in ((spec, -2), (spec, 3), (PENTAGON, 1), (PENTAGON, -1)):
        options = ("-n", 12, "--require", "solid", "-o", tmp_path / "x.stl")
        refused = gtb("mesh", path, f"--thickness={thickness}", *options, status=1)
        (named,) = re.findall(r"; --thickness (\S+) was tried and is solid[;\n]", refused.err)
        assert 0 < float(named) / thickness < 1
        assert gtb("mesh", path, f"--thickness={named}", *options).status == 0


@pytest.mark.parametrize(("y", "z"), [(0.47, -0.46), (0.5, -0.46), (0.47, -0.5), (0.5, -0.5)])
def test_no_thickness_is_named_for_a_surface_that_passes_through_itself(y, z):
    """Inside faces, along the edges of one patch, of the other, and of both."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    wall = [[u, y, z + v] for u, v in square]
    cross = Model((Patch(square, [[x, y, 0] for x, y in square], name="floor"), Patch(square, wall, name="wall")))
    with pytest.raises(RequirementError, match=r"no thickness is solid, as the surface passes through itself$"):
        Recipe(4, thickness=0.1, require="solid").mesh(cross)


def test_a_tolerance_in_toric_parameters_is_refused_with_the_way_out():
    with pytest.raises(DomainError, match=r"^parametrization: a tolerance chooses the parameters itself"):
        Recipe(tolerance="1%", parametrization="toric")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radius": 1.0, "thickness": 1.0}, "radius: excludes thickness"),
        ({"require": "closed"}, "require: expected watertight"),
        ({"resolution": 2, "require": "watertight"}, "not watertight: pentagon edge 0"),
        ({"resolution": 10, "max_faces": 499}, "makes 500 faces, more than 499"),
        *(({"tolerance": text}, "tolerance: expected a positive number or percentage")
          for text in ("1", "%", "-1%", "0%", "1_0%", "nan%", "inf%")),
    ],
)  # fmt: skip
def test_what_makes_no_sense_or_cannot_be_is_refused(options, message):
    with pytest.raises((DomainError, RequirementError, ToleranceError), match=message):
        Recipe(**options).mesh(load(SPECS / "pentagon.toml"))


@pytest.mark.parametrize(("cells", "share"), [(100, 0.95), (10_000, 0.8), (100_000, 0.5)])
def test_the_smaller_size_that_is_named_is_near_the_largest(cells, share):
    for most in (np.inf, 0.43):
        tried = list[float]()
        text = _smaller(-0.9, most, lambda size, tried=tried: tried.append(size) or size > -0.41, cells, "{:g}".format)
        assert -0.41 < tried[tried.index(float(text.removesuffix(" was tried and is solid")))] <= -0.41 * share


@pytest.mark.parametrize(
    ("low", "is_solid"),
    [((2, 2, 2.5), False), ((2.1, 2, 2.3), False), ((4, 4, 2.5), True), ((4, 4, 4), True), ((4.1, 0, 0), True)],
)
def test_boxes_that_pass_through_each_other_along_edges_are_no_solid(low, is_solid):
    """All triangles of the first pair only touch; the third and the fourth share a part of an edge, or a corner."""
    model = Model((*box((0, 0, 0), (4, 4, 4), "one"), *box(low, np.add(low, (4, 4, 6)), "two")))
    if is_solid:
        assert Recipe(4, require="solid").mesh(model)[1] == []
    else:
        with pytest.raises(RequirementError, match="passes through itself"):
            Recipe(4, require="solid").mesh(model)
