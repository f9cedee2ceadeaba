"""Programs that read what gtb says: schemas of all outputs, and the places that errors name."""

import json
import pickle
from pathlib import Path

import jsonschema
import pytest

from gtb_cli.errors import DomainError, Fault, SpecError
from gtb_cli.shell.faults import located
from gtb_cli.shell.messages import annotation
from tests.outputs import SCHEMAS, schema_of, validator
from tests.shell import SPECS, gtb
from tests.tables import cases


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_one_and_asks_for_its_version(name):
    jsonschema.Draft202012Validator.check_schema(schema_of(name))
    assert not validator(name).is_valid({})
    assert not validator(name).is_valid({"schema": 2})


def test_what_is_not_as_a_schema_says_is_seen():
    found = json.loads(gtb("info", SPECS / "pentagon.toml", "--json", status=0).out)
    validator("info").validate(found | {"more": 1})  # a key that is added
    for key in validator("info").schema["anyOf"][0]["required"]:
        assert not validator("info").is_valid({name: value for name, value in found.items() if name != key})
        assert not validator("info").is_valid(found | {key: {"x": 0}})


def test_files_that_programs_read_are_as_their_schemas_say(tmp_path):
    curve = SPECS / "example-3.4.toml"
    gtb("degenerate", curve, "-x", 3, "-n", 2, "-q", "-o", tmp_path, status=0)
    gtb("mesh", curve, SPECS / "bicubic.toml", "-n", 2, "-q", "-o", tmp_path, "--manifest", tmp_path / "m", status=0)
    for name, file in (("sequence", "sequence.json"), ("manifest", "m")):
        validator(name).validate(json.loads((tmp_path / file).read_text()))


@pytest.mark.parametrize(("parts", "text"), [*cases("commands/parts", "parts"), ([""], "")])
def test_parts_of_a_text(parts, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a: there.toml").touch()
    assert located(Fault(text), ["x.toml", "x.toml:3: b.toml", "y"]) == Fault(*parts)


def test_a_file_that_is_given_comes_before_one_that_exists(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a:3").touch()
    Path("a").touch()
    assert located(Fault("a:3: is empty"), ["a"]) == Fault("is empty", "a", 3)
    assert located(Fault("a:3: is empty"), ["a", "a:3"]) == Fault("is empty", "a:3")
    assert located(Fault("a:3: is empty")) == Fault("is empty", "a:3")


def test_an_error_keeps_its_faults_on_its_way():
    parts = Fault("must be positive", "a: b.toml", 3, 7, "weights[1]")
    error = pickle.loads(pickle.dumps(SpecError(parts, "one\ntwo")))
    assert str(error) == "a: b.toml:3:7: weights[1]: must be positive\none\ntwo"
    assert error.faults == [parts, Fault("one"), Fault("two")]
    assert [*map(str, error.within("x").faults)] == [f"x: {line}" for line in str(error).split("\n")]
    assert type(DomainError("knots: are flat").within("x")) is DomainError


def test_an_annotation_has_no_way_out_of_its_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fault = Fault("100%\n::error::no\r\x1b[0m", str(tmp_path / "in" / "a,b:c%.toml"), 3, 4, "x")
    shown = "::warning file=in/a%2Cb%3Ac%25.toml,line=3,col=4,title=gtb::x: 100%25%0A::error::no%0D\\x1b[0m"
    assert annotation(fault, "warning") == shown
    outside = str(tmp_path.parent / "x.toml")
    assert annotation(Fault("no", outside), "error") == f"::error file={outside},title=gtb::no"
    assert annotation(Fault("no", "<stdin>", 2), "error") == "::error line=2,title=gtb::no"
