"""What only real processes show: pipes, signals, full disks, terminals, and the same bytes everywhere."""

import ctypes
import os
import pty
import re
import resource
import select
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from gtb_cli.commands.cli import COMMANDS
from gtb_cli.verdicts.comparing import Comparing
from tests.marks import long, mostly_long
from tests.shell import (
    BICUBIC,
    PENTAGON,
    REPOSITORY,
    SPECS,
    TIMEOUT,
    command,
    environment,
    example_of,
    gtb,
    names,
    process,
    run_process,
    script,
    until,
)

SOON = 120.0  # seconds within which what should end at once has ended, on a busy machine

# Options of a mesh whose writing takes about a second, and much longer than making it
LARGE = ["-n", "150", "-f", "stl", "--ascii", "-q"]


@pytest.fixture
def workplace(tmp_path):
    """A folder with `specs/`, as in a clone."""
    (tmp_path / "specs").symlink_to(SPECS)
    return tmp_path


# Signals that a shell lets background jobs ignore, and their children with them
STOPPING = (signal.SIGINT, signal.SIGHUP)


@pytest.fixture
def start():
    """Start real processes, which ignore no signals at first; what is left of them is ended with the test."""
    children = []

    def started(*arguments: object, preexec_fn=lambda: None, variables=(), **options) -> subprocess.Popen:
        def prepare():
            for number in STOPPING:
                signal.signal(number, signal.SIG_DFL)
            preexec_fn()

        child = subprocess.Popen(command(*arguments), env=environment(**dict(variables)), preexec_fn=prepare, **options)
        children.append(child)
        return child

    yield started
    for child in children:
        child.kill()
        child.wait()
        for stream in (child.stdin, child.stdout, child.stderr):
            if stream is not None:
                stream.close()


@pytest.fixture
def on_terminal(start):
    """Start a process with a terminal as standard output and error."""
    terminals = []

    def started(*arguments: object) -> tuple[subprocess.Popen, int]:
        terminal, end = pty.openpty()
        terminals.append(terminal)
        child = start(*arguments, stdin=subprocess.DEVNULL, stdout=end, stderr=end)
        os.close(end)
        return child, terminal

    yield started
    for terminal in terminals:
        os.close(terminal)


def read_all(terminal: int) -> str:
    shown = b""
    while select.select([terminal], [], [], SOON)[0]:
        try:
            shown += os.read(terminal, 65536)
        except OSError:  # how Linux says that the other end is closed
            break
    return shown.decode("utf-8")


# --- commands


SLOW = {"degenerate", "knot-limit", "fill", "fair", "plot"}  # whose examples take long


@pytest.mark.parametrize("name", mostly_long(sorted(COMMANDS, key=SLOW.__contains__), len(COMMANDS) - len(SLOW)))
def test_the_example_in_the_help_runs(name, workplace):
    result = script(example_of(name), workplace)
    assert result.status == 0
    assert "error" not in result.err


def test_the_entry_point_is_the_module():
    import tomllib

    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["scripts"] == {"gtb": "gtb_cli.__main__:main"}


THREADS_SEEN = """
import os
from gtb_cli.__main__ import THREADS, main
os.environ.pop(THREADS[-1], None)
try:
    main()
finally:
    print([os.environ[name] for name in THREADS])
"""


def test_libraries_of_sums_get_one_thread_whatever_the_environment_says():
    line = [sys.executable, "-c", THREADS_SEEN, "--version"]
    result = run_process(line, OPENBLAS_NUM_THREADS="8", OMP_NUM_THREADS="2")
    assert result.text.endswith(f"\n{['1'] * 5}\n")


# --- streams


