"""Sliders: numbers of ``let`` to turn, with their comments (turned: `pages/watch.js`; answer: `view_server`)."""

import math
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from gtb_cli.errors import SpecError
from gtb_cli.language.document import Document, Faults, read
from gtb_cli.language.expression import FUNCTIONS, evaluate_expression, names_in
from gtb_cli.language.keys_and_values import MAX_SIZE
from gtb_cli.vocabulary import SpecFormat

_COMMENT = re.compile(r"""(?:[^"'#]|"(?:[^"\\]|\\.)*"|'[^']*')*#\s*(.*)""")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\s*(?:…|\.{{2,3}})\s*({_NUMBER})")


class Slider(NamedTuple):
    """A number of ``let``, its value in the spec, and the range of values that are sensible.

    `step` is 1 if a ``repeat`` depends on it. `label` is the comment on its line without a range, and `text` the line.
    """

    name: str
    value: float
    low: float
    high: float
    step: float
    label: str
    line: int
    text: str


def sliders(data: bytes | str, source: str, format: SpecFormat | None = None) -> tuple[Slider, ...]:
    """Return a slider for each number of a spec's own ``let`` that depends on no other; none if it cannot be read."""
    try:
        document = read(data, source, format)
    except SpecError:
        return ()
    spec = document.data if isinstance(document.data, dict) else {}
    let = spec.get("let")
    if not isinstance(let, dict):
        return ()
    free = {name: value for name, entry in let.items() if (value := plain_value(entry)) is not None}
    whole = _counts(spec, let)
    return tuple(
        _slider(name, free[name], name in whole, label, line, text)
        for name, label, line, text in _commented(document, let)
        if name in free
    )


def check_ranges(document: Document, faults: Faults, numbers: Mapping[str, float], given: Collection[str]) -> None:
    """Note which number of all of ``let`` is outside the range that the comment on its line gives.

    That is a fault of a given count, as ``gtb new`` refuses it, and a doubt about any other number.
    """
    spec: Any = document.data
    for name, label, _, _ in _commented(document, numbers) if re.search(r"…|\.\.", document.text) else ():
        if (ends := range_in(label)) and not ends[0] <= numbers[name] <= ends[1]:
            words = f"{numbers[name]:g} is outside {ends[0]:g} … {ends[1]:g}, the range in its comment"
            if name in given and name in _counts(spec, spec["let"]):
                faults.doubt = (("let", name), words)
                raise SpecError(faults.doubted())  # alone: the rest follows
            if faults.doubt is None or "let" not in faults.doubt[0]:  # what follows is doubted later
                faults.doubt = ("let", name), words


def _commented(document: Document, names: Collection[str]) -> list[tuple[str, str, int, str]]:
    """Return names of ``let``, each with the comment on its line, if it is alone there, and that line."""
    lines, texts, found = document.lines({("let", name) for name in names}), document.text.split("\n"), []
    for name in names:
        text = texts[(line := lines[("let", name)]) - 1].strip()
        comment = _COMMENT.match(text) if document.format == "toml" and [*lines.values()].count(line) == 1 else None
        found.append((name, comment[1] if comment else "", line, text))
    return found


def range_in(comment: str) -> tuple[float, float] | None:
    """Return the ends of the range, such as ``10 … 80``, that a comment gives first, if any."""
    ends = sorted(map(float, found.groups())) if (found := _RANGE.search(comment)) else []
    return (ends[0], ends[1]) if ends and math.isfinite(ends[1]) and ends[0] < ends[1] else None


def plain_value(entry: object) -> float | None:
    """Return the value of a number, or of an expression of numbers and constants alone."""
    if isinstance(entry, str):
        if names_in(entry) or any(re.search(rf"\b{name}\b", entry) for name in FUNCTIONS):
            return None
        with suppress(SpecError):
            return evaluate_expression(entry)
        return None
    if isinstance(entry, bool) or not isinstance(entry, int | float) or not abs(entry) < MAX_SIZE:
        return None
    return float(entry)


def _counts(spec: dict[str, Any], let: dict[str, Any]) -> set[str]:
    """Return the names on which the count of a ``repeat`` depends."""
    lists = [entries for key in ("patches", "include") if isinstance(entries := spec.get(key), list)]
    waiting = [table.get("repeat") for entries in lists for table in entries if isinstance(table, dict)]
    found: set[str] = set()
    while waiting:
        entry = waiting.pop()
        new = set(names_in(entry)) - found if isinstance(entry, str) else set()
        found |= new
        waiting += [let.get(name) for name in new]
    return found


def _slider(name: str, value: float, is_count: bool, label: str, line: int, text: str) -> Slider:
    low, high = (math.ceil(value / 2) if is_count and value > 0 else min(0.0, 2 * value)), max(0.0, 2 * value)
    if value == 0:
        low, high = -1.0, 1.0
    if ends := range_in(label):
        low, high = ends
        label = _RANGE.sub("", label, count=1).strip(" \t,;:()")
    step = 1.0 if is_count else 10.0 ** math.floor(math.log10((high - low) / 100))
    return Slider(name, value, min(low, value), max(high, value), step, label, line, text)
