"""A separate process that reads a ``.3dm`` file from standard input and prints lines of JSON.

On some damaged files McNeel's library runs for ever or takes all memory, and nothing in its own process can stop it.
This file is run by its path and imports nothing from the package, so that the process starts fast.

Each line but the last is an object of the file: its ``name``, whether it is ``trimmed``, and its ``forms``, NURBS with
``degrees``, ``knots`` (one row for each parameter), ``counts`` of control points and their homogeneous ``rows``. The
last line has the file's ``unit``: without it, the output is incomplete.
"""

import json
import sys
from collections.abc import Iterator
from importlib import import_module
from itertools import product
from math import prod
from typing import Any

MISSING_STATUS = 3  # exit status if the library is not installed
DAMAGED_STATUS = 4  # exit status if the library refuses the file

# Processor seconds allowed for any file, and for each byte of it. A sound file of 8 MB takes 0.06 s to read and 3 s to
# print, nearly all of it in Python.
SECONDS, SECONDS_PER_BYTE = 0.5, 2e-6

# Bytes of memory allowed for any file beyond what the process already has, and for each byte of the file
MEMORY, MEMORY_PER_BYTE = 150_000_000, 10

# Largest number of control points of a form, as in `gtb_cli.importers.nurbs`; larger forms have no rows
MAX_CONTROL_POINTS = 100_000


def main() -> int:
    """Read standard input, and return the exit status."""
    data = sys.stdin.buffer.read()
    try:
        library = import_module("rhino3dm")
    except ImportError:
        return MISSING_STATUS
    _limit(len(data))
    file = library.File3dm.FromByteArray(data)
    if file is None:
        return DAMAGED_STATUS
    for entry in file.Objects:
        forms, trimmed = _forms(library, entry.Geometry)
        _write({"name": entry.Attributes.Name, "trimmed": trimmed, "forms": list(map(_plain, forms))})
    _write({"unit": str(file.Settings.ModelUnitSystem).rpartition(".")[2].lower()})
    return 0


def _write(line: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(line) + "\n")


def _limit(size: int) -> None:
    """Let the system end this process when it needs more than a file of this size may."""
    try:
        import resource
        import signal

        signal.setitimer(signal.ITIMER_PROF, SECONDS + size * SECONDS_PER_BYTE)
        with open("/proc/self/statm", encoding="ascii") as statistics:
            now = int(statistics.read().split()[0]) * resource.getpagesize()
        most = now + MEMORY + size * MEMORY_PER_BYTE
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    except (ImportError, AttributeError, OSError, ValueError):
        return  # a system without limits; the parent process waits for a limited time


def _forms(library: Any, geometry: Any) -> tuple[list[Any], bool]:
    """Return the NURBS forms of an object, and whether its faces may be trimmed."""
    if isinstance(geometry, library.Extrusion):
        geometry = geometry.ToBrep(False)
    if isinstance(geometry, library.Brep):
        faces = [face.UnderlyingSurface().ToNurbsSurface() for face in geometry.Faces]
        return [face for face in faces if face is not None], True
    form = None
    if isinstance(geometry, library.Surface):
        form = geometry.ToNurbsSurface()
    elif isinstance(geometry, library.Curve):
        form = geometry.ToNurbsCurve()
    return ([] if form is None else [form]), False


def _plain(form: Any) -> dict[str, object]:
    points = form.Points
    if hasattr(form, "KnotsU"):
        counts, knots = [points.CountU, points.CountV], [form.KnotsU, form.KnotsV]
        degrees = [form.Degree(0), form.Degree(1)]
        places: Iterator[Any] = product(range(counts[0]), range(counts[1]))
    else:
        counts, knots, degrees = [len(points)], [form.Knots], [form.Degree]
        places = iter(range(counts[0]))
    rows = []
    if 0 < prod(counts) <= MAX_CONTROL_POINTS:
        # This library keeps points as x w, y w, z w, w.
        rows = [[point.X, point.Y, point.Z, point.W] for point in map(points.__getitem__, places)]
    return {
        "degrees": degrees,
        "counts": counts,
        "knots": [list(map(row.__getitem__, range(len(row)))) for row in knots],
        "rows": rows,
    }


if __name__ == "__main__":
    raise SystemExit(main())
