"""Certified curves: nothing of a curve is beyond the tolerance, wherever samples happen to be."""

import math

import numpy as np
import pytest

from gtb_cli.models.model import Model
from gtb_cli.tessellation.chords import ChordProofs, Intervals
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.marks import mostly_long
from tests.specs import SPECS, load

SAMPLES = 2000

SLACK = 1e-9  # part of the tolerance by which a sample may exceed it through rounding


def dense_points(curve: Patch) -> np.ndarray:
    """Points of a curve at torus coordinates of every size, and more of them where it is far between two."""
    knots, logarithms = curve.knots[:, 0] - curve.knots[:, 0].mean(), np.log(curve.weights)

    def points(s: np.ndarray) -> np.ndarray:
        e = np.outer(s, knots) + logarithms
        t = np.exp(e - e.max(axis=1, keepdims=True))
        return t @ curve.control_points / t.sum(axis=1, keepdims=True)

    far = 300 / np.diff(np.unique(knots)).min()
    s = np.geomspace(1e-3, far, SAMPLES)
    s = np.concatenate([-s[::-1], [0.0], s])
    for _ in range(3):
        steps = np.linalg.norm(np.diff(points(s), axis=0), axis=1)
        pieces = np.clip(steps / steps.sum() * SAMPLES, 1, 16).astype(int)
        parts = [np.linspace(*ends, n, False) for *ends, n in zip(s, s[1:], pieces, strict=False)]
        s = np.concatenate([*parts, s[-1:]])
    return points(s)


def farthest(curve: Patch, tolerance: float, **options) -> float:
    """Largest distance of a curve from its mesh, in units of the tolerance."""
    mesh = tessellate(curve, tolerance=tolerance, **options)
    points = dense_points(curve)
    nearest = np.full(len(points), np.inf)
    for start, end in mesh.vertices[mesh.cells]:
        chord = end - start
        along = np.clip((points - start) @ chord / max(chord @ chord, 1e-300), 0, 1)
        np.minimum(nearest, np.linalg.norm(points - start - along[:, None] * chord, axis=1), out=nearest)
    return float(nearest.max() / tolerance)


def line(seed: int) -> tuple[Patch, float]:
    """A straight line run back and forth, through up to 60 knots."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 61))
    knots, x, kind = np.sort(rng.random(n)), rng.normal(size=n), rng.random()
    weights = np.ones(n)
    if kind >= 0.3:
        weights = np.exp(5 * rng.normal(size=n)) if kind < 0.7 else 10.0 ** rng.uniform(-12, 12, n)
    part = rng.choice([3e-2, 1e-2, 1e-3])
    return Patch(knots, np.outer(x, [1, 0, 0]), weights), float(part * np.ptp(x))


@pytest.mark.parametrize("seed", mostly_long([100002, 100399, 100232, 100464, 100467]))
def test_turning_points_that_samples_pass_by_are_reached(seed):
    """With samples alone, these lines were 6.3, 2.2, 1.3, 1.3 and 1.5 tolerances too short; two with weights 1."""
    assert farthest(*line(seed)) <= 1 + SLACK


def random_curve(seed: int) -> Patch:
    rng = np.random.default_rng(seed)
    n = int(rng.choice([3, 5, 9, 20, 60]))
    knots = rng.random(n)
    if seed % 3 == 0:  # clusters
        knots = knots[rng.integers(0, n, n)] + 10.0 ** -rng.uniform(1, 8) * rng.random(n)
    points = rng.normal(size=(n, 3))
    weights = [np.ones(n), np.exp(rng.normal(size=n)), 10.0 ** rng.uniform(-12, 12, n)][seed % 4 % 3]
    return Patch(knots, points, weights)


@pytest.mark.parametrize("seed", mostly_long(range(16)))
def test_random_curves_are_within_the_tolerance(seed):
    curve = random_curve(seed)
    tolerance = (0.03, 0.002)[seed % 2] * float(np.linalg.norm(np.ptp(curve.control_points, axis=0)))
    assert farthest(curve, tolerance) <= 1 + SLACK


def test_a_straight_line_takes_one_segment():
    assert len(tessellate(Patch([0, 0.1, 0.7, 1], np.outer([0, 1, 1, 3], [1, 2, 3])), tolerance=1e-9).cells) == 1


@pytest.mark.parametrize("name", ["cubic-bezier", "example-2.1", "example-3.2"])
def test_a_certificate_takes_few_more_segments_than_the_bend(name):
    """The best polyline of equal arcs in the curvature's root is near; halves of parameters cannot do much better."""
    curve = load(SPECS / f"{name}.toml")
    assert isinstance(curve, Patch)
    points = dense_points(curve)
    tolerance = 1e-4 * float(np.linalg.norm(np.ptp(points, axis=0)))
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    steps, length = steps[length > 1e-9], length[length > 1e-9]
    unit = steps / length[:, None]
    turn = np.linalg.norm(np.diff(unit, axis=0), axis=1)
    root = np.sqrt(turn * (length[1:] + length[:-1]) / 2).sum()
    assert len(tessellate(curve, tolerance=tolerance).cells) <= 1.75 * root / math.sqrt(8 * tolerance)


