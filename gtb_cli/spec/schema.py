"""The JSON Schema of a spec, for editors and for programs that write specs."""

from __future__ import annotations

from typing import Any, get_args

from gtb_cli.knots.domain import EdgeNormals
from gtb_cli.spec.expression import MAX_LENGTH
from gtb_cli.spec.reader import CONTROL, LARGEST, MAX_KNOTS, MAX_NAME, MAX_PATCHES, NAMED_COEFFICIENTS


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a spec, TOML or JSON.

    Returns
    -------
    dict
        Plain data, ready for ``json.dumps``.

    Notes
    -----
    What a schema cannot say is left to `gtb_cli.spec.loading.parse`: that lists have an entry for each knot, whether an
    expression has a value and which, that numbers are finite (JSON has no others), that the hull is not flat, how many
    edges it has, whether the knots are a lattice; and what comes before data, such as syntax, repeated keys and sizes.
    """
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "GT-Bézier patch, or model of several patches",
        "if": {"type": "object", "required": ["patches"]},
        "then": {"$ref": "#/$defs/model"},
        "else": {"$ref": "#/$defs/patch"},
        "$defs": {
            "model": _MODEL,
            "patch": _PATCH,
            "name": {
                "description": "Default: the name of the file without its suffix.",
                "type": "string",
                "maxLength": MAX_NAME,
                "pattern": r"\S",
                "not": {"pattern": CONTROL},
            },
            "coordinate": _number(minimum=-LARGEST, maximum=LARGEST),
            "positive": _number(exclusiveMinimum=0),
            "scale": _number(minimum=1 / LARGEST, maximum=LARGEST),
            "expression": {
                "description": "Digits, + - * / ** ( ), sqrt sin cos tan exp log pi e.",
                "type": "string",
                "maxLength": MAX_LENGTH,
                "pattern": "[0-9a-z]",
                "not": {"pattern": r"[^-+*/()0-9A-Za-z. \t]"},
            },
        },
    }


def _number(**limits: float) -> dict[str, Any]:
    return {"anyOf": [{"type": "number", **limits}, {"$ref": "#/$defs/expression"}]}


def _list(kind: str, least: int = 0) -> dict[str, Any]:
    return {"type": "array", "items": {"$ref": f"#/$defs/{kind}"}, "minItems": least, "maxItems": MAX_KNOTS}


def _tuples(size: int, least: int = 0) -> dict[str, Any]:
    entry = {"type": "array", "items": {"$ref": "#/$defs/coordinate"}, "minItems": size, "maxItems": size}
    return {"type": "array", "items": entry, "minItems": least, "maxItems": MAX_KNOTS}


_MODEL = {
    "type": "object",
    "properties": {
        "name": {"$ref": "#/$defs/name"},
        "patches": {
            "type": "array",
            "items": {"$ref": "#/$defs/patch"},
            "minItems": 1,
            "maxItems": MAX_PATCHES,
        },
    },
    "required": ["patches"],
    "additionalProperties": False,
}

_PATCH = {
    "type": "object",
    "properties": {
        "name": {"$ref": "#/$defs/name"},
        "knots": {
            "description": "Knots a_i in any order: numbers for a curve, pairs for a surface.",
            "anyOf": [_list("coordinate", 2), _tuples(2, 3)],
        },
        "weights": {"description": "Weights, one for each knot; default: all 1.", **_list("positive")},
        "log_weights": {
            "description": "Natural logarithms of the weights, in place of these, where they are beyond floats.",
            **_list("coordinate"),
        },
        "control_points": {
            "description": "Control points b_i, one for each knot, all with two coordinates (z = 0) or all with three.",
            "anyOf": [_tuples(2), _tuples(3)],
        },
        "coefficients": {
            "description": "Coefficients c_i of the basis, one for each knot, or the name of a rule; default: all 1.",
            "anyOf": [{"enum": list(NAMED_COEFFICIENTS)}, _list("positive")],
        },
        "lifting": {"description": "Lifting values λ_i, one for each knot.", **_list("coordinate")},
        "edge_normals": {
            "description": "Length of the edge functions' normals.",
            "enum": list(get_args(EdgeNormals)),
            "default": "auto",
        },
        "edge_scale": {
            "description": "Factor of the edge functions, or one for each edge, counter-clockwise from the lowest, "
            "then leftmost, corner; for a curve [k0, k1].",
            "anyOf": [{"$ref": "#/$defs/scale"}, _list("scale", 2)],
            "default": 1,
        },
    },
    "required": ["knots", "control_points"],
    "not": {"required": ["weights", "log_weights"]},
    "additionalProperties": False,
}
