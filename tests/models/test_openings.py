"""Why models are open, a line for each reason; and seams that are welded."""

import re
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gtb_cli.bezier.elevation import elevate
from gtb_cli.errors import DomainError, RequirementError, ToleranceError
from gtb_cli.models.model import Model
from gtb_cli.models.openings import near_misses, obstacles, other_grids, seam_remarks
from gtb_cli.models.same_edges import find_joints
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.shell import SPECS
from tests.specs import load

# Knots of two patches side by side, of which one has its middle knot on the left, the other on the right
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0.5]]


def pair(weight: float = 1.0, knot: float = 0.5, shift: float = 0.0) -> Model:
    one = Patch([*SQUARE[:4], [1, 0.5]], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0.5, 0.4]], name="one")
    points = [[1 + shift, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 0.5, 0.4]]
    return Model((one, Patch([*SQUARE[:4], [0, knot]], points, [1, 1, 1, 1, weight], name="two")))


@pytest.mark.parametrize(
    ("model", "line"),
    [
        (pair(2.0), "one edge 1 is open: same ends and control points as two edge 3, but weights × coefficients 1 1 1 "
                    "against 1 2 1"),
        (pair(1.0, 0.75), "one edge 1 is open: same ends and control points as two edge 3, but knots at 0 0.5 1 "
                          "against 0 0.75 1 of the edge"),
        (pair(shift=0.015), "one edge 1 is open: 0.015 from two edge 3, `weld` 0.02 joins them, if `tolerance` "
                             "is not below it"),
        (pair(shift=1.5e-4), "one edge 1 is open: 0.00015 from two edge 3, `weld` 0.0002 joins them, if `tolerance` "
                             "is not below it"),
    ],
)  # fmt: skip
def test_a_pair_of_open_edges_has_a_line_that_says_what_differs(model, line):
    lines = obstacles(model.joints, model.patches)
    assert lines[0] == line
    assert len(lines) == 2  # and the ring around both
    assert lines[1].startswith("one edge 0 is open, in a ring with ")
    assert seam_remarks(model) == [line.replace("is open", "is not joined")]
    if weld := re.search(r"`weld` (\S+) joins", line):
        Recipe(weld=float(weld[1]), tolerance=float(weld[1]), require="one-piece").mesh(model)


def panels(axis: str, count: int, height: float = 1.0, knots: Sequence[Sequence[float]] = SQUARE[:4]) -> list[Patch]:
    """Upright panels: a sixth of a ring around the z axis, and copies of it turned about an axis."""
    points = np.array([[2, 0, 0], [1, 3**0.5, 0], [1, 3**0.5, height], [2, 0, height], [1.5, 0.5, 0.5]])[: len(knots)]
    turned = [Rotation.from_euler(axis, 60 * k, degrees=True).apply(points) for k in range(count)]
    return [Patch(knots, each, name=f"panel-{k}" if k else "panel") for k, each in enumerate(turned)]


@pytest.mark.parametrize(
    ("patches", "line"),
    [
        (panels("x", 6), "panel and 5 copies are not joined: turned about the z axis, they close a ring"),
        (panels("z", 7), "panel-6 lies where panel is: 5 copies close the ring"),
        ([*panels("z", 6), panels("z", 1, height=0)[0].replace(name="lip")], "all control points of lip are those"),
        (panels("z", 6, knots=[*SQUARE[:4], [-0.5, 0.5]]), "; with knot 4, now a corner, inside the hull"),
    ],
)
def test_mistakes_of_rings_are_named_where_mending_them_closes_the_ring(patches, line):
    assert line in " ".join(seam_remarks(Model(patches)))
    with pytest.raises((DomainError, RequirementError), match=line):
        Recipe(4, thickness=0.1, require="solid").mesh(Model(patches))
    assert seam_remarks(Model(panels("z", 6))) == []
    assert re.search(r", between panel and panel-\d$", Recipe(4, thickness=0.1).mesh(Model(panels("x", 6)))[1][-1])


def test_an_edge_whose_points_are_in_reversed_order_says_so():
    knots = [[0, 0], [3, 0], [3, 3], [0, 3]]
    one = Patch([*knots, [3, 1], [3, 2]], [[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0], [3, 1, 1], [3, 2, 0]], name="a")
    two = Patch([*knots, [0, 1], [0, 2]], [[3, 0, 0], [6, 0, 0], [6, 3, 0], [3, 3, 0], [3, 2, 0], [3, 1, 1]], name="b")
    line = obstacles(find_joints([one, two]), [one, two])[0]
    assert line == "a edge 1 is open: same ends as b edge 3, but the control points between them in reversed order"
    uneven = two.replace(control_points=two.control_points[[0, 1, 2, 3, 5, 4]], weights=[1, 1, 1, 1, 3, 1])
    heavy = one.replace(weights=[1, 1, 1, 1, 1, 3])
    line = obstacles(find_joints([heavy, uneven]), [heavy, uneven])[0]
    same = "same ends and control points as b edge 3"
    assert line == f"a edge 1 is open: {same}, but weights × coefficients in reversed order"


def test_true_openings_have_a_line_each():
    teapot = load(SPECS / "teapot.toml")
    assert obstacles(teapot.joints, teapot.patches)[4:] == ["2 more rings of edges are open"]
    assert seam_remarks(teapot) == []


