"""`gtb check` as scripts and people see it; what is measured is tested in test_checks.py."""

import json

import pytest

from gtb_cli.checks import properties as room
from gtb_cli.checks.properties import PROPERTIES
from gtb_cli.checks.report import Finding
from tests.shell import CURVE, PENTAGON, gtb

TWO = b"""
name = "two"
[[patches]]
name = "first"
knots = [[0, 0], [1, 0], [0, 1]]
control_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]
[[patches]]
knots = [[0, 0], [1, 0], [1, 1], [0, 1]]
control_points = [[1, 0, 0], [0, 0, 0], [0, -1, 0], [1, -1, 0]]
"""


@pytest.fixture
def failing(monkeypatch):
    """The basis seems not to add up to 1; the second failure has no number, the third an infinite one."""

    def replaced(prop):
        if prop.name == "partition of unity":
            return prop._replace(measure=lambda probe: Finding("fails", 0.25, 1e-14, "largest difference"))
        if prop.name == "convex hull":
            return prop._replace(measure=lambda probe: Finding("fails", None, None, "could not be measured"))
        if prop.name == "corners":
            return prop._replace(measure=lambda probe: Finding("fails", float("inf"), 0.0, "not a number"))
        return prop

    monkeypatch.setattr(room, "PROPERTIES", tuple(map(replaced, PROPERTIES)))


def test_knots_near_an_edge_hide_no_other_failure(failing, tmp_path):
    """What fails with the knots on the edge as well is a failure; only what holds there is not decided."""
    path = tmp_path / "near.toml"
    path.write_text(
        "knots = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 1e-12]]\n"
        "control_points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1], [0.5, 0.2, 3]]\n",
        encoding="utf-8",
    )
    result = gtb("check", path, status=1)
    lines = result.text.splitlines()
    assert [line.split()[1] for line in lines if line.startswith("fails")] == ["partition", "corners", "convex"]
    assert [line.split()[2] for line in lines if line.startswith("not decided")] == ["definition", "isoparametric"]


def test_a_property_that_fails_is_exit_status_1(failing):
    result = gtb("check", PENTAGON, status=1)
    assert result.err == ""
    (line,) = (line for line in result.text.splitlines() if "partition of unity" in line)
    assert line.startswith("fails ")
    assert "0.25 > 1e-14" in line
    assert "3 fail" in result.text.splitlines()[-1]
    assert gtb("check", PENTAGON, "-q").status == 1


def test_a_failure_as_json_has_no_numbers_that_json_has_not(failing):
    result = gtb("check", PENTAGON, "--json", status=1)

    def refuse(constant):
        raise AssertionError(constant)

    found = json.loads(result.out, parse_constant=refuse)
    assert found["holds"] is False
    rows = {row["name"]: row for row in found["properties"]}
    assert set(rows["corners"]) == {"name", "reference", "status", "value", "bound", "reason"}
    assert rows["partition of unity"]["value"] == 0.25
    assert rows["corners"]["value"] is None
    assert rows["convex hull"]["value"] is rows["convex hull"]["bound"] is None


def test_a_model_that_fails_lists_what_does(failing):
    result = gtb("check", "-", stdin=TWO, status=1)
    lines = result.text.splitlines()
    first = lines.index("patch 0 (first): 9 hold, 3 fail, 4 measured, 3 not applicable")
    assert [line[:5] for line in lines[first + 1 : first + 4]] == ["fails"] * 3
    assert lines[first + 4].startswith("patch 1: ")
    found = json.loads(gtb("check", "-", "--json", stdin=TWO, status=1).out)
    assert (found["name"], found["holds"], len(found["patches"])) == ("two", False, 2)
    assert {row["name"]: row["value"] for row in found["joints"]}["open edges"] == 3 + 4 - 2


def on_terminal(monkeypatch, **variables: str) -> str:
    """What a terminal would show."""
    monkeypatch.setattr("gtb_cli.commands.check.is_terminal", lambda output: True)
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    return gtb("check", CURVE).text


def test_colours_are_for_terminals(monkeypatch):
    assert "\033[32mholds" in on_terminal(monkeypatch)
    assert "\033" not in on_terminal(monkeypatch, NO_COLOR="1")
    assert "\033" not in on_terminal(monkeypatch, TERM="dumb")
    assert "\033[32mholds" in on_terminal(monkeypatch, NO_COLOR="")
