"""Work shared among processes: what becomes of it when one of them fails."""

import ctypes
import time

import pytest

from gtb_cli.errors import GtbError
from gtb_cli.shell import processes
from gtb_cli.shell.processes import in_processes


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    monkeypatch.setattr(processes, "HEARTBEAT_SECONDS", 0.05)
    monkeypatch.setattr(processes, "MISSED_HEARTBEATS", 6)


def held(seconds):
    """Let no other thread of the process run, as the import of a library does that tries for ever."""
    ctypes.PyDLL(None).usleep(int(1e6 * seconds))
    return seconds


def slept(seconds):
    time.sleep(seconds)
    return seconds


def test_a_worker_that_says_nothing_for_long_is_an_error():
    start = time.monotonic()
    with pytest.raises(GtbError, match=r"a process has fallen silent .*-j 1 needs less"):
        list(in_processes(held, [0, 100, 0], 2))
    assert time.monotonic() - start < 60


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


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_where_a_thread_of_the_library_cannot_start_another_nothing_is_waited_for(monkeypatch):
    def refused(queue):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("multiprocessing.queues.Queue._start_thread", refused)
    with pytest.raises(GtbError, match="cannot start a thread"):
        list(in_processes(slept, [0, 0], 2))


def test_a_worker_that_works_for_long_is_waited_for():
    assert list(in_processes(slept, [0, 1, 0], 2)) == [0, 1, 0]
