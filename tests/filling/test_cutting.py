"""Holes with concave corners: cut into parts that meet with exact planes, none of which folds."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

import gtb_cli
from gtb_cli.errors import DomainError
from gtb_cli.fairing.energy import energy_samples
from gtb_cli.filling.certificate import Filling
from gtb_cli.filling.cutting import _cuts, _halves, fill_parts
from gtb_cli.filling.fill import filled
from gtb_cli.filling.hole_corners import between_stations, corners
from gtb_cli.filling.one_patch import fill_loop
from gtb_cli.filling.sides import HoleSide, bernstein, loop, points_and_tangents, stations
from gtb_cli.filling.strips import strip_side
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from tests.filling.loops import homogeneous
from tests.filling.test_one_patch import ONCE, PLANES, L, plane_sides
from tests.marks import long, mostly_long
from tests.shell import gtb


def graph(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A cubic, with its derivatives in x and y."""
    z = 0.1 * x**3 - 0.2 * x * y**2 + 0.15 * x**2 * y + 0.1 * x * y
    return np.array([z, 0.3 * x**2 - 0.2 * y**2 + 0.3 * x * y + 0.1 * y, -0.4 * x * y + 0.15 * x**2 + 0.1 * x])


def graph_sides(corners: np.ndarray) -> list[HoleSide]:
    """The sides of a hole in the graph over a polygon: cubics, with its tangent planes."""
    sides = []
    for k, start in enumerate(corners):
        way = corners[(k + 1) % len(corners)] - start
        t = np.linspace(0, 1, 4)
        flat = start + t[:, None] * way
        points = np.linalg.solve(bernstein(3, t), np.column_stack([flat, graph(*flat.T)[0]]))
        points[[0, -1], :2] = flat[[0, -1]]
        flat, inwards = start + stations()[:, None] * way, np.array([-way[1], way[0]])
        across = np.column_stack([np.tile(inwards, (96, 1)), inwards @ graph(*flat.T)[1:]])
        sides.append(HoleSide(f"s{k}", homogeneous(points), across))
    return sides


def star(n: int, inner: float = 0.45) -> np.ndarray:
    angles = np.arange(2 * n) * np.pi / n
    radii = np.where(np.arange(2 * n) % 2, inner, 1.0)
    return radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def assert_not_folded(filling: Filling) -> None:
    """As seen from above, no patch turns back, at places denser than those of the certificate."""
    assert filling.fault is None
    for patch in filling.patches:
        assert (patch.normals(energy_samples(patch.domain, 40)[0], "linear")[:, 2] > 0).all()


@long
def test_a_concave_hole_in_a_graph_is_cut_and_its_parts_meet_with_exact_planes():
    sides = graph_sides(0.5 * L[:, :2])
    assert [round(corner.angle) for corner in corners(sides)] == pytest.approx([90, 90, 90, 270, 90, 90], abs=6)
    filling = filled(sides, None, "hole", raises=ONCE)
    assert_not_folded(filling)
    assert filling.angle < PLANES
    assert len(filling.parts) == 2
    assert [patch.name for patch in filling.model] == ["hole-0", "hole-1"]
    assert filling.remarks[0] == "the hole is cut from its concave corner (0.5, 0.5, 0.03125) to (0, 0, 0)"
    (seam,) = filling.model.seams
    assert seam.angle < PLANES
    (bends,) = {contact.bend for contact in filling.contacts if not math.isnan(contact.bend)}
    assert bends == seam.bend
    given = {tuple(side.ends.ravel()) for side in sides}
    assert given < {tuple(side.ends.ravel()) for side in filling.sides}
    assert filling.bending.area == pytest.approx(sum(part.bending.area for part in filling.parts))
    assert filling.bending.variation < 20
    for patch in filling.patches:
        x, y, z = patch.evaluate(energy_samples(patch.domain, 12)[0], "linear").T
        assert np.abs(z - graph(x, y)[0]).max() < 3e-3


