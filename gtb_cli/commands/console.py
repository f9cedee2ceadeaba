"""Where commands meet the shell: standard streams, messages and progress."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import IO, TYPE_CHECKING, TextIO

from gtb_cli.errors import ExportError, SpecError

if TYPE_CHECKING:
    from threading import Thread

    from gtb_cli.theory.model import Model
    from gtb_cli.theory.patch import Patch

STANDARD = "-"
"""As the name of a file: standard input or output."""

STDIN = "<stdin>"
"""What messages call standard input."""

PATIENCE = 2.0
"""Seconds before a progress bar appears."""

BETWEEN = 0.1
"""Seconds between two pictures of a progress bar."""

BAR = 30
"""Characters of a progress bar."""


def complain(message: str) -> None:
    """Say what went wrong, in one line on standard error."""
    say(f"gtb: error: {printable(message)}")


def printable(text: str) -> str:
    """Text that does nothing to a terminal, whatever the names of files in it."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def say(line: str) -> None:
    """Write to standard error, if anybody is there."""
    if sys.stderr is not None:
        try:
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        except OSError:
            _abandon(sys.stderr)


class Console:
    """Messages of a command, on standard error.

    Parameters
    ----------
    quiet : bool
        Say nothing but errors.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def note(self, message: str) -> None:
        """Say what was done."""
        if not self.quiet:
            say(f"gtb: {printable(message)}")

    def warn(self, message: str) -> None:
        """Say what the user might not expect."""
        if not self.quiet:
            say(f"gtb: warning: {printable(message)}")

    def progress(self, total: float) -> Progress:
        """Return a progress bar for work of some size; it is invisible where no person would see it."""
        visible = not self.quiet and sys.stderr is not None and sys.stderr.isatty()
        return Progress(total, visible=visible)


class Progress:
    """A bar on the last line of a terminal that appears when the work takes longer than `PATIENCE`.

    Parameters
    ----------
    total : float
        Size of the work, in any unit.
    visible : bool
        Whether to draw at all.
    """

    def __init__(self, total: float, *, visible: bool) -> None:
        self.label = ""
        self._total = total
        self._done = 0.0
        self._visible = visible
        self._thread: Thread | None = None

    def advance(self, amount: float) -> None:
        """Note that a part of the work is done."""
        self._done += amount

    def over(self, blocks: Iterable[bytes], amount: float, expected: float) -> Iterator[bytes]:
        """Yield `blocks` of about `expected` bytes in all, and advance by `amount` meanwhile."""
        left = amount
        for block in blocks:
            yield block
            step = min(left, amount * len(block) / expected)
            left -= step
            self.advance(step)
        self.advance(left)

    def __enter__(self) -> Progress:
        if self._visible:
            import threading

            self._over = threading.Event()
            self._thread = threading.Thread(target=self._draw, daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread is not None:
            self._over.set()
            self._thread.join()

    def _draw(self) -> None:
        import time

        start = time.monotonic()
        if self._over.wait(PATIENCE):
            return
        with suppress(OSError, ValueError):  # the terminal has gone
            while True:
                share = min(self._done / self._total, 0.99)
                seconds = int(time.monotonic() - start)
                bar = "#" * int(share * BAR)
                line = f"[{bar:-<{BAR}}] {share:4.0%} {seconds // 60}:{seconds % 60:02d} {printable(self.label)}"
                width = os.get_terminal_size(sys.stderr.fileno()).columns or 80
                # The last column is left free: writing there makes some terminals start a new line.
                sys.stderr.write("\r" + line[: width - 1].ljust(width - 1))
                sys.stderr.flush()
                if self._over.wait(BETWEEN):
                    break
            sys.stderr.write("\r" + " " * (width - 1) + "\r")
            sys.stderr.flush()


def read_spec(path: str, spec_format: str | None = None) -> Patch | Model:
    """Read a spec from a file, or from standard input.

    Raises
    ------
    SpecError
        It cannot be read, or is not right: a line for each error.
    """
    from gtb_cli.spec.document import MAX_BYTES
    from gtb_cli.spec.loading import load, parse

    if path == STANDARD:
        return parse(read_bytes(path, MAX_BYTES + 1), STDIN, spec_format)  # type: ignore[arg-type]
    if spec_format is not None:
        return parse(read_bytes(path, MAX_BYTES + 1), path, spec_format)  # type: ignore[arg-type]
    return load(path)


def read_bytes(path: str, limit: int) -> bytes:
    """Read at most `limit` bytes of a file, or of standard input."""
    with opened(path) as file:
        return file.read(limit)


@contextmanager
def opened(path: str) -> Iterator[IO[bytes]]:
    """Open a file, or standard input, for reading bytes.

    Raises
    ------
    SpecError
        There is none, or reading it fails.
    """
    if path == STANDARD and sys.stdin is None:
        raise SpecError(f"{STDIN}: standard input is closed")
    try:
        if path == STANDARD:
            yield sys.stdin.buffer
        else:
            with open(path, "rb") as file:
                yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        raise SpecError(f"{shown_input(path)}: {error.strerror or error}") from None


def shown_input(path: str) -> str:
    """Name an input in messages."""
    return STDIN if path == STANDARD else path or "''"


def write_blocks(output: str, blocks: Iterable[bytes]) -> None:
    """Write bytes to standard output, or to a file that appears whole or not at all.

    Raises
    ------
    ExportError
        They cannot be written.
    BrokenPipeError
        The reader of a pipe has gone.
    """
    if output != STANDARD:
        from gtb_cli.files import replace_file

        replace_file(output, blocks)
        return
    if sys.stdout is None:
        raise ExportError("cannot write standard output: it is closed")
    try:
        for block in blocks:
            sys.stdout.buffer.write(block)
            sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        abandon_stdout()
        raise ExportError(f"cannot write standard output: {error.strerror or error}") from None


def write_text(output: str, text: str) -> None:
    """Write text as UTF-8, whatever the locale, as `write_blocks` does."""
    write_blocks(output, [text.encode("utf-8", "backslashreplace")])


def is_terminal(output: str) -> bool:
    """Whether an output is standard output and that is a terminal."""
    return output == STANDARD and sys.stdout is not None and sys.stdout.isatty()


def abandon_stdout() -> None:
    """Send what standard output still holds nowhere, so that the end of the process does not fail on it again."""
    if sys.stdout is not None:
        _abandon(sys.stdout)


def _abandon(stream: TextIO) -> None:
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
