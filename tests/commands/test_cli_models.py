"""Models on the command line: what is open is named, and what is closed says so."""

from __future__ import annotations

import json
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


def test_the_teapots_openings_are_named_and_nothing_is_written(tmp_path):
    target = tmp_path / "teapot.stl"
    target.write_bytes(b"old")
    result = gtb("mesh", str(TEAPOT), "-n", "2", "--require", "watertight", "-o", str(target))
    assert result.status == 1
    lines = result.err.splitlines()
    assert len(lines) == 6  # one for each opening
    ring = "lid-1 edge 2 is open, in a ring with lid-2 edge 2, lid-4 edge 2, lid-3 edge 2"
    assert f"gtb: error: {TEAPOT}: not watertight: {ring}" in lines
    assert target.read_bytes() == b"old"


def test_a_single_patch_is_open_and_its_solid_is_not(tmp_path):
    spec = str(SPECS / "pentagon.toml")
    assert gtb("mesh", spec, "-n", "3", "--require", "watertight").status == 1
    solid = gtb("mesh", spec, "-n", "3", "--thickness", "0.1", "--require", "watertight", "-o", str(tmp_path / "s.stl"))
    assert solid.status == 0


def test_info_says_what_is_shared_and_what_is_open():
    closed = json.loads(gtb("info", str(CLOSED), "--json").out)
    assert closed["closed"] is True
    assert closed["open_edges"] == []
    teapot = json.loads(gtb("info", str(TEAPOT), "--json").out)
    assert (teapot["closed"], teapot["shared_edges"], len(teapot["open_edges"])) == (False, 52, 16)
    assert len(teapot["collapsed_edges"]) == 8


def test_open_sides_are_those_without_one_opposite():
    corners = np.eye(4, 3)
    closed = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    assert len(Mesh(corners, closed).open_sides) == 0
    assert sorted(map(tuple, Mesh(corners, closed[1:]).open_sides.tolist())) == [(0, 1), (1, 2), (2, 0)]
    turned = closed.copy()
    turned[0] = turned[0, ::-1]
    assert len(Mesh(corners, turned).open_sides) == 6
    assert len(Mesh(corners, np.vstack([closed, [[0, 1, 2]]])).open_sides) > 0


def test_edges_between_the_same_vertices_are_reported(tmp_path):
    """The halves of a ring, with one segment each, are one side of four triangles."""
    target = str(tmp_path / "teapot.obj")
    one, two = (gtb("mesh", str(TEAPOT), "-n", n, "-o", target) for n in "12")
    assert one.status == two.status == 0
    assert "with -n 1 edges of patches that have the same ends are one: 2 sides have more than two faces" in one.err
    assert "; -n 3 keeps them apart" in one.err
    assert "warning" not in two.err


def test_a_patch_that_closes_on_itself_is_joined_as_a_model(tmp_path):
    """A band of degree 5 by 1 whose first and last columns of control points are the same."""
    ring = [(1, 0), (1, 3), (-3, 3), (-3, -3), (1, -3), (1, 0)]
    knots = [[i, j] for j in range(2) for i in range(6)]
    points = [[x, y, z] for z in (0, 1) for x, y in ring]
    patch = {"name": "band", "knots": knots, "control_points": points, "coefficients": "binomial"}
    for name, spec in (("patch", patch), ("model", {"patches": [patch]})):
        (tmp_path / f"{name}.json").write_text(json.dumps(spec), encoding="utf-8")
    alone = gtb("mesh", str(tmp_path / "patch.json"), "--require", "watertight")
    assert alone.status == 1
    assert "band edge 1 and edge 3 are the same curve, but only the edges of models are joined" in alone.err
    joined = gtb("mesh", str(tmp_path / "model.json"), "--require", "watertight")
    assert joined.status == 1
    assert len(joined.err.splitlines()) == 2
    solid = ("--thickness", "0.1", "--require", "watertight", "-o", str(tmp_path / "band.stl"))
    assert gtb("mesh", str(tmp_path / "model.json"), *solid).status == 0


def test_an_stl_file_of_an_open_surface_says_so(tmp_path):
    """A slicer would take it, and print something else."""
    way_out = ", open: --thickness D makes a solid"
    for name, options, is_open in (
        ("pentagon", (), True),
        ("pentagon", ("--thickness", 0.1), False),
        ("box-corner", (), True),
        ("hebesphenorotunda", (), False),
    ):
        result = gtb("mesh", SPECS / f"{name}.toml", "-n", 2, *options, "-o", tmp_path / "x.stl")
        assert (way_out in result.err) == is_open
    assert way_out not in gtb("mesh", SPECS / "pentagon.toml", "-n", 2, "-o", tmp_path / "x.obj").err
