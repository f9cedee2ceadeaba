"""--max-seconds and --max-memory: a command that costs more ends in one line, and leaves nothing behind."""

import os
import resource
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.marks import long, mostly_long
from tests.shell import BICUBIC, PENTAGON, SPECS, TIMEOUT, command, environment, gtb, process, until

HUGE = ("mesh", PENTAGON, "-n", "4000", "--max-faces", "1000000000")  # 80 million faces: a minute, and 10 GB
LATE = "gtb: error: stopped after 0.6 s: --max-seconds allows no more\n"


def refused(folder, *arguments):
    """The error of a command, which must leave the folder as it was."""
    (folder / "old.obj").write_bytes(b"old")
    result = process(*arguments, folder=folder)
    assert (result.status, result.out) == (2, b"")
    assert os.listdir(folder) == ["old.obj"]
    assert (folder / "old.obj").read_bytes() == b"old"
    return result.err


@pytest.mark.parametrize(
    "words",
    [
        (*HUGE, "-o", "old.obj"),
        ("mesh", SPECS / "teapot.toml", "--tolerance", "0.0001%", "--max-faces", "100000000", "-o", "old.obj"),
        ("mesh", "-j", "2", PENTAGON, BICUBIC, *HUGE[2:], "-o", "new/"),
    ],
    ids=["numpy", "refinement", "processes"],
)
@long
def test_what_takes_longer_is_stopped(words, tmp_path):
    assert refused(tmp_path, "--max-seconds", "0.6", *words) == LATE


def stuck(folder, code, seconds=0.6):
    """Run a command whose reading of specs is replaced by some code, which begins when a folder is being made."""
    start = (
        "import os, sys, signal, time, ctypes; from gtb_cli import files; from gtb_cli.__main__ import main\n"
        f"def stuck(self, path, blocks):\n    {code}\n"
        "files.StagedFiles.add = stuck\n"
        f"sys.argv[1:] = ['--max-seconds', '{seconds}', 'mesh', *sys.argv[1:], '-n', '2', '-o', 'new/deep/']; main()"
    )
    words = [sys.executable, "-c", start, PENTAGON, BICUBIC]
    done = subprocess.run(words, cwd=folder, env=environment(), capture_output=True, timeout=TIMEOUT, check=False)
    assert os.listdir(folder) == []
    return done.returncode, done.stderr.decode()


@pytest.mark.skipif(sys.platform != "linux", reason="the C library is found by its name on Linux")
def test_code_that_lets_no_other_thread_run_is_killed_and_cleaned_up_after(tmp_path):
    """Open CASCADE holds the interpreter's lock for as long as it works."""
    assert stuck(tmp_path, "ctypes.PyDLL('libc.so.6').sleep(15)") == (2, LATE)
    assert stuck(tmp_path, "signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(15)") == (2, LATE)


def test_a_process_that_no_longer_unwinds_at_a_signal_is_late_all_the_same(tmp_path):
    """Python takes its handlers away when it ends."""
    assert stuck(tmp_path, "signal.signal(signal.SIGTERM, signal.SIG_DFL); time.sleep(15)") == (2, LATE)


def test_a_process_that_crashes_is_one_line_and_leaves_nothing(tmp_path):
    message = "gtb: error: the process was killed by SIGSEGV: is there too little memory?\n"
    assert stuck(tmp_path, "os.kill(os.getpid(), signal.SIGSEGV)", seconds=15) == (2, message)


@pytest.mark.parametrize("format", mostly_long(["obj", "stl"]))
def test_what_needs_more_memory_is_refused(format, tmp_path):
    text = refused(tmp_path, "--max-memory", "400M", *HUGE, "-f", format, "-o", "old.obj")
    assert text.endswith(": not enough memory for this within --max-memory 400M\n")


@pytest.mark.parametrize("megabytes", mostly_long([360, 500], 0))
def test_libraries_that_do_not_fit_are_said_to_need_memory_and_not_to_be_missing(megabytes, tmp_path):
    words = ("--max-memory", f"{megabytes}M", "mesh", BICUBIC, "-f", "step", "-o", tmp_path / "x.step")
    result = process(*words)
    message = f"gtb: error: not enough memory for this within --max-memory {megabytes}M\n"
    if result.status:
        assert (result.status, result.err, os.listdir(tmp_path)) == (2, message, [])


@long
def test_within_its_bounds_a_command_does_what_it_does_without(tmp_path):
    bounds = ("--max-seconds", "50", "--max-memory", "3G")
    with open(PENTAGON, "rb") as spec:
        text = spec.read()
    for words in (("mesh", "-", "-n", "2"), ("mesh", "-", "--require", "watertight"), ("info", "nothing.toml")):
        assert gtb(*words, stdin=text) == process(*bounds, *words, stdin=text)
    plain, within = tmp_path / "plain", tmp_path / "within"
    words = ("mesh", PENTAGON, BICUBIC, "-n", "2", "-o")
    gtb(*words, f"{plain}/", status=0)
    assert process(*bounds, *words, f"{within}/", "-j", "2").status == 0
    one, other = ([path.read_bytes() for path in sorted(folder.iterdir())] for folder in (plain, within))
    assert one == other


def resident(number):
    """Bytes that the process holds which works for another one, the one that waits."""
    workers = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    return sum(int(Path(f"/proc/{worker}/statm").read_text().split()[1]) for worker in workers) * resource.getpagesize()


@pytest.mark.parametrize("number", mostly_long([signal.SIGINT, signal.SIGTERM], 0))
def test_a_signal_stops_the_command(number, tmp_path):
    words = command("--max-seconds", "50", *HUGE, "-o", tmp_path / "x.obj")
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # which a job in the background ignores
    with subprocess.Popen(words, env=environment(), stderr=subprocess.PIPE, preexec_fn=heard) as running:
        until(lambda: resident(running.pid) > 160 << 20)
        running.send_signal(number)
        assert running.wait(TIMEOUT) == 128 + number
        assert running.stderr.read() == b""  # whose end is there only when no process has it any more
    assert os.listdir(tmp_path) == []
