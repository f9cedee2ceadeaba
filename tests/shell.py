"""What tests of the command line share: runs in this process, and in real ones."""

from __future__ import annotations

import contextlib
import glob
import os
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unittest.mock import patch
from warnings import catch_warnings

from click.testing import CliRunner

from gtb_cli.commands.cli import run

REPOSITORY = Path(__file__).parent.parent
SPECS = REPOSITORY / "specs"
PENTAGON = str(SPECS / "pentagon.toml")
BICUBIC = str(SPECS / "bicubic.toml")
CURVE = str(SPECS / "cubic-bezier.toml")

TIMEOUT = 300  # seconds after which a process hangs; each takes less than three, but machines stand still at times

# Results of commands that failed, until a test looks at the status: what is left at its end fails it (conftest.py)
unseen: list[Result] = []


@dataclass(eq=False)
class Result:
    """What a command did."""

    _status: int
    out: bytes
    err: str
    line: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        if self._status:
            unseen.append(self)

    @property
    def status(self) -> int:
        """The exit status, which has now been looked at."""
        unseen[:] = [result for result in unseen if result is not self]
        return self._status

    @property
    def text(self) -> str:
        return self.out.decode("utf-8")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Result) and (self.status, self.out, self.err) == (other.status, other.out, other.err)


def gtb(*arguments: object, stdin: bytes = b"", status: int | None = None) -> Result:
    """Run a command in this process, with click's streams; it must end with the status if there is one."""
    words = [str(argument) for argument in arguments]
    with CliRunner().isolation(input=stdin) as streams:
        found = run(words)
        out, err = streams[0].getvalue(), streams[1].getvalue().decode("utf-8")
    result = Result(found, out, err, f"gtb {shlex.join(words)}")
    assert status is None or result.status == status, result
    return result


def example_of(name: str) -> str:
    """The command line that the help of a command opens with."""
    return re.search(r"^  Example: (.*)$", gtb(name, "--help").text, re.MULTILINE)[1]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment, without what would hide how streams are buffered or order files otherwise."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    path = f"{Path(sys.executable).parent}:{inherited['PATH']}"  # where python3 is this Python
    return inherited | {"PATH": path, "PYTHONPATH": str(REPOSITORY), "LC_ALL": "C.UTF-8", **variables}


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "gtb_cli", *map(str, arguments)]


def run_process(words: list[str], folder: Path | None = None, stdin: bytes = b"", **variables: str) -> Result:
    """Run any program to its end."""
    done = subprocess.run(
        words, input=stdin, cwd=folder, env=environment(**variables), capture_output=True, timeout=TIMEOUT, check=False
    )
    return Result(done.returncode, done.stdout, done.stderr.decode("utf-8"), shlex.join(words))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def until(condition: Callable[[], object]) -> object:
    """Wait until something is so, and return what the condition says then: at once, or late on a busy machine."""
    end = time.monotonic() + TIMEOUT
    while not (found := condition()):
        assert time.monotonic() < end, "timed out"
        time.sleep(0.005)
    return found


def process(*arguments: object, stdin: bytes = b"", folder: Path | None = None, **variables: str) -> Result:
    """Run a command in a process of its own."""
    return run_process(command(*arguments), folder, stdin, **variables)


def shell(line: str, folder: Path, **variables: str) -> Result:
    """Run lines of a shell in which `gtb` is the command under test."""
    folder_of_command = folder / ".bin"
    if not folder_of_command.exists():
        folder_of_command.mkdir()
        script = folder_of_command / "gtb"
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gtb_cli "$@"\n', encoding="utf-8")
        script.chmod(0o755)
    path = f"{folder_of_command}:{os.environ['PATH']}"
    return run_process(["bash", "-c", f"set -o pipefail; {line}"], folder, PATH=path, **variables)


def script(text: str, folder: Path) -> Result:
    """Run lines of a shell up to the first that fails."""
    result = Result(0, b"", "")
    for line in re.sub(r"\s# .*$", "", text, flags=re.MULTILINE).replace("&&", "\n").strip().splitlines():
        done = run_line(line, folder)
        result = Result(done.status, result.out + done.out, result.err + done.err, line)
        if done.status:
            break
    return result


def run_line(line: str, folder: Path) -> Result:
    """Run lines of a shell, with `gtb` and scripts of Python in this process where pipes and files for streams are all.

    It shows the same as `shell` in a fraction of the time. Git is run where it finds `gtb`.
    """
    stages = line.split(" | ")
    here = [_runs_here(stage) for stage in stages]
    if any(re.search(r"\b(gtb|git)\b", _bare(stage)) for stage, own in zip(stages, here, strict=True) if not own):
        return shell(line, folder)
    if not any(here):
        return run_process(["bash", "-c", f"set -o pipefail; {line}"], folder)
    status, out, err = 0, b"", ""
    with contextlib.chdir(folder):
        for stage, is_here in zip(stages, here, strict=True):
            quoted = re.sub(r"'[^']*'", lambda found: found[0].replace("*", "\ue000"), stage)  # no pattern
            done = _here(shlex.split(quoted), out) if is_here else run_process(["bash", "-c", stage], None, out)
            status, out, err = done.status or status, done.out, err + done.err
    return Result(status, out, err, line)


def _bare(stage: str) -> str:
    """A command without what it quotes; for other commands than gtb without what is in single quotes."""
    return re.sub(r"'[^']*'|\"[^\"]*\"" if stage.startswith("gtb") else r"'[^']*'", "", stage)


def _runs_here(stage: str) -> bool:
    """Tell whether a command is one of gtb, or a script of Python, that needs no shell."""
    if not re.match(r"((\w+=\w* )*gtb|python3 (-c|\w+\.py))( |$)", stage):
        return False
    return not re.search(r"[$`;&()|\n\\\"]|<<|\d>|>>|> /dev/", _bare(stage))


def _here(words: list[str], stdin: bytes) -> Result:
    """Run one command of a pipe in this process and the working folder."""
    if re.fullmatch(r"\w+=\w*", words[0]):
        with patch.dict(os.environ, [words[0].split("=")]):
            return _here(words[1:], stdin)
    while len(words) > 2 and words[-2] in ("<", ">"):
        *words, sign, path = words
        if sign == ">":
            done = _here(words, stdin)
            Path(path).write_bytes(done.out)
            return Result(done.status, b"", done.err)
        stdin = Path(path).read_bytes()
    paths = [path for word in words[1:] for path in (sorted(glob.glob(word)) or [word.replace("\ue000", "*")])]
    return gtb(*paths, stdin=stdin) if words[0] == "gtb" else _script(paths, stdin)


def _script(words: list[str], stdin: bytes) -> Result:
    """Run a script of Python, whose name or `-c` and text come first."""
    path, *rest = words[words[0] == "-c" :]
    text = path if words[0] == "-c" else Path(path).read_text(encoding="utf-8")
    names, status = {"__name__": "__main__"}, 0
    with CliRunner().isolation(input=stdin) as seen, catch_warnings(action="ignore"), patch("sys.argv", [path, *rest]):
        try:
            exec(text, names)
        except SystemExit as end:
            status = end.code
        sys.stdout.flush()
        names.clear()  # functions hold all names, and these hold files that nobody closed
        return Result(status, seen[0].getvalue(), seen[1].getvalue().decode("utf-8"))
