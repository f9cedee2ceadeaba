"""Joints of models: whichever way edges are represented, and however many there are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import softmax

from gtb_cli.bezier.elevation import elevate
from gtb_cli.models.curve_matches import equal
from gtb_cli.models.model import Model
from gtb_cli.models.near_ends import meeting, touching
from gtb_cli.models.same_edges import find_joints
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.edges import Curve
from gtb_cli.theory.patch import Patch
from tests.specs import SPECS, load

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def squares(count: int, step: float) -> list[Patch]:
    """Unit squares in a row."""
    return [Patch(SQUARE, SQUARE + np.array([k * step, 0.0])) for k in range(count)]


def test_an_edge_is_joined_with_the_same_curve_of_a_higher_degree():
    one, other = squares(2, 1.0)
    joints = find_joints([one, elevate(other, 2)])
    assert [(j.first, j.second, j.opposite) for j in joints.shared] == [((0, 1), (1, 3), True)]
    assert not joints.almost


@pytest.mark.parametrize(("turned", "flipped"), [((1, 3), (1, 3)), ((0,), (0,)), ((0, 1, 3), (2,))])
def test_the_smaller_half_of_the_patches_is_flipped_or_the_later_one(turned, flipped):
    row = [Patch(SQUARE[:, :: -1 if k in turned else 1], p.control_points) for k, p in enumerate(squares(4, 1.0))]
    assert find_joints(row).flipped == tuple(k in flipped for k in range(4))


def curve_of(knots: np.ndarray, logs: np.ndarray, points: np.ndarray) -> Curve:
    """Knots are put on [0, 1], and both ends' weights become 1."""
    knots = (knots - knots[0]) / (knots[-1] - knots[0])
    return Curve(knots, logs - (1 - knots) * logs[0] - knots * logs[-1], points)


def random_curve(rng: np.random.Generator) -> Curve:
    """A curve of two to six knots, some of them near others, with weights of up to 1e12."""
    knots = np.sort(np.concatenate([[0, 1], rng.random(rng.integers(5))]))
    if rng.random() < 0.3 and len(knots) > 3:
        knots[2] = knots[1] + 10.0 ** rng.uniform(-8, -3)
        knots.sort()
    spread = rng.choice([0.0, 1.0, 5.0, 28.0])
    return curve_of(knots, rng.uniform(-spread, spread, len(knots)), rng.uniform(-1, 1, (len(knots), 3)))


def represented(one: Curve, rng: np.random.Generator) -> Curve:
    """The same curve, times a random function above and below, and with weights κ e^{σ a}."""
    count = rng.integers(1, 5)
    knots, logs = np.sort(rng.random(count)), rng.uniform(-2, 2, count)
    knots, rows = (one.knots[:, None] + knots).ravel(), np.repeat(np.arange(len(one.knots)), count)
    order = np.argsort(knots)
    logs = (one.log_weights[:, None] + logs).ravel()[order] + rng.uniform(-3, 3) * knots[order]
    return curve_of(knots[order], logs, one.points[rows[order]])


def torus_points(curve: Curve, s: np.ndarray) -> np.ndarray:
    """(m, 3) points at (m,) torus coordinates, from the definition."""
    return softmax(curve.log_weights[:, None] + np.outer(curve.knots, s), axis=0).T @ curve.points


@pytest.mark.parametrize("seed", range(60))
def test_equal_curves_are_proved_to_be_and_no_bump_is_missed(seed):
    """The bump is at any knot, of any size, and as narrow as the knots are near: the proof is by control points."""
    rng = np.random.default_rng(seed)
    one = random_curve(rng)
    other = represented(one, rng)
    size = 10.0 ** rng.choice([-9, 0, 9])
    one, other = (replace(curve, points=size * curve.points) for curve in (one, other))
    match = equal(one, other, 2e-9 * size)
    assert match is not None
    fractions = np.concatenate([rng.random(20), 10.0 ** -rng.uniform(1, 9, 5)])
    there = other.points_at(match.carried(one, other, fractions))
    assert np.abs(there - one.points_at(fractions)).max() <= 2e-9 * size
    points = other.points.copy()
    points[rng.integers(len(points))] += size * 10.0 ** rng.uniform(-11, -1) * rng.normal(size=3)
    bent = replace(other, points=points)
    found = equal(one, bent, 2e-9 * size)
    if found is not None and found.torus is not None:
        s = np.concatenate([np.linspace(-100, 100, 4001), 1e3 * rng.normal(size=1000), 1e8 * rng.normal(size=1000)])
        apart = torus_points(one, s) - torus_points(bent, found.torus[0] * s + found.torus[1])
        assert np.linalg.norm(apart, axis=1).max() <= 2e-9 * size
        assert found.distance >= np.linalg.norm(apart, axis=1).max() * (1 - 1e-6)


@pytest.mark.parametrize("height", [1e-2, 1e-3, 1e-4, 1e-7, 2e-9])
def test_a_bump_between_two_samples_is_no_joint(height):
    """A straight edge and one with a bump between the fractions 0 and 1/64 passed for one curve."""
    one, other = squares(2, 1.0)
    places = np.array([0.00078125, 0.0078125, 0.01484375])
    points = np.column_stack([np.ones(3), places, np.array([0, height, 0])])
    weights = [1, 1, 1, 1, 106.34, 1.538e14, 1.8496e20]
    bent = Patch([*SQUARE, *np.column_stack([0 * places, places])], [*other.control_points, *points], weights)
    joints = find_joints([one, bent])
    assert not joints.shared
    assert joints.almost[0][2] == pytest.approx(height, rel=0.01)
    assert find_joints([one, bent], weld=1.01 * height).shared[0].distance == joints.almost[0][2]


