"""Several specs and folders of them, wherever a report or a mesh of each makes sense."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.shell import BICUBIC, CURVE, PENTAGON, SPECS, gtb


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two specs, and files that are not specs."""
    place = tmp_path_factory.mktemp("several") / "specs"
    place.mkdir()
    for path in (BICUBIC, CURVE):
        shutil.copy(path, place)
    (place / "README.md").write_text("text")
    (place / ".hidden.toml").write_text("text")
    (place / "folder.toml").mkdir()
    return place


def test_info_has_a_line_for_each(folder):
    box = str(SPECS / "box-corner.toml")
    result = gtb("info", folder, box)
    assert result.status == 0, result.err
    assert result.text.splitlines() == [
        f"{folder / 'bicubic.toml'}: rational Bézier tensor product of degree 3 × 3, 16 knots",
        f"{folder / 'cubic-bezier.toml'}: rational Bézier curve of degree 3, 4 knots",
        f"{box}: model of 7 surfaces, 6 open edges",
    ]
    in_full = gtb("info", "--long", folder).text
    assert in_full.count("linear precision") == 2
    data = json.loads(gtb("info", "--json", folder).out)
    assert [(Path(entry["file"]).name, entry["knots"]) for entry in data] == [
        ("bicubic.toml", 16),
        ("cubic-bezier.toml", 4),
    ]


def test_one_spec_is_reported_in_full(folder):
    assert "linear precision" in gtb("info", CURVE).text
    assert json.loads(gtb("info", "--json", CURVE).out)["knots"] == 4
    assert json.loads(gtb("check", "--json", CURVE).out)["holds"] is True


def test_check_has_a_line_for_each_and_the_worst_status(folder, tmp_path):
    result = gtb("check", CURVE, CURVE)
    assert result.status == 0
    assert [line.split()[0] for line in result.text.splitlines()] == ["holds", "holds"]
    assert " 0 fail, " in result.text
    bad = tmp_path / "bad.toml"
    bad.write_text("knots = 1")
    result = gtb("check", bad, CURVE)
    assert result.status == 2
    assert str(bad) in result.err
    assert result.text.startswith(f"holds  {CURVE}: ")
    assert gtb("info", bad, CURVE).status == 2


def test_a_folder_is_meshed(folder, tmp_path):
    result = gtb("mesh", folder, "-n", 2, "-o", tmp_path / "out")
    assert result.status == 0, result.err
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["bicubic.obj", "cubic-bezier.obj"]
    assert gtb("diff", tmp_path / "out", folder, "-n", 2).status == 0
    (tmp_path / "empty").mkdir()
    result = gtb("mesh", tmp_path / "empty", "-o", tmp_path / "more")
    assert result.status == 2
    assert "empty: has no specs" in result.err
    assert not (tmp_path / "more").exists()


def test_a_spec_in_a_folder_is_not_overwritten(folder):
    before = (folder / "bicubic.toml").read_bytes()
    assert gtb("info", folder, "-o", folder / "bicubic.toml").status == 2
    assert (folder / "bicubic.toml").read_bytes() == before


def test_a_large_model_fits_on_a_screen_and_long_says_all():
    teapot = PENTAGON.replace("pentagon", "teapot") if isinstance(PENTAGON, str) else PENTAGON.with_name("teapot.toml")
    short = gtb("info", teapot).text
    assert len(short.splitlines()) <= 24
    assert "open edges        rim-1 edge 0; " in short
    assert gtb("info", teapot, "--long").text.count("linear precision") == 32


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


@pytest.mark.parametrize("command", [("check",), ("check", "--json"), ("info", "--long"), ("info", "--json")])
def test_processes_that_share_reports_change_nothing(command, folder, tmp_path):
    """Neither what is printed, nor errors and their order, nor standard input, which the first process reads."""
    bad = tmp_path / "bad.toml"
    bad.write_text("knots = 1")
    given = ("-", bad, folder)
    alone, shared = (gtb(*command, *given, "-j", jobs, stdin=Path(PENTAGON).read_bytes()) for jobs in (1, 3))
    assert (alone.status, alone.text, alone.err) == (2, shared.text, shared.err)
    assert shared.status == 2
    assert all(name in alone.text for name in ("<stdin>", "bicubic.toml", "cubic-bezier.toml"))


def test_a_requirement_is_checked_by_every_process(folder):
    result = gtb("check", PENTAGON, folder / "bicubic.toml", "--require", "watertight", "-j", 2)
    assert result.status == 1
    assert [line.split(": ")[2] for line in result.err.splitlines()] == [str(PENTAGON), str(folder / "bicubic.toml")]
