"""Folders as inputs: the specs or meshes in them, and the files of two folders that belong together."""

import os
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gtb_cli.errors import GtbError, SpecError
from gtb_cli.vocabulary import FORMATS, SPEC_FORMATS, suffix_of

# Largest number of subfolders that are read: twenty that link to each other have a million paths through them
MAX_FOLDERS = 10_000


class Pair(NamedTuple):
    """Files of two folders that belong together; None if a folder lacks the file."""

    name: str
    first: str | None
    second: str | None


def specs_among(paths: Sequence[str]) -> tuple[str, ...]:
    """Return the paths, with each folder replaced by the specs in it, sorted by name.

    Raises
    ------
    SpecError
        A folder cannot be read, or has no specs.
    """
    found: list[str] = []
    for path in paths:
        if not os.path.isdir(path):
            found.append(path)
            continue
        try:
            names = sorted(name for name in os.listdir(path) if suffix_of(name) in SPEC_FORMATS)
        except OSError as error:
            raise SpecError(f"{path}: {error.strerror}") from None
        specs = [os.path.join(path, name) for name in names if not name.startswith(".")]
        specs = [spec for spec in specs if not os.path.isdir(spec)]
        if not specs:
            raise SpecError(f"{path}: has no specs, files that end in .toml or .json")
        found += specs
    return tuple(found)


def pairs(a: str, b: str) -> tuple[list[Pair], dict[str, str]]:
    """Match all files of two folders by name; specs of a folder without meshes and meshes, by name without suffix.

    Beside meshes, only the specs of such a folder count. Also return what cannot be read, such as links to nothing, by
    name, with a message for each. Hidden files and manifests are left out: these say which versions made the others.
    """
    unreadable: dict[str, str] = {}
    first, second = _files(a, unreadable), _files(b, unreadable)
    if not first and not unreadable:
        raise GtbError(f"{a}: has no files to compare with")
    meshes = [any(suffix_of(name) in FORMATS for name in files) for files in (first, second)]
    if meshes[0] != meshes[1] and _specs(first if meshes[1] else second):
        first, second = (
            _by_stem(files if own else _specs(files)) for files, own in zip((first, second), meshes, strict=True)
        )
        unreadable = {os.path.splitext(name)[0]: message for name, message in unreadable.items()}
    names = [name for name in sorted({*first, *second}) if not any(part in unreadable for part in _parts(name))]
    return [Pair(name, first.get(name), second.get(name)) for name in names], unreadable


def _parts(name: str) -> Iterator[str]:
    """Yield a path and those of the folders above it."""
    while name:
        yield name
        name = os.path.dirname(name)


def _files(folder: str, unreadable: dict[str, str]) -> dict[str, str]:
    """Return the paths of the files in a folder and its subfolders, by name."""
    files = {name: os.path.join(folder, name) for name in _names(folder, unreadable)}
    for name, path in files.items():
        try:
            os.stat(path)
        except OSError as error:
            unreadable[name] = f"{path}: {error.strerror}"
    return {name: path for name, path in files.items() if not _is_manifest(path)}


def _is_manifest(path: str) -> bool:
    """Tell whether a file is the manifest of others."""
    import json

    most_bytes = 100_000_000
    if suffix_of(path) != "json" or not os.path.isfile(path) or os.path.getsize(path) > most_bytes:
        return False
    try:
        with open(path, "rb") as file:
            content = json.load(file)
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and {"versions", "options", "files"} <= content.keys()


def _names(folder: str, unreadable: dict[str, str]) -> Iterator[str]:
    """Yield the names of all files below a folder that are not hidden, following links; note folders not readable."""
    waiting: list[tuple[str, frozenset[tuple[int, int]]]] = [("", frozenset())]
    count = 0
    while waiting:
        place, above = waiting.pop()
        path = os.path.join(folder, place) if place else folder
        try:
            status = os.stat(path)
            here = status.st_dev, status.st_ino
            if here in above:  # a link to a folder that contains it
                continue
            count += 1
            if count > MAX_FOLDERS:
                raise GtbError(f"{folder}: has more than {MAX_FOLDERS} folders in it; do links lead to each other?")
            with os.scandir(path) as entries:
                listed = sorted((entry.name, _is_folder(entry)) for entry in entries)
        except OSError as error:
            message = f"{error.filename}: {error.strerror}"
            if not place:
                raise GtbError(message) from None
            unreadable[place] = message
            continue
        for name, is_folder in listed:
            inner = os.path.join(place, name)
            if name.startswith("."):
                continue
            if "\n" in name and os.path.islink(os.path.join(path, name)):  # its errors would not begin with its name
                unreadable[inner] = f"{path}: {name!r} is a link with a line break in its name"
                continue
            if is_folder:
                waiting.append((inner, above | {here}))
            else:
                yield inner


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Tell whether an entry must be read as a folder; a link in a circle without the suffix of a file may be one."""
    try:
        return entry.is_dir()
    except OSError:
        return suffix_of(entry.name) not in (*FORMATS, *SPEC_FORMATS)


def _specs(files: dict[str, str]) -> dict[str, str]:
    return {name: path for name, path in files.items() if suffix_of(name) in SPEC_FORMATS}


def _by_stem(files: dict[str, str]) -> dict[str, str]:
    stems: dict[str, str] = {}
    for name, path in files.items():
        stem = os.path.splitext(name)[0] if suffix_of(name) in (*FORMATS, *SPEC_FORMATS) else name
        if stem in stems:
            raise GtbError(f"{stems[stem]} and {path}: only one of them can be compared with a spec or mesh {stem}")
        stems[stem] = path
    return stems
