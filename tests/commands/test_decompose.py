"""`gtb decompose --net`: the control net that a lifting induces, as a mesh of lines."""

import json
from itertools import combinations

import numpy as np
import pytest

from tests.shell import SPECS, gtb
from tests.specs import load


def lines(text: bytes) -> list[tuple[int, int]]:
    return [
        (int(a) - 1, int(b) - 1) for kind, a, b in (row.split() for row in text.decode().splitlines() if row[0] == "l")
    ]


def borders(knots: np.ndarray, cell: list[int]) -> set[tuple[int, int]]:
    """Pairs of knots of a cell with no knot between them, and none on one side of their line."""
    found = set()
    for i, j in combinations(cell, 2):
        step = knots[j] - knots[i]
        others = knots[[k for k in cell if k not in (i, j)]] - knots[i]
        across = others[:, 0] * step[1] - others[:, 1] * step[0]
        on_line = np.abs(across) < 1e-12
        between = on_line & (others @ step > 0) & (others @ step < step @ step)
        if not between.any() and ((across >= -1e-12).all() or (across <= 1e-12).all()):
            found.add((i, j))
    return found


@pytest.mark.parametrize("name", ["pentagon", "example-4.4", "example-4.1", "nonagon"])
def test_the_net_runs_along_the_borders_of_the_cells(name):
    path = SPECS / f"{name}.toml"
    patch = load(path)
    options = () if patch.lifting is not None else ("--lifting", ",".join("0" * len(patch.knots)))
    cells = json.loads(gtb("decompose", str(path), *options, "--json").out)["cells"]
    written = gtb("decompose", str(path), *options, "--net")
    assert written.status == 0
    assert set(lines(written.out)) == set().union(*(borders(patch.knots, cell) for cell in cells))
    points = [row.split()[1:] for row in written.out.decode().splitlines() if row[0] == "v"]
    np.testing.assert_allclose(np.array(points, dtype=float), patch.control_points, atol=1e-8)


def test_the_net_of_a_curve_is_the_polygon_of_the_knots_that_are_present():
    """Property (g): with one weight to infinity, the polyline b_0 b_i b_n."""
    result = gtb("decompose", str(SPECS / "example-3.1.toml"), "--lifting", "0,0,1,0,0", "--net")
    assert lines(result.out) == [(0, 2), (2, 4)]


def test_the_usual_net_of_a_bezier_patch_needs_no_lifting():
    knots = load(SPECS / "bicubic.toml").knots
    apart = {(i, j) for i, j in combinations(range(16), 2) if np.abs(knots[i] - knots[j]).sum() == 1}
    assert set(lines(gtb("decompose", SPECS / "bicubic.toml", "--net").out)) == apart
    triangle = lines(gtb("decompose", SPECS / "bezier-triangle.toml", "--net").out)
    n = round((8 * len(load(SPECS / "bezier-triangle.toml").knots) + 1) ** 0.5 - 3) // 2
    assert len(triangle) == 3 * n * (n + 1) // 2
    assert lines(gtb("decompose", SPECS / "cubic-bezier.toml", "--net").out) == [(0, 1), (1, 2), (2, 3)]
    assert "has no lifting" in gtb("decompose", SPECS / "trapezoid.toml", "--net", status=2).err
    assert "has no lifting" in gtb("decompose", SPECS / "bicubic.toml", status=2).err


def test_polygons_go_around_their_cells():
    found = json.loads(gtb("decompose", SPECS / "example-4.4.toml", "--json").out)
    knots = load(SPECS / "example-4.4.toml").knots
    assert list(found) == ["cells", "polygons", "absent"]
    for cell, polygon in zip(found["cells"], found["polygons"], strict=True):
        assert set(polygon) <= set(cell)
        corners = knots[polygon]
        sides = np.roll(corners, -1, axis=0) - corners
        turns = sides[:, 0] * np.roll(sides, -1, axis=0)[:, 1] - sides[:, 1] * np.roll(sides, -1, axis=0)[:, 0]
        assert (turns > 0).all()


def test_the_output_names_the_format(tmp_path):
    target = tmp_path / "net.ply"
    assert gtb("decompose", str(SPECS / "pentagon.toml"), "--net", "-o", str(target)).status == 0
    assert target.read_bytes().startswith(b"ply\n")
    for options in (("-o", str(tmp_path / "net.stl")), ("--json",)):
        result = gtb("decompose", str(SPECS / "pentagon.toml"), "--net", *options)
        assert (result.status, result.out) == (2, b"")
        assert "--net" in str(result.err)
    assert [path.name for path in tmp_path.iterdir()] == ["net.ply"]
