"""Work shared on a cluster by Dask, behind the same interface as `gtb_cli.process.processes`."""

import logging
import os
import re
import socket
import threading
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError, Future, wait
from pathlib import Path
from typing import Any, TypeAlias

from gtb_cli.errors import GtbError
from gtb_cli.process.processes import R, T, in_order

Warn: TypeAlias = Callable[[str], None]
CONNECTION_SECONDS = 10.0  # seconds within which a scheduler must answer


def in_cluster(function: Callable[[T], R], tasks: Iterable[T], address: str, warn: Warn) -> Generator[R]:
    """Yield ``function(task)`` for each task, in their order, computed by the workers of a Dask cluster.

    `address` is where the scheduler is, such as ``tcp://127.0.0.1:8786``, or its scheduler file. If a worker dies,
    another one does its unfinished tasks. Workers that join later take part, unchecked. At most two results for each
    thread of the workers wait for their turn. Raises what `function` raises, and a `GtbError` if Dask is missing, no
    scheduler or worker answers, workers have other versions, or a task kills one after another.
    """
    client = _connected(address)
    from distributed.scheduler import KilledWorker

    try:
        _check_workers(client, address, warn)
        executor = client.get_executor(pure=False)
        yield from in_order(
            lambda task: executor.submit(function, task),
            tasks,
            lambda: 2 * max(1, sum(client.ncores().values())),
            lambda future: _awaited(future, client, address, warn),
        )
    except KilledWorker as error:
        raise GtbError(f"--cluster {address}: a task killed one worker after another: {error}") from None
    finally:
        client.close(timeout=CONNECTION_SECONDS)


def _connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise GtbError("--cluster needs Dask, the extra gtb-cli[cluster]: pip install distributed") from None

    class Connection(Client):  # type: ignore[misc]
        def __del__(self) -> None:  # closing a client that never connected takes long and prints messages
            pass

    logging.disable()  # Dask's own messages are replaced by ours, in the user's words
    connection: Future[Any] = Future()

    def connect(place: str) -> None:
        try:
            connection.set_result(Connection(place, timeout=CONNECTION_SECONDS, set_as_default=False))
        except BaseException as error:  # noqa: BLE001 -- raised where the result is awaited
            connection.set_exception(error)

    try:
        place = _scheduler(address)
        host, _, port = place.partition("://")[2].rpartition(":")
        socket.create_connection((host.strip("[]"), int(port)), CONNECTION_SECONDS).close()
        # Another program that listens there but says nothing would keep us waiting for ever.
        threading.Thread(target=connect, args=(place,), daemon=True).start()
        return connection.result(2 * CONNECTION_SECONDS)
    except (OSError, ValueError, AssertionError) as error:
        reason = getattr(error, "strerror", None) or str(error).partition("\n")[0] or "not in time"
        raise GtbError(f"--cluster {address}: no scheduler answers: {reason}") from None


def _scheduler(address: str) -> str:
    """Return the address of a scheduler, read from its file if `address` names one."""
    if os.path.isfile(address):
        import json

        try:
            address = json.loads(Path(address).read_text(encoding="utf-8"))["address"]
        except (ValueError, KeyError, TypeError):
            raise ValueError("this is not a scheduler file of Dask") from None
    # HOST:PORT; an address that contains colons stands in brackets
    match = re.fullmatch(r"(?:(tcp|tls)://)?([^:/\s]+:\d{1,5}|\[[\da-fA-F:.]+\]:\d{1,5})", address)
    if match:
        return f"{match[1] or 'tcp'}://{match[2]}"
    raise ValueError("expected tcp://HOST:PORT, tls://HOST:PORT, or a scheduler file")


def _awaited(future: Future[R], client: Any, address: str, warn: Warn) -> R:
    """Wait for a result, unless no worker is left to compute it."""
    while not wait([future], 5.0).done:  # seconds between two checks that there are workers
        if client.status != "running":
            raise GtbError(f"--cluster {address}: the scheduler has gone")
        _wait_for_workers(client, address, warn)
    try:
        return future.result()
    except CancelledError:
        raise GtbError(f"--cluster {address}: the scheduler has gone") from None


def _wait_for_workers(client: Any, address: str, warn: Warn) -> None:
    """Wait until there is a worker: none has joined yet, or the last one has gone."""
    seconds = 60.0
    if client.ncores():
        return
    warn(f"--cluster {address}: no workers yet; waiting for one up to {seconds:g} seconds")
    try:
        client.wait_for_workers(1, timeout=seconds)
    except TimeoutError:
        raise GtbError(f"--cluster {address}: no workers within {seconds:g} seconds") from None


def _check_workers(client: Any, address: str, warn: Warn) -> None:
    """Refuse workers with other programs than this process; warn if their processors may round differently."""
    from gtb_cli.process.versions import PACKAGES, versions

    # Environment variable that must be 1 on workers: the last digit of a sum depends on how threads split it
    threads_variable = "OPENBLAS_NUM_THREADS"
    _wait_for_workers(client, address, warn)
    for worker, threads in client.run(os.getenv, threads_variable).items():
        if threads != "1":
            fault = f"was started without {threads_variable}=1, and digits depend on it"
            raise GtbError(f"--cluster {address}: {worker} {fault}")
    unlike: dict[str, list[str]] = {}
    for worker, found in client.run(versions, on_error="return").items():
        if isinstance(found, BaseException):
            raise GtbError(f"--cluster {address}: {worker} does not answer: {found}")
        for name, expected in versions().items():
            if found.get(name) == expected:
                continue
            if name in ("gtb", "sources", *PACKAGES):
                theirs = f"{name} {found[name]}" if found.get(name) else f"no {name}"
                raise GtbError(f"--cluster {address}: {worker} has {theirs}, and this process has {expected}")
            unlike.setdefault(f"{name} {found.get(name)}, and this process has {expected}", []).append(worker)
    for difference, workers in unlike.items():
        have = f"{', '.join(workers)} {'have' if len(workers) > 1 else 'has'}"
        warn(f"--cluster {address}: {have} {difference}: last digits of their files may differ")
