"""Bytes to a file's disk, which takes them while others are computed."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import IO

FLUSHED_BYTES = 1 << 22
"""Bytes of a file that go to the disk together, in a thread that computes nothing: it would be idle until the end."""


def write_to_disk(file: IO[bytes], blocks: Iterable[bytes]) -> None:
    """Write `blocks` to a file, and have them on the disk at the end.

    Raises
    ------
    OSError
        The system refuses some of them.
    """
    errors: list[OSError] = []

    def flush() -> None:
        try:
            os.fsync(file.fileno())
        except OSError as error:  # the system tells it only once
            errors.append(error)

    thread, waiting = None, 0
    try:
        for block in blocks:
            file.write(block)
            waiting += len(block)
            if waiting >= FLUSHED_BYTES and not (thread and thread.is_alive()):
                waiting, thread = 0, threading.Thread(target=flush)
                with suppress(RuntimeError):  # there may be no more threads
                    thread.start()
    finally:
        if thread and thread.ident:
            thread.join()
    file.flush()
    if not errors:
        flush()
    for error in errors:
        raise error
