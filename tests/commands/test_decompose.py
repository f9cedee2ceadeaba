"""`gtb decompose --net`: the control net that a lifting induces, as a mesh of lines."""

import json

import numpy as np
import pytest

from tests.shell import SPECS, Result, gtb
from tests.specs import load


def lines(result: Result) -> list[list[int]]:
    return [[int(part) - 1 for part in row.split()[1:]] for row in result.text.splitlines() if row[0] == "l"]


@pytest.mark.parametrize("name", ["pentagon", "example-4.4"])
def test_the_net_runs_along_the_borders_of_the_cells(name):
    spec = SPECS / f"{name}.toml"
    polygons = json.loads(gtb("decompose", spec, "--json").out)["polygons"]
    sides = {tuple(sorted(pair)) for polygon in polygons for pair in zip(polygon, np.roll(polygon, 1), strict=True)}
    written = gtb("decompose", spec, "--net", status=0)
    assert sorted(map(tuple, lines(written))) == sorted(sides)
    points = [row.split()[1:] for row in written.text.splitlines() if row[0] == "v"]
    np.testing.assert_allclose(np.array(points, dtype=float), load(spec).control_points, atol=1e-8)


def test_the_net_of_a_curve_is_the_polygon_of_the_knots_that_are_present():
    """Property (g): with one weight to infinity, the polyline b_0 b_i b_n."""
    curve = SPECS / "example-3.1.toml"
    assert lines(gtb("decompose", curve, "--lifting", "0,0,1,0,0", "--net")) == [[0, 2], [2, 4]]


def test_the_usual_net_of_a_bezier_patch_needs_no_lifting():
    assert lines(gtb("decompose", SPECS / "cubic-bezier.toml", "--net")) == [[0, 1], [1, 2], [2, 3]]
    knots = load(SPECS / "bicubic.toml").knots
    net = lines(gtb("decompose", SPECS / "bicubic.toml", "--net"))
    assert (np.abs(np.diff(knots[net], axis=1)).sum(axis=2) == 1).all()
    assert len(net) == 2 * 4 * 3
    assert "has no lifting" in gtb("decompose", SPECS / "trapezoid.toml", "--net", status=2).err


def test_the_output_names_the_format(tmp_path):
    target = tmp_path / "net.ply"
    assert gtb("decompose", SPECS / "pentagon.toml", "--net", "-o", target).status == 0
    assert target.read_bytes().startswith(b"ply\n")
    for options in (("-o", tmp_path / "net.stl"), ("--json",)):
        assert "--net" in gtb("decompose", SPECS / "pentagon.toml", "--net", *options, status=2).err
    assert [path.name for path in tmp_path.iterdir()] == ["net.ply"]
