"""`gtb bezier` on the command line; the pieces themselves are tested in tests/bezier/test_pieces.py."""

from __future__ import annotations

import pytest

from gtb_cli.language.loading import parse
from gtb_cli.theory.model import Model
from tests.shell import CURVE, PENTAGON, SPECS, gtb

INTEGERS = SPECS / "example-4.1-integer.toml"


def test_the_pieces_are_a_model_that_mesh_takes() -> None:
    result = gtb("bezier", INTEGERS)
    assert result.status == 0
    pieces = parse(result.text)
    assert isinstance(pieces, Model)
    assert [piece.name for piece in pieces] == [f"example-4.1-integer-piece{i}" for i in range(5)]
    mesh = gtb("mesh", "-", "-n", "2", stdin=result.out)
    assert mesh.status == 0
    assert mesh.text.count("\nf ") == 5 * 2 * 2 * 2


def test_a_curve_is_split_at_an_expression() -> None:
    result = gtb("bezier", CURVE, "--split", "sqrt(2)")
    pieces = parse(result.text)
    assert isinstance(pieces, Model)
    assert len(pieces) == 2
    assert pieces.dimension == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([PENTAGON], "pentagon.toml: has Bézier pieces of degree 70 only: the distances of the knots from edge 0"),
        ([SPECS / "hexagon.toml"], "hexagon.toml: has no Bézier pieces: the distances of the knots from edge 0 have"),
        ([INTEGERS, "--split", "1"], "example-4.1-integer.toml: split: is for curves"),
        (
            [SPECS / "teapot.toml", "--split", "1"],
            "is a model of 32 patches, and --split is for one curve",
        ),
        ([CURVE, "--split", "0"], "split: expected a parameter between the ends 0 and 3, got 0"),
        ([CURVE, "--split", "1,2"], "--split: expected one parameter, got 2"),
        ([CURVE, "--max-degree", "2"], "degree 3 only"),
    ],
)
def test_the_reason_where_there_are_none(arguments: list[object], message: str) -> None:
    result = gtb("bezier", *arguments)
    assert result.status == 2
    assert result.out == b""
    assert message in result.err


def test_neighbours_that_divide_an_edge_elsewhere_are_told_of() -> None:
    spec = b"""
[[patches]]
knots = [[0, 0], [1, 0], [1, 1], [0, 1]]
control_points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
[[patches]]
knots = [[0, 0], [1, 0], [1, 1], [0, 1]]
weights = [1, 2, 2, 1]
control_points = [[1, 0, 0], [0, 0, 0], [0, -1, 0], [1, -1, 0]]
"""
    result = gtb("bezier", "-", stdin=spec)
    assert result.status == 0
    assert "4 edges of pieces are open where patches are joined" in result.err
