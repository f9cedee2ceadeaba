"""Single values under keys of a spec, checked, and the key probably meant; `patch_reader` lists the keys there are."""

import math
import re
import sys
from collections import ChainMap
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import SpecError
from gtb_cli.language.document import Faults, shown
from gtb_cli.language.expression import COUNTER, degrees_in, doubted_angle, evaluate_expression
from gtb_cli.language.scanner import Path

MAX_SIZE = 1e100  # a coordinate, lifting value or scale: squares and products of two stay finite
MAX_NAME = 200  # longest name, in characters
# Characters not allowed in names: control characters and line ends
CONTROL_CHARACTERS = r"[\u0000-\u001f\u007f-\u009f\u2028\u2029]"
# characters in all expressions of a spec together, repeated ones counted once: a second of evaluation
MAX_EXPRESSIONS = 200_000
MAX_POINTS = 2_000_000  # control points of all copies together: about 200 MB by the time they are meshed

# Options of gtb mesh that are looked for among the keys, and other words for keys
OPTIONS = ("thickness", "tolerance", "radius", "rim", "resolution", "unit")
OTHER_WORDS = {"angle": "degrees", "points": "control_points", "move": "translate", "flip": "mirror"}
OTHER_WORDS |= {"count": "repeat", "set": "let"}

Check: TypeAlias = tuple[str, Callable[[float], bool]]

FINITE: Check = ("must be finite", math.isfinite)
COORDINATE: Check = (f"must be at most {MAX_SIZE:g} in size", lambda x: abs(x) <= MAX_SIZE)
POSITIVE: Check = ("must be positive", lambda x: x > 0)
SCALE: Check = (f"must be between {1 / MAX_SIZE:g} and {MAX_SIZE:g}", lambda x: 1 / MAX_SIZE <= x <= MAX_SIZE)


@dataclass
class Budget:
    """What further expressions and copies of a spec may take, in all its files."""

    characters: int = MAX_EXPRESSIONS
    points: int = MAX_POINTS


