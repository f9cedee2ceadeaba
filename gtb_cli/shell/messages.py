"""Errors, warnings, notes and progress on standard error: as text, as JSON, or as annotations of GitHub."""

import itertools
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TextIO

from gtb_cli.errors import Fault
from gtb_cli.shell.faults import in_options, located
from gtb_cli.vocabulary import SCHEMA, printable

STANDARD = "-"  # the name of a file that stands for standard input or output
# How errors and warnings are printed: as lines, as one JSON object at the end, or as annotations of GitHub
FORMS = ("text", "json", "github")


@dataclass
class _Messages:
    """The form of a command line's errors and warnings, the line's own words, and what is printed at its end."""

    form: str = FORMS[0]
    words: Sequence[str] = ()
    waiting: list[dict[str, object]] = field(default_factory=list)


_messages = _Messages()


def begin(form: str, words: Sequence[str]) -> None:
    """Print the errors and warnings of this command line in one of the `FORMS`."""
    global _messages
    _messages = _Messages(form, words)


def finish(status: int) -> None:
    """Print the errors and warnings that are one object."""
    if _messages.waiting:
        import json

        say(json.dumps({"schema": SCHEMA, "errors": _messages.waiting, "status": status}))


def tell(what: Fault | str, severity: str = "note") -> None:
    """Print an error, a warning or a note, as a line on standard error or as `begin` says."""
    if _messages.form == "text" or (_messages.form == "github" and severity == "note"):
        return say(f"gtb: {'' if severity == 'note' else f'{severity}: '}{printable(str(what))}")
    fault = what if isinstance(what, Fault) else Fault(what)
    if _messages.form == "github":
        say(annotation(located(fault, _messages.words), severity))
    elif severity != "note":
        _messages.waiting.append(error_record(fault, severity))


def error_record(fault: Fault, severity: str = "error") -> dict[str, object]:
    """Return an error or a warning as plain data."""
    fault = located(fault, _messages.words)
    return {key: getattr(fault, key) for key in ("file", "line", "column", "key", "message")} | {"severity": severity}


def annotation(fault: Fault, severity: str) -> str:
    """Write a fault as a command to GitHub's workflows, with the path as from the working folder."""
    file = fault.file
    if file is not None and os.path.isabs(file) and (inside := os.path.relpath(file))[:2] != os.pardir:
        file = inside
    properties = {"file": file if file != "<stdin>" else None, "line": fault.line, "col": fault.column, "title": "gtb"}
    given = [f"{key}={_escaped(str(value), ':,')}" for key, value in properties.items() if value is not None]
    return f"::{severity} {','.join(given)}::{_escaped(str(Fault(fault.message, key=fault.key)))}"


def _escaped(text: str, more: str = "") -> str:
    """Escape a value of a workflow command; what would control a terminal is escaped as in other messages."""
    return printable("".join(f"%{ord(c):02X}" if c in "%\r\n" + more else c for c in text))


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

    def warn(self, message: str, severity: str = "warning") -> None:
        """Print what the user might not expect, or may like to know, in the words of options."""
        self.note(in_options(message), severity)

    def note(self, message: str, severity: str = "note") -> None:
        """Print what was done."""
        if not self.quiet:
            self._show("")
            tell(message, severity)

    def report(self, output: str, size: str, warnings: Iterable[str] = ()) -> None:
        """Print what was written to an output, and the warnings."""
        prefix = "" if output == STANDARD else f"{output}: "
        for warning in warnings:
            self.warn(f"{prefix}{warning}")
        if output != STANDARD:
            self.note(f"{prefix}{size}")

    @contextmanager
    def counter(self, total: int | None) -> Iterator[Callable[[str], None]]:
        """Give a function that shows on a terminal, after two seconds, which thing of how many is being made."""
        visible, start, numbers = self._visible(), time.monotonic(), itertools.count(1)

        def begin(label: str) -> None:
            number = next(numbers)
            if visible and time.monotonic() - start > 2.0:
                self._show(f"[{number}{'' if total is None else f'/{total}'}] {printable(label)}")

        try:
            yield begin
        finally:
            self._show("")

    @contextmanager
    def clock(self, label: str, after: float = 2.0) -> Iterator[Callable[[str], None]]:
        """Show on a terminal, after some seconds, how many of them something takes; as a counter, it is alone."""
        import threading

        done, start = threading.Event(), time.monotonic()

        def tick() -> None:
            pause = after
            while not done.wait(pause):
                self._show(f"{label}: {time.monotonic() - start:.0f} s")
                pause = 1.0

        thread = threading.Thread(target=tick, daemon=True)
        if not self._visible():
            done.set()
        thread.start()
        try:
            yield lambda _: None
        finally:
            done.set()
            thread.join()
            self._show("")

    def _visible(self) -> bool:
        return not self.quiet and sys.stderr is not None and sys.stderr.isatty()

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
