"""Work shared among the processes of `-j`: results in order, and an error if a process is killed."""

from __future__ import annotations

import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar

from gtb_cli.errors import GtbError

if TYPE_CHECKING:
    from concurrent.futures import Future

T = TypeVar("T")
R = TypeVar("R")

MAX_JOBS = 64  # largest number of worker processes


def processors() -> int:
    """Return the number of processors that this process may use."""
    return min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, MAX_JOBS)


def in_order(
    submit: Callable[[T], Future[R]],
    tasks: Iterable[T],
    limit: Callable[[], int],
    result_of: Callable[[Future[R]], R] = lambda future: future.result(),
) -> Generator[R]:
    """Yield the results of tasks in order: `submit` starts one, `result_of` waits for it, at most ``limit()`` wait."""
    waiting: deque[Future[R]] = deque()
    try:
        for task in tasks:
            waiting.append(submit(task))
            if len(waiting) > limit():
                yield result_of(waiting.popleft())
        while waiting:
            yield result_of(waiting.popleft())
    finally:
        for future in waiting:
            future.cancel()


def in_processes(function: Callable[[T], R], tasks: Iterable[T], jobs: int) -> Generator[R]:
    """Yield ``function(task)`` for each task, in their order, computed by this many processes.

    `function` is defined at the top level of a module. At most `jobs` + 1 results wait at a time. Closing the generator
    ends the processes at once. Raises what `function` raises, and a `GtbError` if a process cannot be started, or was
    killed, as happens when memory runs out.
    """
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import active_children, get_context

    # A copy of this process has already imported everything; copies are safe only on Linux.
    executor = ProcessPoolExecutor(jobs, get_context("fork" if sys.platform == "linux" else "spawn"), _start_worker)

    def submitted(task: T) -> Future[R]:
        try:
            return executor.submit(function, task)  # which may start a process
        except BrokenProcessPool:
            raise
        except (OSError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise GtbError(f"cannot start a process: {reason} (-j 1 needs none)") from None

    try:
        yield from in_order(submitted, tasks, lambda: jobs)
        executor.shutdown()
    except BrokenProcessPool:
        raise GtbError("a process was killed (is there too little memory? -j 1 needs less)") from None
    finally:
        for process in active_children():
            process.kill()
        # A truncated result would be awaited as long as any process, this one included, could still write the rest.
        writer = getattr(getattr(executor, "_result_queue", None), "_writer", None)
        if writer is not None:
            writer.close()
        with suppress(RuntimeError):  # its own thread could not be started
            executor.shutdown(cancel_futures=True)


def _start_worker() -> None:
    """Leave Ctrl-C to the parent process, and end when that ends, however it ends."""
    import threading
    from multiprocessing import parent_process

    if not os.environ.get("GTB_TRACEBACK"):
        sys.stderr = None  # where memory runs out, the trace of what failed goes there: this process's parent says it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, signal.SIG_DFL)
    parent = parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
