"""Messages and progress on standard error."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

from gtb_cli.errors import GtbError

if TYPE_CHECKING:
    from threading import Thread


STANDARD = "-"  # the name of a file that stands for standard input or output


def complain(message: str) -> None:
    """Print an error message as one line on standard error."""
    say(f"gtb: error: {printable(message)}")


def lines_about(error: Exception) -> list[str]:
    """Return the lines of the message for any error; GTB_TRACEBACK=1 shows where an internal error comes from."""
    # Messages for system errors that concern neither a file nor a stream
    system_limits = {
        errno.EMFILE: "too many open files: the system allows this process no more",
        errno.ENFILE: "too many open files: the system allows no more",
        errno.EAGAIN: "no more processes or threads: the system allows no more",
        errno.ENOMEM: "not enough memory for this",
        errno.ENOENT: "the working folder is gone",
    }
    match error:
        case GtbError():
            return str(error).split("\n")
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
    """Messages of a command, on standard error.

    Parameters
    ----------
    quiet : bool
        Print only errors.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self._progress: Progress | None = None

    def note(self, message: str) -> None:
        """Print what was done."""
        if not self.quiet:
            self._say(f"gtb: {printable(message)}")

    def warn(self, message: str) -> None:
        """Print what the user might not expect."""
        if not self.quiet:
            self._say(f"gtb: warning: {printable(message)}")

    def _say(self, line: str) -> None:
        if self._progress is None:
            say(line)
        else:
            self._progress.say(line)

    def report(self, output: str, size: str, warnings: Iterable[str] = ()) -> None:
        """Print what was written to an output, and the warnings."""
        prefix = "" if output == STANDARD else f"{output}: "
        for warning in warnings:
            self.warn(f"{prefix}{warning}")
        if output != STANDARD:
            self.note(f"{prefix}{size}")

    def progress(self, total: float) -> Progress:
        """Return a progress bar for work of the given size; it is invisible unless a person would see it."""
        visible = not self.quiet and sys.stderr is not None and sys.stderr.isatty()
        self._progress = Progress(total, visible=visible)
        return self._progress


class Progress:
    """A bar on the last line of a terminal; it appears when the work takes longer than `PROGRESS_DELAY`.

    Parameters
    ----------
    total : float
        Size of the work, in any unit.
    visible : bool
        Whether the bar is drawn at all.
    """

    def __init__(self, total: float, *, visible: bool) -> None:
        self.label = ""
        self._total = total
        self._done = 0.0
        self._visible = visible
        self._thread: Thread | None = None
        self._lock: AbstractContextManager[object] = nullcontext()
        self._width = 0

    def advance(self, amount: float) -> None:
        """Record that a part of the work is done."""
        self._done += amount

    def over(self, blocks: Iterable[bytes], amount: float, expected: float) -> Iterator[bytes]:
        """Yield `blocks`, about `expected` bytes in all, and advance by `amount` meanwhile."""
        left = amount
        for block in blocks:
            yield block
            step = min(left, amount * len(block) / expected)
            left -= step
            self.advance(step)
        self.advance(left)

    def say(self, line: str) -> None:
        """Write a line in the place of the bar, until the bar is drawn again."""
        with self._lock:
            self._clear()
            say(line)

    def __enter__(self) -> Progress:
        if self._visible:
            import threading

            self._lock = threading.Lock()
            self._over = threading.Event()
            thread = threading.Thread(target=self._draw, daemon=True)
            with suppress(RuntimeError):  # no thread can be started: the work is done without a bar
                thread.start()
                self._thread = thread
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is not None:
            self._over.set()
            self._thread.join()

    def _draw(self) -> None:
        progress_delay = 2.0  # seconds before a progress bar appears
        progress_interval = 0.1  # seconds between two updates of a progress bar
        bar_characters = 30  # length of a progress bar in characters
        import time

        start = time.monotonic()
        if self._over.wait(progress_delay):
            return
        with suppress(OSError, ValueError):  # the terminal is gone
            while True:
                share = min(self._done / self._total, 0.99)
                seconds = int(time.monotonic() - start)
                bar = "#" * int(share * bar_characters)
                clock = f"{seconds // 60}:{seconds % 60:02d}"
                line = f"[{bar:-<{bar_characters}}] {share:4.0%} {clock} {printable(self.label)}".rstrip()
                width = os.get_terminal_size(sys.stderr.fileno()).columns or 80
                with self._lock:
                    # The last column is left free: writing there makes some terminals start a new line.
                    self._width = width - 1
                    sys.stderr.write("\r" + line[: self._width].ljust(self._width))
                    sys.stderr.flush()
                if self._over.wait(progress_interval):
                    break
            with self._lock:
                self._clear()

    def _clear(self) -> None:
        """Erase the bar."""
        if self._width:
            with suppress(OSError, ValueError):
                sys.stderr.write("\r" + " " * self._width + "\r")
                sys.stderr.flush()
            self._width = 0


def abandon(stream: TextIO | None) -> None:
    """Discard what a stream still holds, so that the end of the process does not fail on it again."""
    if stream is not None:
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
