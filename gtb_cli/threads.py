"""Work shared among threads: numpy lets other threads run in its loops, and results stay in order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
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

    with ThreadPoolExecutor(count) as executor:
        # In the context of this thread, which says how numpy treats overflow.
        yield from in_order(
            lambda task: executor.submit(copy_context().run, function, task),
            tasks,
            lambda: WAITING_RESULTS * count,
        )


def in_order(
    submit: Callable[[T], Future[R]],
    tasks: Iterable[T],
    limit: Callable[[], int],
    result_of: Callable[[Future[R]], R] = lambda future: future.result(),
) -> Generator[R]:
    """Yield the results of tasks in their order, whoever computes them.

    Parameters
    ----------
    submit : callable
        Hands a task to whoever computes it.
    tasks : iterable
    limit : callable
        How many results may wait for their turn; it is asked again after each task.
    result_of : callable, optional
        Waits for a result.
    """
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
