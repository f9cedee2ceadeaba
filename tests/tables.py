"""Tables of cases in text files: below `=== section`, lines of data as JSON, ` | ` and what is said of them."""

import json
from pathlib import Path
from typing import Any


def cases(name: str, section: str) -> list[tuple[Any, str]]:
    """Return data and message of each line in a section of a file beside the tests, such as `knots/refused`."""
    text = (Path(__file__).parent / f"{name}.txt").read_text(encoding="utf-8")
    lines = text.split(f"=== {section}\n")[1].partition("\n\n")[0].splitlines()
    return [(json.loads(data), message) for data, _, message in (line.partition(" | ") for line in lines)]
