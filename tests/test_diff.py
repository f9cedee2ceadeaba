"""`gtb diff`: what differs, by how much, and with which exit status."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gtb_cli.export import write_mesh
from gtb_cli.mesh import Mesh
from gtb_cli.patch import Patch
from gtb_cli.spec import dump, load
from gtb_cli.tessellation import tessellate
from tests.shell import CURVE, PENTAGON, gtb


def moved(by: float) -> Mesh:
    mesh = tessellate(load(PENTAGON), 8)
    vertices = mesh.vertices.copy()
    vertices[17, 2] += by
    return Mesh(vertices, mesh.cells, name="moved")


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb"])
def test_a_mesh_is_that_of_its_spec(kind, tmp_path):
    target = tmp_path / f"mesh.{kind}"
    assert gtb("mesh", PENTAGON, "-n", 8, "-o", target).status == 0
    result = gtb("diff", target, PENTAGON, "-n", 8, "--json")
    assert result.status == 0, result.err + result.text
    assert json.loads(result.out)["same"] is True


def test_a_vertex_that_moved_is_found(tmp_path):
    one, two = tmp_path / "one.obj", tmp_path / "two.obj"
    write_mesh(moved(0.0), one)
    write_mesh(moved(3e-6), two)
    found = json.loads(gtb("diff", one, two, "--json").out)
    assert (found["same"], found["method"]) == (False, "vertices")
    assert found["distance"] == pytest.approx(3e-6, abs=2e-8)
    assert gtb("diff", one, two).status == 1
    assert gtb("diff", one, two, "--tolerance", "4e-6").status == 0
    assert gtb("diff", one, two, "--tolerance", "1%").status == 0


def test_a_control_point_changed_by_a_millionth_of_the_size_is_found(tmp_path):
    patch = load(PENTAGON)
    size = float(np.linalg.norm(np.ptp(patch.control_points, axis=0)))
    points = patch.control_points.copy()
    points[3, 2] += 1e-6 * size
    changed = tmp_path / "changed.toml"
    changed.write_text(dump(Patch(patch.knots, points, patch.weights)))
    assert gtb("diff", PENTAGON, changed, "-n", 12).status == 1


def test_other_faces_are_compared_as_surfaces(tmp_path):
    found = json.loads(gtb("diff", PENTAGON, PENTAGON, "--json").out)
    assert found["same"] is True
    coarse, fine = tmp_path / "coarse.obj", tmp_path / "fine.obj"
    gtb("mesh", PENTAGON, "-n", 8, "-o", coarse)
    gtb("mesh", PENTAGON, "-n", 13, "-o", fine)
    found = json.loads(gtb("diff", coarse, fine, "--json").out)
    assert (found["same"], found["method"]) == (False, "surface")
    assert 1e-3 < found["distance"] < 0.5


def test_curves_are_compared_too(tmp_path):
    target = tmp_path / "curve.obj"
    gtb("mesh", CURVE, "-o", target)
    assert gtb("diff", target, CURVE).status == 0


@pytest.mark.parametrize("text", [b"", b"v 1 2\nf 1 2 3\n", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"])
def test_what_cannot_be_read_is_an_error_that_names_the_file(text, tmp_path):
    broken = tmp_path / "broken.obj"
    broken.write_bytes(text)
    result = gtb("diff", broken, PENTAGON)
    assert result.status == 2
    assert str(broken) in result.err
    assert "internal" not in result.err
