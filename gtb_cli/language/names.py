"""``let``: named numbers, each of which may use those before it, and what ``--set`` gives them."""

import keyword
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from gtb_cli.errors import SpecError
from gtb_cli.language.document import shown
from gtb_cli.language.expression import CONSTANTS, COUNTER, FUNCTIONS, evaluate_expression, names_in
from gtb_cli.language.keys_and_values import FINITE, Values, suggestion
from gtb_cli.language.patch_reader import MODEL_KEYS, PATCH_KEYS
from gtb_cli.language.reading import Let, Number

Unknown: TypeAlias = Callable[[str, str], object]  # is told a given name that no number has, and what is said of it

NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]*"  # pattern of the name of a number
MAX_NUMBER_NAME = 60  # longest name of a number, in characters
MAX_NAMES = 1000  # named numbers


def read_numbers(table: dict[str, Any], values: Values, given: Let, unknown: Unknown) -> None:
    """Read ``let``, if present, with the `given` numbers in place of those of the same names."""
    values.names = names = dict[str, float]()
    # Without one, a table with another name is probably meant
    others = [entry for key, entry in table.items() if isinstance(entry, dict) and key not in PATCH_KEYS | MODEL_KEYS]
    let = table.get("let", others[0] if others else names)
    if not isinstance(let, dict):
        values.faults.add(("let",), f"must be a table of numbers, got {shown(let)}")
        return
    if len(let) > MAX_NAMES:
        values.faults.add(("let",), f"must have at most {MAX_NAMES} names, got {len(let)}")
        return
    for name in given:
        if name not in let:
            likely = suggestion(name, let) or f"; there are {', '.join(list(let)[:30]) or 'none'}"
            likely += "; an included file's are set beside its name, {file = …, let = {…}}" * ("include" in table)
            unknown(name, f"has no number of this name in its let{likely}")
    for name, value in let.items():
        number = _given(name, given[name], let, values) if name in given else None
        if number is None and (fault := _name_fault(name, value) or _late(value, let, names)):
            values.faults.add(("let", name), fault)
        elif number is None:
            number = values.number(value, ("let", name), FINITE)
        names[name] = 1.0 if number is None else number  # so that its users are not reported as well
    if "weld" in let and re.findall(NAME_PATTERN, str([*table.values()])).count("weld") == 1:
        values.faults.add(("let", "weld"), "is used in no expression: the spec's weld stands before [let]")


def numbers_in_no_let(table: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers, and expressions, at the top of a spec if one of its expressions uses them."""
    others = {key: entry for key, entry in table.items() if key not in PATCH_KEYS | MODEL_KEYS}
    found = {key: entry for key, entry in others.items() if isinstance(entry, int | float | str)}
    return found if found and found.keys() & re.findall(NAME_PATTERN, str([*table.values()])) else {}


def _late(value: object, let: Mapping[str, object], names: Mapping[str, float]) -> str | None:
    """Say which name an expression uses before it has a number."""
    needed = names_in(value) if isinstance(value, str) else []
    late = next((other for other in needed if other in let and other not in names), None)
    return late and f"uses {late}, which must come before it"


def _given(name: str, value: Number, let: Mapping[str, object], values: Values) -> float | None:
    """Evaluate a number that is given in place of the spec's own; None if it is wrong."""
    try:
        if isinstance(value, str):
            if fault := _late(value, let, values.names):
                raise SpecError(fault)
            value = evaluate_expression(value, values.names)
        if math.isfinite(value):
            return float(value)
        raise SpecError(f"must be finite, got {value}")
    except (SpecError, TypeError) as error:
        values.faults.add((), f"`let` {name}: {error}")
        return None


def _name_fault(name: str, value: object) -> str | None:
    """Say why a number cannot have this name."""
    if name in PATCH_KEYS | MODEL_KEYS and not isinstance(value, int | float):  # after [let] by mistake
        return "is a key of a spec, and [let] takes all keys that follow: put it before [let]"
    if not re.fullmatch(NAME_PATTERN, name) or len(name) > MAX_NUMBER_NAME:
        return f"must be a letter, then at most {MAX_NUMBER_NAME - 1} letters, digits and _, to be the name of a number"
    if name in FUNCTIONS or name in CONSTANTS:
        meaning = f"{CONSTANTS[name]:.6g}" if name in CONSTANTS else "a function"
        return f"is {meaning} in expressions: choose another name"
    if name == COUNTER:
        return "is the number of a copy: choose another name"
    return "is a word with another meaning in expressions" if keyword.iskeyword(name) else None
