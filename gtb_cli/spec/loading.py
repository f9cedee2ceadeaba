"""Spec files: TOML or JSON → `Patch` and `Model`, with every error of a file at once."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from gtb_cli.errors import SpecError
from gtb_cli.spec.document import MAX_BYTES, Document, Faults, read
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


def from_dict(data: Mapping[str, Any]) -> Patch | Model:
    """Read a spec that is there as plain data: what `to_dict` gives, or a file's content, or made by a program.

    Parameters
    ----------
    data : mapping
        The keys of a spec, with lists, tuples or arrays of numbers and expressions.

    Returns
    -------
    Patch or Model

    Raises
    ------
    SpecError
        As for `load`, with key paths.
    """
    document = Document(_plain(data), "", "json", ())
    faults = Faults(document, "from_dict")
    result = Reader(faults).spec(document.data, None)
    if result is None or faults.count:
        raise SpecError(str(faults))
    return result


def _plain(value: object) -> object:
    """Lists, dictionaries and numbers of Python, as parsers give them."""
    match value:
        case np.ndarray() | np.generic():
            return value.tolist()
        case Mapping():
            return {str(key): _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
    return value


def _stem(source: str) -> str | None:
    """Name for a patch without one, where the file has a name that a patch can have."""
    stem = os.path.splitext(os.path.basename(source))[0]
    return None if source == "-" or source.startswith("<") or name_fault(stem) else stem
