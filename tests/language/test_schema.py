"""The JSON Schema against all specs, good and bad."""

import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from keyword import kwlist
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from gtb_cli.language import expression, includes, keys_and_values, names, patch_reader as reader
from gtb_cli.language.patch_reader import COPY_KEYS, INCLUDE_KEYS, MODEL_KEYS, PATCH_KEYS, RIBBONS
from gtb_cli.language.schema import page, schema
from gtb_cli.theory.basis import COEFFICIENTS
from gtb_cli.vocabulary import TEMPLATES
from tests.shell import SPECS, gtb
from tests.specs import BAD_SPECS, GOOD_SPECS, Case, bad_specs
from tests.tables import cases

STRUCTURAL, OTHER = ([case for case in bad_specs() if case.kind == kind] for kind in ("schema", "beyond schema"))
VALIDATOR = jsonschema.Draft202012Validator(schema())


def data(path: Path) -> object:
    text = path.read_bytes().decode("utf-8-sig")
    return json.loads(text) if path.suffix == ".json" else tomllib.loads(text)


def test_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())


def test_names_every_key_and_no_other() -> None:
    properties = schema()["properties"]
    assert set(properties) == PATCH_KEYS | MODEL_KEYS | {*RIBBONS}
    assert set(properties["patches"]["items"]["properties"]) == PATCH_KEYS | COPY_KEYS | {*RIBBONS}


def test_its_limits_are_those_of_the_reader() -> None:
    kinds, keys = schema()["$defs"], schema()["properties"]
    number, name, grid = kinds["let"]["propertyNames"], kinds["name"], kinds["knots"]["anyOf"][2]
    assert number["not"]["enum"] == [*expression.FUNCTIONS, *expression.CONSTANTS, expression.COUNTER, *kwlist]
    assert (number["pattern"], grid["pattern"]) == (f"^{names.NAME_PATTERN}$", f"^{reader.GRID}$")
    assert (number["maxLength"], kinds["let"]["maxProperties"]) == (names.MAX_NUMBER_NAME, names.MAX_NAMES)
    assert (name["maxLength"], keys["include"]["maxItems"]) == (keys_and_values.MAX_NAME, includes.MAX_FILES)
    assert (keys["patches"]["maxItems"], kinds["numbers"]["maxItems"]) == (reader.MAX_PATCHES, reader.MAX_KNOTS)
    assert kinds["expression"]["maxLength"] == expression.MAX_CHARACTERS
    assert name["not"]["pattern"] == keys_and_values.CONTROL_CHARACTERS
    assert kinds["coefficients"]["anyOf"][0]["enum"] == [*COEFFICIENTS]


def test_a_misspelled_key_is_the_only_fault() -> None:
    """Neither a validator nor an editor, which knows the keys of the root, names another one."""
    patch = {"knots": [0, 1], "control_points": [[0, 0], [1, 1]], "lifting": [0, 1], "weihgts": [1, 2], "name": "a"}
    for spec, shown in ((patch, schema()), ({"patches": [patch]}, schema()["properties"]["patches"]["items"])):
        (fault,) = VALIDATOR.iter_errors(spec)
        assert (fault.validator, "'weihgts' was unexpected" in fault.message) == ("additionalProperties", True)
        assert patch.keys() - shown["properties"].keys() == {"weihgts"}


@pytest.mark.parametrize(("spec", "key"), cases("language/keys", "keys"))
def test_keys_belong_to_patches_models_or_copies(spec: dict[str, Any], key: str) -> None:
    curve = {"knots": [0, 1], "control_points": [[0, 0], [1, 1]]}
    tables = [table if "copy" in table else table | curve for table in spec.get("patches", ())]
    whole = spec | {"patches": tables} if tables else spec | curve
    (fault,) = VALIDATOR.iter_errors(whole)
    table = whole if key in whole else tables[0]
    expected = (f"{key!r} was unexpected", f"False schema does not allow {table[key]!r}")
    assert any(words in fault.message for words in expected)


@pytest.mark.parametrize("path", GOOD_SPECS, ids=lambda path: path.name)
def test_good_specs_are_valid(path: Path) -> None:
    VALIDATOR.validate(data(path))


@pytest.mark.parametrize("case", STRUCTURAL, ids=lambda case: case.file)
def test_structural_errors_are_invalid(case: Case) -> None:
    assert not VALIDATOR.is_valid(data(BAD_SPECS / case.file))