def test_curves_that_close_each_other_are_certified_too():
    """A vertex between two curves is the end of one, and the beginning of the other."""
    curves = [Patch([0, 1, 2], [[0, 0], [1, y], [2, 0]]) for y in (1.0, -2.0)]
    back = curves[1].replace(control_points=curves[1].control_points[::-1])
    mesh = tessellate(Model((curves[0], back)), tolerance=1e-3)
    alone = sum(len(tessellate(curve, tolerance=1e-3).cells) for curve in curves)
    assert len(mesh.cells) == alone == len(mesh.vertices)


@pytest.mark.parametrize("options", [{"resolution": 3}, {"tolerance": 1e-3}])
def test_a_weld_moves_no_ends_of_curves(options):
    """It joins edges of surfaces. Both ends of each curve were put at one place, in the middle."""
    curves = Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]]), Patch([0, 1, 2], [[2, 0], [1, -1], [0, 1]])
    assert tessellate(Model(curves, weld=0.1), **options) == tessellate(Model(curves), **options)


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e9, 0.0), (1.0, 1e7)])
def test_scale_and_place_of_knots_and_points_do_not_count(scale, shift):
    knots, points = np.array([0, 1, 2, 4.0]), np.array([[0, 0, 0], [1, 2, 0], [2, -1, 1], [3, 0, 0.0]])
    curve = Patch(scale * knots + shift, scale * points + shift)
    same = tessellate(Patch(knots, points), tolerance=1e-3)
    assert len(tessellate(curve, tolerance=1e-3 * scale).cells) == len(same.cells)


def test_the_bound_is_not_met_by_a_chord_that_is_too_far():
    """The arc is 1/2 high: a tolerance just below fails, one just above holds."""
    arc = ChordProofs(Patch([0, 1, 2], [[0, 0], [1, 1], [2, 0]], None, [1, 2, 1]))
    ends, chords = np.array([[0, 2.0]]), np.array([[[0, 0, 0.0], [2, 0, 0.0]]])
    assert arc.failing(ends, chords, 0.499).all()
    assert arc.failing(ends, chords, 0.5).all()  # as near as that no bound is
    assert not arc.failing(ends, chords, 0.52).any()


def test_between_the_ends_of_a_part_its_bounds_hold_and_are_near():
    """Across a chord, and along it, where a curve that does not turn back needs none."""
    closest, n = np.zeros(2), 400
    for seed in range(12):
        curve, start = random_curve(seed), np.random.default_rng(seed).normal(size=n) * 8
        proofs, end = ChordProofs(curve), start + np.geomspace(1e-2, 4, n)
        _, *points, _ = proofs._seen_from(np.tile(curve.control_points[[0, -1]], (n, 1, 1)))
        first, last = (proofs._at(s, *points) for s in (start, end))
        bounds = proofs._between(Intervals(np.arange(n), start, end), first, last, points) + 1e-12
        assert seed % 4 or (bounds[1] == 1e-12).any()
        for share in np.linspace(0, 1, 17):
            at = proofs._at(start + share * (end - start), *points)
            across = np.linalg.norm(at.y - (1 - share) * first.y - share * last.y, axis=0)
            along = np.abs(at.x - np.clip(at.x, np.minimum(first.x, last.x), np.maximum(first.x, last.x)))
            closest = np.maximum(closest, ([across, along] / bounds).max(axis=1))
    assert ((closest > [0.9, 0.6]) & (closest <= 1)).all()
