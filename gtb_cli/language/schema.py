"""The JSON Schema of a spec, for editors and for programs that write specs."""

import re
from keyword import kwlist
from pathlib import Path
from typing import Any, TypeAlias, get_args

from gtb_cli.knots.domain import EdgeNormals
from gtb_cli.language.copies import AXES
from gtb_cli.language.expression import CONSTANTS, COUNTER, FUNCTIONS, MAX_CHARACTERS
from gtb_cli.language.includes import MAX_FILES
from gtb_cli.language.keys_and_values import CONTROL_CHARACTERS, MAX_NAME, MAX_SIZE
from gtb_cli.language.names import MAX_NAMES, MAX_NUMBER_NAME, NAME_PATTERN
from gtb_cli.language.patch_reader import GRID, MAX_KNOTS, MAX_PATCHES
from gtb_cli.theory.basis import COEFFICIENTS

Schema: TypeAlias = dict[str, Any]


def page() -> str:
    """Return the text of every key with an example, as Markdown."""
    return Path(__file__).with_name("spec.md").read_text(encoding="utf-8")


def schema() -> Schema:
    """Return the JSON Schema (draft 2020-12) of a spec, TOML or JSON, as plain data, ready for ``json.dumps``.

    A schema cannot express every rule. `gtb_cli.language.loading.parse` alone checks syntax, repeated keys and sizes;
    that lists have an entry for each knot; the values of expressions and the names in them; that copied patches and
    included files exist; that ribbons are for curves and for gtb fill alone; that names do not clash; that numbers are
    finite (JSON has no others); that a name has no half of a surrogate pair; that the hull is not flat, and the number
    of its edges; and whether the knots are a lattice.
    """
    names = {"pattern": f"^{NAME_PATTERN}$", "maxLength": MAX_NUMBER_NAME}
    definitions = {
        "let": {
            "type": "object",
            "propertyNames": names | {"not": {"enum": [*FUNCTIONS, *CONSTANTS, COUNTER, *kwlist]}},
            "additionalProperties": _number(),
            "maxProperties": MAX_NAMES,
        },
        "name": {"type": "string", "maxLength": MAX_NAME, "pattern": r"\S", "not": {"pattern": CONTROL_CHARACTERS}},
        "coordinate": _number(minimum=-MAX_SIZE, maximum=MAX_SIZE),
        "positive": _number(exclusiveMinimum=0),
        "scale": _number(minimum=1 / MAX_SIZE, maximum=MAX_SIZE),
        "expression": {
            "description": "Digits, + - * / ** ( ), sqrt sin cos tan asin acos atan exp log pi e deg, names of let.",
            "type": "string",
            "maxLength": MAX_CHARACTERS,
            "pattern": "[0-9A-Za-z]",
            "not": {"pattern": r"[^-+*/()0-9A-Za-z_. \t]|(^|[^A-Za-z0-9_])[0-9.]*_"},
        },
    }
    definitions["let"], definitions["name"] = (_told({key: definitions[key]})[key] for key in ("let", "name"))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "GT-Bézier patch, or model of several patches",
        **_either(_model(), _any({"required": ["patches"]}, {"required": ["include"]}), shared=("name", "let")),
        "$defs": {f"{key}_of_patch": schema for key, schema in _patch().items()} | definitions,
    }


def _ref(kind: str) -> Schema:
    return {"$ref": f"#/$defs/{kind}"}


def _any(*schemas: Schema) -> Schema:
    return {"anyOf": list(schemas)}


def _number(**limits: float) -> Schema:
    return _any({"type": "number", **limits}, _ref("expression"))


def _array(items: Schema, least: int, most: int) -> Schema:
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


def _list(kind: str, least: int = 0, most: int = MAX_KNOTS) -> Schema:
    return _array(_ref(kind), least, most)


def _tuples(size: int, least: int = 0) -> Schema:
    return _array(_list("coordinate", size, size), least, MAX_KNOTS)


def _either(others: Schema, condition: Schema, shared: tuple[str, ...]) -> Schema:
    """Return the schema of a patch, or if a condition holds of a table with other keys.

    All keys stand side by side, and the condition forbids some: where each case had a list of its own, editors would
    report every key of a patch beside one that is misspelled.
    """
    patch = {key: _ref(f"{key}_of_patch") for key in _patch()}
    return {
        "type": "object",
        "properties": {"name": _ref("name"), **patch, **others},
        "additionalProperties": False,
        "if": condition,
        "then": {"properties": dict.fromkeys(patch, False)},
        "else": {
            "required": ["knots", "control_points"],
            "not": {"required": ["weights", "log_weights"]},
            "properties": {key: False for key in others if key not in shared},
        },
    }


def _told(keys: Schema) -> Schema:
    """Return the schemas of keys, each with what the page says first of it."""
    texts = dict(re.findall(r"^### (\w+)\n\n((?:\S.*\n)+)", page(), re.MULTILINE))
    return {key: {"description": " ".join(texts[key].split()), **schema} for key, schema in keys.items()}


def _model() -> Schema:
    """Return the keys of a model, and of patches what they have in common with it."""
    file = _told({"file": {"type": "string", "minLength": 1}})
    moved = {"properties": {"name": _ref("name"), "let": _ref("let"), **_moves(), **file}, "required": ["file"]}
    entry = _any(file["file"], {"type": "object", **moved, "additionalProperties": False})
    percentage = {"type": "string", "pattern": r"^[-+*/()0-9A-Za-z_. \t]*[0-9A-Za-z)][ \t]*%[ \t]*$"}
    names = _any({"type": "string"}, _array({"type": "string"}, 1, MAX_PATCHES))
    copy = _told({"copy": names, "hidden": {"type": "boolean"}}) | _moves()
    keys = {
        "include": _array(entry, 0, MAX_FILES),
        "weld": _any(_ref("positive"), percentage),
        "patches": _array(_either(copy, {"required": ["copy"]}, shared=("hidden",)), 1, MAX_PATCHES),
    }
    return {"let": _ref("let"), **_told(keys)}


def _moves() -> Schema:
    """Return the keys by which copies are mirrored, scaled, rotated, translated and repeated."""
    axis = _any({"enum": list(AXES)}, _list("coordinate", 3, 3))
    angle = {"axis": axis, "degrees": _ref("coordinate"), "about": _list("coordinate", 2, 3)}
    rotation = {"type": "object", "properties": angle, "required": ["axis", "degrees"], "additionalProperties": False}
    return _told(
        {
            "mirror": {"enum": list(AXES)},
            "scale": _any(_ref("scale"), _list("scale", 3, 3)),
            "rotate": rotation,
            "translate": _list("coordinate", 2, 3),
            "repeat": _number(minimum=1, maximum=MAX_PATCHES),
        }
    )


def _patch() -> Schema:
    """Return the keys of a patch, but for its name."""
    numbers = _list("coordinate")
    points = _any(_tuples(2), _tuples(3))
    return _told(
        {
            "knots": _any(_list("coordinate", 2), _tuples(2, 3), {"type": "string", "pattern": f"^{GRID}$"}),
            "weights": _list("positive"),
            "log_weights": numbers,
            "control_points": points,
            "ribbon": points,
            "ribbon2": points,
            "coefficients": _any({"enum": list(COEFFICIENTS)}, _list("positive")),
            "lifting": numbers,
            "edge_normals": {"enum": list(get_args(EdgeNormals)), "default": "auto"},
            "edge_scale": _any(_ref("scale"), _list("scale", 2)) | {"default": 1},
        }
    )
