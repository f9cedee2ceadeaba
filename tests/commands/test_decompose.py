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


def test_the_usual_net_of_a_bezier_patch_needs_no_lifting():
    assert lines(gtb("decompose", SPECS / "cubic-bezier.toml", "--net")) == [[0, 1], [1, 2], [2, 3]]
    knots = load(SPECS / "bicubic.toml").knots
    net = lines(gtb("decompose", SPECS / "bicubic.toml", "--net"))
    assert (np.abs(np.diff(knots[net], axis=1)).sum(axis=2) == 1).all()
    assert len(net) == 2 * 4 * 3
    assert "has no lifting" in gtb("decompose", SPECS / "trapezoid.toml", "--net", status=2).err


def test_a_degeneration_leads_to_a_decomposition_by_its_number(tmp_path):
    spec = tmp_path / "hexagon.json"
    corners = [[2, 0], [3, 0], [4, 2], [3, 4], [1, 5], [0, 2]]
    spec.write_text(json.dumps({"knots": corners, "control_points": corners, "weights": [1] * 6}))
    found = json.loads(gtb("decompose", spec, "--all", "--json", status=0).out)["decompositions"]
    assert [row["cells"] for row in found] == sorted(row["cells"] for row in found)
    for row in found[::7]:
        lifting = ",".join(map(repr, row["lifting"]))
        assert json.loads(gtb("decompose", spec, "--json", f"--lifting={lifting}").out)["cells"] == row["cells"]
    limit = gtb("degenerate", spec, "--to", 40, "-x", "inf", "--emit-spec", status=0).text
    assert limit.count("[[patches]]") == len(found[40]["cells"])
