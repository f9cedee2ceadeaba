"""Work shared among copies of the process: results in order, errors where they belong, no copy left behind."""

import os
import signal
import subprocess
import sys
import time

import pytest

from gtb_cli.formats.export import encode_mesh
from gtb_cli.process import forks
from gtb_cli.process.forks import WORTH_TASKS, in_forks, shared_array
from gtb_cli.process.threads import limit_threads
from gtb_cli.tessellation.tessellate import tessellate
from tests.patches import pentagon

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux only")

TASKS = range(3 * WORTH_TASKS)


@pytest.fixture(autouse=True)
def allowed(monkeypatch):
    monkeypatch.setattr(forks, "_allowed", True)
    limit_threads(3)
    yield
    limit_threads(0)
    with pytest.raises(ChildProcessError):  # none is left
        os.waitpid(-1, os.WNOHANG)


def text(number):
    return b"%d %d" % (number, os.getpid())


def test_results_are_in_order_and_come_from_copies():
    results = [result.split() for result in in_forks(text, TASKS)]
    assert [int(number) for number, _ in results] == list(TASKS)
    processes = {int(process) for _, process in results}
    assert len(processes) == 3
    assert os.getpid() not in processes


def test_copies_fill_an_array():
    filled = shared_array((len(TASKS), 2))

    def fill(number):
        filled[number] = number, os.getpid() != here
        return b""

    here = os.getpid()
    assert list(in_forks(fill, TASKS)) == [b""] * len(TASKS)
    assert filled.tolist() == [[number, 1] for number in TASKS]


def test_few_tasks_are_done_here():
    assert {int(result.split()[1]) for result in in_forks(text, TASKS[: WORTH_TASKS + 1])} == {os.getpid()}


def test_nothing_is_copied_where_it_is_not_allowed(monkeypatch):
    monkeypatch.setattr(forks, "_allowed", False)
    assert {int(result.split()[1]) for result in in_forks(text, TASKS)} == {os.getpid()}


def test_results_longer_than_a_pipe_holds_arrive():
    size = 3 * forks.PIPE_BYTES
    assert [len(result) for result in in_forks(lambda k: bytes(size + k), TASKS)] == [size + k for k in TASKS]


def test_tasks_of_copies_that_are_killed_are_done_here():
    here = os.getpid()

    def fragile(number):
        if os.getpid() != here and number == 7:
            os.kill(os.getpid(), signal.SIGKILL)
        return text(number)

    results = [result.split() for result in in_forks(fragile, TASKS)]
    assert [int(number) for number, _ in results] == list(TASKS)
    assert int(results[7][1]) == here


def test_no_process_can_be_started(monkeypatch):
    def refused():
        raise OSError

    monkeypatch.setattr(os, "fork", refused)
    assert {int(result.split()[1]) for result in in_forks(text, TASKS)} == {os.getpid()}


def test_an_error_is_raised_where_its_result_would_be():
    results = in_forks(lambda k: b"%d" % (1 // (5 - k)), TASKS)
    assert [next(results) for _ in range(5)] == [b"0"] * 4 + [b"1"]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_copies_end_when_no_more_results_are_wanted():
    results = in_forks(lambda k: b"%d" % k if k < 3 else time.sleep(1000), TASKS)
    next(results)
    results.close()


def test_copies_end_with_the_process():
    program = (
        "import os, time; from gtb_cli.process import forks; from gtb_cli.process.threads import limit_threads\n"
        "limit_threads(2)\n"
        "forks.allow_forks()\n"
        "for result in forks.in_forks(lambda k: str(os.getpid()).encode() * 100_000, range(1000)):\n"
        "    print(result[:10].decode(), flush=True); time.sleep(1000)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.kill()
        # Copies have this pipe open as well: it ends with the last of them.
        assert not process.stdout.read()


def test_the_bytes_of_a_mesh_do_not_depend_on_the_number(monkeypatch):
    monkeypatch.setattr(forks, "WORTH_TASKS", 1)
    monkeypatch.setattr("gtb_cli.moment.torus.BLOCK_NUMBERS", 1 << 13)
    written = []
    for count in (1, 3):
        limit_threads(count)
        mesh = tessellate(pentagon(), 60, normals=False)
        written.append(b"".join(encode_mesh(mesh, "obj")))
    assert written[0] == written[1]
