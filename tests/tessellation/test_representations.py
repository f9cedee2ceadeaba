"""Models whose shared edges are one curve with different knots, weights and parameters on each side."""

from math import comb

import numpy as np
import pytest

from gtb_cli.bezier.elevation import elevate
from gtb_cli.checks.joint_checks import joint_findings
from gtb_cli.models.curve_matches import equal, matched
from gtb_cli.models.model import Model
from gtb_cli.models.openings import seam_remarks
from gtb_cli.models.same_edges import find_joints
from gtb_cli.tessellation.complexes import Complex, coarse_complexes, joined_complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.edges import Curve, edge_curve, edge_points_at
from gtb_cli.theory.patch import Patch
from tests.marks import long

ROUNDING = 1e-13  # distance, as a fraction of the size, of points from two representations of one curve
ARC = np.array([(1.0, 0, 0), (1.0, 1, 0), (0.0, 1, 0)])
UP = np.array([0.0, 0.0, 1.0])


def curve(points: np.ndarray, weights: np.ndarray) -> Patch:
    """A rational Bézier curve."""
    degree = len(points) - 1
    return Patch(np.arange(degree + 1), points, np.asarray(weights) * [comb(degree, i) for i in range(degree + 1)])


def refined(model: Model, sampler: Sampler, tolerance: float) -> tuple[Complex, np.ndarray]:
    return refine(next(coarse_complexes(model.patches, model.joints)), sampler, tolerance, 10**5)


def represented(one: Patch, factor: float, by: int, elevated_first: bool = False, reverse: bool = False) -> Patch:
    """The same curve after a Möbius map of its parameter and elevations."""
    if elevated_first:
        one, by = elevate(one, by), 0
    weights = np.exp(one.log_products) * factor ** np.arange(len(one.knots))
    other = elevate(Patch(np.arange(len(one.knots)), one.control_points, weights), by)
    if not reverse:
        return other
    return Patch(other.knots, other.control_points[::-1], np.exp(other.log_products)[::-1])


def loft(one: Patch, *offsets: np.ndarray, scale: float = 1.0, shift: float = 0.0, name: str | None = None) -> Patch:
    """A patch of the curve and of copies that are moved, with straight edges between if these are in a row."""
    rows = [one.control_points + offset for offset in offsets]
    knots = [(i, j) for j in range(len(rows)) for i in range(len(one.knots))]
    weights = [np.exp(one.log_products) * comb(len(rows) - 1, j) for j in range(len(rows))]
    return Patch(knots, np.concatenate(rows) * scale + shift, np.concatenate(weights), name=name)


def loft_of_knots(one: Patch) -> Patch:
    """A patch whose edge 0 is a curve with any knots."""
    knots = [(t, j) for j in range(2) for t in one.knots[:, 0]]
    points = np.concatenate([one.control_points, one.control_points + UP])
    return Patch(knots, points, np.tile(np.exp(one.log_products), 2))


def body(seed: int, factor: float = 3.0, by: int = 2, elevated_first: bool = False, reverse: bool = False,
         scale: float = 1.0, shift: float = 0.0) -> Model:  # fmt: skip
    """Two patches that share all four edges: two random curves, and segments between their ends."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(2, 6))
    points = np.cumsum(rng.uniform(-0.3, 1.0, (degree + 1, 3)), axis=0)
    one = curve(points / np.ptp(points, axis=0).max(), np.exp(rng.uniform(-1, 1, degree + 1)))
    patches = []
    for name, side, sign in (("one", one, 1), ("two", represented(one, factor, by, elevated_first, reverse), -1)):
        bulge = np.zeros((len(side.knots), 3))
        bulge[1:-1] = sign * np.array([0.3, -0.4, 0.1])
        patches.append(loft(side, 0 * UP, UP + bulge, 2 * UP, scale=scale, shift=shift, name=name))
    return Model(tuple(patches), name="body")


CASES = [
    (0, 0.3, 1, False, False, 1.0, 0.0),
    (1, 5.0, 2, False, True, 1.0, 0.0),
    (2, 3.0, 3, True, False, 1e-9, 0.0),
    (3, 0.5, 2, True, True, 1e9, 0.0),
    (4, 2.0, 1, False, True, 1.0, 1e7),
    (5, 1.0, 2, False, False, 1.0, 1e7),
]


def assert_parameters_are_those_of_points(model: Model, mosaic: Complex, points: np.ndarray, tolerance: float) -> None:
    """Each cell's corners have the parameters of its own patch, and cells cover Δ without folds."""
    for index, patch in enumerate(model):
        rows = np.flatnonzero(mosaic.cell_patch == index)
        corners = mosaic.corners[rows]
        own = patch.evaluate(corners.reshape(-1, 2), "linear")
        assert np.abs(own - points[mosaic.cells[rows].ravel()]).max() <= tolerance
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        assert (area > 0).all() or (area < 0).all()
        x, y = patch.domain.vertices.T
        assert np.abs(area).sum() == pytest.approx(np.abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)), rel=1e-9)