def test_eval_does_not_depend_on_how_a_pipe_is_cut(start):
    text = "".join(f"{i / 5000} {1 - i / 5000}\n" for i in range(5000)).encode()
    whole = process("eval", PENTAGON, stdin=text)
    cut = start("eval", PENTAGON, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    for piece in range(0, len(text), 20_001):
        cut.stdin.write(text[piece : piece + 20_001])
        time.sleep(0.02)
    out, _ = cut.communicate(timeout=TIMEOUT)
    assert cut.returncode == 0
    assert out == whole.out
    assert out.count(b"\n") == 5000


# --- terminals


@pytest.mark.parametrize(
    ("options", "refused"), mostly_long([(["-f", "ply"], True), ([], False), (["-f", "glb"], True)], 2)
)
def test_binary_data_is_not_for_a_terminal(options, refused, on_terminal):
    child, terminal = on_terminal("mesh", PENTAGON, "-n", 1, *options)
    shown = read_all(terminal)
    assert child.wait(TIMEOUT) == (2 if refused else 0)
    assert ("is binary, and standard output is a terminal" in shown) == refused
    assert ("f 1 " in shown) != refused


# --- stopping


def stop_while_writing(start, folder: Path, number: int) -> subprocess.Popen:
    """Send a signal to a process when its temporary file has appeared."""
    child = start("mesh", PENTAGON, "-o", folder / "x.obj", *LARGE, stderr=subprocess.PIPE)
    until(lambda: any(name.startswith(".gtb-") for name in names(folder)))
    child.send_signal(number)
    return child


@pytest.fixture
def in_the_background():
    """Let this process, too, ignore signals as a background job does: tests say the same there."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in STOPPING}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("in_the_background")
@pytest.mark.parametrize(
    ("number", "status"), mostly_long([(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)], 0)
)
def test_a_stopped_process_leaves_no_traces(number, status, start, tmp_path):
    (tmp_path / "x.obj").write_text("old", encoding="utf-8")
    child = stop_while_writing(start, tmp_path, number)
    _, error = child.communicate(timeout=SOON)
    assert child.returncode == status
    assert error == b""
    assert names(tmp_path) == ["x.obj"]
    assert (tmp_path / "x.obj").read_text(encoding="utf-8") == "old"


STOPPED_IN_AN_IMPORT = """
import os, signal, sys

class Stop:
    def find_spec(self, name, path=None, target=None):
        if os.path.exists("a"):  # the folders are made, and so is the one with the temporary name
            assert [name[:5] for name in os.listdir("a/b")] == [".gtb-"]
            print("stopped in an import", flush=True)
            os.kill(os.getpid(), signal.SIGTERM)

sys.meta_path.insert(0, Stop())
from gtb_cli.__main__ import main
main()
"""


def test_a_process_that_is_stopped_in_an_import_leaves_no_new_folder(tmp_path):
    """Such a process leaves at once, without unwinding."""
    arguments = ["mesh", PENTAGON, BICUBIC, "-n", "2", "-f", "stl", "-o", "a/b/out"]
    line = [sys.executable, "-c", STOPPED_IN_AN_IMPORT, *arguments]
    done = run_process(line, tmp_path)
    assert (done.status, done.text, done.err) == (128 + signal.SIGTERM, "stopped in an import\n", "")
    assert names(tmp_path) == []


STOPPED_WITH_A_FOLDER = """
import os, signal

def made(*arguments, make=os.mkdir):
    make(*arguments)
    os.kill(os.getpid(), signal.SIGTERM)

os.mkdir = made
from gtb_cli.__main__ import main
main()
"""


def test_a_first_approval_that_is_stopped_leaves_no_new_folder(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "x.txt").write_text("new", encoding="utf-8")
    done = run_process([sys.executable, "-c", STOPPED_WITH_A_FOLDER, "approve", "golden", "out"], tmp_path)
    assert (done.status, names(tmp_path)) == (128 + signal.SIGTERM, ["out"])


def test_a_process_that_is_stopped_before_its_file_has_its_name_leaves_no_traces(tmp_path):
    (tmp_path / "x.obj").write_text("old", encoding="utf-8")
    stopped = STOPPED_WITH_A_FOLDER.replace("mkdir", "fsync")
    done = run_process([sys.executable, "-c", stopped, "mesh", PENTAGON, "-n", "2", "-o", "x.obj", "-q"], tmp_path)
    assert (done.status, done.err, names(tmp_path)) == (128 + signal.SIGTERM, "", ["x.obj"])
    assert (tmp_path / "x.obj").read_text(encoding="utf-8") == "old"


def test_what_changes_while_it_is_compared_is_not_taken_over(tmp_path, monkeypatch):
    for name in ("golden", "out"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x.txt").write_text(name)
    compare, change = Comparing._pair, partial((tmp_path / "out" / "x.txt").write_text, "one")
    monkeypatch.setattr(Comparing, "_pair", lambda *words: (compare(*words), change())[0])
    assert "x.txt: was changed after" in gtb("approve", tmp_path / "golden", tmp_path / "out", status=2).err
    assert (tmp_path / "golden" / "x.txt").read_text() == "golden"


def test_an_unexpected_error_is_of_one_file_and_those_of_others_are_said(tmp_path, monkeypatch):
    for folder in ("golden", "out"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.ply").write_text(f"ply\n{folder}")
        (tmp_path / folder / "b.obj").write_text(f"v 0 0 {folder}\n")
    monkeypatch.setattr("gtb_cli.formats.ply.read_ply", lambda _: [][0])
    said = gtb("approve", tmp_path / "golden", tmp_path / "out", status=2).err.splitlines()
    told = "a.ply: internal error", "b.obj: line 1: 'out' is not a number", "golden: nothing was taken over"
    assert [words in line for words, line in zip(told, said, strict=True)] == [True] * 3


def test_signals_that_are_ignored_stay_ignored(start, tmp_path):
    mesh = ["mesh", PENTAGON, "-n", "100", "-o", tmp_path / "x.obj", "-q"]
    child = start(*mesh, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    while child.poll() is None:
        child.send_signal(signal.SIGINT)
        time.sleep(0.02)
    assert child.returncode == 0
    assert names(tmp_path) == ["x.obj"]


def group_is_gone(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


def start_batch(start, folder: Path) -> subprocess.Popen:
    specs = [SPECS / f"{name}.toml" for name in ("bicubic", "pentagon", "hexagon", "nonagon")]
    child = start("mesh", *specs, "-j", 2, "-o", folder, *LARGE, stderr=subprocess.PIPE, start_new_session=True)
    until(lambda: len(Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split()) == 2)
    until(lambda: any(name.startswith(".gtb-") for name in names(folder)))
    return child


def end_a_worker(child: subprocess.Popen) -> None:
    os.kill(int(Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split()[0]), signal.SIGKILL)


KILLED = b"gtb: error: a process was killed (is there too little memory? -j 1 needs less)\n"


@long
@pytest.mark.parametrize(
    ("end", "status", "said"),
    [
        (lambda child: os.killpg(child.pid, signal.SIGINT), 130, b""),
        (lambda child: child.send_signal(signal.SIGINT), 130, b""),
        (end_a_worker, 2, KILLED),
        (lambda child: child.kill(), -signal.SIGKILL, b""),
    ],
    ids=["Ctrl-C", "interrupt", "a worker is killed", "killed"],
)
def test_a_batch_that_is_ended_leaves_neither_processes_nor_files(end, status, said, start, tmp_path):
    (tmp_path / "out").mkdir()
    child = start_batch(start, tmp_path / "out")
    end(child)
    _, error = child.communicate(timeout=SOON)
    assert (child.returncode, error) == (status, said)
    until(lambda: group_is_gone(child.pid))
    assert status < 0 or names(tmp_path / "out") == []


CUT_OFF = """
import os, struct, sys, time
from gtb_cli.process.processes import in_processes

def work(task):
    if task:  # the length of a result that never comes, as if it was killed while it writes that
        os.read(start, 1)
        os.write(sys._getframe(1).f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1_000_000))
        os.write(there, b".")
        time.sleep(600)

