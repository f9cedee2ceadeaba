"""Messages and progress on standard error."""

import errno
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from gtb_cli.errors import GtbError

STANDARD = "-"  # the name of a file that stands for standard input or output


def complain(message: str) -> None:
    """Print an error message as one line on standard error."""
    say(f"gtb: error: {printable(message)}")


def lines_about(error: Exception) -> list[str]:
    """Return the lines of the message for any error; GTB_TRACEBACK=1 shows where an internal error comes from."""
    system_limits = {
        errno.EMFILE: "too many open files: the system allows this process no more",
        errno.ENFILE: "too many open files: the system allows no more",
        errno.EAGAIN: "no more processes or threads: the system allows no more",
        errno.ENOMEM: "not enough memory for this",
        errno.ENOENT: "the working folder is gone",
    }
    match error:
        case GtbError():
            return [discreet(line) for line in in_options(str(error)).split("\n")]
        case MemoryError() | SystemError():  # the second, from C code that had no memory left to say so
            return ["not enough memory for this"]
        case OSError(filename=str() | bytes() as name):
            return [f"{os.fsdecode(name)}: {error.strerror}"]
        case OSError(errno=number) if number in system_limits:
            return [system_limits[number]]
        case OSError():
            return [f"cannot write standard output: {error.strerror or error}"]
    if os.environ.get("GTB_TRACEBACK"):
        import traceback

        say("".join(traceback.format_exception(error)).rstrip())
    return [f"internal error, please report it: {type(error).__name__}: {error} (GTB_TRACEBACK=1 shows where)"]


def in_options(message: str) -> str:
    """Return a message of the library with options in place of the arguments that it names in backticks."""
    options = {
        "ascii": "--ascii",
        "certify": "--certify",
        "distances=False": "--no-distance",
        "edge": "--hole EDGE",
        "fit": "gtb fit",
        "isoparametric_points": "--polyline",
        "lifting": "--lifting",
        "max_degree": "--max-degree",
        "max_faces": "--max-faces",
        'parametrization="toric"': "--parametrization toric",
        "patch": "--patch",
        "radius": "--radius R",
        "resolution": "-n",
        "tolerance": "--tolerance",
        "weld": "--weld",
        "what": "--what",
    }
    return re.sub("`([^`\n]+)`", lambda found: options.get(found[1], found[0]), message)


def discreet(line: str) -> str:
    """Return the line of an error without what it quotes, if the file with which it begins is a link out of its folder.

    So a job on a stranger's files puts no line of another file into its log.
    """
    quotations = r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\""""
    path = next((line[:i] for i, c in enumerate(line) if c == ":" and leads_out(line[:i])), None)
    if path is None:
        return line
    text, count = re.subn(quotations, "…", line.removeprefix(path))
    return f"{path}{text} (not quoted: a link leads out of its folder)" if count else line


def leads_out(path: str) -> bool:
    """Tell whether one of the links in a path leads out of the folder in which it stands."""
    folder, steps = "", path.split(os.sep)
    for step in steps:
        place = os.path.join(folder, step) if step else folder or os.sep
        if step and os.path.islink(place):
            inside = os.path.realpath(folder or os.curdir)
            if os.path.commonpath([inside, os.path.realpath(place)]) != inside:
                return True
        folder = place
    return False


def printable(text: str) -> str:
    """Return the text without characters that would control a terminal, such as those in names of files."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def say(line: str) -> None:
    """Write a line to standard error, if it is open."""
    if sys.stderr is not None:
        try:
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        except OSError:
            abandon(sys.stderr)


class Console:
    """Messages of a command, on standard error; if it is quiet, only errors."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self._width = 0  # of the counter on the last line of a terminal

    def note(self, message: str) -> None:
        """Print what was done."""
        self._say(f"gtb: {printable(message)}")

    def warn(self, message: str) -> None:
        """Print what the user might not expect."""
        self._say(f"gtb: warning: {printable(in_options(message))}")

    def _say(self, line: str) -> None:
        if not self.quiet:
            self._show("")
            say(line)

    def report(self, output: str, size: str, warnings: Iterable[str] = ()) -> None:
        """Print what was written to an output, and the warnings."""
        prefix = "" if output == STANDARD else f"{output}: "
        for warning in warnings:
            self.warn(f"{prefix}{warning}")
        if output != STANDARD:
            self.note(f"{prefix}{size}")

    @contextmanager
    def counter(self, total: int) -> Iterator[Callable[[str], None]]:
        """Give a function that shows on a terminal, after two seconds, which of `total` things is being made."""
        visible = not self.quiet and sys.stderr is not None and sys.stderr.isatty()
        start, begun = time.monotonic(), 0

        def begin(label: str) -> None:
            nonlocal begun
            begun += 1
            if visible and time.monotonic() - start > 2.0:
                self._show(f"[{begun}/{total}] {printable(label)}")

        try:
            yield begin
        finally:
            self._show("")

    def _show(self, text: str) -> None:
        """Show a text in the place of the last one."""
        if text or self._width:
            with suppress(OSError, ValueError):  # the terminal is gone
                columns = os.get_terminal_size(sys.stderr.fileno()).columns or 80
                text = text[: columns - 1]  # writing in the last column makes some terminals start a new line
                sys.stderr.write(f"\r{' ' * self._width}\r{text}")
                sys.stderr.flush()
            self._width = len(text)


def abandon(stream: TextIO | None) -> None:
    """Discard what a stream still holds, so that the end of the process does not fail on it again."""
    if stream is not None:
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
