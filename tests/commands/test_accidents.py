"""What happens to people who start: each accident with the sentence that helps, and no file where it is an error."""

import re

import pytest

from gtb_cli.language.loading import load
from gtb_cli.tessellation.doubtful_corners import doubtful_corners
from gtb_cli.theory.patch import Patch
from tests.shell import gtb
from tests.specs import GOOD_SPECS

DOME = """name = "dome"
knots          = [[0, 0],    [40, 0],    [40, 40],    [0, 40],    [20, 20]]
control_points = [[0, 0, 0], [40, 0, 0], [40, 40, 0], [0, 40, 0], [20, 20, 30]]
weights = [1, 1, 1, 1, 5]
"""
HANDLE = 'knots = [0, 1, 2]\ncontrol_points = [[0, 0], [48, 60], [96, 0]]\n'  # fmt: skip
SOLID = "--thickness 2 -n 4 --require solid"


def test_a_curve_too_thick_for_its_bends_has_a_radius_that_is_tried(tmp_path):
    (tmp_path / "handle.toml").write_text(HANDLE, encoding="utf-8")
    done = gtb("mesh", tmp_path / "handle.toml", "--radius", 50, "-o", tmp_path / "handle.stl", status=0)
    radius = re.search(r"a radius of (\S+) was tried and is solid", done.err)[1]
    assert 10 < float(radius) < 50
    gtb("mesh", tmp_path / "handle.toml", "--radius", radius, "--require", "solid", "-o", tmp_path / "x.stl", status=0)
    larger = ["--radius", 1.05 * float(radius), "--require", "solid", "-o", tmp_path / "y.stl"]
    assert gtb("mesh", tmp_path / "handle.toml", *larger).status == 1  # it is nearly the largest


def test_files_of_windows_and_names_with_umlauts_and_blanks_are_well(tmp_path):
    """A byte order mark, ends of lines of Windows, and a name that the groups of a mesh file can hold."""
    text = DOME.replace("dome", "Schüssel für Ömi").replace("\n", "\r\n")
    path = tmp_path / "Schüssel für Ömi.toml"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    meshes = [tmp_path / f"Schüssel für Ömi.{suffix}" for suffix in ("obj", "stl", "ply", "glb")]
    for mesh in meshes:
        done = gtb("mesh", path, "-n", 4, "-o", mesh, status=0)
        assert "warning" not in done.err
        assert re.search("^vertices +25$", gtb("info", mesh, status=0).text, re.MULTILINE)
    path.write_bytes(text.encode("latin1"))
    assert "byte 0xfc (invalid start byte): save it as UTF-8" in gtb("mesh", path, status=2).err


def test_an_inverted_patch_of_a_model_is_turned(tmp_path):
    """The sides of a model agree where they can: the same solid comes of it."""
    text = gtb("new", "bowl", 5).text
    floor = "[[0, 0], [0, 1], [0, 2], [0, 3], [1, 0], [1, 1], [1, 2], [2, 0], [2, 1], [3, 0]]"
    lines = []
    for spec in (text, text.replace(floor, re.sub(r"\[(\d), (\d)\]", r"[\2, \1]", floor))):
        (tmp_path / "bowl.toml").write_text(spec, encoding="utf-8")
        done = gtb("mesh", tmp_path / "bowl.toml", *SOLID.split(), "-o", tmp_path / "bowl.stl", status=0)
        lines.append(done.err.split("bowl.stl: ")[1])
    assert lines[0] == lines[1]
    assert "closed, 115.4" in lines[0]


@pytest.mark.parametrize("path", GOOD_SPECS, ids=lambda path: path.stem)
def test_no_corner_of_a_good_spec_is_doubtful(path):
    assert doubtful_corners(load(path)) == []


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9, 1e90])
def test_exchanged_corners_are_found_at_any_scale_and_place(scale):
    around = [[1, 0, 0], [2, 0, 1], [3, 2, 0], [1, 3, 0], [0, 2, 1]]
    for order, sentence in (([0, 1, 2, 3, 4], None), ([0, 1, 2, 4, 3], "control points 3 and 4 were exchanged")):
        points = [[scale * x + 1e7 * scale for x in around[k]] for k in order]
        knots = [[x, y] for x, y, _ in around]
        found = doubtful_corners(Patch(knots, points))
        assert [line.split("as if ")[-1] for line in found] == ([sentence] if sentence else [])
