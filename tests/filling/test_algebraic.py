"""Sides that lie on a quadric, a cubic or a quartic are filled as this surface."""

import numpy as np
import pytest

from gtb_cli.fairing.energy import energy_samples
from gtb_cli.filling import fairest
from gtb_cli.filling.algebraic import ways_to_surface
from gtb_cli.filling.one_patch import fill_loop
from gtb_cli.filling.sides import HoleSide, points_and_tangents, side_normals, stations
from gtb_cli.filling.tangent_rows import EdgeRows
from tests.benchmarks.filling import cubic, sides as graph_sides
from tests.filling.loops import ARC, homogeneous, random_sides
from tests.marks import long, mostly_long

PAGE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]])


def arc_side(curve: np.ndarray, across: np.ndarray) -> HoleSide:
    return HoleSide("arc", curve, np.broadcast_to(across, (96, 3)))


def known(kind: str) -> list[HoleSide]:
    if kind in ("cubic", "random"):
        return graph_sides(7, *cubic(7)) if kind == "cubic" else random_sides(5, 0)
    if kind == "page":  # folded in the middle: its planes are a quadric
        curves = [homogeneous(PAGE[[k, (k + 1) % 6]]) for k in range(6)]
        inward = [[0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, -1, 0], [0, 0, -1], [0, 1, 0]]
        return [arc_side(*each) for each in zip(curves, np.array(inward), strict=True)]
    if kind == "sphere":
        turns = [np.roll(np.eye(3), k, axis=1) for k in range(3)]
        arcs = [np.column_stack([ARC[:, :3] @ turn, ARC[:, 3]]) for turn in turns]
        return [arc_side(arc, np.eye(3)[(k + 2) % 3]) for k, arc in enumerate(arcs)]
    x, y, _, w = ARC.T
    if kind in ("pipe", "cap"):  # the end of a cylinder, which does not close it, and of cones, which are many quadrics
        quarters = [np.column_stack([*at, 0 * w, w]) for at in ((x, y), (-y, x), (-x, -y), (y, -x))]
        inwards = kind == "cap"
        return [arc_side(c, np.eye(3)[2] - inwards * points_and_tangents(c, stations())[0]) for c in quarters]
    up, low = np.column_stack([x + 2 * w, 0 * w, y, w]), np.column_stack([3 * x, 3 * y, 0 * w, w])
    high = np.column_stack([2 * x, 2 * y, w, w])[::-1]
    outward = points_and_tangents(high, stations())[0] * [1, 1, 0]
    ways = np.eye(3)[2], np.eye(3)[0], outward, np.eye(3)[1]
    return [arc_side(*each) for each in zip((low, up[:, [1, 0, 2, 3]], high, up[::-1]), ways, strict=True)]


@pytest.mark.parametrize(
    ("kind", "degree"), [("sphere", 2), ("cubic", 3), ("torus", 4), ("page", 0), ("cap", 0), ("random", 0)]
)
def test_sides_tell_of_the_surface_on_which_they_lie(kind, degree):
    found = ways_to_surface([EdgeRows(side.curve, side_normals(side), None) for side in known(kind)])
    assert (0 if found is None else found.args[0].sum(axis=1).max()) == degree
    if found is not None:  # ways end there
        places = 0.01 + np.concatenate([points_and_tangents(side.curve, stations())[0] for side in known(kind)])
        assert np.abs(found(places + found(places))).max() < 1e-12


@pytest.mark.parametrize(("kind", "most"), mostly_long([("sphere", 2e-4), ("cubic", 5e-4), ("torus", 3e-3)]))
def test_a_hole_in_a_known_surface_is_filled_as_it(kind, most):
    """The fairest patch is .0004, .019 or .028 off."""
    patch = fill_loop(known(kind)).patch
    x, y, z = patch.evaluate(energy_samples(patch.domain, 20)[0], "linear").T
    graph = z - cubic(7)[0](np.column_stack([x, y]))
    off = {"cubic": graph, "sphere": np.hypot(np.hypot(x, y), z) - 1, "torus": np.hypot(np.hypot(x, y) - 2, z) - 1}
    assert np.abs(off[kind]).max() < most


@long
def test_the_end_of_a_pipe_is_closed():
    assert fill_loop(known("pipe"), raises=1).bending.energy < 20


@long
def test_a_surface_that_a_patch_comes_no_nearer_to_is_not_followed(monkeypatch):
    plain = fill_loop(random_sides(5, 0), raises=0).patch
    monkeypatch.setattr(fairest, "ways_to_surface", lambda _: np.zeros_like)
    assert fill_loop(random_sides(5, 0), raises=0).patch == plain
