"""Isoparametric curves against the surface, in 50 digits and by command."""

from pathlib import Path

import numpy as np
import pytest

from gtb_cli.bezier.isocurve import isocurve, isoparametric_points
from gtb_cli.errors import DomainError
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.language.loading import parse
from gtb_cli.theory.patch import Patch
from tests import exact
from tests.patches import bicubic, cubic_curve, pentagon, repeated_knots
from tests.shell import BICUBIC, CURVE, PENTAGON, gtb

# A rectangle of real knots, two of them at the same height, with edges of different scale
REAL = Patch(
    [[0, 0], [2, 0], [2, 1.5], [0, 1.5], [0.3, 0.7], [1.9, 0.7], [1, 0]],
    [[0, 0, 0], [4, 0, 1], [4, 3, 0], [0, 3, 2], [1, 1, 5], [3, 1, -2], [2, 0, 3]],
    [1, 2, 3, 1, 5, 0.5, 2],
    edge_scale=[1, 2, 0.5, 1],
)


@pytest.mark.parametrize("patch", [bicubic(), REAL, repeated_knots()])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.9, 1.0])
def test_they_are_curves_of_the_surface(patch: Patch, axis: int, fraction: float) -> None:
    agreement = 1e-13
    low, high = patch.domain.vertices.min(axis=0), patch.domain.vertices.max(axis=0)
    value = float(low[axis] + fraction * (high[axis] - low[axis]))
    curve = isocurve(patch, axis, value)
    assert curve.dimension == 1
    assert len(np.unique(curve.knots)) == len(curve.knots)
    for t in np.linspace(low[1 - axis], high[1 - axis], 5):
        u = [value, t] if axis == 0 else [t, value]
        expected = [float(x) for x in exact.point(patch, u)]
        assert np.abs(curve.evaluate([t])[0] - expected).max() <= agreement * 10


def test_a_polyline_is_had_anywhere() -> None:
    parameters, points = isoparametric_points(pentagon(), 0, 1.0, 9)
    assert (parameters[:, 0] == 1).all()
    np.testing.assert_array_equal(points, pentagon().evaluate(parameters))
    heights = pentagon().domain.edge_functions(parameters)
    assert heights[0].min() == heights[-1].min() == 0
    assert heights[1:-1].min() > 0


@pytest.mark.parametrize(
    ("patch", "axis", "value", "message"),
    [
        (pentagon(), 0, 1.0, "is not a rectangle along the axes: isoparametric curves are not GT-Bézier curves"),
        (cubic_curve(), 0, 1.0, "is a curve"),
        (bicubic(), 1, 3.5, "v: expected 0 to 3, got 3.5"),
        (bicubic(), 0, float("nan"), "u: expected 0 to 3, got nan"),
    ],
)
def test_the_reason_where_there_are_none(patch: Patch, axis: int, value: float, message: str) -> None:
    with pytest.raises(DomainError, match=message):
        isocurve(patch, axis, value)


def test_a_corner_has_no_curve() -> None:
    triangle = Patch([[0, 0], [1, 0], [0, 1]], np.eye(3))
    with pytest.raises(DomainError, match="u: at 1 the domain has only a corner"):
        isoparametric_points(triangle, 0, 1.0, 5)


def test_a_polyline_is_written_as_the_suffix_says(tmp_path: Path) -> None:
    for suffix in ("obj", "ply", "glb"):
        output = tmp_path / f"x.{suffix}"
        assert gtb("isocurve", PENTAGON, "--u", "1", "--polyline", "4", "-o", output).status == 0
        assert read_mesh(output, suffix).cells.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    for name, message in [("x.png", "cannot tell the format of"), ("x.stl", "--polyline writes lines")]:
        result = gtb("isocurve", PENTAGON, "--u", "1", "--polyline", "4", "-o", tmp_path / name)
        assert result.status == 2
        assert message in result.err
        assert not (tmp_path / name).exists()


def test_on_the_command_line() -> None:
    curve = parse(gtb("isocurve", BICUBIC, "--v", "sqrt(2)").text)
    assert isinstance(curve, Patch)
    assert curve.name == "bicubic-v1.41421"
    lines = gtb("isocurve", PENTAGON, "--u", "1", "--polyline", "4").text.splitlines()
    assert [line.split()[0] for line in lines] == ["v"] * 5 + ["l"] * 4
    for arguments, message in [
        ([PENTAGON, "--u", "1"], "pentagon.toml: the domain is not a rectangle"),
        ([BICUBIC], "expected one of --u V and --v V"),
        ([BICUBIC, "--u", "1", "--v", "1"], "expected one of --u V and --v V"),
        ([CURVE, "--u", "1", "--polyline", "3"], "is a curve"),
    ]:
        result = gtb("isocurve", *arguments)
        assert result.status == 2
        assert message in result.err
