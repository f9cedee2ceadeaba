"""`gtb mesh --resume`: what is up to date is not made again, and all else is as if it were."""

import json
import os
import shutil
from itertools import product
from pathlib import Path

import pytest

from gtb_cli.process.versions import versions
from gtb_cli.tessellation.recipe import Recipe
from tests.shell import BICUBIC, CURVE, PENTAGON, REPOSITORY, gtb, process


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Three specs and a broken one in the working folder."""
    broken = 'knots = "none"\n'
    monkeypatch.chdir(tmp_path)
    for path in (PENTAGON, BICUBIC, CURVE, PENTAGON.replace("pentagon", "hexagon")):
        Path(Path(path).name).write_bytes(Path(path).read_bytes())
    Path("broken.toml").write_text(broken)
    return tmp_path


@pytest.fixture
def made(monkeypatch):
    """Names of the specs that are meshed in this process."""
    names = []
    mesh = Recipe.mesh

    def noted(self, spec, *more, **options):
        names.append(spec.name)
        return mesh(self, spec, *more, **options)

    monkeypatch.setattr(Recipe, "mesh", noted)
    return names


SPECS = ("pentagon.toml", "broken.toml", "bicubic.toml", "cubic-bezier.toml")


def resumed(*more, specs=SPECS, n=2):
    return gtb("mesh", *specs, "-n", n, "-o", "out/", "--manifest", "m.json", "--resume", *more)


def test_another_processor_makes_everything_again(place):
    line = ["mesh", "pentagon.toml", "bicubic.toml", "-n", 2, "-o", "out", "--manifest", "m.json", "--resume"]
    older = {"NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX X86_V3 X86_V4"}
    for variables, kept in (({}, 0), ({}, 2), (older, 0), (older, 2), ({}, 0)):
        done = process(*line, **variables) if variables else gtb(*line)
        assert done.err.count("up to date") == kept


def test_a_changed_source_makes_everything_again(tmp_path):
    """One constant of a copy of the program differs, and not its version."""
    shutil.copytree(REPOSITORY / "gtb_cli", tmp_path / "gtb_cli")  # with bytecode, which is of these sources
    line = ["mesh", PENTAGON, BICUBIC, "-n", 2, "-o", "out", "--manifest", "m.json", "--resume"]

    def kept() -> int:
        return process(*line, folder=tmp_path, PYTHONPATH=str(tmp_path)).err.count("up to date")

    assert [kept(), kept()] == [0, 2]
    with (tmp_path / "gtb_cli" / "theory" / "basis.py").open("a") as file:
        file.write("\n")
    assert kept() == 0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("versions", versions() | {"processor": "z80"}),  # another machine made it
        *product(["vertices", "faces", "inputs", "warnings", "sha256", "file"], [None, "nonsense", [1]]),
    ],
)
def test_an_entry_that_lacks_something_shows_nothing(key, value, place):
    resumed(specs=["pentagon.toml", "bicubic.toml"])
    expected = Path("m.json").read_text()
    record = json.loads(expected)
    record["files"][0][key] = value
    if value is None:
        del record["files"][0][key]
    Path("m.json").write_text(json.dumps(record))
    result = resumed(specs=["pentagon.toml", "bicubic.toml"])
    assert (result.status, result.err.count("up to date")) == (0, 1)
    assert Path("m.json").read_text() == expected


def test_a_file_under_another_name_is_not_taken_for_what_was_included(place, made):
    """Where a link stands before "..", names without it are those of other files."""
    Path("deep/inner").mkdir(parents=True)
    Path("link").symlink_to("deep/inner")
    Path("deep/part.toml").write_bytes(Path("bicubic.toml").read_bytes())
    Path("part.toml").write_bytes(Path("bicubic.toml").read_bytes())
    Path("whole.toml").write_text('include = ["link/../part.toml"]\n')
    resumed(specs=["whole.toml", "pentagon.toml"])
    Path("deep/part.toml").write_bytes(Path("hexagon.toml").read_bytes())
    made.clear()
    resumed(specs=["whole.toml", "pentagon.toml"])
    assert made == ["whole"]


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b'{"versions": 1}', b"\xff", b"[" * 100_000])
def test_a_damaged_manifest_shows_nothing(text, place):
    Path("m.json").write_bytes(text)
    result = resumed(specs=["pentagon.toml", "bicubic.toml"])
    assert result.status == 0
    assert len(json.loads(Path("m.json").read_text())["files"]) == 2


def test_an_interrupted_run_is_resumed(place, made, monkeypatch):
    """The first file is there, and so is a manifest that lists it, in the order of all."""
    mesh = Recipe.mesh

    def interrupted(self, spec, *more, **options):
        if spec.name == "bicubic":
            raise KeyboardInterrupt
        return mesh(self, spec, *more, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Recipe, "mesh", interrupted)
        with pytest.raises(KeyboardInterrupt):
            resumed()
    assert os.listdir("out") == ["pentagon.obj"]
    assert [entry["file"] for entry in json.loads(Path("m.json").read_text())["files"]] == ["out/pentagon.obj"]
    made.clear()
    resumed(specs=["cubic-bezier.toml", "pentagon.toml", "bicubic.toml"])
    assert made == ["cubic-bezier", "bicubic"]
    files = [entry["file"] for entry in json.loads(Path("m.json").read_text())["files"]]
    assert files == ["out/cubic-bezier.obj", "out/pentagon.obj", "out/bicubic.obj"]
