"""Inputs stay what they are: no command overwrites what it reads, under any name."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from gtb_cli.shell.meshing import MeshOptions
from gtb_cli.tessellation.recipe import Recipe
from tests.shell import PENTAGON, command, environment, gtb, process

SPEC = Path(PENTAGON).read_bytes()
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Inputs of all kinds, in the working folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("s.toml", "w.obj"):
        Path(name).write_bytes(SPEC)
    Path("s.glb").symlink_to("s.toml")
    Path("linked.toml").symlink_to("s.toml")
    triangle = {"knots": [[0, 0], [1, 0], [0, 1]], "control_points": [[0, 0], [1, 0], [0, 1]], "lifting": [0, 1, 0]}
    Path("sequence.json").write_text(json.dumps(triangle), encoding="utf-8")
    Path("p.txt").write_bytes(b"0.5 1.5\n0.6 1.4\n")
    Path("whole.toml").write_text("include = ['part.toml']\n", encoding="utf-8")
    Path("part.toml").write_bytes(SPEC)
    Path("meshes").mkdir()
    for name in ("a.obj", "b.obj", "meshes/a.obj"):
        Path(name).write_bytes(OBJ)
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_an_input_that_comes_by_a_redirection_is_not_overwritten(folder):
    arguments = command("info", "-", "-o", "s.toml")
    with Path("s.toml").open("rb") as file:
        done = subprocess.run(arguments, stdin=file, env=environment(), capture_output=True, check=False)
    assert done.returncode == 2
    assert b"would be overwritten" in done.stderr
    assert Path("s.toml").read_bytes() == SPEC


@pytest.mark.parametrize(
    "line",
    [
        "mesh s.toml -o x.obj --deps x.obj",
        "mesh s.toml -o x.obj --deps y --manifest ./y",
        "mesh s.toml -o x.obj --deps to-x",
        "mesh s.toml linked.toml -o out --deps out/s.obj",
        "mesh s.toml linked.toml -f glb -o out --manifest out/linked.glb",
    ],
)
def test_two_outputs_are_two_files(line, folder):
    Path("to-x").symlink_to("x.obj")
    before = sorted(os.listdir())
    result = gtb(*line.split(), "-n", "1")
    assert result.status == 2
    assert "would be written twice" in result.err
    assert sorted(os.listdir()) == before


def test_another_file_is_overwritten(folder):
    shutil.copy("s.toml", "t.toml")
    assert gtb("info", "s.toml", "-o", "t.toml").status == 0
    assert Path("s.toml").read_bytes() == SPEC
    assert Path("t.toml").read_bytes() != SPEC


# --- one of several specs


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_internal_error_of_one_spec_leaves_the_others(jobs, folder, monkeypatch):
    mesh = Recipe.mesh

    def broken(self, spec, rounding):
        if spec.name == "bad":
            raise IndexError("row 3")
        return mesh(self, spec, rounding)

    monkeypatch.setattr(Recipe, "mesh", broken)
    Path("bad.toml").write_bytes(SPEC.replace(b'name = "pentagon"', b'name = "bad"'))
    result = gtb("mesh", "s.toml", "bad.toml", "linked.toml", "-n", "2", "-j", jobs, "-o", "out")
    assert result.status == 2
    assert "bad.toml: internal error, please report it: IndexError: row 3" in result.err
    assert sorted(os.listdir("out")) == ["linked.obj", "s.obj"]


def test_an_internal_error_in_the_middle_of_a_file_leaves_the_others(folder, monkeypatch):
    encoded = MeshOptions.encoded

    def broken(self, mesh, kind):
        yield from encoded(self, mesh, kind)
        if mesh.name == "bad":
            raise IndexError("row 3")

    monkeypatch.setattr(MeshOptions, "encoded", broken)
    Path("bad.toml").write_bytes(SPEC.replace(b'name = "pentagon"', b'name = "bad"'))
    result = gtb("mesh", "bad.toml", "s.toml", "-n", "2", "-o", "out", "--manifest", "m.json")
    assert result.status == 2
    assert "bad.toml: internal error" in result.err
    assert os.listdir("out") == ["s.obj"]
    assert [entry["file"] for entry in json.loads(Path("m.json").read_text())["files"]] == ["out/s.obj"]


# --- words


def test_errors_are_json_where_standard_error_is_not_utf_8(folder):
    result = process("info", "--json", "größe.toml", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert result.status == 2
    assert json.loads(result.err)["errors"] == ["größe.toml: No such file or directory"]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(24, "Too many open files"), "too many open files"),
        (BlockingIOError(11, "Resource temporarily unavailable"), "no more processes or threads"),
        (FileNotFoundError(2, "No such file or directory"), "the working folder is gone"),
        (OSError(28, "No space left on device"), "cannot write standard output: No space left on device"),
        (OSError(13, "Permission denied", "x.toml"), "x.toml: Permission denied"),
    ],
)
def test_errors_of_the_system_are_said_in_words_of_what_they_are_about(error, words, monkeypatch):
    def broken(*arguments):
        raise error

    monkeypatch.setattr("gtb_cli.language.loading.load", broken)
    monkeypatch.setattr("gtb_cli.commands.cli.abandon", lambda stream: None)
    result = gtb("elevate", PENTAGON)
    assert result.status == 2
    assert result.err.startswith(f"gtb: error: {words}")


@pytest.mark.parametrize("variables", [{}, {"COMP_WORDS": "gtb", "COMP_CWORD": "x"}, {"_GTB_COMPLETE": "x"}])
def test_a_question_of_no_shell_is_a_usage_error(variables, monkeypatch):
    monkeypatch.setenv("_GTB_COMPLETE", "bash_complete")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    result = gtb()
    assert result.status == 2
    assert result.err == "gtb: error: _GTB_COMPLETE is for shells, which also set COMP_WORDS and COMP_CWORD\n"


def test_a_question_that_is_empty_is_none(monkeypatch):
    expected = gtb("info", PENTAGON).text
    monkeypatch.setenv("_GTB_COMPLETE", "")
    assert gtb("info", PENTAGON).text == expected


def test_the_beginning_of_an_option_suggests_it():
    assert "--resolution" in gtb("mesh", PENTAGON, "--res", "4", status=2).err


def test_help_is_a_command_too():
    assert gtb("help", "mesh").text == gtb("mesh", "--help").text
    assert gtb("help").text == gtb("--help").text
    result = gtb("help", "mash")
    assert result.status == 2
    assert "Did you mean mesh?" in result.err


def test_a_terminal_gets_no_thousands_of_lines(monkeypatch):
    monkeypatch.setattr("gtb_cli.commands.mesh.is_terminal", lambda output: output == "-")
    assert gtb("mesh", PENTAGON, "-n", "2").out.startswith(b"v ")
    result = gtb("mesh", PENTAGON)
    assert result.status == 2
    assert result.out == b""
    assert "lines, and standard output is a terminal: give -o FILE" in result.err
