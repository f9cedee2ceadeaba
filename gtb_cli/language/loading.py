"""Spec files, TOML or JSON (which: `document`) → `Patch` and `Model`, with every error of a file at once."""

import os
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.errors import Fault, SpecError
from gtb_cli.files import read_file
from gtb_cli.language.document import MAX_BYTES, Document, Faults, error_about, read, spec_format_of
from gtb_cli.language.includes import Library
from gtb_cli.language.keys_and_values import Budget, Values, valid_name
from gtb_cli.language.model_reader import read_spec
from gtb_cli.language.names import Unknown
from gtb_cli.language.reading import NO_LET, Let, Reading
from gtb_cli.language.scanner import Path
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import SpecFormat


def load(path: str | os.PathLike[str], let: Let = NO_LET) -> Patch | Model:
    """Read a spec file.

    Parameters
    ----------
    path : path
        Its suffix ``.toml`` or ``.json`` decides the format; without either, its first character does.
    let : mapping
        Numbers, or expressions over names before them, in place of those that the spec's own ``let`` gives these names.

    Returns
    -------
    Patch or Model
        Named after the file if the spec has no name.

    Raises
    ------
    SpecError
        It cannot be read, or describes no patch: a line for each error with file, line, key path and what was found.
    """
    source = os.fspath(path)
    return parse(read_file(source, MAX_BYTES + 1), source, spec_format_of(source), let)


def load_patch(path: str | os.PathLike[str], let: Let = NO_LET) -> Patch:
    """Read a spec file of a single patch, as `load` does; a `SpecError` is also raised for a model."""
    spec = load(path, let)
    if isinstance(spec, Model):
        raise SpecError(Fault(f"expected a single patch, this is a model of {len(spec)}", os.fspath(path)))
    return spec


def load_model(path: str | os.PathLike[str], let: Let = NO_LET) -> Model:
    """Read a spec file, as `load` does; a single patch becomes a model of one."""
    spec = load(path, let)
    return Model(spec.patches, spec.name) if isinstance(spec, Patch) else spec


def parse(
    text: bytes | str,
    source: str = "<spec>",
    format: SpecFormat | None = None,
    let: Let = NO_LET,
    warn: Callable[[str], object] = warnings.warn,
    row: int | None = None,
) -> Patch | Model:
    """Read the text of a spec, at most 10 MB of UTF-8; the format by its first character unless given.

    The stem of `source` names a nameless patch; included files are in its folder. ``-`` and text in angle brackets are
    not files: they give no name and include nothing. `warn` is told what is probably meant otherwise, such as a sine of
    60; `row` is that of `Reader`. Raises what `load` raises. Any text takes at most about five seconds and 300 MB.
    """
    library, budget = Library(), Budget()
    files: list[Faults] = []

    def spec(
        text: bytes | str, format: SpecFormat | None, readers: tuple[str, ...], given: Let, unknown: Unknown
    ) -> Patch | Model | None:
        """Read one file, the last of `readers`, each of which includes the next."""
        document = read(text, readers[-1], format)
        faults = Faults(document, readers[-1], f" (included by {readers[-2]})" if len(readers) > 1 else "")
        files.append(faults)

        def include(name: str, numbers: Let, place: Path) -> tuple[Patch, ...]:
            def missing(number: str, fault: str) -> None:
                faults.add((*place, number), f"{name} {fault}")

            path, data = library.taken(name, readers)
            found = spec(data, spec_format_of(path), (*readers, path), numbers, missing)
            return () if found is None else found.patches

        values = Values(faults, budget)
        found = read_spec(values, include, document.data, stem_of(readers[-1]), row, given, unknown)
        if isinstance(document.data, dict) and document.data.get("let") and values.names:
            from gtb_cli.language.sliders import check_ranges

            check_ranges(document, faults, values.names, given)
        return found

    result = spec(text, format, (source,), let, lambda name, what: files[0].add((), f"`let` {name}: the spec {what}"))
    if result is None or any(faults.count for faults in files):
        raise error_about(files)
    if doubt := next(filter(None, (faults.doubted() for faults in files)), None):
        warn(str(doubt))
    return result


def parse_loop(
    text: bytes | str, source: str, reading: Reading
) -> tuple[Patch | Model, tuple[tuple[FloatArray, ...], ...]]:
    """Read the text of a spec whose curves may have the keys ``ribbon`` and ``ribbon2``; otherwise like `parse`.

    Also return up to two (n, 3) further rows of control points of each patch, moved with the copies.
    """
    format, let = reading.spec_format or spec_format_of(source), dict(reading.let)
    spec = parse(text, source, format, let, str, 0)
    if spec.dimension == 2:
        return spec, ((),) * len(spec.patches)
    rows = [[patch.control_points] for patch in spec.patches]
    for number in (1, 2):
        for found, patch in zip(rows, parse(text, source, format, let, str, number).patches, strict=True):
            if not np.array_equal(found[-1], patch.control_points):
                found.append(patch.control_points)
    return spec, tuple(tuple(found[1:]) for found in rows)


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

    def include(name: str, let: Let, place: Path) -> tuple[Patch, ...]:
        raise SpecError(f"{name}: plain data have no folder from which files could be taken")

    faults = Faults(Document(plain := _plain(data), "", "json", ()), "from_dict")
    result = read_spec(Values(faults, Budget()), include, plain, None, None, NO_LET, lambda *_: None)
    if result is None or faults.count:
        raise error_about([faults])
    return result


def _plain(value: object) -> object:
    """Return Python lists, dictionaries and numbers, as parsers do."""
    match value:
        case np.ndarray() | np.generic():
            return value.tolist()
        case Mapping():
            return {str(key): _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
    return value


def stem_of(source: str) -> str | None:
    """Return the name of a nameless patch, if the file's name is valid for a patch."""
    is_file = source != "-" and not source.startswith("<")
    return valid_name(os.path.splitext(os.path.basename(source))[0]) if is_file else None
