"""Spec files: TOML or JSON → `Patch` and `Model`, with every error of a file at once."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import SpecError
from gtb_cli.files import read_file
from gtb_cli.language.document import MAX_BYTES, Document, Faults, read, spec_format_of
from gtb_cli.language.includes import Library
from gtb_cli.language.models import ModelReader
from gtb_cli.language.scanner import Format
from gtb_cli.language.values import Budget, Values, name_fault
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch


def load(path: str | os.PathLike[str]) -> Patch | Model:
    """Read a spec file.

    Parameters
    ----------
    path : path
        Its suffix ``.toml`` or ``.json`` decides the format; without either, its first character does.

    Returns
    -------
    Patch or Model
        Named after the file if the spec has no name.

    Raises
    ------
    SpecError
        The file cannot be read, or does not describe a patch: one line for each error, with file, line if known, key
        path and what was found.
    """
    source = os.fspath(path)
    return parse(read_file(source, MAX_BYTES + 1), source, spec_format_of(source))


def parse(text: bytes | str, source: str = "<spec>", format: Format | None = None) -> Patch | Model:
    """Read the text of a spec.

    Parameters
    ----------
    text : bytes or str
        At most 10 MB of UTF-8.
    source : str
        File name for messages. Its stem names a nameless patch; included files are in its folder. ``-`` and text in
        angle brackets are not files: they give no name and include nothing.
    format : "toml", "json" or None
        None: JSON if the first character is ``{``, otherwise TOML.

    Raises
    ------
    SpecError
        See `load`.

    Notes
    -----
    Any text takes at most about five seconds and 300 MB; 300 bicubic patches take a third of a second.
    """
    return _Files(source).whole(text, format)


def parse_loop(
    text: bytes | str, source: str, format: Format | None = None
) -> tuple[Patch | Model, tuple[FloatArray | None, ...]]:
    """Read the text of a spec whose curves may have the key ``ribbon``; otherwise like `parse`.

    Returns
    -------
    tuple of (Patch or Model, rows)
        The (n, 3) second row of control points of each patch, moved with the copies, or None if it has none.
    """
    spec = _Files(source, second_row=False).whole(text, format)
    if spec.dimension == 2:
        return spec, (None,) * (1 if isinstance(spec, Patch) else len(spec))
    moved = _Files(source, second_row=True).whole(text, format)
    pairs = zip(spec.patches, moved.patches, strict=True)
    rows = ((first.control_points, second.control_points) for first, second in pairs)
    return spec, tuple(None if np.array_equal(curve, row) else row for curve, row in rows)


def from_dict(data: Mapping[str, Any]) -> Patch | Model:
    """Read a spec from plain data: the result of `to_dict`, the content of a file, or a program's own data.

    Parameters
    ----------
    data : mapping
        The keys of a spec, with lists, tuples or arrays of numbers and expressions.

    Raises
    ------
    SpecError
        See `load`; the messages have key paths.
    """
    document = Document(_plain(data), "", "json", ())
    faults = Faults(document, "from_dict")
    result = ModelReader(Values(faults, Budget()), _nothing_included).spec(document.data, None)
    if result is None or faults.count:
        raise SpecError(str(faults))
    return result


def _plain(value: object) -> object:
    """Python lists, dictionaries and numbers, as parsers return them."""
    match value:
        case np.ndarray() | np.generic():
            return value.tolist()
        case Mapping():
            return {str(key): _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
    return value


def _nothing_included(name: str) -> tuple[Patch, ...]:
    raise SpecError(f"{name}: plain data have no folder from which files could be taken")


class _Files:
    """The file of a spec and those it includes, with the faults of all of them."""

    def __init__(self, source: str, second_row: bool | None = None) -> None:
        self._source = source
        self._second_row = second_row
        self._library = Library(source)
        self._budget = Budget()
        self._faults: list[tuple[Faults | SpecError, str]] = []  # and what stands after their messages

    def whole(self, text: bytes | str, format: Format | None) -> Patch | Model:
        """Read the spec, or raise an error that lists all faults."""
        result = self.spec(text, self._source, format, (self._source,))
        if result is None or self.count:
            raise SpecError(str(self))
        return result

    def spec(
        self, text: bytes | str, source: str, format: Format | None, readers: tuple[str, ...]
    ) -> Patch | Model | None:
        """Read the text of one file, the last of `readers`, each of which includes the next."""
        note = f" (included by {readers[-2]})" if len(readers) > 1 else ""
        try:
            document = read(text, source, format)
        except SpecError as error:
            self._faults.append((error, note))
            return None
        faults = Faults(document, source)
        self._faults.append((faults, note))

        def include(name: str) -> tuple[Patch, ...]:
            path, data = self._library.taken(name, readers)
            found = self.spec(data, path, spec_format_of(path), (*readers, path))
            return () if found is None else found.patches

        reader = ModelReader(Values(faults, self._budget), include, self._second_row)
        return reader.spec(document.data, _stem(source))

    @property
    def count(self) -> int:
        """The number of faults of all files."""
        return sum(faults.count if isinstance(faults, Faults) else 1 for faults, _ in self._faults)

    def __str__(self) -> str:
        lines = [line + note for faults, note in self._faults if (text := str(faults)) for line in text.split("\n")]
        if len(self._faults) == 1 or len(lines) <= Faults.SHOWN:
            return "\n".join(lines)
        return "\n".join([*lines[: Faults.SHOWN], f"... and {max(self.count, len(lines)) - Faults.SHOWN} more"])


def _stem(source: str) -> str | None:
    """The name of a nameless patch, if the file's name is valid for a patch."""
    stem = os.path.splitext(os.path.basename(source))[0]
    return None if source == "-" or source.startswith("<") or name_fault(stem) else stem
