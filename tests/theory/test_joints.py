"""Joints of models: whichever way edges are represented, and however many there are."""

from __future__ import annotations

import numpy as np
import pytest

from gtb_cli.assembly.openings import meeting
from gtb_cli.bezier.elevation import elevate
from gtb_cli.knots.domain import Domain
from gtb_cli.theory import joints as room
from gtb_cli.theory.edges import Curve
from gtb_cli.theory.joints import find_joints
from gtb_cli.theory.patch import Patch
from tests.specs import SPECS, load

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def squares(count: int, step: float) -> list[Patch]:
    """Unit squares in a row."""
    return [Patch(SQUARE, SQUARE + np.array([k * step, 0.0])) for k in range(count)]


def test_an_edge_is_joined_with_the_same_curve_of_a_higher_degree():
    one, other = squares(2, 1.0)
    joints = find_joints([one, elevate(other, 2)])
    ((first, second, opposite),) = [(j.first, j.second, j.opposite) for j in joints.shared]
    assert (first, second, opposite) == ((0, 1), (1, 3), True)
    assert not joints.almost


def test_a_straight_edge_is_joined_with_one_of_more_knots():
    one, other = squares(2, 1.0)
    refined = Patch([*SQUARE, (0, 0.3)], [*other.control_points, (1.0, 0.3, 0.0)], [1, 1, 1, 1, 5])
    assert len(find_joints([one, refined]).shared) == 1


def test_a_straight_edge_with_its_point_beside_it_is_only_almost_the_same():
    one, other = squares(2, 1.0)
    bent = Patch([*SQUARE, (0, 0.3)], [*other.control_points, (1.0, 0.3, 0.001)], [1, 1, 1, 1, 5])
    joints = find_joints([one, bent])
    assert not joints.shared
    assert len(joints.almost) == 1


def test_three_representations_of_one_edge_are_crowded():
    across = np.array([(1.0, 0, 0), (-1.0, 0, 0), (0, 0, 1.0)])
    fan = [Patch(SQUARE, np.outer(SQUARE[:, 1], (0, 1, 0)) + np.outer(SQUARE[:, 0], way)) for way in across]
    joints = find_joints([fan[0], elevate(fan[1]), elevate(fan[2], 2)])
    assert joints.crowded == (((0, 3), (1, 3), (2, 3)),)
    assert not any(joint.opposite for joint in joints.shared)


@pytest.mark.parametrize("name", ["box-corner", "teapot"])
def test_elevated_models_have_the_same_joints(name):
    patches = load(SPECS / f"{name}.toml")
    before = find_joints(patches)
    after = find_joints([elevate(patch) for patch in patches])
    assert (after.shared, after.open, after.almost) == (before.shared, before.open, ())


@pytest.mark.parametrize("name", ["box-corner", "rounded-cube", "hebesphenorotunda"])
def test_models_with_patches_elevated_by_different_numbers_have_the_same_joints(name):
    patches = load(SPECS / f"{name}.toml")
    before = find_joints(patches)
    after = find_joints([elevate(patch, k % 3) for k, patch in enumerate(patches)])
    assert (after.open, after.almost) == (before.open, ())
    assert len(after.shared) == len(before.shared)
    assert any(joint.places for joint in after.shared)


@pytest.mark.parametrize("shift", [1e5, 1e7, 1e8])
def test_edges_far_away_are_joined_although_their_points_are_rounded(shift):
    model = load(SPECS / "box-corner.toml")
    joints = find_joints([patch.replace(control_points=patch.control_points + shift) for patch in model])
    assert (len(joints.shared), len(joints.open), joints.almost) == (12, 6, ())


def test_far_edges_of_small_patches_in_a_long_row_are_not_almost_the_same():
    assert not find_joints(squares(300, 1.5)).almost


def test_edges_are_evaluated_for_those_with_near_ends_only(monkeypatch):
    counted = []
    points_at = Curve.points_at
    monkeypatch.setattr(Curve, "points_at", lambda *args: counted.append(args) or points_at(*args))
    patches = [*squares(60, 1.0), Patch(SQUARE, SQUARE + np.array([0.0, 1.001]))]
    assert len(find_joints(patches).almost) == 1
    assert len({id(curve) for curve, _ in counted}) == 2


def random_curves(rng: np.random.Generator, count: int) -> list[Curve]:
    """Segments between a few places, some of them moved by less than a hundredth."""
    places = rng.random((count, 3))
    ends = places[rng.integers(count, size=(count, 2))] + rng.choice([0.0, 0.004, 0.05], size=(count, 2, 3))
    return [Curve(np.array([0.0, 1.0]), np.zeros(2), pair) for pair in ends]


@pytest.mark.parametrize("seed", range(5))
def test_curves_that_touch_and_meet_are_those_that_all_pairs_show(seed):
    rng = np.random.default_rng(seed)
    curves, reach = random_curves(rng, 40), 10 ** rng.uniform(-3, -1, 40)
    ends = np.array([curve.ends for curve in curves])
    pairs = [(i, j) for i in range(40) for j in range(i + 1, 40)]
    same = {(i, j): min(np.abs(ends[i] - way).max() for way in (ends[j], ends[j, ::-1])) for i, j in pairs}
    assert room.touching(curves, reach) == [pair for pair in pairs if same[pair] <= min(reach[list(pair)])]
    near = [np.abs(ends[i][:, None] - ends[j]).max(axis=2).min() <= 0.01 for i, j in pairs]
    met = [(i, j) for i, others in enumerate(meeting(curves, 0.01)) for j in others]
    assert [(i, j) for i, j in met if i < j] == [pair for pair, is_near in zip(pairs, near, strict=True) if is_near]
    assert sorted((j, i) for i, j in met) == met


def test_patches_with_one_basis_share_their_edges_knots(monkeypatch):
    made = []
    edge_knots = Domain.edge_knots
    monkeypatch.setattr(Domain, "edge_knots", lambda *args: made.append(args) or edge_knots(*args))
    first = Patch(SQUARE, SQUARE)
    row = [first.replace(control_points=first.control_points + np.array([k, 0.0, 0.0])) for k in range(20)]
    assert len(find_joints(row).shared) == 19
    assert len(made) == 4
