"""`gtb diff`: what differs, by how much, and with which exit status."""

import contextlib
import json
import os
import shlex
import shutil
import subprocess
import threading
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from gtb_cli.formats.export import write_mesh
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.tessellate import tessellate
from tests.marks import long
from tests.shell import PENTAGON, command, gtb, shell
from tests.specs import load
from tests.tiny_meshes import model, plane, surface


def moved(by: float) -> Mesh:
    mesh = tessellate(load(PENTAGON), 8)
    vertices = mesh.vertices.copy()
    vertices[17, 2] += by
    return Mesh(vertices, mesh.cells, name="moved")


def test_a_vertex_that_moved_is_found(tmp_path):
    one, two = tmp_path / "one.obj", tmp_path / "two.obj"
    write_mesh(moved(0.0), one)
    write_mesh(moved(3e-6), two)
    found = json.loads(gtb("diff", one, two, "--json", status=1).out)
    assert (found["same"], found["method"]) == (False, "vertices")
    assert found["distance"] == pytest.approx(3e-6, abs=2e-8)
    assert gtb("diff", one, two).status == 1
    assert gtb("diff", one, two, "--tolerance", "4e-6").status == 0
    assert gtb("diff", one, two, "--tolerance", "1%").status == 0


@pytest.mark.parametrize("text", [b"", b"v 1 2\nf 1 2 3\n", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"])
def test_what_cannot_be_read_is_an_error_that_names_the_file(text, tmp_path):
    broken = tmp_path / "broken.obj"
    broken.write_bytes(text)
    result = gtb("diff", broken, PENTAGON)
    assert result.status == 2
    assert str(broken) in result.err
    assert "internal" not in result.err


def endless(pipe: Path, data: bytes) -> None:
    """Make a pipe that gives the same data for ever."""
    os.mkfifo(pipe)

    def write() -> None:
        with contextlib.suppress(BrokenPipeError), pipe.open("wb") as file:
            while True:
                file.write(data)

    threading.Thread(target=write, daemon=True).start()


@pytest.mark.parametrize("source", ["device", "sparse file", "pipe"])
def test_what_has_no_end_is_not_read_to_it(source, tmp_path):
    path = tmp_path / "endless"
    if source == "device":
        path = Path("/dev/zero")
    elif source == "sparse file":
        path.touch()
        os.truncate(path, 1 << 32)
    else:
        endless(path, b"y\n" * 50_000)
    gtb("diff", PENTAGON, PENTAGON)  # what is imported does not count
    tracemalloc.start()
    result = gtb("diff", path, PENTAGON)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert result.status == 2
    assert ("a spec has at most" if source == "pipe" else "is neither a mesh nor a spec") in result.err
    assert peak < 50e6


def test_a_mesh_without_end_is_not_read_to_it(tmp_path, monkeypatch):
    monkeypatch.setattr("gtb_cli.formats.meshfiles.MAX_STREAM_BYTES", 1 << 20)
    pipe = tmp_path / "pipe.obj"
    endless(pipe, b"v 0 0 0\n" * 5_000)
    result = gtb("diff", pipe, PENTAGON, status=2)
    assert "pipe.obj: does not end within 1 MB; more is read only from files" in result.err
    large = tmp_path / "large.obj"
    large.write_bytes(b"v 0 0 0\n" * 200_000 + b"l 1 2\n")
    assert gtb("diff", large, large).status == 0


def test_what_could_not_be_proved_is_said_everywhere(tmp_path, monkeypatch):
    monkeypatch.setattr("gtb_cli.meshes.hausdorff.MAX_CUTS", 0)
    for n in (5, 7):
        write_mesh(plane(n), tmp_path / f"{n}.obj")
    result = gtb("diff", tmp_path / "5.obj", tmp_path / "7.obj", "-q")
    assert result.status == 0
    assert "not proved: at most 0." in result.text
    result = gtb("diff", tmp_path / "5.obj", tmp_path / "7.obj", "--json")
    found = json.loads(result.out)
    assert (found["same"], found["proved"]) == (True, False)
    assert found["bound"] > found["tolerance"]
    assert "warning" in result.err


def test_a_tolerance_that_the_file_cannot_hold_is_said(tmp_path):
    for suffix in ("ply", "stl"):
        write_mesh(surface(5), tmp_path / f"x.{suffix}")
    result = gtb("diff", tmp_path / "x.ply", tmp_path / "x.stl", "--tolerance", "1e-12", "--json", status=0)
    found = json.loads(result.out)
    assert found["asked_tolerance"] == 1e-12 < found["tolerance"] == found["resolution"]
    assert "instead of 1e-12: the numbers in the files are no finer" in result.err
    assert "instead of 1e-12" in found["warnings"][0]


def test_the_part_of_a_model_that_differs_is_named(tmp_path):
    mesh = model()
    vertices = mesh.vertices.copy()
    vertices[mesh.cells[mesh.groups[1][1], 0], 0] += 0.01
    write_mesh(mesh, tmp_path / "one.obj")
    write_mesh(Mesh(vertices, mesh.cells, groups=mesh.groups), tmp_path / "two.obj")
    result = gtb("diff", tmp_path / "one.obj", tmp_path / "two.obj")
    assert result.status == 1
    assert " of right: (" in result.text


@pytest.fixture
def folders(tmp_path):
    """Two folders with the same meshes, one of them in a folder within."""
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        (folder / "inner").mkdir(parents=True)
        write_mesh(surface(3), folder / "a.obj")
        write_mesh(surface(4), folder / "inner" / "b.ply")
        (folder / "manifest.json").write_text(json.dumps({"versions": str(folder), "options": {}, "files": []}))
        (folder / ".hidden.obj").write_text(str(folder))
    return one, two


@pytest.mark.parametrize("name", ["a.obj", "z.obj", "inner", "z"])
@pytest.mark.parametrize("target", ["nothing", "itself"])
def test_a_link_that_leads_nowhere_does_not_hide_the_rest(folders, name, target):
    one, two = folders
    link = one / name
    if link.is_dir():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(name if target == "itself" else target)
    result = gtb("diff", one, two)
    same = 2 if name.startswith("z") else 1
    counts = f"{same} same, 0 different, 0 missing, 0 extra, 1 unreadable"
    assert (result.status, result.text.splitlines()[-1]) == (2, counts)
    assert result.err.count(str(link)) == 1
    assert json.loads(gtb("diff", one, two, "--json", status=2).out)["errors"][0]["name"] == name


def test_linked_folders_are_compared_too(folders):
    for folder, n in zip(folders, (3, 5), strict=True):
        (folder / "inner").rename(folder.parent / f"real-{folder.name}")
        (folder / "inner").symlink_to(folder.parent / f"real-{folder.name}")
        (folder / "inner" / "loop").symlink_to(folder)
        write_mesh(surface(n), folder / "inner" / "b.ply")
    (folders[0] / "again").symlink_to(folders[0] / "inner")
    (folders[1] / "again").symlink_to(folders[1] / "inner")
    result = gtb("diff", *folders)
    assert (result.status, result.text.splitlines()[-1]) == (1, "1 same, 2 different, 0 missing, 0 extra")


def test_a_tolerance_of_zero_is_what_the_files_can_hold(tmp_path):
    one, two = tmp_path / "one.obj", tmp_path / "two.obj"
    write_mesh(moved(0.0), one)
    write_mesh(moved(1e-6), two)
    result = gtb("diff", one, PENTAGON, "-n", 8, "--tolerance", 0)
    assert (result.status, result.err) == (0, "")
    assert gtb("diff", one, two, "--tolerance", 0).status == 1
    assert gtb("diff", one, two, "--tolerance", -1).status == 2


def test_numbers_with_a_star_look_different(tmp_path):
    one, two = tmp_path / "one.obj", tmp_path / "two.obj"
    write_mesh(surface(8), one)
    mesh = surface(9)
    write_mesh(Mesh(mesh.vertices * (1 + 1e-12), mesh.cells), two)
    text = gtb("diff", one, two, "--tolerance", 1e-15, status=1).text
    rows = [line.split() for line in text.splitlines() if line.endswith("*")]
    assert rows
    assert all(row[-2] != row[-3] for row in rows)


def test_what_is_in_the_same_place_and_yet_different_is_said(folders):
    """By the status, in the text and in JSON, also of folders; and in a warning if it is ignored."""
    one, two = folders
    cells = surface(3).cells.copy()
    cells[4] = cells[4, ::-1]
    write_mesh(Mesh(surface(3).vertices, cells), two / "a.obj")
    write_mesh(Mesh(surface(4).vertices, surface(4).cells[:-1]), two / "inner" / "b.ply")
    result = gtb("diff", one, two, "--tolerance", "50%", "-q", status=1)
    assert "1 face is turned over\n" in result.text
    assert "in the same place, but 1 against 0 faces that the other has not" in result.text
    found = json.loads(gtb("diff", one, two, "--tolerance", "50%", "--json", status=1).out)
    assert [(entry["same"], entry["turned_faces"], len(entry["remarks"])) for entry in found["files"]] == [
        *((False, 1, 0), (False, 0, 2))
    ]
    result = gtb("diff", one, two, "--tolerance", "50%", "--ignore", "orientation, connectivity", status=0)
    assert "1 face is turned over, which is ignored" in result.err
    assert "2 same, 0 different" in result.text
    assert (
        gtb("diff", one, two, "--tolerance", "50%", "--ignore", "orientation", status=1).text.count("different:") == 1
    )
    assert "got 'colour'" in gtb("diff", one, two, "--ignore", "orientation,colour", status=2).err


def test_equal_bytes_are_compared_at_once(tmp_path, monkeypatch):
    """Those of meshes: specs with equal bytes may include others, and what cannot be read is no mesh."""
    for folder, height in (("one", 1), ("two", 2)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "part.toml").write_text(
            f"knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, {height}]]\n"
        )
        (tmp_path / folder / "whole.toml").write_text('include = ["part.toml"]\n')
        (tmp_path / folder / "garbage.stl").write_bytes(b"garbage")
        for suffix in ("obj", "stl", "ply", "glb"):
            write_mesh(surface(5), tmp_path / folder / f"x.{suffix}")
    assert gtb("diff", tmp_path / "one" / "whole.toml", tmp_path / "two" / "whole.toml").status == 1
    garbage = gtb("diff", tmp_path / "one" / "garbage.stl", tmp_path / "two" / "garbage.stl", "--json", status=2)
    (error,) = json.loads(garbage.out)["errors"]
    assert error["file"].endswith("garbage.stl")
    assert error["message"].startswith("is not an STL file")
    monkeypatch.setattr("gtb_cli.distances.comparison.decoded", None)
    for suffix in ("obj", "stl", "ply", "glb"):
        paths = [tmp_path / folder / f"x.{suffix}" for folder in ("one", "two")]
        assert gtb("diff", *paths, status=0).text == f"same: {paths[0]} and {paths[1]}: equal bytes\n"
        found = json.loads(gtb("diff", *paths, "--json", status=0).out)
        assert (found["same"], found["method"], found["distance"]) == (True, "bytes", 0.0)


def test_few_vertices_that_decide_the_tolerance_are_said(tmp_path):
    mesh = surface(8)
    far = np.concatenate([mesh.vertices, 1e6 + np.eye(3)])
    cells = np.concatenate([mesh.cells, len(mesh.vertices) + np.array([[0, 1, 2]])])
    paths = []
    for by in (0.0, 1e-4):
        vertices = far.copy()
        vertices[9, 2] += by
        paths.append(tmp_path / f"{by}.obj")
        write_mesh(Mesh(vertices, cells), paths[-1])
    result = gtb("diff", *paths, status=0)
    assert "without a few vertices far from all others, the size is " in result.err
    assert gtb("diff", *paths, "--tolerance", "1e-2", status=0).err == ""


def test_a_folder_without_an_end_or_a_pipe_in_it(folders, monkeypatch):
    monkeypatch.setattr("gtb_cli.shell.folders.MAX_FOLDERS", 500)
    one, two = folders
    for folder in folders:
        os.mkfifo(folder / "pipe.obj")
        for name in range(20):
            (folder / f"d{name}").mkdir()
        for name in range(20):
            for other in range(name + 1, 20):
                (folder / f"d{name}" / f"l{other}").symlink_to(folder / f"d{other}")
    result = gtb("diff", one, two)
    assert result.status == 2
    assert "more than 500 folders" in result.err
    for folder in folders:
        for link in folder.glob("d*/l*"):
            link.unlink()
    result = gtb("diff", one, two)
    assert (result.status, result.text) == (2, "2 same, 0 different, 0 missing, 0 extra, 1 unreadable\n")
    assert f"{one / 'pipe.obj'}: is not a file" in result.err


def test_a_deep_folder_and_names_that_forge_lines(folders):
    one, two = folders
    with contextlib.chdir(one):
        for _ in range(1500):
            os.mkdir("d")
            os.chdir("d")
    for name in ("\x1b[31mred.obj", "x\n99 same, 0 different.obj"):
        write_mesh(surface(3), one / name)
    result = gtb("diff", one, two)
    assert result.status == 1
    assert "\x1b" not in result.text
    assert result.text.splitlines()[-1] == "2 same, 0 different, 2 missing, 0 extra"
    assert len(result.text.splitlines()) == 3
    subprocess.run(["rm", "-r", one / "d"], check=True)  # pytest's own way is too deep


@pytest.mark.parametrize("options", [[], ["--json"]], ids=["text", "JSON"])
@long
def test_a_reader_that_has_seen_enough_changes_neither_report_nor_status(options, folders):
    a, b = folders
    write_mesh(surface(5), b / "a.obj")
    for pair in ((a, b), (a / "a.obj", b / "a.obj")):
        report = a.parent / "page.html"
        words = shlex.join(command("diff", *pair, *options, "--report", report))
        result = shell(f"({words}; echo $? >status) | true", a.parent)
        assert (result.status, result.err, (a.parent / "status").read_text()) == (0, "", "1\n")
        assert report.read_text().startswith("<!DOCTYPE html>")
        report.unlink()


@pytest.mark.parametrize(
    ("kind", "first", "second", "remark"),
    [
        ("glb", [], ["--unit", "mm"], "no unit, y up against mm, y up"),
        ("glb", [], ["--up", "z"], "no unit, y up against no unit, z up"),
        ("3mf", [], ["--unit", "in"], "millimeter, surface against inch, surface"),
    ],
)
def test_equal_numbers_that_mean_other_sizes_or_places_are_different(kind, first, second, remark, tmp_path):
    """Viewers show one larger, or lying."""
    one, two = tmp_path / f"one.{kind}", tmp_path / f"two.{kind}"
    for path, options in ((one, first), (two, second)):
        gtb("mesh", PENTAGON, "-n", "2", *options, "-o", path, status=0)
    found = json.loads(gtb("diff", one, two, "--json", "--ignore", "orientation,connectivity", status=1).out)
    assert (found["distance"] < found["tolerance"], found["remarks"]) == (
        True,
        [f"the numbers are meant otherwise: {remark}"],
    )
    gtb("mesh", PENTAGON, "-n", "2", "-o", tmp_path / "x.obj", status=0)
    gtb("diff", one, tmp_path / "x.obj", "--ignore", "connectivity", status=0)
    for path, folder in ((one, "golden"), (two, "out")):
        (tmp_path / folder).mkdir()
        path.rename(tmp_path / folder / f"x.{kind}")
    assert (
        f"0 apart, the numbers are meant otherwise: {remark}"
        in gtb("approve", tmp_path / "golden", tmp_path / "out").err
    )
