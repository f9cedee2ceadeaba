"""`specs/THEORY.md`: every module, name, command and test that it names exists, and none is missing."""

import importlib
import re
from pathlib import Path

import pytest

import gtb_cli
from gtb_cli.commands.cli import COMMANDS
from tests.shell import SPECS

PACKAGE = Path(gtb_cli.__file__).parent
PAGE = (SPECS / "THEORY.md").read_text(encoding="utf-8")
FILE = r"`(\w+(?:/\w+)*\.py)`"
ROWS = [row for row in re.findall(r"^\| (.*) \|$", PAGE, re.M) if row.count(" | ") == 5 and re.search(FILE, row)]


def cells(row: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", row)]


def test_every_file_exists() -> None:
    files = set(re.findall(FILE, PAGE))
    assert [file for file in files if not (PACKAGE / file).is_file()] == []
    wings = ("knots", "moment", "theory", "bezier")
    rooms = {f"{wing}/{path.name}" for wing in wings for path in (PACKAGE / wing).glob("[a-z]*.py")}
    assert rooms - files == set()


def test_every_public_name_is_there() -> None:
    named = {name.split(".")[0] for name in re.findall(r"`([\w.]+)`", PAGE)}
    assert set(gtb_cli.__all__) - named == set()


@pytest.mark.parametrize("row", ROWS, ids=lambda row: cells(row)[0])
def test_names_of_a_row_exist(row: str) -> None:
    _, _, files, names, _, _ = cells(row)
    modules = [importlib.import_module("gtb_cli." + file[:-3].replace("/", ".")) for file in re.findall(FILE, files)]
    assert modules
    for name in re.findall(r"`([\w.]+)`", names):
        first, *others = name.split(".")
        found = [getattr(place, first) for place in (gtb_cli, *modules) if hasattr(place, first)]
        assert found, f"{name} is neither of gtb_cli nor of {files}"
        for other in others:
            assert hasattr(found[0], other) or other in found[0].__annotations__, name


def test_every_command_exists() -> None:
    assert set(re.findall(r"`gtb ([\w-]+)", PAGE)) - set(COMMANDS) == set()


def test_every_test_exists() -> None:
    sources = [path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("*.py")]
    known = {name for text in sources for name in re.findall(r"^def (\w+)\(", text, re.M)}
    named = [name for row in ROWS for name in re.findall(r"`(\w+)`", cells(row)[5])]
    assert len(named) >= len(ROWS)
    assert [name for name in named if name not in known] == []