def test_a_moebius_band_has_a_seam_at_which_sides_do_not_agree():
    low, high = np.array([[[0, 0, z], [1, 0, z], [0, 1, z]] for z in (0, 1)])
    rows = [(low[0], low[1], high[1], high[0]), (low[1], low[2], high[2], high[1]), (low[2], high[0], low[0], high[2])]
    band = [Patch(SQUARE[:4], row, name=name) for row, name in zip(rows, "abc", strict=True)]
    assert obstacles(find_joints(band), band)[-1] == "b edge 1 and c edge 3 cannot be given the same orientation"


def test_a_ring_of_three_edges_can_be_filled():
    corners = np.eye(3)
    sides = [Patch([[0, 0], [1, 0], [0, 1]], [corners[k - 1], corners[k], [0, 0, 0]]) for k in range(3)]
    cure = "; `fills` EDGE=g0 can close it by a lid, without =g0 smoothly"
    assert [line.endswith(cure) for line in obstacles(find_joints(sides), sides)] == [True]


# welding


def perturbed(model: Model, share: float) -> Model:
    rng = np.random.default_rng(1)
    size = np.ptp(np.concatenate([patch.control_points for patch in model]), axis=0).max()
    moved = [p.replace(control_points=p.control_points + rng.uniform(-1, 1, p.control_points.shape) * share * size)
             for p in model]  # fmt: skip
    return Model(tuple(moved), weld=4 * share * size)


@pytest.mark.parametrize("share", [1e-3, *mostly_long([1e-5, 1e-7], 0)])
@pytest.mark.parametrize("name", ["vase", "hebesphenorotunda"])
def test_a_perturbed_closed_model_closes(name, share):
    model = load(SPECS / f"{name}.toml")
    rough = perturbed(model, share)
    assert not rough.replace(weld=None).joints.closed
    assert rough.joints.closed
    mesh, fine = tessellate(rough, 4, normals=False), tessellate(model, 4, normals=False)
    assert len(mesh.open_sides) == 0
    assert mesh.vertices.shape == fine.vertices.shape
    size = np.ptp(fine.vertices, axis=0).max()
    assert np.abs(mesh.vertices - fine.vertices).max() <= 4 * share * size


def test_vertices_of_a_welded_seam_are_on_the_mean_curve():
    model = pair(shift=1e-3).replace(weld=2e-3)
    mesh = tessellate(model, 4, normals=False)
    free = tessellate(model.replace(weld=None), 4, normals=False)
    assert len(free.vertices) - len(mesh.vertices) == 5
    assert [1.0005, 0, 0] in mesh.vertices.round(12).tolist()
    with pytest.raises(ToleranceError, match=r"welding moves vertices by up to 0\.001, more than the tolerance"):
        tessellate(model, tolerance=1e-4)


def test_points_of_a_rough_pole_are_one():
    ball = load(SPECS / "teapot.toml")
    knob = Model(tuple(patch for patch in ball if patch.name and patch.name.startswith("knob")))
    rough = perturbed(knob, 1e-6)
    assert len(rough.joints.collapsed) == 4
    low = len(tessellate(knob, 4, normals=False).vertices)
    assert len(tessellate(rough, 4, normals=False).vertices) == low


def test_what_is_welded_is_said_and_far_ones_are_warned_of():
    remarks = Recipe(4, weld="1%").mesh(pair(shift=1e-3))[1]
    assert remarks == ["1 seams were welded, which were up to 0.001 apart (one edge 1 and two edge 3)"]
    assert "1 of them were farther apart than 1% of their edges" in Recipe(4, weld=0.1).mesh(pair(shift=0.05))[1]
    remarks = Recipe(4, weld=1.001).mesh(pair())[1]  # as long as the edges themselves
    assert any("edges were welded into points, up to 1 long" in remark for remark in remarks), remarks


def quarter(name: str, height: float, weights: tuple[float, float, float]) -> Patch:
    """A quarter of a cylinder that begins with that of a circle."""
    points = [(x, y, z) for z in (0, height) for x, y in ((1, 0), (1, 1), (0, 1))]
    return Patch([(i, j) for j in range(2) for i in range(3)], points, [*weights, *weights], name=name)


def test_the_same_curve_at_other_parameters_is_joined():
    """A Möbius map gives weights a factor to the power of i, which changes nothing; more knots change parameters."""
    circle, mapped = (1, 0.5**0.5, 1), (1, 2 * 0.5**0.5, 4)
    above = quarter("above", 1, circle)
    for other in (
        quarter("below", -1, mapped),
        elevate(quarter("below", -1, circle), 2),
        elevate(quarter("below", -1, mapped), 2),
    ):
        model = Model((above, other))
        assert len(model.joints.shared) == 1
        assert not near_misses(model.joints, model.patches)
    other = Model((above, quarter("below", -1, (1, 0.9, 1))))
    (reason,) = [line.format("B") for _, _, line in near_misses(other.joints, other.patches)]
    assert reason == "same ends and control points as B, but weights × coefficients 1 0.7071 1 against 1 0.9 1"
    other = Model((above, elevate(quarter("below", -1, (1, 0.72, 1)))))
    (reason,) = [line.format("B") for _, _, line in near_misses(other.joints, other.patches)]
    assert reason.startswith("same ends as B, but curves (3 control points against 4) up to 0.0")


def test_knots_far_apart_are_no_grid_of_as_many_rows():
    knots = np.indices((3, 4)).reshape(2, -1).T * 1e9
    assert other_grids(Model([Patch(knots, np.column_stack([knots, knots[:, 0]]), name="a")])) == []