class Values:
    """Reads single values of one file, and notes the faults of wrong ones; `names` are for its expressions."""

    def __init__(self, faults: Faults, budget: Budget) -> None:
        self.faults = faults
        self.names: MutableMapping[str, float] = {}
        self._budget = budget
        self._note = ""  # after each message
        self._evaluated: dict[str, float] = {}

    def of_copy(self, number: int) -> "Values":
        """Return a reader of the same file whose expressions know the copy's number."""
        values = Values(self.faults, self._budget)
        values.names = ChainMap({COUNTER: float(number)}, self.names)
        values._note = f" ({COUNTER} = {number})"
        return values

    def takes_points(self, count: int, path: Path) -> bool:
        """Count control points that copies add; False, and a fault, if they are too many."""
        self._budget.points -= count
        if self._budget.points < 0:
            self.faults.add(path, f"makes more than {MAX_POINTS} control points, together with the copies before")
        return self._budget.points >= 0

    def tuples(self, entries: list[object], path: Path, sizes: tuple[int, ...]) -> FloatArray | None:
        """Read pairs or triples of coordinates, all of the same size: that of most of them; an arc stands for four."""
        lengths = [len(entry) if isinstance(entry, list) else 3 * is_arc(entry) for entry in entries]
        given = [length for length in lengths if length in sizes]
        if given:
            sizes = (max(dict.fromkeys(given), key=given.count),)
        else:
            entries = entries[:1]  # one fault, not one for each
        rows = list[FloatArray | None]()
        for i, entry in enumerate(entries):
            place = (*path, i)
            is_row = is_arc(entry) and 3 in sizes
            rows += self._arc(str(entry), place) if is_row else [self.coordinates(entry, place, sizes, COORDINATE)]
        return None if not rows or any(row is None for row in rows) else np.array(rows)

    def _arc(self, text: str, path: Path) -> list[FloatArray] | list[None]:
        """Read the four control points of a circle's arc, or of one that is less round, about the z axis."""
        name, _, inside = text.strip(" \t")[:-1].partition("(")
        parts = inside.split(",")
        given = [number for part in parts if (number := self.number(part, path, COORDINATE)) is not None]
        if len(given) < len(parts):
            return [None]
        fault = ""
        if not 3 <= len(given) <= 5:
            forms = "arc(radius, height, angle) or arc(radius, height, angle, roundness, start)"
            fault = f"must be {forms}, got {shown(text)}"
        elif not name.startswith("arc"):
            fault = f"arc is written in small letters, got {shown(text)}"
        elif given[0] < 0:
            fault = f"the radius must not be negative, got {given[0]:g} in {shown(text)}"
        elif not 0 < abs(given[2]) <= math.pi:
            fault = f"the angle must be at most 180*deg, got {given[2]:g} radians in {shown(text)}"
            fault += ": degrees are written *deg" * (abs(given[2]) > 2 * math.pi)
        if fault:
            self.faults.add(path, f"{fault}{self._note}")
            return [None]
        r, z, angle, roundness, start = (*given, *(1.0, 0.0)[len(given) - 3 :])
        if self.faults.doubt is None and (doubt := doubted_angle("the start", "".join(parts[4:]).strip(), start)):
            self.faults.doubt = path, doubt
        c, s, q = math.cos(angle), math.sin(angle), roundness * 4 / 3 * math.tan(angle / 4)
        x, y = np.array([(1, 0), (1, q), (c + q * s, s - q * c), (c, s)]).T
        turned = x * math.cos(start) - y * math.sin(start), x * math.sin(start) + y * math.cos(start)
        return [*np.column_stack([r * turned[0], r * turned[1], np.full(4, z)])]

    def coordinates(self, entry: object, path: Path, sizes: tuple[int, ...], check: Check) -> FloatArray | None:
        """Read a list of one of the given sizes."""
        if isinstance(entry, list) and len(entry) in sizes:
            return self.numbers(entry, path, check)
        hint = decimal_commas(entry, 3) if isinstance(entry, list) else ""
        if isinstance(entry, list) and len(entry) == 3 and "knots" in path:
            hint = ": knots lie in a plane"
        self.faults.add(path, f"must be a list of {' or '.join(map(str, sizes))} coordinates, got {shown(entry)}{hint}")
        return None

    def numbers(self, entries: list[object], path: Path, check: Check) -> FloatArray | None:
        """Read a list of numbers."""
        values = [self.number(entry, (*path, i), check) for i, entry in enumerate(entries)]
        return None if None in values else np.array(values)

    def number(self, value: object, path: Path, check: Check) -> float | None:
        """Read a number or an expression."""
        expected, holds = check
        try:
            number = self._value(value, path) if isinstance(value, str) else value
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise SpecError(f"must be a number, got {shown(value)}")
            if not abs(number) <= sys.float_info.max:
                raise SpecError(f"must be finite, got {shown(value)}")
            number = float(number)
            if not holds(number):
                result = f" = {shown(number)}" if isinstance(value, str) else ""
                raise SpecError(f"{expected}, got {shown(value)}{result}")
            return number
        except SpecError as error:
            self.faults.add(path, f"{error}{self._note}")
            return None

    def _value(self, text: str, path: Path) -> float:
        """Evaluate an expression; a repeated one is evaluated once."""
        if text not in self._evaluated:
            self._budget.characters -= len(text)
            if self._budget.characters < 0:
                raise SpecError(f"expressions may have {MAX_EXPRESSIONS} characters together, write others as numbers")
            self._evaluated[text] = evaluate_expression(text, self.names)
            if self.faults.doubt is None and (angle := degrees_in(text, self.names)):
                self.faults.doubt = path, angle
        return self._evaluated[text]