def test_near_knots_at_an_end_are_no_copies():
    """A curve that starts with a spike of both sides of the corner passed for one that starts there."""
    one, other = squares(2, 1.0)
    points = other.control_points.copy()
    points[0] = (1, 0, 1)
    spike = Patch([*SQUARE, (0, 5e-10)], [*points, (1, 0, -1)])
    assert not find_joints([one, spike]).shared


def test_edges_become_one_only_if_each_two_are_near():
    """Eight edges, each 0.09 from the next, became one, and moved by 0.315."""
    ways = [(np.cos(k), np.sin(k), 0.0) for k in range(8)]
    fan = [Patch(SQUARE, np.outer(SQUARE[:, 1], (0, 0, 1)) + np.outer(SQUARE[:, 0], way)) for way in ways]
    lifts = np.outer(0.09 * np.arange(8), (0, 0, 1))
    fan = [patch.replace(control_points=patch.control_points + lift) for patch, lift in zip(fan, lifts, strict=True)]
    joints = find_joints(fan, weld=0.1)
    assert {joint.second[0] - joint.first[0] for joint in joints.shared} == {1}
    assert not joints.crowded
    joints = find_joints(fan, weld=0.2)
    assert max(joint.distance for joint in joints.shared) == pytest.approx(0.18)
    moved = tessellate(Model(tuple(fan), weld=0.2), 1).vertices
    corners = np.concatenate([patch.control_points for patch in fan])
    assert np.linalg.norm(corners[:, None] - moved, axis=2).min(axis=1).max() <= 0.2


def test_each_edge_is_almost_the_same_as_those_nearest_to_it():
    """All pairs of forty squares, each turned by a hundredth of a degree, were reported, and compared."""
    turns = np.radians(0.01 * np.arange(40))
    row = [Patch(SQUARE, np.column_stack([SQUARE @ [[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]])) for a in turns]
    almost = find_joints(row).almost
    following = {(a, b, i) for (i, a), (j, b), _ in almost if j == i + 1 and a == b}
    assert following == {(k, k, i) for k in range(4) for i in range(39)}
    assert len(almost) < 200


@pytest.mark.parametrize("height", [0.0, 0.001])
def test_a_straight_edge_is_joined_with_one_of_more_knots_unless_their_points_are_beside_it(height):
    one, other = squares(2, 1.0)
    joints = find_joints([one, Patch([*SQUARE, (0, 0.3)], [*other.control_points, (1, 0.3, height)], [1, 1, 1, 1, 5])])
    assert (len(joints.shared), len(joints.almost)) == ((0, 1) if height else (1, 0))


def test_three_representations_of_one_edge_are_crowded():
    across = np.array([(1.0, 0, 0), (-1.0, 0, 0), (0, 0, 1.0)])
    fan = [Patch(SQUARE, np.outer(SQUARE[:, 1], (0, 1, 0)) + np.outer(SQUARE[:, 0], way)) for way in across]
    joints = find_joints([fan[0], elevate(fan[1]), elevate(fan[2], 2)])
    assert joints.crowded == (((0, 3), (1, 3), (2, 3)),)
    assert not any(joint.opposite for joint in joints.shared)


@pytest.mark.parametrize("name", ["box-corner", "rounded-cube", "hebesphenorotunda"])
def test_models_with_patches_elevated_by_different_numbers_have_the_same_joints(name):
    patches = load(SPECS / f"{name}.toml")
    before = find_joints(patches)
    after = find_joints([elevate(patch, k % 3) for k, patch in enumerate(patches)])
    assert (after.open, after.almost) == (before.open, ())
    assert len(after.shared) == len(before.shared)
    assert any(joint.match for joint in after.shared)


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
    near = [pair for pair in pairs if same[pair] <= min(reach[list(pair)])]
    rows, gaps = touching(curves, reach)
    assert [(*pair, gap) for pair, gap in zip(rows.tolist(), gaps, strict=True)] == [(*p, same[p]) for p in near]
    near = [np.abs(ends[i][:, None] - ends[j]).max(axis=2).min() <= 0.01 for i, j in pairs]
    met = [(i, j) for i, others in enumerate(meeting(curves, 0.01)) for j in others]
    assert [(i, j) for i, j in met if i < j] == [pair for pair, is_near in zip(pairs, near, strict=True) if is_near]
    assert sorted((j, i) for i, j in met) == met


def test_knots_are_compared_more_closely_where_weights_vary():
    """Three weights balance at a parameter of -300, at which a knot that is off by 1e-9 turns the curve by 3e-7."""
    weights = np.exp([0, 100, 200, 0, 0, 0])
    points = np.array([[0, 0, 0], [1, 1, 0], [0, 1, 0.5], [1, 0, 0], [0, 0, 1], [1, 0, 1]], dtype=float)
    beside = points * [1, 1, -1] + [0, 0, 1] * (points[:, 2:] == 0.5)
    for off, count in ((0, 1), (1e-12, 1), (0.95e-9, 0)):
        knots = [[[0, 0], [1 / 3, 0], [2 / 3 + shift, 0], [1, 0], [0, 1], [1, 1]] for shift in (0, off)]
        one, other = Patch(knots[0], points, weights), Patch(knots[1], beside, weights)
        assert len(find_joints([one, other]).shared) == count