@pytest.mark.parametrize(("corners", "planes"), mostly_long([(star(3), False), (star(4, 0.3), True)], 0))
def test_plane_holes_with_concave_corners_stay_plane(corners, planes):
    sides = plane_sides(np.column_stack([corners, np.zeros(len(corners))]), [1] * len(corners))
    given = sides if planes else [replace(side, across=None) for side in sides]
    filling = filled(given, None, None, raises=ONCE)
    assert_not_folded(filling)
    for patch in filling.patches:
        np.testing.assert_allclose(patch.control_points[:, 2], 0, atol=1e-12)


@long
def test_a_random_star_is_filled_without_folds():
    rng = np.random.default_rng([9, 7])
    n = int(rng.integers(5, 12))
    angles, radii = (np.arange(n) + 0.7 * rng.random(n)) * 2 * np.pi / n, rng.uniform(0.3, 1, n)
    corners = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    filling = filled(graph_sides(corners), None, None, raises=ONCE)
    if filling.fault is None:
        assert_not_folded(filling)
        assert filling.angle < PLANES


def face(turn: np.ndarray, name: str) -> Patch:
    """A sixth of a sphere: a polynomial of degree 6 through its points."""
    t = (1 - np.cos(np.pi * np.arange(7) / 6)) / 2
    u, v = np.tan((2 * np.stack(np.meshgrid(t, t, indexing="ij")) - 1) * np.pi / 4)
    points = np.stack([u, v, np.ones_like(u)], axis=-1)
    points = points / np.linalg.norm(points, axis=-1, keepdims=True) @ turn.T
    inverse = np.linalg.inv(bernstein(6, t))
    net = np.einsum("ai,bj,ijk->abk", inverse, inverse, points).reshape(-1, 3)
    knots = [[i, j] for i in range(7) for j in range(7)]
    return Patch(
        knots, np.round(net, 12), coefficients=[math.comb(6, i) * math.comb(6, j) for i, j in knots], name=name
    )


@pytest.mark.parametrize("gone", mostly_long(["+z+x", "+z+x+y-x"], 0))
def test_neighbouring_patches_of_a_sphere_are_filled_in(gone):
    """Two concave corners, joined by a great circle; with more, three or four. Along all edges planes are met."""
    axes = {f"{sign}{'xyz'[k]}": float(f"{sign}1") * np.eye(3)[k] for sign in "+-" for k in range(3)}
    turns = {name: np.column_stack([np.roll(z, 1), np.cross(z, np.roll(z, 1)), z]) for name, z in axes.items()}
    rest = Model([face(turn, name) for name, turn in turns.items() if name not in gone], weld=1e-9)
    filling = filled(rest, None, None, raises=None if gone == "+z+x" else ONCE)
    assert filling.fault is None
    assert filling.angle < PLANES
    assert filling.model.patches[: len(rest)] == rest.patches
    assert filling.model.joints.closed
    if gone == "+z+x":
        for patch in filling.patches:
            radii = np.linalg.norm(patch.evaluate(energy_samples(patch.domain, 12)[0], "linear"), axis=1)
            np.testing.assert_allclose(radii, 1, atol=0.01)
    edges = [joint for joint in filling.model.seams if max(joint.first[0], joint.second[0]) >= len(rest)]
    assert max(seam.angle for seam in edges) < 1e-6


def test_only_a_loop_of_curves_is_cut_inside_a_side():
    hole = plane_sides(np.array([[0.0, 0, 0], [4, 2, 0], [0, 4, 0], [1.5, 2, 0]]), [1] * 4)
    assert [corner.concave for corner in corners(hole)] == [False, False, False, True]
    assert len(list(_cuts(hole, False, 4))) == 1
    cuts = sorted(_cuts(hole, True, 4), key=lambda cut: cut[0])
    assert cuts[0][3] == "the hole is cut from its concave corner (1.5, 2, 0) to (4, 2, 0)"
    assert [cut[3][-14:] for cut in cuts[1:]] in ([f"cuts s{k} in two" for k in pair] for pair in ((0, 1), (1, 0)))
    for _, left, right, _ in cuts[1:]:
        loop(left)
        loop(right)


