"""`gtb diff`: what differs, by how much, and with which exit status."""

import contextlib
import json
import os
import subprocess
import threading
import tracemalloc
from pathlib import Path

import pytest

from gtb_cli.formats.export import write_mesh
from tests.marks import long
from tests.shell import PENTAGON, gtb
from tests.tiny_meshes import plane, surface


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
    result = gtb("diff", tmp_path / "5.obj", tmp_path / "7.obj", "-q", status=0)
    assert "not proved: at most 0." in result.text
    result = gtb("diff", tmp_path / "5.obj", tmp_path / "7.obj", "--json")
    found = json.loads(result.out)
    assert (found["same"], found["proved"]) == (True, False)
    assert found["bound"] > found["tolerance"]
    assert "warning" in result.err


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


def test_equal_bytes_are_compared_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr("gtb_cli.distances.operands.decoded", None)
    for suffix in ("obj", "stl", "ply", "glb"):
        paths = tmp_path / f"one.{suffix}", tmp_path / f"two.{suffix}"
        for path in paths:
            write_mesh(surface(5), path)
        assert gtb("diff", *paths, status=0).text == f"same: {paths[0]} and {paths[1]}: equal bytes\n"
        found = json.loads(gtb("diff", *paths, "--json", status=0).out)
        assert (found["same"], found["method"], found["distance"]) == (True, "bytes", 0.0)


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
    result = gtb("diff", one, two, status=2)
    assert "more than 500 folders" in result.err
    for folder in folders:
        for link in folder.glob("d*/l*"):
            link.unlink()
    result = gtb("diff", one, two)
    assert (result.status, result.text) == (2, "2 same, 0 different, 0 missing, 0 extra, 1 unreadable\n")
    assert f"{one / 'pipe.obj'}: is not a file" in result.err


@long
def test_a_deep_folder_and_names_that_forge_lines(folders):
    one, two = folders
    with contextlib.chdir(one):
        for _ in range(1500):
            os.mkdir("d")
            os.chdir("d")
    for name in ("\x1b[31mred.obj", "x\n99 same, 0 different.obj"):
        write_mesh(surface(3), one / name)
    result = gtb("diff", one, two, status=1)
    assert "\x1b" not in result.text
    assert result.text.splitlines()[-1] == "2 same, 0 different, 2 missing, 0 extra"
    assert len(result.text.splitlines()) == 3
    subprocess.run(["rm", "-r", one / "d"], check=True)  # pytest's own way is too deep
