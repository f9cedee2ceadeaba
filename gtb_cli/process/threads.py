"""Work shared among threads: numpy's loops let other threads run, and results stay in order."""

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


_limit = 0
_memory_is_scarce = False


def limit_threads(count: int) -> None:
    """Share work in this process among `count` threads; 0: one for each processor it may use."""
    global _limit
    _limit = count


def forbid_threads() -> None:
    """Use one thread in this process, whatever is asked for: each further one takes memory of its own."""
    global _memory_is_scarce
    _memory_is_scarce = True


def thread_count() -> int:
    """The number of threads that share work."""
    if _memory_is_scarce:
        return 1
    if _limit:
        return _limit
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(function: Callable[[T], R], tasks: Iterable[T], *, worth: bool = True) -> Iterator[R]:
    """Yield ``function(task)`` for each task, in order, computed by several threads.

    Parameters
    ----------
    function : callable
        A function whose result depends only on its task, so that results are the same for any number of threads.
    tasks : iterable
    worth : bool
        Whether the tasks are large enough; if not, or with one thread, this thread does them one after another.
    """

    count = thread_count()
    if count == 1 or not worth:
        yield from map(function, tasks)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(count) as executor:
        # In the context of this thread, which has numpy's settings for overflow.
        yield from in_order(
            lambda task: executor.submit(copy_context().run, function, task),
            tasks,
            lambda: 2 * count,
        )


def in_order(
    submit: Callable[[T], Future[R]],
    tasks: Iterable[T],
    limit: Callable[[], int],
    result_of: Callable[[Future[R]], R] = lambda future: future.result(),
) -> Generator[R]:
    """Yield the results of tasks in order, whoever computes them.

    Parameters
    ----------
    submit : callable
        Starts a task and returns its future.
    tasks : iterable
    limit : callable
        Returns how many results may wait for their turn; called again after each task.
    result_of : callable, optional
        Waits for the result of a future.
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
