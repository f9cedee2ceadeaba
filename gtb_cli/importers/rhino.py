"""``.3dm`` files of Rhino: curves, surfaces and the faces of solids, as exact Bézier patches.

McNeel's own library, which is an extra of this package, reads the format in a separate process.
"""

import json
import subprocess
import sys
from typing import Any

import numpy as np

from gtb_cli.errors import DomainError, SpecError
from gtb_cli.importers import rhino_process
from gtb_cli.importers.nurbs import MAX_CONTROL_POINTS, spans
from gtb_cli.importers.words import MAX_MAGNITUDE
from gtb_cli.language.entries import valid_name
from gtb_cli.language.patch_reader import MAX_PATCHES
from gtb_cli.theory.patch import Patch

# Seconds after which the process is stopped: it may only wait, or the system may not limit its processor time
PATIENCE_SECONDS = 60.0


def read_3dm(data: bytes, source: str) -> tuple[list[Patch], list[str]]:
    """Read the curves and surfaces of a ``.3dm`` file; faces of solids are whole, not trimmed."""
    *objects, last = _objects(data, source)
    patches: list[Patch] = []
    others = trimmed = 0
    for index, entry in enumerate(objects):
        name, forms = valid_name(entry["name"]), entry["forms"]
        others += not forms
        trimmed += entry["trimmed"]
        for face, form in enumerate(forms):
            try:
                patches += _spans(form, name if len(forms) == 1 or name is None else f"{name}-{face}")
            except DomainError as error:
                raise SpecError(f"{source}: objects[{index}]: {error}") from None
            if len(patches) > MAX_PATCHES:
                raise SpecError(f"{source}: objects[{index}]: here the model has more than {MAX_PATCHES} patches")
    remarks = [f"its unit of length is {last['unit']}"]
    if others:
        remarks.append(f"{others} objects that are neither curves nor surfaces are left out")
    if trimmed:
        remarks.append(f"{trimmed} solids or trimmed surfaces: their faces are given whole, not trimmed")
    return patches, remarks


def _objects(data: bytes, source: str) -> list[dict[str, Any]]:
    damaged = f"{source}: is not a .3dm file, or is damaged"
    try:
        # -P: modules are imported neither from the folder of that file nor from the working folder.
        done = subprocess.run(
            [sys.executable, "-P", rhino_process.__file__],
            input=data,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=PATIENCE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise SpecError(f"{damaged}: it is not read within {PATIENCE_SECONDS:g} s") from None
    if done.returncode == rhino_process.MISSING_STATUS:
        raise SpecError(f"{source}: .3dm files need the extra gtb-cli[rhino]: pip install 'gtb-cli[rhino]'")
    if done.returncode == rhino_process.DAMAGED_STATUS:
        raise SpecError(damaged)
    if done.returncode:
        raise SpecError(f"{damaged}: Rhino's library fails, or needs more time or memory than such a file may")
    return [json.loads(line) for line in done.stdout.splitlines()]


def _spans(form: dict[str, Any], name: str | None) -> list[Patch]:
    """Return the patches of a curve or surface that the process has printed."""
    counts = form["counts"]
    if not form["rows"]:
        raise DomainError(f"control points: expected 1 to {MAX_CONTROL_POINTS}, got {' × '.join(map(str, counts))}")
    rows = np.array(form["rows"])
    # This format leaves out the first and the last knot, which have no effect.
    knots = [np.array([*row[:1], *row, *row[-1:]]) for row in form["knots"]]
    for what, values in [("control points", rows), *(("knots", row) for row in knots)]:
        if not (np.abs(values) <= MAX_MAGNITUDE).all():
            raise DomainError(f"{what}: expected numbers up to {MAX_MAGNITUDE:g}")
    return spans(form["degrees"], knots, rows.reshape(*counts, 4), name)