@pytest.mark.parametrize("case", OTHER, ids=lambda case: case.file)
def test_the_list_of_what_it_cannot_say_is_true(case: Case) -> None:
    assert VALIDATOR.is_valid(data(BAD_SPECS / case.file))


@pytest.mark.parametrize(
    "spec",
    [
        {"knots": [0, 1], "control_points": [[0, 0], [1, 1]]},
        {"knots": ["1/2", 1], "control_points": [["pi", 0, 1], [1, 1, 1]], "edge_scale": ["sqrt(2)", 1]},
        {"knots": [[0, 0], [1, 0], [0, 1]], "control_points": [[0, 0]] * 3, "coefficients": "partition-of-unity"},
        {"name": "a", "patches": [{"name": "b", "knots": [0, 1], "control_points": [[0, 0], [1, 1]]}]},
    ],
)
def test_small_specs_are_valid(spec: object) -> None:
    VALIDATOR.validate(spec)


def test_templates_name_a_schema_beside_them(tmp_path):
    for name in TEMPLATES:
        text = gtb("new", name, *([5] if TEMPLATES[name] else [])).text
        line, how = text.splitlines()[:2]
        assert line == "#:schema ./spec-schema.json"
        assert "gtb schema -o spec-schema.json" in how
    assert gtb("schema", "-o", tmp_path / "spec-schema.json").status == 0
    assert json.loads((tmp_path / "spec-schema.json").read_text(encoding="utf-8")) == schema()


def test_ribbons_belong_to_curves_of_a_loop() -> None:
    curve = {"knots": [0, 1], "control_points": [[0, 0, 0], [1, 0, 0]], "ribbon": [[0, 1, 0], ["1/2", 1, 0]]}
    VALIDATOR.validate({"patches": [curve]})
    assert not VALIDATOR.is_valid({"patches": [{**curve, "ribbon": [[0], [1]]}]})
    VALIDATOR.validate(curve)  # as a file that a loop includes


def test_the_page_of_keys_has_every_key_once_and_stands_among_the_specs() -> None:
    keys = re.findall(r"^### (.*)$", page(), re.MULTILINE)
    assert sorted(keys) == sorted(PATCH_KEYS | MODEL_KEYS | COPY_KEYS | INCLUDE_KEYS | {*RIBBONS})
    assert (SPECS / "SPEC.md").read_text(encoding="utf-8") == page() == gtb("help", "spec").text, (
        "gtb help spec > specs/SPEC.md"
    )
    properties = schema()["properties"]
    assert properties["weld"]["description"].startswith("Edges within this distance are joined")
    assert "description" in properties["patches"]["items"]["properties"]["rotate"]


@pytest.mark.parametrize("section", page().split("\n### ")[1:], ids=lambda section: section.split("\n")[0])
def test_its_lines_are_specs(section: str, tmp_path: Path) -> None:
    """Three lines each, which use the key, are valid, and are meshed, or filled."""
    key, *rest = section.split("\n")
    lines = [line.removeprefix("    ") for line in rest if line.startswith("    ")]
    assert len(lines) == 3
    text = "\n".join(lines) + "\n"
    assert re.search(rf"\b{key}\b", text)
    VALIDATOR.validate(tomllib.loads(text))
    (tmp_path / "spec.toml").write_text(text, encoding="utf-8")
    for name in ("bicubic.toml", "vase.toml"):
        shutil.copy(SPECS / name, tmp_path)
    command = ["fill", "--continuity", "g0", "--elevate", 0] if key in RIBBONS else ["mesh", "-n", 3]
    gtb(*command, tmp_path / "spec.toml", "-o", tmp_path / ("out.toml" if key in RIBBONS else "out.obj"), status=0)


def patterns(value: object) -> Iterator[str]:
    """Each pattern in a schema."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if key == "pattern":
            yield inner
        elif isinstance(inner, dict | list):
            yield from patterns(inner)


def test_patterns_are_what_editors_of_toml_understand() -> None:
    """Those of taplo are Rust's, without halves of surrogate pairs, looks around a match, and what matched before.

    With one pattern that it does not understand it marks every line of every spec as wrong.
    """
    found = list(patterns(schema()))
    assert len(found) >= 5
    assert not [pattern for pattern in found if re.search(r"\\u[dD][89a-fA-F]|\(\?|\\[1-9]", pattern)]
