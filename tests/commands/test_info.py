"""`gtb info`, and reports on several specs, wherever a report of each makes sense."""

import json
from pathlib import Path

import pytest

from tests.marks import mostly_long
from tests.shell import BICUBIC, CURVE, PENTAGON, SPECS, gtb
from tests.specs import load


def test_info_sees_the_scale_of_the_normals():
    text = Path(PENTAGON).read_bytes() + b'\nedge_normals = "unit"\n'
    found = json.loads(gtb("info", "-", "--json", stdin=text).out)
    assert found["edge_normals"] == "unit"
    assert round(found["linear_precision_error"], 2) == 0.22  # mathematics.md, section 7


def test_info_names_repeated_knots():
    (group,) = json.loads(gtb("info", SPECS / "repeated-knot.toml", "--json").out)["repeated_knots"]
    first, second = load(SPECS / "repeated-knot.toml").knots[group].tolist()
    assert first == second


def test_a_large_model_is_described_in_few_words(tmp_path):
    """Only the joints with the largest angles, and the first open edges, unless all are asked for."""
    knots, corners = [[0, 0], [1, 0], [0, 1], [1, 1]], [(0, 0), (1, 0), (0, 1), (1, 1)]
    patches = [
        {"knots": knots, "control_points": [[x + k, y, (x + k) ** 2 / 200] for x, y in corners]} for k in range(60)
    ]
    spec = tmp_path / "row.json"
    spec.write_text(json.dumps({"patches": patches}))
    text = gtb("info", spec).text
    assert text.count("\njoint ") == 6
    assert "and 22 more, with --long\n" in text
    assert "and more          59 joints in all, and each patch: with --long\n" in text
    in_full = gtb("info", spec, "--long").text
    assert in_full.count("\njoint ") == 59
    assert "more, with --long" not in in_full
    assert len(json.loads(gtb("info", spec, "--json").text)["joints"]) == 59


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
