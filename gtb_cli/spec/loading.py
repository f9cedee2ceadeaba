"""Spec files: TOML or JSON → `Patch` and `Model`, with every error of a file at once."""

from __future__ import annotations

import os
from typing import cast

from gtb_cli.errors import SpecError
from gtb_cli.spec.document import MAX_BYTES, Faults, read
from gtb_cli.spec.reader import Reader, name_fault
from gtb_cli.spec.scanner import Format
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch


def load(path: str | os.PathLike[str]) -> Patch | Model:
    """Read a spec file.

    Parameters
    ----------
    path : path
        Read as TOML or JSON after its suffix ``.toml`` or ``.json``, else after its first character.

    Returns
    -------
    Patch or Model
        Named after the file where the spec has no name.

    Raises
    ------
    SpecError
        The file cannot be read, or what it says is not a patch: one line for each error, with file, line where known,
        key path and what was found.
    """
    source = os.fspath(path)
    try:
        with open(source, "rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise SpecError(f"{source or repr(source)}: {error.strerror or error}") from None
    except ValueError as error:  # a null character in the path
        raise SpecError(f"{source!r}: {error}") from None
    suffix = os.path.splitext(source)[1].lower()
    return parse(data, source, cast(Format, suffix[1:]) if suffix in (".toml", ".json") else None)


def parse(text: bytes | str, source: str = "<spec>", format: Format | None = None) -> Patch | Model:
    """Read the text of a spec.

    Parameters
    ----------
    text : bytes or str
        At most 10 MB of UTF-8.
    source : str
        File name for messages, whose stem names a nameless patch; ``-`` and text in angle brackets are no files
        and give no name.
    format : "toml", "json" or None
        None: JSON where the first character is ``{``, else TOML.

    Returns
    -------
    Patch or Model

    Raises
    ------
    SpecError
        See `load`.

    Notes
    -----
    Whatever the text is, about a second and 150 MB at most.
    """
    document = read(text, source, format)
    faults = Faults(document, source)
    result = Reader(faults).spec(document.data, _stem(source))
    if result is None or faults.count:
        raise SpecError(str(faults))
    return result


def _stem(source: str) -> str | None:
    """Name for a patch without one, where the file has a name that a patch can have."""
    stem = os.path.splitext(os.path.basename(source))[0]
    return None if source == "-" or source.startswith("<") or name_fault(stem) else stem
