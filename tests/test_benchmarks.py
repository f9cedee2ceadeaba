"""What `make bench` does, with a thousandth of the points: times say nothing, results are compared all the same."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gtb_cli.fairing.metric import blocks
from gtb_cli.fairing.variation import bendings
from gtb_cli.filling.hole_files import loop_from_text
from gtb_cli.filling.sides import side_normals, stations
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.theory.patch import Patch
from tests import benchmarks
from tests.benchmarks import Row, compared, filling, gb, paired
from tests.benchmarks.__main__ import line, main
from tests.benchmarks.jets import bending, normals
from tests.marks import long, mostly_long

SCALE = 1e-3

POINTS = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])


@pytest.mark.parametrize(
    ("name", "count"),
    mostly_long([("evaluate", 7), ("meshes", 8), ("export", 7), ("diff", 4), ("refinement", 7), ("sequences", 3)], 2)
    + mostly_long([("startup", 7)], 0),
)
def test_every_line_has_a_ratio_or_a_peer_that_is_missing(name, count, capsys):
    peers = {"splinepy", "splipy", "OCP"}  # they need not be installed
    with benchmarks.scaled(SCALE):
        main([f"bench_{name}"])
    machine, head, *lines = capsys.readouterr().out.splitlines()
    assert "processors" in machine
    assert len(lines) == count
    place = head.index("  ratio")
    for text in lines:
        _, _, package = text.partition("not installed: ")
        assert package in peers if package else math.isfinite(float(text[place:].split()[0]))


@long
def test_a_hole_in_a_cubic_is_filled_near_to_it(capsys, monkeypatch):
    monkeypatch.setattr(filling, "FINE", 60), filling.main(["3"])
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if "gtb fill" in line]
    assert [row[3] for row in rows] == ["g1", "g2"]
    for missed, _, _, _, _, _, _, _, degrees, off, nearer, _, curved, folds, *_ in rows:
        assert float(missed) < 2e-3  # Open CASCADE misses it by 2.2e-3, and a thin plate by 3.5e-3
        assert float(degrees) < 1e-9
        assert float(nearer) < 0.011 * float(off)  # from the plane of a corner, a hundredth as far from it
        assert float(curved) < 4
        assert folds == "0"


def test_a_generalized_bezier_patch_with_four_sides_is_bicubic_and_bends_as_one():
    """Two independent derivations of curvature and its variation agree."""
    heights = np.random.default_rng(4).normal(size=(4, 4))
    grid = np.stack([*np.meshgrid(np.arange(4) / 3, np.arange(4) / 3, indexing="ij"), heights], axis=-1)
    turned = [np.rot90(grid, -k) for k in range(4)]  # whose first column is side k
    found = gb.GeneralizedBezier(np.array([side[:, :2].swapaxes(0, 1) for side in turned]), np.zeros(3))
    knots = grid[..., :2].reshape(-1, 2)
    bicubic = Patch(knots, grid.reshape(-1, 3), coefficients=np.outer([1, 3, 3, 1], [1, 3, 3, 1]).ravel())
    places = np.random.default_rng(5).uniform(0.1, 0.9, (20, 2))
    turn = gb.polygon(4)[[0, 1, 3]]
    to_polygon = turn[0] + places @ (turn[1:] - turn[0])
    jets = found.jets(to_polygon)
    assert jets[0] == pytest.approx(bicubic.evaluate(places, "linear"), abs=1e-12)
    s = MomentMap(knots, bicubic.log_products).inverse(places, 1e-13)
    areas = np.ones(20)
    [[expected]] = bendings(blocks(knots, bicubic.log_products, s), areas, [bicubic.control_points])
    bent = bending(jets, 2 * areas)  # the area of the polygon
    assert dataclasses.astuple(bent) == pytest.approx(dataclasses.astuple(expected), rel=1e-9)


def test_generalized_bezier_patches_touch_their_ribbons():
    path = Path(__file__).parent / "filling" / "cagd86.gbp"
    patch, sides = gb.GeneralizedBezier.read(path), loop_from_text(path.read_bytes(), str(path))
    corners, t = gb.polygon(5), stations()[[9, 48, 80]]
    for k, side in enumerate(sides):
        places = corners[k] + t[:, None] * (corners[(k + 1) % 5] - corners[k])
        angles = np.cross(normals(patch.jets((1 - 1e-9) * places)), side_normals(side)[[9, 48, 80]])
        assert np.abs(angles).max() < 1e-8


def test_a_missed_budget_and_what_is_counted_are_said():
    assert " ".join(line(Row("a", 0.2, 0.1, 2, 1.5, 3e-16)).split()) == "a 200.0 100.0 2.000 1.50 3e-16 over budget"
    assert " ".join(line(Row("b", 30, 60, 0.5, 1, unit="triangles")).split()) == "b 30 60 0.500 1.00 triangles"


def peer(result: np.ndarray) -> Callable[[], Callable[[], np.ndarray]]:
    return lambda: lambda: result


def test_a_peer_that_does_something_else_is_not_timed():
    with pytest.raises(AssertionError, match=r"a: results are 0\.001 apart"):
        compared("a", lambda: POINTS, peer(POINTS + 1e-3), within=1e-6)


def test_times_are_for_the_same_work(monkeypatch):
    """3 seconds, of which one is allowed, beside 2; the first pair does not count."""
    ticks = iter([0, 100, 100, 200, 200, 203, 203, 205])
    monkeypatch.setattr(benchmarks, "time", SimpleNamespace(perf_counter=ticks.__next__))
    monkeypatch.setattr(benchmarks, "gc", SimpleNamespace(collect=int))
    row = paired("a", lambda: None, lambda: None, runs=1, allowance=1)
    assert (row.measured, row.beside, row.ratio) == (3, 2, 1)


def test_a_peer_that_is_not_installed_has_a_line():
    def absent() -> Callable[[], np.ndarray]:
        import surely_not_installed  # type: ignore[import-not-found]

        return surely_not_installed.evaluate

    row = compared("a", lambda: POINTS, absent, within=1e-6)
    assert " ".join(line(row).split()) == "a not installed: surely_not_installed"
