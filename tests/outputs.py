"""JSON that commands print, against the schemas of `gtb schema --output`."""

import json
from functools import cache

import jsonschema

from gtb_cli.language.outputs import schema_of
from gtb_cli.vocabulary import OUTPUTS
from tests.shell import Result


@cache
def validator(name: str) -> jsonschema.protocols.Validator:
    return jsonschema.Draft202012Validator(schema_of(name))


def check_json(line: str, done: Result) -> None:
    """What a line that asks for JSON prints is valid, on both streams."""
    words = line.split()
    if done.text.startswith(("{", "[")) and "gtb" in words and "--json" in words:
        name = next((name for name in OUTPUTS if name in words), "version")
        validator(name).validate(json.loads(done.text))
    for text in done.err.splitlines():
        if text.startswith("{"):
            validator("errors").validate(json.loads(text))
