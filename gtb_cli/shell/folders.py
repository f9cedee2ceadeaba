"""Folders as inputs: the specs or meshes in them, and the files of two folders that belong together."""

import os
from collections.abc import Sequence
from contextlib import suppress

from gtb_cli.errors import Fault, GtbError, SpecError
from gtb_cli.vocabulary import FORMATS, SEQUENCE_RECORD, SPEC_FORMATS, suffix_of

MAX_FOLDERS = 10_000  # that are read: twenty that link to each other have a million paths through them


def is_pattern(path: str) -> bool:
    """Tell whether a path stands for the files whose names match it, as where no shell has expanded it."""
    return any(sign in path for sign in "*?[") and not os.path.lexists(path)


def are_several(paths: Sequence[str]) -> bool:
    """Tell whether paths stand for several specs: a folder and a pattern do, even if they have only one."""
    return len(paths) > 1 or is_pattern(paths[0]) or os.path.isdir(paths[0])


def specs_among(paths: Sequence[str], meshes: bool = False) -> tuple[str, ...]:
    """Return the paths, with the specs in place of each folder, and what matches in place of each pattern, by name.

    With `meshes`, a folder's meshes count, too. Raises a `SpecError` if there is nothing.
    """
    found: list[str] = []
    for path in paths:
        if is_pattern(path):
            from glob import glob

            matching = sorted(glob(path))
            if not matching:
                raise SpecError(Fault("no file has such a name", path))
            found += specs_among(matching, meshes)
        elif os.path.isdir(path):
            found += _specs_in(path, meshes)
        else:
            found.append(path)
    return tuple(found)


def _specs_in(folder: str, meshes: bool) -> list[str]:
    suffixes = (*SPEC_FORMATS, *FORMATS) if meshes else SPEC_FORMATS
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise SpecError(Fault(str(error.strerror), folder)) from None
    paths = [os.path.join(folder, name) for name in names if suffix_of(name) in suffixes and name[0] != "."]
    found = [path for path in paths if not os.path.isdir(path)]
    if meshes:
        found = [path for path in found if os.path.basename(path) != SEQUENCE_RECORD and not _is_manifest(path)]
    if not found:
        *most, last = (f".{suffix}" for suffix in suffixes)
        what = "specs or meshes" if meshes else "specs"
        raise SpecError(Fault(f"has no {what}, files that end in {', '.join(most)} or {last}", folder))
    return found


def pairs(a: str, b: str) -> tuple[dict[str, tuple[str | None, str | None]], dict[str, str]]:
    """Pair the files of two folders by name; where one has specs and the other meshes, by name without suffix.

    A path is None where a folder lacks the file. Beside meshes, only the specs of the other folder count. What cannot
    be read, such as links to nothing, is returned, too, by name, with a message for each. Hidden files and manifests,
    which say which versions made the other files, are left out.
    """
    unreadable: dict[str, str] = {}
    first, second = files_in(a, unreadable), files_in(b, unreadable)
    if not first and not unreadable:
        raise GtbError(f"{a}: has no files to compare with")
    meshes = [any(suffix_of(name) in FORMATS for name in files) for files in (first, second)]
    if meshes[0] != meshes[1] and _specs(first if meshes[1] else second):
        both = zip((first, second), meshes, strict=True)
        first, second = (_by_stem(files if own else _specs(files)) for files, own in both)
        unreadable = {os.path.splitext(name)[0]: message for name, message in unreadable.items()}
    hidden = tuple(f"{name}{os.sep}" for name in unreadable)  # what is in folders that cannot be read
    names = sorted(name for name in {*first, *second} - unreadable.keys() if not name.startswith(hidden))
    return {name: (first.get(name), second.get(name)) for name in names}, unreadable


def files_in(folder: str, unreadable: dict[str, str]) -> dict[str, str]:
    """Return the paths of files below a folder, by name, but no hidden files or manifests; note what is unreadable."""
    files: dict[str, str] = {}
    waiting: list[tuple[str, frozenset[tuple[int, int]]]] = [("", frozenset())]
    count = 0
    while waiting:
        place, above = waiting.pop()
        path = os.path.join(folder, place) if place else folder
        try:
            status, names = os.stat(path), sorted(os.listdir(path))
        except OSError as error:
            unreadable[place] = f"{error.filename}: {error.strerror}"
            if not place:
                raise GtbError(unreadable[place]) from None
            continue
        here = status.st_dev, status.st_ino
        if here in above:  # a link to a folder that contains it
            continue
        if (count := count + 1) > MAX_FOLDERS:
            raise GtbError(f"{folder}: has more than {MAX_FOLDERS} folders in it; do links lead to each other?")
        for name in [name for name in names if name[0] != "."]:
            inner, file = os.path.join(place, name), os.path.join(path, name)
            try:
                os.stat(file)
            except OSError as error:  # such as a link to nothing
                unreadable[inner] = f"{file}: {error.strerror}"
            if "\n" in name and os.path.islink(file):  # its errors would not begin with its name
                unreadable[inner] = f"{path}: {name!r} is a link with a line break in its name"
            if inner in unreadable:
                continue
            if os.path.isdir(file):
                waiting.append((inner, above | {here}))
            elif not _is_manifest(file):
                files[inner] = file
    return files


def _is_manifest(path: str) -> bool:
    """Tell whether a file is the manifest of others; few bytes of larger ones would take much memory."""
    import json

    from gtb_cli.language.document import MAX_BYTES

    with suppress(OSError, ValueError, RecursionError):
        if suffix_of(path) == "json" and os.path.isfile(path) and os.path.getsize(path) <= MAX_BYTES:
            with open(path, "rb") as file:
                content = json.load(file)
            return isinstance(content, dict) and {"versions", "options", "files"} <= content.keys()
    return False


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
