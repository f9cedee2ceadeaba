"""Work shared among processes: what becomes of it when one of them fails."""

import os
import time

import pytest

from gtb_cli.errors import GtbError
from gtb_cli.process import memory
from gtb_cli.process.processes import in_processes
from gtb_cli.shell.workers import Workers


def slept(seconds):
    time.sleep(seconds)
    return seconds


class Unsendable(Exception):
    """What cannot be sent to another process, nor the reason why."""

    def __reduce__(self):
        raise self


def unsendable(task):
    return Unsendable()


def test_a_worker_whose_result_cannot_be_sent_is_one_error_and_no_trace(capfd):
    with pytest.raises(GtbError, match="a process was killed"):
        list(in_processes(unsendable, [0, 1], 2))
    assert capfd.readouterr() == ("", "")


def test_where_no_thread_can_be_started_the_reason_is_said(monkeypatch):
    def refused(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("concurrent.futures.process._ExecutorManagerThread.start", refused)
    with pytest.raises(GtbError, match="cannot start a process: can't start new thread"):
        list(in_processes(slept, [0, 0], 2))


def test_results_come_in_the_order_of_the_tasks():
    assert list(in_processes(slept, [0, 0.2, 0], 2)) == [0, 0.2, 0]


def own_number(task):
    return os.getpid()


@pytest.mark.parametrize(("limit", "alone"), [(None, False), (1 << 31, False), ((1 << 30) - 1, True)])
def test_where_memory_is_scarce_this_process_does_the_work(limit, alone, monkeypatch):
    """A worker that could not allocate what it needs to send its result was waited for."""
    monkeypatch.setattr("gtb_cli.process.memory.limit_of_addresses", lambda: limit)
    assert (set(Workers(2).results(own_number, [0, 1, 2])) == {os.getpid()}) == alone


def test_workers_share_the_memory_that_is_allowed(monkeypatch):
    limits = []
    monkeypatch.setattr(memory, "_allowed", 8 << 30)
    monkeypatch.setattr("resource.getrlimit", lambda kind: (8 << 30, 8 << 30))
    monkeypatch.setattr("resource.setrlimit", lambda kind, limit: limits.append(limit))
    assert memory.divided_among(3) == 3
    assert limits == [((8 << 30) // 4, 8 << 30)]
