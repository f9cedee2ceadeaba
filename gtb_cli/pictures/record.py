"""Reader of the folders that `gtb degenerate` and `gtb knot-limit` write."""

import json
import math
import os
from typing import Any

from gtb_cli.errors import SpecError
from gtb_cli.files import read_file
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.pictures.sequences import Frames
from gtb_cli.vocabulary import SEQUENCE_RECORD


def read_frames(path: str) -> Frames:
    """Read the meshes that a `sequence.json`, or that of a folder, lists.

    Raises
    ------
    SpecError
        The record does not exist or is not valid; it may only name files in its own folder.
    GtbError
        A mesh cannot be read.
    """
    max_record_bytes = 10_000_000  # a record in bytes
    record = os.path.join(path, SEQUENCE_RECORD) if os.path.isdir(path) else path
    data = read_file(record, max_record_bytes + 1)
    try:
        entries = json.loads(data if len(data) <= max_record_bytes else b"")["meshes"]
        key = next(key for key in ("x", "step") if key in entries[0])
        values = tuple(_number(entry[key]) for entry in entries)
        measured = [entry["distance_to_limit"] for entry in entries]
        distances = () if None in measured else tuple(float(value) for value in measured)
        filmed = [entry.get("distance_to_limit_with_film") for entry in entries]
        names = [os.fspath(entry["file"]) for entry in entries]
    except (ValueError, KeyError, TypeError, IndexError, StopIteration, AttributeError, RecursionError):
        raise SpecError(f"{record}: is not a list of meshes as gtb degenerate and gtb knot-limit write it") from None
    for name in names:
        if os.path.basename(name) != name:
            raise SpecError(f"{record}: {name!r} is not the name of a file in its folder")
    folder = os.path.dirname(record)
    meshes = tuple(read_mesh(os.path.join(folder, name)) for name in names)
    if len({mesh.is_curve for mesh in meshes}) > 1:
        raise SpecError(f"{record}: curves and surfaces are mixed")
    films = None if None in filmed else tuple(float(value) for value in filmed)
    return Frames(key, values, meshes, distances, films)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | str) or (value != "inf" and value == str(value)):
        raise ValueError(value)
    return math.inf if value == "inf" else float(value)
