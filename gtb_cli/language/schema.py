"""The JSON Schema of a spec, for editors and for programs that write specs."""

from keyword import kwlist
from typing import Any, TypeAlias, get_args

from gtb_cli.knots.domain import EdgeNormals
from gtb_cli.language.copies import AXES
from gtb_cli.language.expression import CONSTANTS, FUNCTIONS, MAX_CHARACTERS
from gtb_cli.language.includes import MAX_FILES
from gtb_cli.language.names import COUNTER, MAX_NAMES, MAX_NUMBER_NAME, NAME_PATTERN
from gtb_cli.language.reader import MAX_KNOTS, MAX_PATCHES
from gtb_cli.language.values import CONTROL_CHARACTERS, MAX_NAME, MAX_SIZE
from gtb_cli.theory.patch import COEFFICIENTS

Schema: TypeAlias = dict[str, Any]


def schema() -> Schema:
    """Return the JSON Schema (draft 2020-12) of a spec, TOML or JSON, as plain data, ready for ``json.dumps``.

    Notes
    -----
    A schema cannot express every rule. `gtb_cli.language.loading.parse` alone checks syntax, repeated keys and sizes;
    that lists have an entry for each knot; the values of expressions and the names in them; that copied patches and
    included files exist; that `ribbon` is for curves and for gtb fill alone; that names do not clash; that numbers are
    finite (JSON has no others); that a name has no half of a surrogate pair; that the hull is not flat, and the number
    of its edges; and whether the knots are a lattice.
    """
    is_model = _any({"required": ["patches"]}, {"required": ["include"]})
    names = {"pattern": f"^{NAME_PATTERN}$", "maxLength": MAX_NUMBER_NAME}
    definitions = {
        "let": {
            "description": "Named numbers, for all expressions; each may use those before it.",
            "type": "object",
            "propertyNames": names | {"not": {"enum": [*FUNCTIONS, *CONSTANTS, COUNTER, *kwlist]}},
            "additionalProperties": _number(),
            "maxProperties": MAX_NAMES,
        },
        "name": {
            "description": "Default: the name of the file without its suffix.",
            "type": "string",
            "maxLength": MAX_NAME,
            "pattern": r"\S",
            "not": {"pattern": CONTROL_CHARACTERS},
        },
        "coordinate": _number(minimum=-MAX_SIZE, maximum=MAX_SIZE),
        "positive": _number(exclusiveMinimum=0),
        "scale": _number(minimum=1 / MAX_SIZE, maximum=MAX_SIZE),
        "expression": {
            "description": "Digits, + - * / ** ( ), sqrt sin cos tan exp log pi e deg, names of let.",
            "type": "string",
            "maxLength": MAX_CHARACTERS,
            "pattern": "[0-9A-Za-z]",
            "not": {"pattern": r"[^-+*/()0-9A-Za-z_. \t]|(^|[^A-Za-z0-9_])[0-9.]*_"},
        },
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "GT-Bézier patch, or model of several patches",
        **_either(_model(), is_model, shared=("name", "let")),
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


def _told(**keys: tuple[str, Schema]) -> Schema:
    """Return schemas, each with its description."""
    return {key: {"description": text, **schema} for key, (text, schema) in keys.items()}


def _model() -> Schema:
    """Return the keys of a model, and of patches what they have in common with it."""
    files = {"type": "array", "items": {"type": "string", "minLength": 1}, "maxItems": MAX_FILES}
    percentage = {"type": "string", "pattern": r"^[-+*/()0-9A-Za-z_. \t]*[0-9A-Za-z)][ \t]*%[ \t]*$"}
    joined = "Edges within this distance are joined: model units, or a percentage of the model's size."
    return {
        "let": _ref("let"),
        **_told(
            include=("Files of this file's folder, or below it, whose patches come before these.", files),
            weld=(joined, _any(_ref("positive"), percentage)),
        ),
        "patches": _array(_either(_copy(), {"required": ["copy"]}, shared=()), 1, MAX_PATCHES),
    }


def _copy() -> Schema:
    """Return the keys of a copy: mirrored, scaled, rotated and translated, in this order."""
    about = {"description": "The fixed point; default: the origin.", **_list("coordinate", 2, 3)}
    axis = _any({"enum": list(AXES)}, _list("coordinate", 3, 3))
    count = "How many copies are made: k = 1, 2, ... in their expressions, and after their names."
    return {
        **_told(
            copy=("Name of the patch that is copied.", {"type": "string"}),
            mirror=("The coordinate that changes sign; normals stay outward.", {"enum": list(AXES)}),
            scale=("Factor, or one for each coordinate.", _any(_ref("scale"), _list("scale", 3, 3))),
        ),
        "rotate": {
            "type": "object",
            "properties": {"axis": axis, "degrees": _ref("coordinate"), "about": about},
            "required": ["axis", "degrees"],
            "additionalProperties": False,
        },
        "translate": _list("coordinate", 2, 3),
        **_told(repeat=(count, _number(minimum=1, maximum=MAX_PATCHES))),
    }


def _patch() -> Schema:
    """Return the keys of a patch, but for its name."""
    numbers = _list("coordinate")
    points = _any(_tuples(2), _tuples(3))
    logarithms = "Natural logarithms of the weights, in place of these, where they are beyond floats."
    places = "Control points b_i, one for each knot, all with two coordinates (z = 0) or all with three."
    rule = "Coefficients c_i of the basis, one for each knot, or the name of a rule; default: all 1."
    factor = "Factor of the edge functions, or one for each edge, counter-clockwise from the lowest, then leftmost, "
    normals = {"enum": list(get_args(EdgeNormals)), "default": "auto"}
    return _told(
        knots=(
            "Knots a_i in any order: numbers for a curve, pairs for a surface.",
            _any(_list("coordinate", 2), _tuples(2, 3)),
        ),
        weights=("Weights, one for each knot; default: all 1.", _list("positive")),
        log_weights=(logarithms, numbers),
        control_points=(places, points),
        ribbon=("For gtb fill, a curve's second row of control points, which goes into the hole.", points),
        coefficients=(rule, _any({"enum": list(COEFFICIENTS)}, _list("positive"))),
        lifting=("Lifting values λ_i, one for each knot.", numbers),
        edge_normals=("Length of the edge functions' normals.", normals),
        edge_scale=(
            f"{factor}corner; for a curve [k0, k1].",
            _any(_ref("scale"), _list("scale", 2)) | {"default": 1},
        ),
    )
