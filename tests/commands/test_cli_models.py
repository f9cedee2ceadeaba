"""Models on the command line: what is open is named, and what is closed says so."""

from pathlib import Path

import numpy as np
import pytest

from gtb_cli.meshes.mesh import Mesh
from tests.marks import mostly_long
from tests.shell import gtb

SPECS = Path(__file__).parents[2] / "specs"
TEAPOT, CLOSED = SPECS / "teapot.toml", SPECS / "hebesphenorotunda.toml"


@pytest.mark.parametrize("size", mostly_long([["-n", "5"], ["--tolerance", "1%"]]))
def test_a_closed_model_passes(size, tmp_path):
    target = tmp_path / "closed.stl"
    result = gtb("mesh", str(CLOSED), *size, "--require", "watertight", "-o", str(target))
    assert result.status == 0
    assert target.exists()


def test_open_sides_are_those_without_one_opposite():
    corners = np.eye(4, 3)
    closed = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    assert len(Mesh(corners, closed).open_sides) == 0
    assert sorted(map(tuple, Mesh(corners, closed[1:]).open_sides.tolist())) == [(0, 1), (1, 2), (2, 0)]
    turned = closed.copy()
    turned[0] = turned[0, ::-1]
    assert len(Mesh(corners, turned).open_sides) == 6
    assert len(Mesh(corners, np.vstack([closed, [[0, 1, 2]]])).open_sides) > 0
