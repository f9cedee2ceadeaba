"""``gtb --max-seconds S --max-memory M``: what a whole command may take; `process.memory` sets the latter limit."""

import math
import os
import re
import signal
import time
from contextlib import suppress

import click

from gtb_cli.errors import GtbError
from gtb_cli.process.memory import LEAST_BYTES, limit_to, size_text

GRACE_SECONDS = 1.0  # seconds that the command gets to end by itself, when its time is over


def seconds_from(text: str) -> float:
    """Read the value of --max-seconds."""
    with suppress(ValueError):
        if 0 < float(text) < 1e9:
            return float(text)
    raise click.BadParameter(f"expected a number of seconds above 0, got {text[:60]!r}")


def bytes_from(text: str) -> int:
    """Read the value of --max-memory: bytes, or a number with K, M or G, powers of 1024."""
    match = re.fullmatch(r"(\d{1,15}(?:\.\d{1,3})?)([KMG]?)B?", text, re.IGNORECASE | re.ASCII)
    if not match:
        raise click.BadParameter(f"expected a size such as 500M or 2G, got {text[:60]!r}")
    size = int(float(match[1]) * 1024 ** " KMG".index(match[2].upper() or " "))
    if size < LEAST_BYTES:
        raise click.BadParameter(f"gtb needs at least {LEAST_BYTES >> 20}M, got {text}")
    return size


def bound(seconds: float | None, size: int | None) -> None:
    """Continue in a copy of this process, limited in seconds and, with the processes that it starts, in bytes.

    This process waits for the copy and raises `click.exceptions.Exit` with its status, or a `GtbError` if it takes too
    long or is killed. The copy is then gone, with its unfinished files.
    """
    if not hasattr(os, "fork"):
        raise GtbError("--max-seconds and --max-memory are not available on this system, which cannot copy processes")
    import tempfile

    from gtb_cli.files import discard, list_unfinished_in

    with tempfile.TemporaryFile() as ledger:
        copy = os.fork()
        if copy == 0:
            list_unfinished_in(os.dup(ledger.fileno()))
            if seconds is not None:
                import resource

                # It ends what nobody waits for any more, such as a worker in a library that lets no other thread run.
                most = math.ceil((seconds + GRACE_SECONDS) * (os.cpu_count() or 1))
                with suppress(OSError, ValueError):
                    resource.setrlimit(resource.RLIMIT_CPU, (most, most))
            if size is not None:
                limit_to(size)
            return
        status, asked = _awaited(copy, seconds)
        if status < 0:
            ledger.seek(0)
            discard([os.fsdecode(name) for name in ledger.read().split(b"\0") if name])
    # Whatever signal ended it in the end: at its very end, for one, Python no longer unwinds at SIGTERM.
    if asked is not None and (isinstance(asked, KeyboardInterrupt) or status < 0 or status == 128 + signal.SIGTERM):
        raise asked
    if status < 0:
        cause = "is there too little memory" if size is None else f"is {size_text(size)} (--max-memory) too little"
        raise GtbError(f"the process was killed by {signal.Signals(-status).name}: {cause}?")
    raise click.exceptions.Exit(status)


def _awaited(copy: int, seconds: float | None) -> tuple[int, GtbError | KeyboardInterrupt | None]:
    """Return the status of a process, negative if a signal killed it, and why it was asked to end, if it was."""
    deadline = math.inf if seconds is None else time.monotonic() + seconds
    asked: GtbError | KeyboardInterrupt | None = None
    while True:
        try:
            number, status = os.waitpid(copy, os.WNOHANG)
            if number:
                return os.waitstatus_to_exitcode(status), asked
            if time.monotonic() > deadline:
                os.kill(copy, signal.SIGTERM if asked is None else signal.SIGKILL)
                asked = asked or GtbError(f"stopped after {seconds:g} s: --max-seconds allows no more")
                deadline = time.monotonic() + GRACE_SECONDS
            time.sleep(0.005)
        except KeyboardInterrupt as stop:
            asked, deadline = stop, time.monotonic() + GRACE_SECONDS
            with suppress(ProcessLookupError):
                os.kill(copy, stop.args[0] if stop.args else signal.SIGINT)
        except ChildProcessError:  # it had ended when the signal came
            return 0, asked
