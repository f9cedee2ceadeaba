"""The files from which a spec is read."""

from __future__ import annotations

import os
import stat

from gtb_cli.errors import SpecError
from gtb_cli.language.document import MAX_BYTES, read, spec_format_of
from gtb_cli.language.includes import MAX_FILES
from gtb_cli.language.scanner import Format


def sources(path: str, format: Format | None = None) -> tuple[str, ...]:
    """Name the files from which a spec is read: its own first, then those it includes, directly or through others.

    Parameters
    ----------
    path : str
    format : "toml", "json" or None
        The format of the spec itself, as in `parse`.

    Returns
    -------
    tuple of str
        Each file once, in the order found from `path` on, and hardly more than `MAX_FILES`. A file that cannot be read
        includes nothing; the reader of the spec reports its faults.
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
    """The names of the files that the text of a file includes."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # a pipe would be emptied, or waited for
            return []
        with open(path, "rb") as file:
            text = file.read(MAX_BYTES + 1)
        # Most specs include nothing, and need not be parsed to show that.
        data = read(text, path, format or spec_format_of(path)).data if b"include" in text else None
    except (OSError, ValueError, SpecError):
        return []
    names = data.get("include") if isinstance(data, dict) else None
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
