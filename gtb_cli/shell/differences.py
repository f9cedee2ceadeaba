"""Reports on the difference of two meshes: as text, as plain data, and as warnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from gtb_cli.shell.console import printable

if TYPE_CHECKING:
    from gtb_cli.meshes.difference import Difference, Point


class Bytes(NamedTuple):
    """Two files of which only the bytes were compared, or had to be."""

    same: bool


def limits(found: Difference | Bytes) -> list[str]:
    """Say where the answer does not quite fit the question."""
    if isinstance(found, Bytes):
        return []
    result = [f"{remark}, which is ignored" for remark in (*found.sides, *found.remarks) if remark not in found.faults]
    if found.asked and found.asked < found.tolerance:
        finest = "the numbers in the files are no finer at this size"
        result.append(f"tolerance {found.tolerance:.3g} instead of {found.asked:.3g}: {finest}")
    if found.stray is not None:
        few = (
            f"without a few vertices far from all others, the size is {found.stray:.3g} instead of {found.diagonal:.3g}"
        )
        result.append(f"{few}, which makes the tolerance {found.tolerance:.3g}")
    if not found.is_proved and found.method != "patches":
        what = f"nothing farther apart than {found.distance:.3g} was found, but it is not proved"
        result.append(f"{what}: between samples it could be {found.bound:.3g}")
    return result


def record(found: Difference | Bytes, names: tuple[str, str], warnings: Sequence[str]) -> dict[str, Any]:
    """Return a difference as plain data, ready for ``json.dumps``."""
    if isinstance(found, Bytes):
        files = {key: {"file": name} for key, name in zip("ab", names, strict=True)}
        return {"same": found.same, "distance": 0.0 if found.same else None, "method": "bytes", **files}
    report: dict[str, Any] = {
        "same": found.same,
        "distance": found.distance,
        "tolerance": found.tolerance,
        "method": found.method,
        "bound": found.bound,
        "proved": found.is_proved,
        "turned_faces": found.turned,
        "remarks": list(found.remarks),
        "ignored": list(found.ignored),
        "warnings": list(warnings),
        "mean": found.mean,
        "asked_tolerance": found.asked,
        "resolution": found.resolution,
        "diagonal": found.diagonal,
        "vertices": None if found.vertex is None else [found.vertex, found.other_vertex],
        "group": found.group or None,
        "a_to_b": {"distance": found.forward.distance, "at": list(found.forward.at)},
        "b_to_a": {"distance": found.backward.distance, "at": list(found.backward.at)},
    }
    for key, name, measures in (("a", names[0], found.first), ("b", names[1], found.second)):
        report[key] = {"file": name, **(measures.record() if measures else {})}
    return report


def text_about(found: Difference | Bytes, names: tuple[str, str]) -> str:
    """Return a line with the verdict and, if the meshes are not the same, a table of what differs."""
    verdict = "same" if found.same else "different"
    head = f"{verdict}: {printable(names[0])} and {printable(names[1])}"
    if isinstance(found, Bytes):
        return f"{head}: {'equal' if found.same else 'other'} bytes\n"
    faults = "".join(f"  {fault}\n" for fault in found.faults)
    if found.method == "vertices":
        text = f"{head}: the same faces, vertices up to {found.distance:.3g} apart"
        text += f" (mean {found.mean:.3g}), tolerance {found.tolerance:.3g}\n"
        if found.same:
            return text
        text += faults
        where = f" of {found.group}" if found.group else ""
        return f"{text}  most at vertex {found.vertex}{where}: {_at(found.forward.at)} and {_at(found.backward.at)}\n"
    if found.method == "patches":
        what = "surfaces" if found.same_kind else "a curve and a surface,"
        text = f"{head}: {what} {found.distance:.3g} apart, themselves (by a search, not proved), tolerance "
        return f"{text}{found.tolerance:.3g}\n{faults}{'' if found.same else _farthest(found)}"
    at_most = "" if found.bound <= found.distance * 1.01 or not found.same else f" (at most {found.bound:.3g})"
    if not found.is_proved:
        at_most = f" where they were looked at (not proved: at most {found.bound:.3g})"
    what = "surfaces" if found.same_kind else "a curve and a surface,"
    text = f"{head}: other faces, {what} {found.distance:.3g} apart{at_most}, tolerance {found.tolerance:.3g}\n"
    text += faults + _farthest(found)
    if found.first is None or found.second is None:
        return text
    rows = [measures.record() for measures in (found.first, found.second)]
    for key in dict.fromkeys([*rows[0], *rows[1]]):
        if key != "bounds":
            text += _row(key.replace("_", " "), [row.get(key) for row in rows])
    return text


def _farthest(found: Difference) -> str:
    """Return a line for each way."""
    ways = ("A from B", found.forward), ("B from A", found.backward)
    return "".join(f"  {way:24}{farthest.distance:.3g} at {_at(farthest.at)}\n" for way, farthest in ways)


def _row(label: str, values: list[float | int | None]) -> str:
    """Return a line of a table; if its two numbers differ, it has a star and enough digits to show that."""
    digits = 9  # unless two different numbers would look the same
    first, second = (_number(value, digits) for value in values)
    if values[0] == values[1]:
        return f"  {label:24}{first:>16}{second:>16}\n"
    if first == second:
        first, second = (_number(value, 17) for value in values)
    width = 16 if max(len(first), len(second)) < 16 else 24
    return f"  {label:24}{first:>{width}}{second:>{width}}  *\n"


def _number(value: float | int | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _at(point: Point) -> str:
    return f"({' '.join(f'{x:.9g}' for x in point)})"
