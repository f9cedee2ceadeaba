"""The folder specs/: what its files and their table say, against the paper and against each other."""

import re
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from tests.specs import GOOD_SPECS, SPECS, load, spec

ROUNDING = 4e-16  # relative: one or two float operations


@pytest.mark.parametrize("path", GOOD_SPECS, ids=lambda path: path.name)
def test_specs_load_and_name_their_source(path: Path) -> None:
    load(path)
    lines = path.read_text(encoding="utf-8").split("\n")
    comment = " ".join(line[2:] for line in lines if line.startswith("#"))
    assert lines[0].startswith("# ")
    assert re.search(r"Li & Zhu|Newell|[Mm]ade up for this collection|textbook", comment)


def test_the_table_of_specs_is_complete_and_true() -> None:
    table = (SPECS / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[`(.*?)`\]\((.*?)\) \| (\w+)(?:, (\d+) (?:edges|patches))? \| (\d+)[ ,]", table, re.M)
    assert sorted(name for name, *_ in rows) == [path.name for path in GOOD_SPECS]
    for name, target, kind, parts, knots in rows:
        found = load(SPECS / target)
        assert name == target
        if isinstance(found, Model):
            assert (kind, int(parts)) == ("model", len(found.patches))
            assert sum(len(patch.knots) for patch in found.patches) == int(knots)
        elif found.dimension == 1:
            assert (kind, parts, int(knots)) == ("curve", "", len(found.knots))
        else:
            assert (kind, int(parts), int(knots)) == ("surface", len(found.domain.vertices), len(found.knots))


def test_curves_of_the_paper() -> None:
    root = 2**0.5
    points = [[0, 0, 0], [0.4, 1.3, 0], [2, 2, 0], [3.7, 1.5, 0], [4, 0, 0]]
    knots = [[0], [root / 4], [1 / 2], [root / 2], [1]]
    assert spec("example-2.1").knots.tolist() == knots
    assert spec("example-2.1").coefficients.tolist() == [0.5, 1, 1.5, 0.7, 0.9]
    for name in ("example-3.1", "example-3.4", "example-3.4-polygon"):
        assert spec(name).knots.tolist() == knots
        assert spec(name).weights.tolist() == [1, 10, 20, 6, 5]
        assert spec(name).control_points.tolist() == points
    assert spec("example-3.4").lifting.tolist() == [2, 1, 5, 9 - 4 * root, 1]  # type: ignore[union-attr]
    assert spec("example-3.4-polygon").lifting.tolist() == [0, 2.5, 3, 2.5, 0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("name", "origin", "moved", "target"),
    [
        ("example-3.2", "example-3.1", [1], 2),
        ("example-3.3", "example-3.1", [1, 3], 2),
        ("example-4.2-limit", "example-4.2", [3], 1),
    ],
)
def test_merged_specs_are_the_limits_of_theorems_3_1_and_4_1(name: str, origin: str, moved: list[int], target: int):
    start, merged = spec(origin), spec(name)
    kept = [i for i in range(len(start.knots)) if i not in moved]
    together = [target, *moved]
    place = kept.index(target)
    weights = start.weights.copy()
    weights[target] = start.weights[together].sum()
    points = start.control_points.copy()
    points[target] = start.weights[together] @ start.control_points[together] / start.weights[together].sum()
    assert merged.knots.tolist() == start.knots[kept].tolist()
    assert merged.weights.tolist() == weights[kept].tolist()
    np.testing.assert_allclose(merged.control_points, points[kept], rtol=ROUNDING)
    assert merged.weights[place] == {"example-3.2": 30, "example-3.3": 36, "example-4.2-limit": 9}[name]


def test_surfaces_of_the_paper() -> None:
    integer = [[0, 2], [1, 2], [0, 1], [1, 1], [2, 1], [0, 0], [1, 0], [2, 0]]
    real = [[0, 2], [1, 2], [0, 6 / 5], [8 / 7, 8 / 7], [2, 1], [0, 0], [6 / 5, 0], [2, 0]]
    heights = dict.fromkeys(("example-4.1-integer", "example-4.1", "example-4.2", "pentagon"), 5.0)
    for name, height in {**heights, "example-4.4": 18.0}.items():
        patch = spec(name)
        assert patch.knots.tolist() == (integer if "integer" in name else real)
        assert patch.weights.tolist() == [2, 2, 5, 7, 2, 3, 5, 2]
        assert patch.coefficients.tolist() == [1] * 8
        assert patch.control_points[:, :2].tolist() == real
        assert patch.control_points[:, 2].tolist() == [0, 4, 2, height, 2, 0, 2, 0]
    for name in ("pentagon", "example-4.4"):
        assert spec(name).lifting.tolist() == [1, 0, 3, 2, 0, 1, 3, 1]  # type: ignore[union-attr]


def test_the_cubic_bezier_curve_is_half_a_circle() -> None:
    points = spec("cubic-bezier").evaluate(np.linspace(0, 3, 101))
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 1, rtol=4 * ROUNDING)
    assert points[0].tolist() == [1, 0, 0]
    assert points[-1].tolist() == [-1, 0, 0]
    assert (np.diff(points[:, 0]) < 0).all()


def test_the_double_knot_is_the_merged_knot_of_its_comment() -> None:
    patch = spec("repeated-knot")
    keep = [i for i in range(10) if i != 5]
    weights, points = patch.weights.copy(), patch.control_points.copy()
    weights[4], points[4] = 4, (1, 1, 3)
    merged = Patch(patch.knots[keep], points[keep], weights[keep])
    u = np.random.default_rng(1).random((50, 2)) * 2
    np.testing.assert_allclose(patch.evaluate(u), merged.evaluate(u), rtol=1e-14)  # ten terms' roundings


def test_irrational_knots_of_the_hexagon() -> None:
    patch = spec("hexagon")
    assert patch.domain.incidence.sum(axis=0).tolist() == [3] * 6  # two corners and one knot on every edge
    for edge in range(6):
        start, middle, end = patch.knots[patch.domain.edge_knots(edge)]
        share = np.linalg.norm(middle - start) / np.linalg.norm(end - start)
        assert share == pytest.approx(2**0.5 / 2, rel=4 * ROUNDING)
    inside = np.linalg.norm(patch.knots[12:18], axis=1)
    np.testing.assert_allclose(inside, 4 * (5**0.5 - 1) / 2, rtol=2 * ROUNDING)
    np.testing.assert_allclose(patch.control_points[:, :2], patch.knots)
