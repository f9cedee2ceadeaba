"""`gtb mesh --manifest`: what it says is what the files are, and it appears with them or not at all."""

import hashlib
import json
import platform
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gtb_cli import __version__
from gtb_cli.shell.folders import files_in
from tests.marks import mostly_long
from tests.shell import PENTAGON, REPOSITORY, SPECS, gtb
from tests.test_architecture import loaded_by

BOX = str(SPECS / "hebesphenorotunda.toml")


def manifest_of(*arguments: object, path: Path) -> dict:
    gtb("mesh", *arguments, "--manifest", path, status=0)
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", mostly_long(["obj", "glb", "ply", "stl"], 2))
def test_it_says_what_the_files_are(kind, tmp_path):
    single = 1e-5  # relative: 32-bit numbers, differences of which are summed
    found = manifest_of(PENTAGON, BOX, "-n", 5, "-f", kind, "-o", tmp_path / "out", path=tmp_path / "out" / "m.json")
    assert [entry["file"] for entry in found["files"]] == [f"pentagon.{kind}", f"hebesphenorotunda.{kind}"]
    for entry in found["files"]:
        data = (tmp_path / "out" / entry["file"]).read_bytes()
        assert (entry["sha256"], entry["bytes"]) == (hashlib.sha256(data).hexdigest(), len(data))
        theirs = trimesh.load_mesh(tmp_path / "out" / entry["file"])
        theirs.merge_vertices(digits_vertex=5, merge_norm=True, merge_tex=True)
        assert entry["faces"] == len(theirs.faces)
        assert entry["area"] == pytest.approx(theirs.area, rel=single)
        assert np.allclose(entry["bounds"], theirs.bounds, rtol=0, atol=single)
        assert (entry["volume"] is not None) == theirs.is_watertight
        if entry["volume"] is not None:
            assert entry["volume"] == pytest.approx(theirs.volume, rel=single)


def test_it_says_what_they_were_made_with(tmp_path):
    found = manifest_of(PENTAGON, "--tolerance", "5%", "-o", f"{tmp_path}/a/", path=tmp_path / "m.json")
    packages = {name: version(name) for name in ("numpy", "scipy", "trimesh")}
    expected = {"gtb": __version__, "python": platform.python_version()} | packages
    assert found["versions"].items() >= expected.items()
    assert found["versions"].keys() - expected.keys() == {"sources", "system", "processor"}
    options = found["options"]
    assert (options["resolution"], options["tolerance"], options["format"]) == (None, "5%", "obj")
    pentagon = found["files"][0]
    assert options["parametrization"] == "linear"
    assert pentagon["tolerance"] == pytest.approx(0.05 * np.sqrt(4 + 4 + 16), rel=1e-9)  # it is 2 by 2 by 4
    found = manifest_of(PENTAGON, BOX, "-n", 3, "--normals", "-o", tmp_path / "b", path=tmp_path / "m.json")
    assert (found["options"]["resolution"], found["options"]["normals"]) == (3, True)
    assert "tolerance" not in found["files"][0]


def test_it_imports_no_trimesh_for_a_version(tmp_path):
    arguments = ["mesh", "-q", "-n", "2", PENTAGON, "-o", "x.obj", "--manifest", "m.json"]
    loaded = loaded_by(f"from gtb_cli.commands.cli import run; run({arguments!r})", tmp_path)
    assert "trimesh" not in loaded
    assert (tmp_path / "m.json").exists()
    assert str(REPOSITORY) not in (tmp_path / "m.json").read_text()


def test_a_large_file_is_no_manifest_as_reading_it_takes_memory(tmp_path):
    for size, count in ((0, 0), (10**7, 1)):
        (tmp_path / "m.json").write_text('{"versions": 1, "options": 1, "files": 1' + " " * size + "}")
        assert len(files_in(str(tmp_path), {})) == count
