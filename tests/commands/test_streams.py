"""Inputs stay what they are, two outputs are two files, and names of files stay in their folder."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gtb_cli.shell import streams
from tests.shell import PENTAGON, command, environment, gtb


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A spec under two names in the working folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(PENTAGON, "s.toml")
    Path("linked.toml").symlink_to("s.toml")
    Path("to-x").symlink_to("x.obj")


def test_an_input_that_comes_by_a_redirection_is_not_overwritten():
    with Path("s.toml").open("rb") as file:
        arguments = command("info", "-", "-o", "s.toml")
        done = subprocess.run(arguments, stdin=file, env=environment(), capture_output=True, check=False)
    assert done.returncode == 2
    assert b"would be overwritten" in done.stderr
    assert Path("s.toml").read_bytes() == Path(PENTAGON).read_bytes()
    shutil.copy("s.toml", "t.toml")
    assert gtb("info", "s.toml", "-o", "t.toml", status=0).out == b""  # another file is


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
def test_two_outputs_are_two_files(line):
    before = sorted(os.listdir())
    result = gtb(*line.split(), "-n", "1")
    assert result.status == 2
    assert "would be written twice" in result.err
    assert sorted(os.listdir()) == before


@given(st.text() | st.text("aé😀 .-", min_size=100, max_size=300))
@example("a" * (streams.MAX_STEM_BYTES - 1) + " b")
def test_file_stems_stay_in_their_folder(name):
    stem = streams.file_stem(name)
    assert stem
    assert stem[0] not in ".- "
    assert not set(stem) & set('/\\:*?"<>|\0\n\r\t')
    assert len(stem.encode("utf-8")) <= streams.MAX_STEM_BYTES
    assert streams.file_stem(stem) == stem