@pytest.mark.parametrize("case", [CASES[0], *(pytest.param(case, marks=long) for case in CASES[1:])])
def test_edges_of_other_parameters_are_joined_in_even_and_refined_meshes(case):
    model = body(*case)
    scale, shift = case[-2:]
    assert model.joints.closed
    assert sum(bool(joint.match) for joint in model.joints.shared) == 2
    assert joint_findings(model)[0].status == "holds"
    rounding = 3 * ROUNDING * scale + 20 * np.spacing(shift)  # points that are inverted are rounded themselves
    sampler = Sampler(model.patches)
    for resolution in (1, 2, 3, 8):
        mosaic = joined_complex(model.patches, model.joints, resolution)
        points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
        assert_parameters_are_those_of_points(model, mosaic, points, rounding)
        for parametrization in ("linear", "toric"):
            assert not len(tessellate(model, resolution, parametrization=parametrization).open_sides)
    mosaic, points = refined(model, sampler, 3e-3 * scale)
    assert_parameters_are_those_of_points(model, mosaic, points, rounding)
    assert not len(tessellate(model, tolerance=3e-3 * scale).open_sides)


@pytest.mark.parametrize(("factor", "by"), [(0.3, 1), (2.0, 3), (5.0, 2)])
def test_a_smooth_seam_is_smooth_at_corresponding_points(factor, by):
    one = curve(ARC, [1, 0.5**0.5, 1])
    model = Model((loft(one, 0 * UP, UP), loft(represented(one, factor, by), UP, 3 * UP)))
    (seam,) = model.seams
    assert seam.angle < 1e-9
    assert seam.bend < 1e-9


def test_a_straight_edge_is_joined_whatever_its_speed():
    square, beside = [np.array([(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0), (x, 1.0)]) for x in (0.0, 1.0)]
    uneven = Patch([*square, (0, 0.5)], [*beside, (1, 0.1)], [1, 1, 1, 1, 0.5])
    model = Model((Patch(square, square), uneven))
    (joint,) = model.joints.shared
    even = np.linspace(0, 1, 50)
    places = joint.across(model.patches, even)
    assert (places[0], places[-1]) == (1, 0)
    assert (np.diff(places) < 0).all()
    np.testing.assert_allclose(edge_points_at(uneven, 3, places)[:, 1], even, rtol=0, atol=1e-14)
    np.testing.assert_allclose(joint.back(model.patches, places), even, rtol=0, atol=1e-13)
    flat = tessellate(model, tolerance=1e-3)
    assert np.abs(flat.vertices[:, 2]).max() == 0


def test_three_representations_on_one_edge_meet_in_the_same_vertices():
    one = curve(ARC, [1, 0.5**0.5, 1])
    ways = np.array([[1.0, 1, 0], [-1.0, -1, 1], [0, 0, 1.0]])
    sides = one, represented(one, 3, 1), represented(one, 0.2, 2)
    fan = [loft(side, 0 * UP, way) for side, way in zip(sides, ways, strict=True)]
    model = Model(tuple(fan))
    assert model.joints.crowded == (((0, 0), (1, 0), (2, 0)),)
    for options in ({"resolution": 5}, {"tolerance": 1e-3}):
        mesh = tessellate(model, **options)
        sides = np.sort(mesh.cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert (np.unique(sides, axis=0, return_counts=True)[1] == 3).sum() >= 5
    sampler = Sampler(model.patches)
    mosaic, points = refined(model, sampler, 1e-3)
    assert_parameters_are_those_of_points(model, mosaic, points, 1e-13)


@pytest.mark.parametrize("order", [1, -1])
def test_a_patch_is_joined_with_itself_at_other_parameters(order):
    """A ring about the z axis, of a curve turned to four angles, the last as the first, of a higher degree there."""
    one = curve([(1.0, 0, 0), (2.0, 0, 1), (1.0, 0, 2)], [1, 2, 1])
    sides = [one, one, one, represented(one, 3.0, 1)][::order]
    knots, points, weights = [], [], []
    for i, (side, angle) in enumerate(zip(sides, 2 * np.pi * np.arange(4) / 3, strict=True)):
        turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        knots += [(i, 2 * k / side.knots[-1, 0]) for k in side.knots[:, 0]]
        points += list(side.control_points @ turn)
        weights += list(np.exp(side.log_products))
    model = Model((Patch(knots, points, weights),))
    assert len(model.joints.open) == 2
    sampler = Sampler(model.patches)
    even = joined_complex(model.patches, model.joints, 6)
    for mosaic, found in (
        (even, sampler.points(even.patch, even.parameters, even.face)),
        refined(model, sampler, 1e-2),
    ):
        assert_parameters_are_those_of_points(model, mosaic, found, 1e-13)


def test_vertices_inside_follow_those_of_the_edge():
    """Else triangles across the cylinder would cut through it: the distance from it would grow fivefold."""
    one = curve(ARC, [1, 0.5**0.5, 1])
    errors = []
    for factor, by in ((1, 0), (5, 2)):
        model = Model((loft(one, 0 * UP, UP), loft(represented(one, factor, by), UP, 2 * UP)))
        mesh = tessellate(model, 16)
        errors.append(np.abs(1 - np.hypot(*mesh.vertices[mesh.faces].mean(axis=1)[:, :2].T)).max())
    assert errors[1] < 2.5 * errors[0]


def test_triangles_that_would_turn_over_are_cut_around_the_centre():
    corners = np.array([(0.0, 0.0), (2.0, 0.0), (0.0, 2.0)])
    around = [Patch(corners, [p, q, p + q - r]) for p, q, r in (np.roll(corners, -k, axis=0) for k in range(3))]
    uneven = Patch([*corners, (1, 0), (1, 1), (0, 1)], [*corners, (0.02, 0), (1, 1), (0, 0.02)], [1, 1, 1, 5, 3, 5])
    model = Model((*around, uneven))
    assert sum(bool(joint.match) for joint in model.joints.shared) == 2
    sampler = Sampler(model.patches)
    mosaic = joined_complex(model.patches, model.joints, 8)
    assert (mosaic.cell_patch == 3).sum() == 3 * 64
    points = sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)
    assert_parameters_are_those_of_points(model, mosaic, points, 1e-13)


