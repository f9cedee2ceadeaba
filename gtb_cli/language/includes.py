"""``include``: the files that a spec may include, all from its own folder."""

import os
import stat

from gtb_cli.errors import SpecError
from gtb_cli.files import read_file
from gtb_cli.language.document import MAX_BYTES, read, spec_format_of
from gtb_cli.vocabulary import SpecFormat

MAX_FILES = 100  # files that a spec includes, directly or through others


class Library:
    """The files that a spec includes, directly or through others, counted as often as they are taken."""

    def __init__(self) -> None:
        self._count = self._bytes = 0

    def taken(self, name: str, readers: tuple[str, ...]) -> tuple[str, bytes]:
        """Return path and content of a file included by the last of `readers`, each of which includes the next.

        Raises `SpecError`, without the including file: it is outside the folder, in a circle, unreadable or too large.
        """
        if readers[0] == "-" or readers[0].startswith("<"):
            raise SpecError(f"{readers[0]} has no folder from which files could be taken")
        path = os.path.join(os.path.dirname(readers[-1]), name)
        try:
            real = os.path.realpath(path)
            folder = os.path.realpath(os.path.dirname(readers[0]))
            inside = os.path.commonpath([folder, real]) == folder
        except (OSError, ValueError) as error:  # a null character, another drive
            raise SpecError(f"{name!r}: {error}") from None
        if os.path.isabs(name) or not inside:
            raise SpecError(f"{name}: is outside the spec's folder, below which included files must be")
        if real in (chain := [os.path.realpath(reader) for reader in readers]):
            circle = [*readers[chain.index(real) :], path]
            raise SpecError(f"{name}: includes itself: {' -> '.join(map(os.path.basename, circle))}")
        if self._count == MAX_FILES:
            raise SpecError(f"{name}: at most {MAX_FILES} files can be included")
        # Of a regular file, at most one byte more than allowed; no other file is waited for.
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        try:
            with open(os.open(real, flags), "rb") as file:
                if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                    raise SpecError(f"{name}: is not a file")
                data = file.read(MAX_BYTES + 1)
        except OSError as error:
            raise SpecError(f"{name}: {error.strerror or error}") from None
        self._bytes += len(data)
        if self._bytes > MAX_BYTES:
            raise SpecError(f"{name}: is too large, files of a spec have at most {MAX_BYTES // 10**6} MB together")
        self._count += 1
        return path, data


def sources(path: str, format: SpecFormat | None = None) -> tuple[str, ...]:
    """Name the files from which a spec is read: its own first, then those it includes, directly or through others.

    Each file stands once, as the folder of `path` and what the including files write (``..`` is left, as it leads
    elsewhere after a link); hardly more than `MAX_FILES`. A file that cannot be read includes nothing.
    """
    found, files = {os.path.realpath(path)}, [path]
    for file in files:  # which grows
        for name in _included(file, format if file == path else None) if len(found) <= MAX_FILES else ():
            below = os.path.join(os.path.dirname(file), name)
            if (real := os.path.realpath(below)) not in found:
                found.add(real)
                files.append(below)
    return tuple(files)


def _included(path: str, format: SpecFormat | None) -> list[str]:
    """Return the names of the files that the text of a file includes."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # a pipe would be emptied, or waited for
            return []
        text = read_file(path, MAX_BYTES + 1)
        # Most specs include nothing, and need not be parsed to show that.
        data = read(text, path, format or spec_format_of(path)).data if b"include" in text else None
    except (OSError, ValueError):
        return []
    names = data.get("include") if isinstance(data, dict) else None
    entries = names if isinstance(names, list) else []
    named = [entry.get("file") if isinstance(entry, dict) else entry for entry in entries]
    return [name for name in named if isinstance(name, str) and "\0" not in name]  # no path has a null character
