"""`Patch` and `Model` → a spec: plain data, text, or a file."""

import json
import math
import os
from typing import Any

import numpy as np

from gtb_cli.errors import SpecError
from gtb_cli.files import replace_file
from gtb_cli.language.document import spec_format_of
from gtb_cli.language.keys_and_values import MAX_SIZE, name_fault
from gtb_cli.language.loading import parse
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import CAD_SUFFIXES, CELL_FORMATS, FORMATS, suffix_of


def to_dict(spec: Patch | Model) -> dict[str, Any]:
    """Return a patch or model as plain data, with the keys of a spec; keys with their default value are left out.

    Returns
    -------
    dict
        Lists, numbers and strings, ready for ``json.dumps``; `gtb_cli.from_dict` turns them into an equal value.
        Weights are numbers if the logarithms of these are those of the patch, otherwise (x^λ ω) they are `log_weights`.
    """
    if isinstance(spec, Model):
        whole = {"name": spec.name, "weld": spec.weld, "patches": [to_dict(patch) for patch in spec.patches]}
        return {key: value for key, value in whole.items() if value is not None}
    if not isinstance(spec, Patch):
        raise SpecError(f"expected a Patch or a Model, got {type(spec).__name__}")
    ones = np.ones(len(spec.knots))
    with np.errstate(divide="ignore"):
        by_number = np.array_equal(np.log(spec.weights), spec.log_weights)
    points, scale = spec.control_points, np.asarray(spec.edge_scale, dtype=np.float64)
    planar = not points[:, 2].any() and not np.signbit(points[:, 2]).any()
    data = {
        "name": spec.name,
        "knots": (spec.knots if spec.dimension == 2 else spec.knots[:, 0]).tolist(),
        "weights": spec.weights.tolist() if by_number and (spec.weights != ones).any() else None,
        "log_weights": None if by_number else spec.log_weights.tolist(),
        "control_points": (points[:, :2] if planar else points).tolist(),
        "coefficients": spec.coefficients.tolist() if (spec.coefficients != ones).any() else None,
        "lifting": None if spec.lifting is None else spec.lifting.tolist(),
        "edge_normals": None if spec.edge_normals == "auto" else spec.edge_normals,
        "edge_scale": scale.tolist() if scale.ndim or scale != 1 else None,
    }
    return {key: value for key, value in data.items() if value is not None}


def save(spec: Patch | Model, path: str | os.PathLike[str]) -> None:
    """Write a patch or model as a spec: JSON if the path ends in ``.json``, otherwise TOML.

    Parameters
    ----------
    spec : Patch or Model
    path : path
        The file appears whole or not at all, and replaces an existing one.

    Raises
    ------
    SpecError
        A spec cannot hold the patch, or the path belongs to another kind of file; nothing is written.
    ExportError
        The file cannot be written.

    Notes
    -----
    `gtb_cli.load` reads back an equal value, bit for bit, which is checked before anything is written. Only the name
    may be new: a spec without one is named after its file.
    """
    target = os.fspath(path)
    text = _text(to_dict(spec), target)
    if parse(text, target, spec_format_of(target) or "toml").replace(name=spec.name) != spec:
        raise SpecError(f"{target}: a spec cannot hold this exactly: both weights and other logarithms of weights")
    replace_file(target, [text.encode("utf-8")])


def dump(spec: Patch | Model, target: str = "") -> str:
    """Return the text of a spec, TOML or JSON as `save` does, with the shortest digits that read back exactly.

    For readability, weights are numbers if possible; their logarithms may then be rounded. Raises `SpecError` if a name
    has control characters, numbers are beyond those that are read, or the target is named like a mesh or CAD file.
    """
    patches = []
    for patch in (spec,) if isinstance(spec, Patch) else spec.patches:
        for key, values in (("knots", patch.knots), ("control_points", patch.control_points)):
            if not (np.abs(values) <= MAX_SIZE).all():
                raise SpecError(f"{key}: the result has numbers beyond {MAX_SIZE:g} in size, which no spec may have")
        is_float = (np.isfinite(patch.weights) & (patch.weights > 0)).all()
        patches.append(patch.replace(weights=patch.weights.copy()) if is_float else patch)
    return _text(to_dict(patches[0] if isinstance(spec, Patch) else spec.replace(patches=tuple(patches))), target)


def check_target(target: str) -> None:
    """Refuse to write a spec to a file with the name of a mesh or CAD file, by a `SpecError`."""
    if suffix_of(target) in {*FORMATS, *CAD_SUFFIXES, *CELL_FORMATS}:
        raise SpecError(f"{target}: expected a name that ends in .toml or .json, this is that of a mesh or CAD file")


def _text(data: dict[str, Any], target: str) -> str:
    check_target(target)
    return json.dumps(data, indent=1) + "\n" if spec_format_of(target) == "json" else _toml(data)


def _toml(data: dict[str, Any]) -> str:
    text = ""
    for key, value in data.items():
        if key == "name":
            if fault := name_fault(value):
                raise SpecError(f"name: {fault}")
            value = value.replace("\\", "\\\\").replace('"', '\\"')
        if key == "patches":
            text = "\n".join([text] * bool(text) + [f"[[patches]]\n{_toml(patch)}" for patch in value])
        elif isinstance(value, list):
            text += _row_text(key, value)
        else:
            text += f'{key} = "{value}"\n' if isinstance(value, str) else f"{key} = {_value_text(value)}\n"
    return text


def _row_text(key: str, values: list[Any]) -> str:
    """Write an array on one line if it fits, otherwise on lines of up to 100 characters."""
    line = f"{key} = {_value_text(values)}\n"
    if len(line) <= 100:
        return line
    lines = [""]
    for entry in map(_value_text, values):
        if len(lines[-1]) + len(entry) > 94:
            lines.append("")
        lines[-1] += f" {entry},"
    return f"{key} = [\n" + "".join(f"   {line}\n" for line in lines) + "]\n"


def _value_text(x: float | list[Any]) -> str:
    if isinstance(x, list):
        return f"[{', '.join(map(_value_text, x))}]"
    if x.is_integer() and abs(x) < 1e15 and (x or math.copysign(1, x) > 0):
        return str(int(x))
    return repr(x)
