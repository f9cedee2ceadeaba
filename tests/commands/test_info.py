"""`gtb info`, and reports on several specs, wherever a report of each makes sense."""

from pathlib import Path
from unittest.mock import Mock

import pytest

import gtb_cli
from gtb_cli.errors import ToleranceError
from tests.marks import mostly_long
from tests.shell import BICUBIC, CURVE, PENTAGON, gtb
from tests.surfaces import box


@pytest.mark.parametrize("command", mostly_long(["check", "info --json", "check --json", "info --long"]))
def test_processes_that_share_reports_change_nothing(command, tmp_path):
    """Neither what is printed, nor errors and their order, nor standard input, which the first process reads."""
    bad = tmp_path / "bad.toml"
    bad.write_text("knots = 1")
    given = ("-", bad, BICUBIC, CURVE)
    alone, shared = (gtb(*command.split(), *given, "-j", jobs, stdin=Path(PENTAGON).read_bytes()) for jobs in (1, 3))
    assert (alone.status, alone.text, alone.err) == (2, shared.text, shared.err)
    assert shared.status == 2
    assert all(name in alone.text for name in ("<stdin>", "bicubic.toml", "cubic-bezier.toml"))


def test_a_solid_that_needs_too_many_faces_is_said_not_to_be_measured(monkeypatch, tmp_path):
    monkeypatch.setattr("gtb_cli.commands.info.Recipe.mesh", Mock(side_effect=ToleranceError("")))
    gtb_cli.save(box(), tmp_path / "box.toml")
    assert "\nleast wall        not measured: within 0.1% " in gtb("info", tmp_path / "box.toml").text