class Table:
    """Reads the values of one table of a file by their keys; what is absent, or wrong and noted, is None."""

    def __init__(self, entries: dict[str, Any], path: Path, values: Values) -> None:
        self.entries, self.path, self.values = entries, path, values
        self.meant = set[str]()  # keys that are probably there, with another name

    def fault(self, key: str, message: str) -> None:
        """Note a fault of the value under a key."""
        self.values.faults.add((*self.path, key), message)

    def unknown_keys(self, known: frozenset[str], elsewhere: Mapping[str, str] = {}) -> None:
        """Note keys that are not known, with what is said of some, and the known ones that were probably meant."""
        faults, left = self.values.faults, known - self.entries.keys()
        for key in [key for key in self.entries if key not in known]:
            word = OTHER_WORDS.get(key)
            likely = word if word in left else likely_word(key, left) if faults.count < faults.SHOWN else None
            hint = f", did you mean {likely}?" if likely else f", known are {', '.join(sorted(known))}"
            if key in OPTIONS:
                likely, hint = None, f": gtb mesh has an option --{key}"
            self.fault(key, elsewhere.get(key, f"is not a key of a spec{hint}"))
            self.meant.add(likely or "")

    def name(self, default: str | None) -> str | None:
        """Read the name; the default if it is absent or wrong."""
        if "name" not in self.entries:
            return default
        name = self.entries["name"]
        if fault := name_fault(name) if isinstance(name, str) else f"must be a string, got {shown(name)}":
            self.fault("name", fault)
        return default if fault else str(name)

    def choice(self, key: str, words: tuple[str, ...], others: str = "") -> str | None:
        """Read one of the given words."""
        value = self.entries.get(key)
        if key not in self.entries or (isinstance(value, str) and value in words):
            return value
        hint = suggestion(value, words) if isinstance(value, str) and len(words[0]) > 1 else ""
        expected = ", ".join(f'"{word}"' for word in words[:-1]) + f' or "{words[-1]}"'
        self.fault(key, f"must be {others}{expected}, got {shown(value)}{hint}")
        return None

    def number(self, key: str, check: Check) -> float | None:
        """Read a number."""
        return self.values.number(self.entries[key], (*self.path, key), check) if key in self.entries else None

    def count(self, key: str, most: int) -> int | None:
        """Read a whole number, 1 if it is absent; None if it is wrong."""
        if key not in self.entries:
            return 1
        whole: Check = (f"must be a whole number from 1 to {most}", lambda x: 1 <= x <= most and x == int(x))
        number = self.number(key, whole)
        return None if number is None else int(number)

    def numbers(self, key: str, check: Check) -> FloatArray | None:
        """Read a list of numbers, which must be there."""
        return self.values.numbers(self.entries[key], (*self.path, key), check)

    def coordinates(self, key: str, sizes: tuple[int, ...], check: Check) -> FloatArray | None:
        """Read a list of one of the given sizes."""
        if key not in self.entries:
            return None
        return self.values.coordinates(self.entries[key], (*self.path, key), sizes, check)


def is_arc(entry: object) -> bool:
    """Tell whether an entry of a list of points stands for the four of an arc."""
    return isinstance(entry, str) and re.fullmatch(r"(?i)[ \t]*arc[ \t]*\(.*\)[ \t]*", entry) is not None


def decimal_commas(entries: list[object], expected: int) -> str:
    """Return a hint for a list that is longer than expected, and may be so by decimal commas; or nothing."""
    is_likely = expected < len(entries) < 2 * expected and all(isinstance(entry, int) for entry in entries)
    return " (decimals have a point, not a comma)" if is_likely else ""


def name_fault(name: str) -> str | None:
    """Return the fault of a name, if any: names go into formats that are read line by line."""
    surrogates = r"[\ud800-\udfff]"  # halves of pairs; a schema with this pattern is refused by editors in Rust
    if not name.strip():
        return "must not be empty"
    if len(name) > MAX_NAME:
        return f"must have at most {MAX_NAME} characters, got {len(name)}"
    if re.search(f"{CONTROL_CHARACTERS}|{surrogates}", name):
        return f"must not have control characters, got {shown(name)}"
    return None


def valid_name(name: object) -> str | None:
    """Return the name of a patch from elsewhere, or None if no patch may have it."""
    return None if not isinstance(name, str) or name_fault(name) else name


def likely_word(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that was probably meant, if any."""
    import difflib

    meant = word[:MAX_NAME].lower().replace("-", "_")
    spelled = {name.replace("-", "_"): name for name in sorted(known)}
    return next((spelled[name] for name in difflib.get_close_matches(meant, spelled, n=1)), None)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return a question whether a known word was meant, or nothing."""
    likely = likely_word(word, known)
    return f", did you mean {likely}?" if likely else ""
