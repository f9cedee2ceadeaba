"""`gtb mesh`: axes, errors of one spec among several, and what holds for any spec, however large or collapsed."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.language.loading import parse
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from tests.marks import mostly_long
from tests.shell import PENTAGON, SPECS, gtb
from tests.specs import load

# --- axes


@pytest.mark.parametrize("name", mostly_long(["pentagon", "example-3.1", "hebesphenorotunda"], 2))
def test_y_is_up_in_glb_and_meshes_that_are_read_stand_as_in_the_spec(name, tmp_path):
    """glTF 2.0, section 3.3: +Y is up. So viewers show it, and trimesh gives the numbers of the file."""
    spec, path, lying, manifest = SPECS / f"{name}.toml", tmp_path / "a.glb", tmp_path / "z.glb", tmp_path / "m.json"
    low, high = tessellate(load(spec), 1).bounds
    upright = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]]
    for file, options, up, bounds in ((path, [], "y", upright), (lying, ["--up", "z"], "z", [low, high])):
        assert gtb("mesh", spec, "-n", 1, *options, "-o", file, "--manifest", manifest).status == 0
        found = json.loads(manifest.read_text())
        assert found["options"]["up"] == up
        np.testing.assert_allclose(found["files"][0]["bounds"], bounds, atol=1e-12)
        np.testing.assert_allclose(trimesh.load_scene(file).bounds, bounds, atol=1e-5)
        np.testing.assert_allclose(read_mesh(file).bounds, [low, high], atol=1e-5)
        same = gtb("diff", file, spec, "-n", 1)
        assert (same.status, ": the same " in same.text) == (0, True)
    turned = gtb("diff", path, lying)
    assert (turned.status, "no unit, y up against no unit, z up" in turned.text) == (1, True)


# --- one of several specs


@pytest.fixture
def several(tmp_path, monkeypatch):
    """Two specs, of which the first is called bad, in the working folder."""
    monkeypatch.chdir(tmp_path)
    Path("good.toml").symlink_to(PENTAGON)
    Path("bad.toml").write_text(Path(PENTAGON).read_text().replace('name = "pentagon"', 'name = "bad"'))
    return "mesh", "bad.toml", "good.toml", "-n", "2", "-o", "out"


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_internal_error_of_one_spec_leaves_the_others(jobs, several, monkeypatch):
    mesh = Recipe.mesh

    def broken(self, spec, rounding, *rest):
        if spec.name == "bad":
            raise IndexError("row 3")
        return mesh(self, spec, rounding)

    monkeypatch.setattr(Recipe, "mesh", broken)
    result = gtb(*several, "-j", jobs, status=2)
    assert "bad.toml: internal error, please report it: IndexError: row 3" in result.err
    assert os.listdir("out") == ["good.obj"]


def test_an_internal_error_in_the_middle_of_a_file_leaves_the_others(several, monkeypatch):
    encoded = MeshOptions.encoded

    def broken(self, mesh, kind):
        yield from encoded(self, mesh, kind)
        if mesh.name == "bad":
            raise IndexError("row 3")

    monkeypatch.setattr(MeshOptions, "encoded", broken)
    assert "bad.toml: internal error" in gtb(*several, "--manifest", "m.json", status=2).err
    assert os.listdir("out") == ["good.obj"]
    assert [entry["file"] for entry in json.loads(Path("m.json").read_text())["files"]] == ["out/good.obj"]


def test_a_terminal_gets_no_thousands_of_lines(monkeypatch):
    monkeypatch.setattr("gtb_cli.commands.mesh.is_terminal", lambda output: output == "-")
    assert gtb("mesh", PENTAGON, "-n", "2").out.startswith(b"v ")
    result = gtb("mesh", PENTAGON, status=2)
    assert result.out == b""
    assert "lines, and standard output is a terminal: give -o FILE" in result.err


# --- any spec


KNOTS = {"tiny": lambda knots: knots * 1e-9, "huge": lambda knots: knots * 1e9, "far": lambda knots: knots + 1e7}


def is_disc(mesh: Mesh) -> bool:
    """Tell whether a mesh is in one piece, with one boundary and no handles; of a curve, with two ends."""
    if mesh.is_curve:
        return len(np.unique(mesh.cells)) - len(mesh.cells) == 1
    body = mesh.to_trimesh()
    return (body.euler_number, body.body_count) == (1, 1)


@pytest.mark.parametrize("options", [{"resolution": 5}, {"tolerance": "10%"}], ids=str)
@pytest.mark.parametrize("move", KNOTS)
@pytest.mark.parametrize("name", mostly_long(["cubic-bezier", "pentagon", "bezier-triangle", "repeated-knot"], 2))
def test_knots_may_be_tiny_huge_or_far_away(name, move, options):
    patch = load(SPECS / f"{name}.toml")
    theirs = tessellate(patch.replace(knots=KNOTS[move](patch.knots)), **options)
    assert is_disc(theirs)
    if "resolution" in options:
        assert np.array_equal(tessellate(patch, **options).cells, theirs.cells)


SQUARE = "knots = [[0, 0], [1, 0], [0, 1], [1, 1]]\n"

COLLAPSED = {
    "an edge": f"{SQUARE}control_points = [[0, 0, 0], [0, 0, 0], [0, 1, 1], [1, 1, 0]]\n",
    "two edges": f"{SQUARE}control_points = [[0, 0, 0], [0, 0, 0], [1, 1, 1], [1, 1, 1]]\n",
    "to a line": f"{SQUARE}control_points = [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]\n",
    "to a point": f"{SQUARE}control_points = [[1, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 3]]\n",
    "a fold": "knots = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]\n"
    "control_points = [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0], [0, 1, 0]]\n",
    "weights": f"{SQUARE}weights = [1e-300, 1e300, 1, 1e-10]\n"
    "control_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1], [1, 1, 0]]\n",
    "tiny": f"{SQUARE}control_points = [[0, 0, 0], [1e-310, 0, 0], [0, 1e-310, 1e-310], [1e-310, 1e-310, 0]]\n",
    "huge": f"{SQUARE}control_points = [[0, 0, 0], [1e30, 0, 0], [0, 1e30, 1e30], [1e30, 1e30, 0]]\n",
    "a curve to a point": "knots = [0, 1, 2]\ncontrol_points = [[1, 1], [1, 1], [1, 1]]\n",
    "ends of a curve": "knots = [0, 1, 2, 3]\ncontrol_points = [[1, 1], [1, 1], [2, 2], [2, 2]]\n",
}


def numbers_of_glb(data: bytes) -> np.ndarray:
    """All numbers of a GLB file that its description does not declare whole."""
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    assert not re.search(rb"NaN|Infinity", data[20 : 20 + length])
    found = []
    for accessor in tree["accessors"]:
        if accessor["componentType"] == 5126:
            view = tree["bufferViews"][accessor["bufferView"]]
            count = accessor["count"] * {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
            start = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            found.append(np.frombuffer(data, "<f4", count, start))
    return np.concatenate(found)


CURVATURE = ["--attribute", "gaussian_curvature", "--attribute", "mean_curvature"]

SHAPES = (["-n", "4"], ["-n", "3", "--parametrization", "linear"], ["--tolerance", "0.2"])

TEXTS = COLLAPSED | {name: (SPECS / f"{name}.toml").read_text("utf-8") for name in ("teapot", "repeated-knot")}


@pytest.mark.parametrize("name", mostly_long(TEXTS, 2))
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as the command does: what overflows must not come out
def test_no_file_has_a_number_that_is_none(name):
    text = TEXTS[name].encode()
    spec = parse(text)
    model = isinstance(spec, Model)
    kinds = [["obj", "--normals"], ["ply", "--ascii", "--normals", *CURVATURE]]
    kinds += [["stl", "--ascii"], ["glb", "--normals"]]
    if model:
        del kinds[1:3]  # no attributes; and STL has the vertices of OBJ
    elif spec.dimension == 1:
        kinds = [["obj"], ["ply", "--ascii"], ["glb"]]
    for shape in SHAPES[:1] if model else SHAPES:
        for kind in kinds:
            result = gtb("mesh", "-", "-f", *kind, *shape, stdin=text)
            if name == "huge" and "--tolerance" in shape:
                assert result.status == 2
                continue
            assert result.status == 0, result.err
            if kind[0] == "glb":
                assert np.isfinite(numbers_of_glb(result.out)).all()
            else:
                assert not re.search(rb"\b(?:nan|inf)\b", result.out, re.IGNORECASE)
