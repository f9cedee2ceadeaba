"""The JSON that commands print or write: tables of the keys that are always there, and of others, and their check.

A kind of value is a word of JSON Schema, a list of another kind, a set of words, one number, None for null, a tuple of
kinds for any of them, or an object with the kind of each key, where a key that ends in ``?`` may be missing.
"""

import json
from functools import cache
from typing import Any, TypeAlias

import jsonschema

from gtb_cli.vocabulary import SCHEMA
from tests.shell import Result

Kind: TypeAlias = object

TEXT, NUMBER, INTEGER, BOOLEAN = "string", "number", "integer", "boolean"
POINT = [NUMBER]
BOX = [POINT]


def _each(keys: str, kind: Kind) -> dict[str, Kind]:
    """Return the kind of several keys."""
    return dict.fromkeys(keys.split(), kind)


EXTENTS = _each("length? length_error? area? area_error? volume? volume_error?", NUMBER)

FAULT: dict[str, Kind] = {
    **_each("file key", (TEXT, None)),
    **_each("line column", (INTEGER, None)),
    "message": TEXT,
    "severity": {"error", "warning"},
}

EVALUATED: dict[str, Kind] = {
    "parameters": [POINT],
    **_each("normals? curvature?", [[(NUMBER, None)]]),
    **_each("derivatives? second_derivatives?", [[[(NUMBER, None)]]]),
}

MEASURES: dict[str, Kind] = {
    "vertices": INTEGER,
    **_each("faces? segments?", INTEGER),
    "bounds": BOX,
    **_each("components euler_characteristic", INTEGER),
    **_each("length? area? volume? boundary_length?", (NUMBER, None)),
    **_each("open_ends? open_edges? crowded_edges?", INTEGER),
}

MESH = MEASURES | {
    "kind": {"mesh"},
    "format": TEXT,
    "space?": TEXT,
    **_each("centroid second_moments", ([NUMBER], None)),
    "digests": "object",
    **_each("turned_edges? collapsed_faces? collapsed_segments?", INTEGER),
    "groups": [{"name": TEXT, "faces?": INTEGER, "segments?": INTEGER}],
}
FAULTY: dict[str, Kind] = {"kind": {"mesh"}, "fault": TEXT, "bytes": INTEGER, "sha256": TEXT}

PATCH: dict[str, Kind] = {
    "name": (TEXT, None),
    "kind": TEXT,
    "degree": ([INTEGER], None),
    **_each("dimension knots", INTEGER),
    "hull_vertices": [POINT],
    "edges": [[INTEGER]],
    "edge_normals": (TEXT, None),
    "repeated_knots": [[INTEGER]],
    **_each("bounding_box control_box", BOX),
    "linear_precision_error": (NUMBER, None),
    **EXTENTS,
}

MODEL: dict[str, Kind] = {
    "name": (TEXT, None),
    "kind": {"model"},
    "dimension": INTEGER,
    **_each("bounding_box control_box", BOX),
    **_each("closed one_sided", BOOLEAN),
    "shared_edges": INTEGER,
    **_each("open_edges collapsed_edges not_joined", [TEXT]),
    "almost_shared_edges": [{"edges": [TEXT], "distance": NUMBER}],
    "welded_edges": INTEGER,
    "welded_distance": NUMBER,
    "crowded_edges": [[TEXT]],
    "joints": [{"edges": [TEXT], "angle": (NUMBER, None), "place": POINT, "curvature_difference": (NUMBER, None)}],
    "patches": [PATCH],
    **EXTENTS,
}

FINDING: Kind = {
    **_each("name reference reason", TEXT),
    "status": {"holds", "fails", "not applicable", "not decided", "measured"},
    **_each("value bound", (NUMBER, None)),
}
CHECKED: dict[str, Kind] = {"name": (TEXT, None), "holds": BOOLEAN, "properties": [FINDING]}
CHECKED_MODEL: dict[str, Kind] = {"name": (TEXT, None), "holds": BOOLEAN, "patches": [CHECKED], "joints": [FINDING]}

FARTHEST: Kind = {"distance": NUMBER, "at": POINT}
COMPARED_FILE: Kind = {"file": TEXT} | {f"{key.removesuffix('?')}?": kind for key, kind in MEASURES.items()}
COMPARED_BYTES = {"same": BOOLEAN, "distance": (NUMBER, None), "method": {"bytes"}, **_each("a b", COMPARED_FILE)}
COMPARED: dict[str, Kind] = COMPARED_BYTES | {
    "method": {"vertices", "surface", "patches"},
    "tolerance": NUMBER,
    "bound": (NUMBER, None),
    "proved": BOOLEAN,
    "turned_faces": INTEGER,
    **_each("remarks ignored warnings", [TEXT]),
    "mean": (NUMBER, None),
    "asked_tolerance": (NUMBER, None),
    "resolution": NUMBER,
    "diagonal": NUMBER,
    "vertices": ([INTEGER], None),
    "group": (TEXT, None),
    **_each("a_to_b b_to_a", FARTHEST),
}
NOT_COMPARED: dict[str, Kind] = {"same": False, "errors": [FAULT]}
FOLDERS: dict[str, Kind] = {
    "same": BOOLEAN,
    "files": [({"name": TEXT} | COMPARED, {"name": TEXT} | COMPARED_BYTES)],
    **_each("missing extra", [TEXT]),
    "renamed": "object",
    "errors": [{"name": TEXT} | FAULT],
}

