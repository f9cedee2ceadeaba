"""The ways in which a spec may be read: its format, numbers in place of those of ``let``, and holes that are filled."""

import re
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from gtb_cli.vocabulary import SpecFormat

Number: TypeAlias = float | str
Numbers: TypeAlias = tuple[tuple[str, Number], ...]
Let: TypeAlias = Mapping[str, Number]
NO_LET: Let = {}


class Reading(NamedTuple):
    """How a spec is read: its format, None where that is seen, and names of its ``let`` with other expressions.

    `fills` are holes of the model that are filled, each with the continuity of its patch.
    """

    spec_format: SpecFormat | None = None
    let: Numbers = ()
    fills: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        """Return the numbers and the holes as a message shows them, or nothing."""
        numbers = [f"{name} = {value}" for name, value in self.let]
        return ", ".join(numbers + [f"{hole} filled" for hole, _ in self.fills])


AS_SEEN = Reading()  # by the suffix or the first character, with the spec's own numbers


def assignment(text: str) -> tuple[str, str]:
    """Read ``NAME=EXPRESSION``; a `ValueError` says what is expected."""
    if text.count("=") > 1:
        raise ValueError(f"expected one NAME=EXPRESSION, each with an option of its own, got {text[:60]!r}")
    name, sign, value = (part.strip() for part in text.partition("="))
    if not sign or not re.fullmatch(r"\w+", name) or not value:
        raise ValueError(f"expected NAME=EXPRESSION, such as height=120, in quotes if it has blanks, got {text[:60]!r}")
    return name, value
