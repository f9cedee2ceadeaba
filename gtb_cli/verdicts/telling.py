"""The difference of two meshes in words, and as plain data."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gtb_cli.meshes.difference import Difference, Point

OTHER_KIND = "one is a curve, the other a surface"


def difference_record(found: Difference) -> dict[str, Any]:
    """Return a difference as plain data, ready for ``json.dumps``."""
    return {
        "same": found.same,
        "distance": found.distance,
        "tolerance": found.tolerance,
        "method": found.method,
        "bound": found.bound,
        "proved": found.is_proved,
        "turned_faces": found.turned,
        "remarks": [*[OTHER_KIND] * (not found.same_kind), *found.words, *found.units, *found.remarks, *found.values],
        "ignored": list(found.ignored),
        "mean": found.mean,
        "asked_tolerance": found.asked,
        "resolution": found.resolution,
        "diagonal": found.diagonal,
        "vertices": None if found.vertex is None else [found.vertex, found.other_vertex],
        "group": found.group or None,
        "a_to_b": {"distance": found.forward.distance, "at": list(found.forward.at)},
        "b_to_a": {"distance": found.backward.distance, "at": list(found.backward.at)},
    }


def difference_text(found: Difference) -> str:
    """Return what follows the names of two meshes: how far they are apart, and what else differs, in a table."""
    what = ("curves" if found.is_curve else "surfaces") if found.same_kind else "a curve and a surface,"
    cells = "segments" if found.is_curve else "faces"
    distance, tolerance = found.amounts[0], f"tolerance {found.amounts[1]}\n"
    words = "".join(f"{word}; " for word in found.words)
    # GitHub takes a name such as ::stop-commands::x for a command, also behind blanks
    faults = "".join("  " + re.sub("^ *:(?=:)", r"\\x3a", fault) + "\n" for fault in found.faults)
    if found.method == "vertices":
        apart = f"vertices up to {distance} apart (mean {found.mean:.3g})"
        text = f"{words}the same {cells}, {apart}, {tolerance}"
        if found.distance <= found.tolerance:
            return text + faults
        where = f" of {found.group}" if found.group else ""
        style = ".9g" if _at(found.forward.at) != _at(found.backward.at) else ""  # all digits
        places = f"{_at(found.forward.at, style)} and {_at(found.backward.at, style)}"
        return f"{text}{faults}  most at vertex {found.vertex}{where}: {places}\n"
    if found.method == "patches":
        apart = f"{distance} apart{' where they were looked at' if found.is_loose else ''}"
        proof = f"not proved{f': at most {found.bound:.3g}' if found.is_loose else ''}"
        proof = f"by a search, {proof}" if found.is_searched else "proved"
        apart = apart if found.is_searched or not found.distance else f"at most {apart}"
        tolerance = tolerance.replace("\n", ", but\n") if faults and found.distance <= found.tolerance else tolerance
        text = f"{what} {apart}, themselves ({proof}), {tolerance}{faults}"
        return text if found.distance <= found.tolerance else text + _farthest(found)
    is_known = found.bound <= max(found.distance * 1.01, found.tolerance * 1e-3)
    at_most = "" if is_known else f" (at most {found.bound:.3g})"
    if not found.is_proved:
        at_most = f" where they were looked at (not proved: at most {found.bound:.3g})"
    others = "" if found.kind == "surface" else f"other {cells}, "
    text = f"{words}{others}{what} {distance} apart{at_most}, {tolerance}{faults}{_farthest(found)}"
    from gtb_cli.meshes.measures import labelled

    rows = [labelled(measures.record()) for measures in (() if words else found.measures)]
    labels = dict.fromkeys(label for row in rows for label in row if label not in ("lowest", "highest"))
    return text + "".join(_row(label, [row.get(label) for row in rows]) for label in labels)


def _farthest(found: Difference) -> str:
    ways = ("A from B", found.forward), ("B from A", found.backward)
    return "".join(f"  {way:24}{farthest.distance:.3g} at {_at(farthest.at)}\n" for way, farthest in ways)


def _row(label: str, values: list[float | int | None]) -> str:
    """Return a line of a table; if its two numbers differ, it has a star and enough digits to show that."""
    first, second = ("–" if value is None else f"{value:.9g}" for value in values)
    is_rounding = None not in values and math.isclose(values[0] or 0, values[1] or 0, rel_tol=1e-12)
    if is_rounding or values[0] == values[1]:
        return f"  {label:24}{first:>16}{second:>16}\n"
    first, second = (f"{value:.17g}" for value in values) if first == second else (first, second)
    width = 16 if max(len(first), len(second)) < 16 else 24
    return f"  {label:24}{first:>{width}}{second:>{width}}  *\n"


def _at(point: Point, style: str = ".9g") -> str:
    return f"({' '.join(f'{x:{style}}' for x in point)})"
