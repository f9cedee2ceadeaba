"""Single values of a spec: numbers, expressions, words and names, with a fault for each wrong one."""

import math
import re
from collections import ChainMap
from collections.abc import Callable, Container, Iterable
from typing import Any, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import SpecError
from gtb_cli.language.document import Faults, shown
from gtb_cli.language.expression import evaluate_expression
from gtb_cli.language.scanner import Path

MAX_SIZE = 1e100  # a coordinate, lifting value or scale: squares and products of two stay finite
MAX_NAME = 200  # longest name, in characters
# Characters not allowed in names: control characters and line ends
CONTROL_CHARACTERS = r"[\u0000-\u001f\u007f-\u009f\u2028\u2029]"


# characters in all different expressions of a spec together: half a second of evaluation
MAX_EXPRESSIONS = 200_000
NO_VALUES: dict[str, float] = {}

Check: TypeAlias = tuple[str, Callable[[float], bool]]

COORDINATE: Check = (f"must be at most {MAX_SIZE:g} in size", lambda x: abs(x) <= MAX_SIZE)
POSITIVE: Check = ("must be positive", lambda x: x > 0)
SCALE: Check = (f"must be between {1 / MAX_SIZE:g} and {MAX_SIZE:g}", lambda x: 1 / MAX_SIZE <= x <= MAX_SIZE)


class Budget:
    """The number of characters that further expressions of a spec may have, and whether an excess was reported."""

    characters = MAX_EXPRESSIONS
    is_said = False


class Values:
    """Reads single values of one file.

    Attributes
    ----------
    faults : Faults
        Faults of this file.
    names : dict of str to float
        Named numbers that expressions may use.
    budget : Budget
        The budget that all files of the spec share.
    """

    def __init__(self, faults: Faults, budget: Budget) -> None:
        self.faults = faults
        self.names: dict[str, float] = {}
        self.budget = budget
        self._evaluated: dict[str, float | str] = {}  # values, or faults

    def tuples(self, entries: list[object], path: Path, sizes: tuple[int, ...]) -> FloatArray | None:
        """Read pairs or triples of coordinates, all of the same size."""
        expected = " or ".join(map(str, sizes))
        lengths = {len(entry) if isinstance(entry, list) else None for entry in entries}
        if len(lengths) == 1 and not lengths & set(sizes):  # one fault, not one for each
            (length,) = lengths
            got = "no lists" if length is None else f"lists of {length}"
            self.faults.add(path, f"must be lists of {expected} coordinates, got {got}")
            return None
        size, rows = 0, []
        for i, entry in enumerate(entries):
            if not isinstance(entry, list):
                self.faults.add((*path, i), f"must be a list of {expected} coordinates, got {shown(entry)}")
            elif len(entry) not in sizes:
                self.faults.add((*path, i), f"must have {expected} coordinates, got {len(entry)}")
            elif size and len(entry) != size:
                self.faults.add((*path, i), f"must have {size} coordinates, as those before, got {len(entry)}")
            else:
                size = len(entry)
                rows.append(self.numbers(entry, (*path, i), COORDINATE))
        good = [row for row in rows if row is not None]
        return np.array(good) if len(good) == len(entries) else None

    def numbers(
        self, entries: list[object], path: Path, check: Check, extra: dict[str, float] = NO_VALUES
    ) -> FloatArray | None:
        """Read a list of numbers."""
        values = [self.number(entry, (*path, i), check, extra) for i, entry in enumerate(entries)]
        good = [value for value in values if value is not None]
        return np.array(good) if len(good) == len(values) else None

    def number(self, value: object, path: Path, check: Check, extra: dict[str, float] = NO_VALUES) -> float | None:
        """Read a number or an expression, which may also use the `extra` names."""
        number, text = value, ""
        if isinstance(value, str):
            number = self._value(value, path, extra)
            if number is None:
                return None
            text = f" = {shown(number)}"
        if isinstance(number, bool) or not isinstance(number, int | float):
            self.faults.add(path, f"must be a number, got {shown(value)}")
            return None
        try:
            number = float(number)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.faults.add(path, f"must be finite, got {shown(value)}")
            return None
        expected, holds = check
        if not holds(number):
            self.faults.add(path, f"{expected}, got {shown(value)}{text}{_where(extra)}")
            return None
        return number

    def _value(self, text: str, path: Path, extra: dict[str, float]) -> float | None:
        """Evaluate an expression; a repeated one is evaluated once."""
        found = None if extra else self._evaluated.get(text)
        if found is None:
            self.budget.characters -= len(text)
            if self.budget.characters < 0:
                if not self.budget.is_said:
                    limit = f"different expressions may have {MAX_EXPRESSIONS} characters together"
                    self.faults.add(path, f"{limit}, write numbers from here on")
                    self.budget.is_said = True
                return None
            try:
                found = evaluate_expression(text, ChainMap(extra, self.names) if extra else self.names)
            except SpecError as error:
                found = str(error)
            if not extra:
                self._evaluated[text] = found
        if isinstance(found, str):
            self.faults.add(path, found + _where(extra))
            return None
        return found