CONE = {"cells": [[INTEGER]], "absent": [INTEGER], "lifting": [NUMBER], **_each("dimension used", INTEGER)}
CELLS: dict[str, Kind] = {"cells": [[INTEGER]], "polygons": [[INTEGER]], "absent": [INTEGER]}

VERSIONS = {**_each("gtb sources python system processor", TEXT), **_each("numpy scipy trimesh", (TEXT, None))}

MEMBER: Kind = {
    "file": TEXT,
    "x?": (NUMBER, {"inf"}),
    "step?": NUMBER,
    "vertices": INTEGER,
    "faces": INTEGER,
    "distance_to_limit": (NUMBER, None),
    "distance_error": (NUMBER, None),
    "distance_to_limit_with_film?": (NUMBER, None),
}

MADE: Kind = MEASURES | {
    "file": TEXT,
    "sha256": TEXT,
    "bytes": INTEGER,
    "inputs": "object",
    "warnings": [TEXT],
    "tolerance?": NUMBER,
    "assurance?": TEXT,
    "versions?": VERSIONS,
}

PART: dict[str, Kind] = {
    "kind": {"part"},
    **_each("format sha256", TEXT),
    **_each("faces trimmed_faces solids open_edges", INTEGER),
    "holes": [TEXT],
    "bounds": [POINT],
    **_each("area volume", (NUMBER, None)),
}

BENT = _each("area bending variation curvature relative_error", NUMBER)
FILLED: dict[str, Kind] = {
    "name": (TEXT, None),
    "sides": [
        {
            "name": TEXT,
            **_each("angle curvature_difference", (NUMBER, None)),
            **_each("place curvature_place", (POINT, None)),
        }
    ],
    "corner_angles": [(NUMBER, None)],
    "corners": [
        {
            "corner": INTEGER,
            "at": POINT,
            **_each("angle angle_near curvature curvature_exponent curvature_near", (NUMBER, None)),
            "curvature_forced": NUMBER,
            "folds": BOOLEAN,
        }
    ],
    "patches": [(TEXT, None)],
    **BENT,
    "nearer": BENT,
    **_each("folds sharp_turns knots", INTEGER),
    "remarks": [TEXT],
    "fault": (TEXT, None),
}

# What is printed or written, by its name
SCHEMAS: dict[str, tuple[dict[str, Kind], ...]] = {
    "info": (PATCH, MODEL, MESH, FAULTY, PART),
    "check": (CHECKED, CHECKED_MODEL),
    "diff": (COMPARED, COMPARED_BYTES, FOLDERS, NOT_COMPARED),
    "decompose": (CELLS, {"patches": [CELLS]}, {"decompositions": [CONE]}),
    "eval": (EVALUATED | {"points": [POINT]}, EVALUATED | {"basis": [POINT]}),
    "fill": (FILLED, {"holes": [{"edges": [TEXT], "near": POINT}]}),
    "errors": ({"errors": [FAULT], "status": INTEGER},),
    "version": (VERSIONS | {"click": TEXT},),
    "sequence": ({"name": (TEXT, None), "meshes": [MEMBER], "rate": {"predicted": (NUMBER, None)}},),
    "manifest": ({"versions": VERSIONS, "options": "object", "files": [MADE]},),
}


def schema_of(name: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of an output, or of a list of them, each with its file."""
    kinds = tuple({"schema": SCHEMA} | kind for kind in SCHEMAS[name])
    entries = [tuple(kind | {"file": TEXT} for kind in kinds)]
    return _schema((*kinds, entries) if name in ("info", "check") else kinds)


def _schema(kind: Kind) -> dict[str, Any]:
    match kind:
        case None:
            return {"type": "null"}
        case str():
            return {"type": kind}
        case int():
            return {"const": kind}
        case set():
            return {"enum": sorted(kind)}
        case list():
            return {"type": "array", "items": _schema(kind[0])}
        case tuple():
            return {"anyOf": [_schema(each) for each in kind]} if len(kind) > 1 else _schema(kind[0])
        case dict():
            return {
                "type": "object",
                "required": [key for key in kind if not key.endswith("?")],
                "properties": {key.removesuffix("?"): _schema(value) for key, value in kind.items()},
            }
    raise TypeError(f"{kind!r} is no kind of value")


@cache
def validator(name: str) -> jsonschema.protocols.Validator:
    return jsonschema.Draft202012Validator(schema_of(name))


def check_json(line: str, done: Result) -> None:
    """What a line that asks for JSON prints is valid, on both streams."""
    words = line.split()
    if done.text.startswith(("{", "[")) and "gtb" in words and "--json" in words:
        name = next((name for name in SCHEMAS if name in words), "version")
        validator(name).validate(json.loads(done.text))
    for text in done.err.splitlines():
        if text.startswith("{"):
            validator("errors").validate(json.loads(text))
