"""Work shared among processes."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar

from gtb_cli.errors import GtbError
from gtb_cli.process.forks import SIGNALS, signals_later
from gtb_cli.process.threads import in_order, limit_threads

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor
    from multiprocessing.connection import Connection

T = TypeVar("T")
R = TypeVar("R")

MAX_JOBS = 64  # largest number of worker processes

HEARTBEAT_SECONDS = 1.0  # seconds between two signs of life of a worker

# Signs of life that a worker may miss while its result is awaited. If there is too little memory to import them, some
# libraries try for ever and let no other thread run meanwhile.
MISSED_HEARTBEATS = 60


def processors() -> int:
    """Return the number of processors that this process may use."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(count, MAX_JOBS)


def in_processes(function: Callable[[T], R], tasks: Iterable[T], jobs: int) -> Generator[R]:
    """Yield ``function(task)`` for each task, in their order, computed by several processes.

    Parameters
    ----------
    function : callable
        Defined at the top level of a module.
    tasks : iterable
    jobs : int
        Number of processes.

    Raises
    ------
    GtbError
        A process was killed, or is silent for long, as happens when memory runs out; or `function` raises it.

    Notes
    -----
    At most `jobs` + 1 results wait at a time. Closing the generator ends the processes at once.
    """
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import active_children, get_context

    # A copy of this process has already imported everything; copies are safe only on Linux.
    context = get_context("fork" if sys.platform == "linux" else "spawn")
    life, sign = context.Pipe(duplex=False)
    if os.name == "posix":
        os.set_blocking(sign.fileno(), False)  # if nobody listens for hours, the pipe is full
    executor = ProcessPoolExecutor(jobs, context, _start_worker, (sign,))
    try:
        yield from in_order(
            lambda task: _submitted(executor, function, task),
            tasks,
            lambda: jobs,
            lambda future: _awaited(future, life, executor),
        )
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
        life.close()
        sign.close()


def _awaited(result: Future[R], life: Connection, executor: ProcessPoolExecutor) -> R:
    """Wait for a result, unless a worker falls silent first, or the thread that would bring it ends."""
    from concurrent.futures import wait
    from multiprocessing import active_children

    missed: dict[int | None, int] = {}
    while not wait([result], HEARTBEAT_SECONDS).done:
        manager = getattr(executor, "_executor_manager_thread", None)
        if manager is not None and not manager.is_alive() and not result.done():
            raise GtbError("cannot start a thread for the processes (-j 1 needs none)")
        heard = set()
        while life.poll():
            heard.add(int.from_bytes(life.recv_bytes(), "little"))
        for process in active_children():
            missed[process.pid] = 0 if process.pid in heard else missed.get(process.pid, 0) + 1
        if max(missed.values(), default=0) > MISSED_HEARTBEATS:
            raise GtbError("a process has fallen silent (is there too little memory? -j 1 needs less)")
    return result.result()


def _submitted(executor: ProcessPoolExecutor, function: Callable[[T], R], task: T) -> Future[R]:
    try:
        with signals_later():  # this may start processes
            return executor.submit(function, task)
    except (OSError, RuntimeError) as error:
        if "process pool" in str(error):  # a worker was killed
            raise
        reason = getattr(error, "strerror", None) or error
        raise GtbError(f"cannot start a process: {reason} (-j 1 needs none)") from None


def _start_worker(sign: Connection) -> None:
    """Leave Ctrl-C to the parent process, end when it ends, however it ends, and give signs of life until then."""
    import threading

    if not os.environ.get("GTB_TRACEBACK"):
        sys.stderr = None  # where memory runs out, the trace of what failed goes there: this process's parent says it
    limit_threads(1)  # the processes already share the processors
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in SIGNALS - {signal.SIGINT}:
        signal.signal(number, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    threading.Thread(target=_live, args=(sign,), daemon=True).start()


def _live(sign: Connection) -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    while parent is not None and parent.is_alive():
        with suppress(OSError):  # nobody listens
            sign.send_bytes(os.getpid().to_bytes(8, "little"))
        parent.join(HEARTBEAT_SECONDS)
    os._exit(1)