def test_a_curve_that_leaves_and_returns_is_another_one():
    one = curve(ARC, [1, 0.5**0.5, 1])
    bent = represented(one, 2, 2)
    points = bent.control_points.copy()
    points[2] += 1e-3
    patches = [loft(one, 0 * UP, UP), loft(bent.replace(control_points=points), 0 * UP, -UP)]
    found = find_joints(patches)
    assert not found.shared
    assert found.almost[0][2] == pytest.approx(5e-4, rel=0.5)


@pytest.mark.parametrize(
    "kind", ["crossing itself", "closed", "repeated point", "cusp", "there and back", "real knots", "weights"]
)
def test_curves_of_every_kind_are_recognised(kind):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points = rng.uniform(-1, 1, (6, 3))
        points[:, 2] = 0
        knots, spread = np.arange(6.0), 1
        if kind == "closed":
            points[-1] = points[0]
        elif kind == "repeated point":
            points[1] = points[0]
        elif kind == "cusp":
            points[2:4] = points[0] + points[5] - points[3:1:-1]
            points[[1, 4]] = points[[5, 0]]
        elif kind == "there and back":
            points = np.outer([0, 0.4, 1, 1, 0.4, 0], points[0])
        elif kind == "real knots":
            knots = np.cumsum(rng.uniform(0.05, 1, 6))
        elif kind == "weights":
            spread = 4
        one = Patch(knots, points, np.exp(rng.uniform(-spread, spread, 6)))
        other = elevate(one.replace(weights=one.weights * np.exp(rng.uniform(-2, 2) * knots)), 2)
        turned = bool(seed % 2)
        if turned:
            other = Patch(-other.knots, other.control_points, np.exp(other.log_products))
        one, other = (edge_curve(loft_of_knots(side), 0) for side in (one, other))
        other = other.reversed() if turned else other
        match = equal(one, other, 1e-11)
        fractions = rng.random(20)
        there = match.carried(one, other, fractions)
        np.testing.assert_allclose(other.points_at(there), one.points_at(fractions), rtol=0, atol=1e-11)
        np.testing.assert_allclose(match.carried(one, other, there, back=True), fractions, rtol=0, atol=1e-11)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_spike_between_samples_is_seen(height):
    """Points are near knots, on a segment at uneven places, with one of them beside it."""
    segment = Curve(np.array([0.0, 1.0]), np.zeros(2), np.array([(0.0, 0, 0), (1.0, 0, 0)]))
    knots = np.linspace(0, 1, 65)
    points = np.column_stack([knots**1.3, 0 * knots, 0 * knots])
    middle = (np.array([16, 17]) / 32) ** (1 / 1.3)
    points[np.abs(knots - middle.mean()).argmin(), 1] = height
    found = matched(segment, Curve(knots, -4 / knots[1] ** 2 * knots**2, points), np.inf)
    there = np.interp([0.5, 17 / 32], *found.places)
    np.testing.assert_allclose(there, middle, atol=knots[1])
    assert (found.distance < 1e-12) if height == 0 else (found.distance > 0.1)


def test_other_parameters_are_welded_like_equal_ones():
    exact, rng = body(3), np.random.default_rng(1)
    patches = [p.replace(control_points=p.control_points + rng.uniform(-1e-6, 1e-6, (len(p.knots), 3))) for p in exact]
    model = Model(tuple(patches))
    assert not model.joints.shared
    assert ["; 1 more likewise" in line for line in seam_remarks(model)] == [True, False, False]
    assert all("`weld` 3e-06" in line or "`weld` 2e-06" in line for line in seam_remarks(model))
    welded = model.replace(weld=1e-5)
    assert welded.joints.closed
    assert max(joint.distance for joint in welded.joints.shared) < 4e-6
    assert not len(tessellate(welded, 8).open_sides)
    mesh, middle = tessellate(welded, 16), tessellate(exact, 16)
    assert np.abs(mesh.vertices - middle.vertices).max() < 3e-6
