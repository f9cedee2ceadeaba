"""Work shared among copies of this process, which do not wait for one interpreter's lock as threads do."""

from __future__ import annotations

import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Generic, NoReturn, TypeVar

from gtb_cli.process.threads import in_threads, limit_threads, thread_count

if TYPE_CHECKING:
    from gtb_cli.arrays import FloatArray

T = TypeVar("T")

SIGNALS = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}

WORTH_TASKS = 8  # fewest tasks for which a copy is made: a copy takes as long as a task or two

SIZE_BYTES = 8  # bytes that say how long a result is

PIPE_BYTES = 1 << 20  # bytes that a pipe holds, where the system allows it: a copy goes on while its result waits

_allowed = False


def allow_forks() -> None:
    """Let `in_forks` copy this process: none of its threads holds what a copy would wait for."""
    global _allowed
    _allowed = sys.platform == "linux"  # elsewhere the system's own libraries may not work in copies


def in_forks(function: Callable[[T], bytes], tasks: Sequence[T]) -> Iterator[bytes]:
    """Yield ``function(task)`` for each task, in order, computed by copies of this process or, elsewhere, by threads.

    Parameters
    ----------
    function : callable
        A function whose result depends only on its task. What else it changes may be lost.
    tasks : sequence
        Each large enough to be worth its way through a pipe.

    Notes
    -----
    This process does the tasks of copies that end too early, such as those whose memory runs out, and so meets their
    errors itself.
    """
    count = min(thread_count(), len(tasks) // WORTH_TASKS)
    if count < 2 or not _allowed:
        yield from in_threads(function, tasks, worth=count > 1)
        return
    copies: list[_Copy[T]] = []
    try:
        with suppress(OSError):  # there may be no more processes
            while len(copies) < count:
                copies.append(_Copy(function, tasks[len(copies) :: count], copies))
        for index, task in enumerate(tasks):
            own = copies[index % count : index % count + 1]
            result = own[0].result() if own else None
            yield function(task) if result is None else result
    finally:
        for copy in copies:
            copy.end()


def shared_array(shape: tuple[int, ...]) -> FloatArray:
    """A new array, which copies of this process can fill as well."""
    import mmap

    import numpy as np

    if thread_count() == 1 or not _allowed:
        return np.empty(shape)
    return np.frombuffer(mmap.mmap(-1, 8 * math.prod(shape))).reshape(shape)


class _Copy(Generic[T]):
    """A copy of this process that does some tasks, and writes their results to a pipe."""

    def __init__(self, function: Callable[[T], bytes], tasks: Sequence[T], others: Sequence[_Copy[T]]) -> None:
        out, into = os.pipe()
        self._pipe = os.fdopen(out, "rb")
        try:
            _enlarge(into)
            with signals_later() as signals:
                self._process = os.fork()
                if not self._process:
                    _work(function, tasks, into, [copy._pipe.fileno() for copy in (*others, self)], signals)
        except OSError:
            self._pipe.close()
            raise
        finally:
            os.close(into)

    def result(self) -> bytes | None:
        """Return the next result, or None if the copy has ended without it."""
        header = self._pipe.read(SIZE_BYTES)
        size = int.from_bytes(header, "little")
        data = self._pipe.read(size)
        return data if len(header) == SIZE_BYTES and len(data) == size else None

    def end(self) -> None:
        """End the copy, whatever it does."""
        self._pipe.close()
        with suppress(ProcessLookupError):
            os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)


def _work(
    function: Callable[[T], bytes], tasks: Sequence[T], into: int, pipes: Sequence[int], signals: set[int]
) -> NoReturn:
    """Do tasks in a copy, which ends with them, or silently when it is told to or nobody reads the results."""
    try:
        for number in (*SIGNALS, signal.SIGPIPE):
            signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, signals)
        limit_threads(1)
        for pipe in pipes:  # an open one would keep another copy waiting for ever if this process were killed
            os.close(pipe)
        with open(into, "wb") as file:
            for task in tasks:
                data = function(task)
                file.write(len(data).to_bytes(SIZE_BYTES, "little"))
                file.write(data)
                file.flush()
    finally:
        os._exit(0)


def _enlarge(pipe: int) -> None:
    import fcntl

    with suppress(OSError, AttributeError):
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


@contextmanager
def signals_later() -> Iterator[set[int]]:
    """Delay the signals that stop this process, here and in the processes started meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):
        yield set()
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield before
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