class Table:
    """Reads the values of one table of a file by their keys; what is absent, or wrong and noted, is None.

    Attributes
    ----------
    entries : dict
        The table itself.
    path : tuple
        Its key path.
    values : Values
    extra : dict of str to float
        Further names that its expressions may use.
    """

    def __init__(
        self, entries: dict[str, Any], path: Path, values: Values, extra: dict[str, float] = NO_VALUES
    ) -> None:
        self.entries, self.path, self.values, self.extra = entries, path, values, extra

    def fault(self, key: str, message: str) -> None:
        """Note a fault of the value under a key."""
        self.values.faults.add((*self.path, key), message)

    def unknown_keys(self, known: frozenset[str], others: Container[str] = ()) -> set[str]:
        """Note keys that are neither known nor among `others`; return the known ones that were probably meant."""
        meant = set()
        for key in [key for key in self.entries if key not in known and key not in others]:
            faults = self.values.faults
            likely = likely_word(key, known - self.entries.keys()) if faults.count < faults.SHOWN else None
            hint = suggestion(likely) or f", known are {', '.join(sorted(known))}"
            self.fault(key, f"is not a key of a spec{hint}")
            meant.add(likely or "")
        return meant

    def name(self, default: str | None) -> str | None:
        """Read the name; the default if it is absent or wrong."""
        if "name" not in self.entries:
            return default
        name = self.entries["name"]
        fault = name_fault(name) if isinstance(name, str) else f"must be a string, got {shown(name)}"
        if fault:
            self.fault("name", fault)
        return default if fault else str(name)

    def choice(self, key: str, words: tuple[str, ...], others: str = "") -> str | None:
        """Read one of the given words."""
        value = self.entries.get(key)
        if key not in self.entries or (isinstance(value, str) and value in words):
            return value
        likely = likely_word(value, words) if isinstance(value, str) else None
        expected = ", ".join(f'"{word}"' for word in words[:-1]) + f' or "{words[-1]}"'
        self.fault(key, f"must be {others}{expected}, got {shown(value)}{suggestion(likely)}")
        return None

    def number(self, key: str, check: Check) -> float | None:
        """Read a number."""
        if key not in self.entries:
            return None
        return self.values.number(self.entries[key], (*self.path, key), check, self.extra)

    def numbers(self, key: str, check: Check) -> FloatArray | None:
        """Read a list of numbers, which must be there."""
        return self.values.numbers(self.entries[key], (*self.path, key), check, self.extra)


def _where(extra: dict[str, float]) -> str:
    """Say for which values of further names a value is wrong."""
    return "".join(f" ({name} = {shown(value)})" for name, value in extra.items())


def name_fault(name: str) -> str | None:
    """Return the fault of a name, if any: names go into formats that are read line by line."""
    # Halves of surrogate pairs, not allowed in names either. Editors with Rust's patterns refuse a schema with this
    # one.
    surrogates = r"[\ud800-\udfff]"
    if not name.strip():
        return "must not be empty"
    if len(name) > MAX_NAME:
        return f"must have at most {MAX_NAME} characters, got {len(name)}"
    if re.search(f"{CONTROL_CHARACTERS}|{surrogates}", name):
        return f"must not have control characters, got {shown(name)}"
    return None


def likely_word(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that was probably meant, if any."""
    import difflib

    meant = word[:MAX_NAME].lower().replace("-", "_")
    spelled = {name.replace("-", "_"): name for name in sorted(known)}
    return next((spelled[name] for name in difflib.get_close_matches(meant, spelled, n=1)), None)


def suggestion(likely: str | None) -> str:
    """Return a question whether a word was meant, or nothing."""
    return f", did you mean {likely}?" if likely else ""
