"""`gtb mesh --watch` in a process of its own: edits renew the file, errors leave it, and Ctrl-C ends it."""

import re
import signal
import subprocess
from pathlib import Path
from unittest.mock import Mock

import pytest

from gtb_cli.errors import GtbError
from gtb_cli.shell.messages import Console
from gtb_cli.shell.streams import Streams
from gtb_cli.shell.watching import Files, watched
from tests.shell import command, environment, names, until

INNER = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, {}]]\n"


def holds(path: Path, expected: str) -> object:
    return until(lambda: path.exists() and expected in path.read_text(encoding="utf-8"))


def test_an_edit_of_an_included_file_renews_the_mesh_and_an_error_leaves_it(tmp_path):
    inner, mesh = tmp_path / "inner.toml", tmp_path / "x.obj"
    inner.write_text(INNER.format(2), encoding="utf-8")
    (tmp_path / "outer.toml").write_text('include = ["inner.toml"]\n', encoding="utf-8")
    words = command("mesh", "outer.toml", "-n", "1", "--watch", "-o", "x.obj")
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        try:
            assert holds(mesh, "v 0.00000000 1.00000000 2.00000000")
            inner.write_text(INNER.format('"oops"'), encoding="utf-8")
            lines = [process.stderr.readline() for _ in range(3)]
            assert re.fullmatch(r"gtb: error: inner\.toml:2: control_points\[2\]\[2\]: .*\n", lines[2]), lines
            assert holds(mesh, "2.00000000")
            inner.write_text(INNER.format(3), encoding="utf-8")
            assert holds(mesh, "v 0.00000000 1.00000000 3.00000000")
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=120)
    assert process.returncode == 130
    assert names(tmp_path) == ["inner.toml", "outer.toml", "x.obj"]


def test_an_error_is_said_only_if_it_stays(monkeypatch, capfd):
    """An editor may leave a file empty for a moment. The third run is ended by Ctrl-C."""
    run = Mock(side_effect=[None, GtbError("is empty"), KeyboardInterrupt])
    monkeypatch.setattr(Files, "changed", lambda _: True)
    with pytest.raises(KeyboardInterrupt):
        watched(lambda **_: run())(watch=True, specs=["x"], streams=Streams(Console(), "y"))
    assert "empty" not in capfd.readouterr().err