here, there = os.pipe()
start, go = os.pipe()
results = in_processes(work, [0, 1, 0], 2)
next(results)
os.write(go, b".")
os.read(here, 1)
time.sleep(0.1)
results.close()
"""


def test_a_worker_killed_while_it_hands_over_its_result_is_not_waited_for():
    assert run_process([sys.executable, "-c", CUT_OFF]).status == 0


# --- files


def limited(kind: int, amount: int):
    """A function that sets a limit of a process before the program starts."""
    return partial(resource.setrlimit, kind, (amount, amount))


SEQUENCE = ["degenerate", SPECS / "example-3.4.toml", "-x", "5", "-n", "200"]


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize(
    "arguments",
    mostly_long(
        [
            ["mesh", PENTAGON, BICUBIC, "-j", "2", "-n", "40"],
            ["mesh", PENTAGON, BICUBIC, "-n", "40"],
            SEQUENCE,
            ["knot-limit", SPECS / "example-3.1.toml", "--merge", "1:2", "-n", "200"],
        ]
    ),
)
def test_a_disk_that_fills_up_leaves_the_old_files(arguments, there, start, tmp_path):
    out = tmp_path / "deep" / "out"
    if there:
        gtb(*arguments, "-n", "10", "-o", out, status=0)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    limit = limited(resource.RLIMIT_FSIZE, 4096)
    without = {"PYTHONDONTWRITEBYTECODE": "1"}  # which Python would cut at the limit, for all later processes
    child = start(*arguments, "-o", out, stderr=subprocess.PIPE, preexec_fn=limit, variables=without)
    _, error = child.communicate(timeout=TIMEOUT)
    assert child.returncode == 2
    assert re.fullmatch(rf"gtb: error: cannot write {out}/\S+\.obj: File too large\n", error.decode())
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before
    assert there or names(tmp_path) == []


def without_power_over_files():
    """Let even root need permissions: PR_CAPBSET_DROP of CAP_DAC_OVERRIDE, before the program starts."""
    ctypes.CDLL(None).prctl(24, 1, 0, 0, 0)


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["mesh", PENTAGON], "x.obj"),
        (["mesh", PENTAGON, BICUBIC], "new"),
        *mostly_long([(["mesh", PENTAGON, BICUBIC], "."), (SEQUENCE, "new"), (["elevate", PENTAGON], "x.toml")], 0),
    ],
)
def test_a_folder_without_permission(arguments, output, start, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "old.obj").write_text("old", encoding="utf-8")
    folder.chmod(0o555)
    child = start(*arguments, "-o", folder / output, stderr=subprocess.PIPE, preexec_fn=without_power_over_files)
    _, error = child.communicate(timeout=TIMEOUT)
    assert child.returncode == 2
    assert re.fullmatch(rf"gtb: error: cannot write {folder}/\S+: Permission denied\n", error.decode())
    assert names(folder) == ["old.obj"]


@pytest.mark.parametrize("megabytes", mostly_long([320, 360, 400], 0))
def test_with_any_limit_of_memory_that_is_allowed_the_process_ends_by_itself(start, tmp_path, megabytes):
    limit = limited(resource.RLIMIT_AS, megabytes << 20)
    words = ["mesh", PENTAGON, "-n", "1000", "-o", tmp_path / "x.obj"]
    child = start(*words, stderr=subprocess.PIPE, preexec_fn=limit)
    _, error = child.communicate(timeout=TIMEOUT)
    assert (child.returncode, b": not enough memory for this\n" in error) in ((0, False), (2, True))
    assert child.returncode == 0 or names(tmp_path) == []


# --- the same bytes


HASHES = {"LC_ALL": "C", "PYTHONHASHSEED": "2", "OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "4"}
PLACES = {"LC_ALL": "C.UTF-8", "PYTHONUTF8": "0", "TZ": "Asia/Tokyo"}


@pytest.mark.parametrize(
    ("arguments", "variables"),
    mostly_long(
        [
            (["mesh", PENTAGON, "--uv", "--normals"], HASHES),
            (["mesh", PENTAGON, "--uv", "--normals", "-f", "glb"], PLACES),
            (["mesh", PENTAGON, "--tolerance", "2%", "-f", "ply"], HASHES),
            (["degenerate", SPECS / "example-3.4.toml", "-x2", "--emit-spec"], HASHES),
            (["check", SPECS / "trapezoid.toml", "--json"], PLACES),
            (["diff", PENTAGON, BICUBIC, "-n", "6", "--json"], HASHES),
        ]
    ),
    ids=str,
)
def test_the_same_bytes_in_any_environment(arguments, variables, tmp_path):
    here, there = gtb(*arguments), process(*arguments, folder=tmp_path, **variables)
    assert here.out
    assert here == there


@pytest.mark.parametrize(
    "variables", mostly_long([{"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, {"LC_ALL": "C"}], 0)
)
def test_any_locale_will_do(variables, tmp_path):
    spec = 'name = "Fläche ∆"\nknots = [0, 1]\ncontrol_points = [[0, 0], [1, 1]]\n'.encode()
    result = process("info", "-", stdin=spec, **variables)
    assert result.status == 0
    assert "Fläche ∆".encode() in result.out
    assert process("--help", **variables).status == 0
    path = tmp_path / "Fläche.toml"
    path.write_bytes(b"knots = 1\n")
    message = process("mesh", path, **variables)
    assert message.status == 2
    assert message.err.startswith("gtb: error: ")
