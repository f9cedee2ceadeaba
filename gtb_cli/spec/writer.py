"""`Patch` and `Model` → the text of a spec."""

from __future__ import annotations

import math

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import SpecError
from gtb_cli.spec.reader import name_fault
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch


def dump(spec: Patch | Model) -> str:
    """Write a patch or model as TOML, with the shortest digits that read back exactly.

    Parameters
    ----------
    spec : Patch or Model

    Returns
    -------
    str
        `gtb_cli.spec.loading.parse` gives equal arrays for it. Keys that have their default value are left out.

    Raises
    ------
    SpecError
        What a spec cannot say: weights beyond the range of floats, a name with control characters.
    """
    if isinstance(spec, Patch):
        return _patch_text(spec)
    parts = [] if spec.name is None else [_name_text(spec.name)]
    return "\n".join(parts + [f"[[patches]]\n{_patch_text(patch)}" for patch in spec.patches])


def _patch_text(patch: Patch) -> str:
    if not (np.isfinite(patch.weights) & (patch.weights > 0)).all():
        raise SpecError("weights: beyond the range of floats, a spec cannot hold them")
    ones = np.ones(len(patch.knots))
    text = "" if patch.name is None else _name_text(patch.name)
    text += _row_text("knots", patch.knots if patch.dimension == 2 else patch.knots[:, 0])
    if (patch.weights != ones).any():
        text += _row_text("weights", patch.weights)
    points = patch.control_points
    planar = not points[:, 2].any() and not np.signbit(points[:, 2]).any()
    text += _row_text("control_points", points[:, :2] if planar else points)
    if (patch.coefficients != ones).any():
        text += _row_text("coefficients", patch.coefficients)
    if patch.lifting is not None:
        text += _row_text("lifting", patch.lifting)
    if patch.edge_normals != "auto":
        text += f'edge_normals = "{patch.edge_normals}"\n'
    scale = np.asarray(patch.edge_scale, dtype=np.float64)
    if scale.ndim:
        text += _row_text("edge_scale", scale)
    elif scale != 1:
        text += f"edge_scale = {_number_text(float(scale))}\n"
    return text


def _name_text(name: str) -> str:
    if fault := name_fault(name):
        raise SpecError(f"name: {fault}")
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'name = "{escaped}"\n'


def _row_text(key: str, values: FloatArray) -> str:
    """Write an array on one line if it fits, else in lines filled up to 100 characters."""
    entries = [
        f"[{', '.join(map(_number_text, entry))}]" if isinstance(entry, list) else _number_text(entry)
        for entry in values.tolist()
    ]
    line = f"{key} = [{', '.join(entries)}]\n"
    if len(line) <= 100:
        return line
    lines = [""]
    for entry in entries:
        if len(lines[-1]) + len(entry) > 94:
            lines.append("")
        lines[-1] += f" {entry},"
    return f"{key} = [\n" + "".join(f"   {line}\n" for line in lines) + "]\n"


def _number_text(x: float) -> str:
    if x.is_integer() and abs(x) < 1e15 and (x or math.copysign(1, x) > 0):
        return str(int(x))
    return repr(x)
