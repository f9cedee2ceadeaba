"""Work shared among threads: numpy lets other threads run in its loops, and results stay in order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextvars import copy_context
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future

T = TypeVar("T")
R = TypeVar("R")

WAITING_RESULTS = 2
"""Number of results per thread that may wait for their turn."""

_limit = 0


def limit_threads(count: int) -> None:
    """Let work in this process be shared among so many threads; 0: as many as it may use processors."""
    global _limit
    _limit = count


def thread_count() -> int:
    """How many threads share work."""
    if _limit:
        return _limit
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(function: Callable[[T], R], tasks: Iterable[T], *, worth: bool = True) -> Iterator[R]:
    """Yield ``function(task)`` for each task, in their order, computed by some threads.

    Parameters
    ----------
    function : callable
        Its results may depend on its task alone: then they are the same for any number of threads.
    tasks : iterable
    worth : bool
        Whether the tasks are large enough; else, and with one thread, they are done one after another in this one.
    """
    count = thread_count()
    if count == 1 or not worth:
        yield from map(function, tasks)
        return
    from concurrent.futures import ThreadPoolExecutor

    waiting: deque[Future[R]] = deque()
    with ThreadPoolExecutor(count) as executor:
        try:
            for task in tasks:
                # In the context of this thread, which says how numpy treats overflow.
                waiting.append(executor.submit(copy_context().run, function, task))
                if len(waiting) > WAITING_RESULTS * count:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
