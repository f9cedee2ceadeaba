"""Inputs stay what they are, and names of files stay in their folder."""

import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import example, given, strategies as st

from gtb_cli.shell import streams
from tests.shell import PENTAGON, command, environment, gtb


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A spec in the working folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(PENTAGON, "s.toml")


def test_an_input_that_comes_by_a_redirection_is_not_overwritten():
    with Path("s.toml").open("rb") as file:
        arguments = command("info", "-", "-o", "s.toml")
        done = subprocess.run(arguments, stdin=file, env=environment(), capture_output=True, check=False)
    assert done.returncode == 2
    assert b"would be overwritten" in done.stderr
    assert Path("s.toml").read_bytes() == Path(PENTAGON).read_bytes()
    shutil.copy("s.toml", "t.toml")
    assert gtb("info", "s.toml", "-o", "t.toml", status=0).out == b""  # another file is


@given(
    st.text(
        st.sampled_from('a .-/\\:*?"<>|\0\n\r\t') | (st.integers(0, 0xD7FF) | st.integers(0xE000, 0x10FFFF)).map(chr)
    )
    | st.text("aé😀 .-", min_size=100, max_size=300)
)
@example("a" * (streams.MAX_STEM_BYTES - 1) + " b")
def test_file_stems_stay_in_their_folder(name):
    stem = streams.file_stem(name)
    assert stem
    assert stem[0] not in ".- "
    assert not set(stem) & set('/\\:*?"<>|\0\n\r\t')
    assert len(stem.encode("utf-8")) <= streams.MAX_STEM_BYTES
    assert streams.file_stem(stem) == stem
