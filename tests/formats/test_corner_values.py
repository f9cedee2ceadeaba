"""Normals, texture coordinates and attributes: read from files of each format, and compared."""

import re

import numpy as np
import pytest

from gtb_cli import GtbError, Mesh, diff, tessellate, write_mesh
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.mesh import NORMALS, TEXTURE
from tests.patches import pentagon
from tests.shell import gtb


@pytest.fixture(scope="module")
def mesh():
    made = tessellate(pentagon(), 3)
    return Mesh(made.vertices, made.cells, made.parameters, made.normals, attributes={"heat": made.vertices[:, 2]})


def held(path):
    known = decode_mesh(path.read_bytes(), str(path))
    return {name: rows[of] for name, (rows, of) in known.values().items()}


@pytest.mark.parametrize("kind", ["obj", "ply", "glb"])
@pytest.mark.parametrize("up", ["z", "y"])
def test_what_was_written_is_read(tmp_path, mesh, kind, up):
    path = tmp_path / f"a.{kind}"
    write_mesh(mesh, path, normals=True, uv=True, up=up)
    found = held(path)
    normals = (mesh.with_y_up if up == "y" and kind != "glb" else mesh).normals[mesh.cells]
    assert np.abs(found[NORMALS] - normals).max() < 1e-6
    assert np.abs(found[TEXTURE] - mesh.parameters[mesh.cells]).max() < 1e-6
    assert ("heat" in found) == (kind == "ply")


def test_a_part_of_a_glb_file_that_is_turned_turns_its_normals(tmp_path):
    assert gtb("mesh", "specs/box-corner.toml", "-n", "3", "-q", "-o", tmp_path / "a.glb", status=0).status == 0
    import trimesh

    scene = trimesh.load_scene(tmp_path / "a.glb")
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])
    scene.apply_transform(turn)
    (tmp_path / "b.glb").write_bytes(scene.export(file_type="glb", include_normals=True))
    one, other = held(tmp_path / "a.glb"), held(tmp_path / "b.glb")
    to_z_up = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    moved = one[NORMALS].reshape(-1, 3) @ (to_z_up @ turn[:3, :3] @ to_z_up.T).T
    assert sorted(map(tuple, moved.round(4) + 0.0)) == sorted(map(tuple, other[NORMALS].reshape(-1, 3).round(4) + 0.0))


@pytest.mark.parametrize(
    ("kind", "edit", "said"),
    [
        ("obj", (rb"(?m)^vn .*", b"vn 0 0 -1"), "normals: up to"),
        ("obj", (rb"(?m)^vn .*", b"vn 0 0 0"), "normals: at 135 corners in one of them only"),
        ("obj", (rb"(?m)^vt 0\.0.*", b"vt 0.5 0.5"), "texture coordinates: up to"),
        ("obj", (rb"/\d+/", b"//"), "texture coordinates: only in the first"),
        ("obj", (rb"(f \d+)/\d+/", rb"\1//"), "texture coordinates: at 45 corners in one of them only"),
        ("ply", (rb"(?m)^((?:\S+ ){8})(0\.\S+)$", rb"\1 0.77"), "heat: up to"),
        ("ply", (rb"property \S+ heat", b"property float heat2"), "heat2: only in the second"),
    ],
)
def test_a_change_is_a_difference_unless_it_is_ignored(tmp_path, mesh, kind, edit, said):
    first, second = tmp_path / f"a.{kind}", tmp_path / f"b.{kind}"
    write_mesh(mesh, first, normals=True, uv=True, ascii=True)
    second.write_bytes(re.sub(*edit, first.read_bytes()))
    found = diff(first, second)
    assert (found.same, any(said in each for each in found.values)) == (False, True)
    assert diff(first, second, ignore="attributes").same
    assert said in gtb("diff", first, second, status=1).text


def test_files_of_other_formats_are_compared_in_what_both_hold(tmp_path, mesh):
    for kind in ("obj", "ply", "glb", "stl"):
        write_mesh(mesh, tmp_path / f"a.{kind}", normals=kind != "stl" or None, uv=kind != "stl")
    assert all(diff(tmp_path / "a.obj", tmp_path / f"a.{kind}").same for kind in ("ply", "glb", "stl"))
    turned = Mesh(mesh.vertices, mesh.cells, normals=-mesh.normals)
    write_mesh(turned, tmp_path / "b.obj", normals=True)
    same = [diff(tmp_path / "b.obj", tmp_path / f"a.{kind}").same for kind in ("ply", "glb", "stl")]
    assert same == [False, False, True]


def test_corners_are_compared_whatever_the_order_of_faces(tmp_path, mesh):
    write_mesh(mesh, tmp_path / "a.ply", normals=True, uv=True)
    order = np.random.default_rng(1).permutation(len(mesh.cells))
    cells = np.array([np.roll(cell, k % 3) for k, cell in enumerate(mesh.cells[order])])
    number = np.random.default_rng(2).permutation(len(mesh.vertices))
    place = np.argsort(number)
    other = Mesh(mesh.vertices[number], place[cells], mesh.parameters[number], mesh.normals[number],
                 attributes={"heat": mesh.attributes["heat"][number]})  # fmt: skip
    write_mesh(other, tmp_path / "b.ply", normals=True, uv=True)
    assert diff(tmp_path / "a.ply", tmp_path / "b.ply").same
    assert diff(mesh, other).same
    hot = Mesh(other.vertices, other.cells, attributes={"heat": other.attributes["heat"] * 1.001})
    assert not diff(mesh, hot).same


def test_references_may_count_back_and_leave_out(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nvt 0 0\nvn 0 0 1\nv 0 1 0\nvt 1 0\nf 1/1/1 2/-1/-1 -1\n")
    found = held(tmp_path / "a.obj")
    assert np.array_equal(found[TEXTURE][0], [[0, 0], [1, 0], [np.nan, np.nan]], equal_nan=True)
    assert np.array_equal(found[NORMALS][0], [[0, 0, 1], [0, 0, 1], 3 * [np.nan]], equal_nan=True)


@pytest.mark.parametrize(
    "text", [b"mtllib\nKd 1 0 0\rmap_Kd p.png\r", b"mtllib\nmap_Kd \\\n p.png\n", b"maplib\nbump p.png"]
)
def test_each_byte_of_pictures_that_libraries_name_counts(tmp_path, text):
    keyword, _, content = text.partition(b"\n")
    for folder, picture in (("a", b"old"), ("b", b"new"), ("c", b"old")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "m.mtl").write_bytes(content if folder != "c" else content.replace(b"\r", b"\r\n"))
        (tmp_path / folder / "p.png").write_bytes(picture)
        (tmp_path / folder / "x.obj").write_bytes(keyword + b" m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemap q\nf 1 2 3\n")
    a, b, c = (tmp_path / folder / "x.obj" for folder in "abc")
    assert (diff(a, b).values, diff(a, c).same) == (("other data: libraries and pictures: not the same",), True)


def test_libraries_that_name_too_many_files_are_refused(tmp_path):
    (tmp_path / "m.mtl").write_text("".join(f"map_Kd {k}\n" for k in range(10_001)))
    for name in "ab":
        (tmp_path / name).write_text(f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {name}\nf 1 2 3\n")
    with pytest.raises(GtbError, match="names more than 10000 files"):
        diff(tmp_path / "a", tmp_path / "b")
