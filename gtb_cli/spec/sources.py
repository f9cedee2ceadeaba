"""The files that a spec is read from."""

from __future__ import annotations

import os
import stat

from gtb_cli.errors import SpecError
from gtb_cli.spec.document import MAX_BYTES, read
from gtb_cli.spec.scanner import Format

MAX_FILES = 100
"""Most files that are looked for; a spec that takes in more is refused where it is read."""


def sources(path: str, format: Format | None = None) -> tuple[str, ...]:
    """Name the files that a spec is read from: its own first, then those that it includes, and these include.

    Parameters
    ----------
    path : str
    format : "toml", "json" or None
        Format of the spec itself, as in `parse`.

    Returns
    -------
    tuple of str
        Each once, as they are found from `path` on. What cannot be read includes nothing: what is wrong with it is for
        the reader of the spec to say.
    """
    found = {path: None}
    waiting = [path]
    while waiting and len(found) <= MAX_FILES:
        file = waiting.pop(0)
        for name in _included(file, format if file == path else None):
            below = os.path.normpath(os.path.join(os.path.dirname(file), name))
            if below not in found:
                found[below] = None
                waiting.append(below)
    return tuple(found)


def _included(path: str, format: Format | None) -> list[str]:
    """Names that the text of a file asks for."""
    suffix = os.path.splitext(path)[1].lower()
    if format is None and suffix in (".toml", ".json"):
        format = "json" if suffix == ".json" else "toml"
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # a pipe would be emptied, or waited for
            return []
        with open(path, "rb") as file:
            text = file.read(MAX_BYTES + 1)
        # Most specs take in nothing, and need not be parsed to see that.
        data = read(text, path, format).data if b"include" in text else None
    except (OSError, ValueError, SpecError):
        return []
    names = data.get("include") if isinstance(data, dict) else None
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