def test_a_side_is_cut_in_two_exactly():
    rng = np.random.default_rng(5)
    curve = homogeneous(rng.normal(size=(4, 3)), np.array([1, 0.4, 2, 1]))
    side = strip_side("side", [curve, homogeneous(rng.normal(size=(4, 3)), curve[:, 3])], 2)
    for half, (low, high) in zip(_halves(side, 0.3), ((0, 0.3), (0.3, 1)), strict=True):
        np.testing.assert_allclose(half.curve[[0, -1], 3], 1, atol=1e-14)
        points, tangents = points_and_tangents(half.curve, stations())
        t = np.linspace(low, high, 40_001)
        far, nearest = cKDTree(points_and_tangents(curve, t)[0]).query(points)
        assert far.max() < 5e-4
        at = t[nearest]
        ways = np.cross(between_stations(side.across, at), points_and_tangents(curve, at)[1])
        found = np.cross(half.across, tangents)
        cosines = (ways * found).sum(axis=1) / np.linalg.norm(ways, axis=1) / np.linalg.norm(found, axis=1)
        assert cosines.min() > 1 - 1e-8


@long
def test_straight_corners_do_not_fold():
    corners = 0.5 * np.array([[0.0, 0], [1, 0], [2, 0], [2, 2], [0, 2]])
    filling = filled(graph_sides(corners), None, None, raises=ONCE)
    assert not filling.parts
    assert_not_folded(filling)


def test_a_spike_is_a_fault_where_corners_are_concave_or_beyond_measure():
    filling = fill_loop(graph_sides(0.5 * L[[0, 1, 2, 5], :2]), raises=0)
    assert filling.fault is None
    sharp = replace(filling, bending=replace(filling.bending, curvature=1e4))
    assert sharp.fault.startswith("the patch turns sharply: its curvature is up to 2.4e+03 times")
    concave = replace(filling, sides=tuple(graph_sides(0.5 * L[:, :2])), sharp_turns=1)
    assert "cut the hole with curves from its concave corners" in concave.fault
    ends = np.column_stack([np.vstack([np.eye(2), -np.eye(2)])[[0, 1, 2, 3, 0]], np.zeros(5), np.ones(5)])
    lobes = [
        HoleSide(f"{k}", np.array([a, 1.5 * (a + b) * [1, 1, 1, 1 / 3], b])) for k, (a, b) in enumerate(pairwise(ends))
    ]
    assert "from its concave corners" in replace(filling, sides=tuple(lobes), folds=1).fault
    turned = [replace(each, angle=angle) for each, angle in zip(filling.contacts, (50, 1, 170, math.nan), strict=True)]
    filling = replace(filling, contacts=tuple(turned))
    assert f"is turned over along {filling.sides[2].name}: give it another ribbon, which points into" in filling.fault


@long
def test_the_command_writes_a_model_of_the_parts(tmp_path):
    corners = L[:, :2]
    ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    curves = [Patch([0, 1], [[*a, 0], [*b, 0]], name=f"side-{k}") for k, (a, b) in enumerate(ends)]
    gtb_cli.save(Model(curves), tmp_path / "loop.toml")
    result = gtb("fill", tmp_path / "loop.toml", "--elevate", ONCE, "-o", tmp_path / "lid.toml", status=0)
    assert "the hole is cut from its concave corner (1, 1, 0) to (0, 0, 0)" in result.err
    assert "4 + 4 sides" in result.err
    assert [patch.name for patch in gtb_cli.load_model(tmp_path / "lid.toml")] == ["loop-0", "loop-1"]


def test_a_dozen_fillings_are_tried_and_no_more():
    tried = []

    def fill(sides):
        tried.append(len(sides))
        raise DomainError("no")

    assert fill_parts(graph_sides(star(7)), fill, False) is None
    assert len(tried) == 12


@long
def test_a_corner_of_190_degrees_is_cut():
    polygon = np.array([[0.0, 0], [1, 0.1], [2, 0], [2, 1], [0, 1]])[:, :2]
    assert len(filled(graph_sides(0.4 * polygon), None, None, raises=ONCE).parts) == 2
