"""What tests of the command line share: runs in this process, and in real ones."""

from __future__ import annotations

import contextlib
import glob
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from click.testing import CliRunner

from gtb_cli.commands.cli import run

REPOSITORY = Path(__file__).parent.parent
SPECS = REPOSITORY / "specs"
PENTAGON = str(SPECS / "pentagon.toml")
BICUBIC = str(SPECS / "bicubic.toml")
CURVE = str(SPECS / "cubic-bezier.toml")

TIMEOUT = 60
"""Seconds after which a process hangs; each takes less than three."""


class Result(NamedTuple):
    """What a command did."""

    status: int
    out: bytes
    err: str

    @property
    def text(self) -> str:
        return self.out.decode("utf-8")


def gtb(*arguments: object, stdin: bytes = b"") -> Result:
    """Run a command in this process, with click's streams."""
    with CliRunner().isolation(input=stdin) as streams:
        status = run([str(argument) for argument in arguments])
        return Result(status, streams[0].getvalue(), streams[1].getvalue().decode("utf-8"))


def example_of(name: str) -> str:
    """The command line that the help of a command opens with."""
    return re.search(r"^  Example: (.*)$", gtb(name, "--help").text, re.MULTILINE)[1]


def environment(**variables: str) -> dict[str, str]:
    """This process's environment, without what would hide how streams are buffered."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return inherited | {"PYTHONPATH": str(REPOSITORY), **variables}


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "gtb_cli", *map(str, arguments)]


def process(*arguments: object, stdin: bytes = b"", folder: Path | None = None, **variables: str) -> Result:
    """Run a command in a process of its own."""
    done = subprocess.run(
        command(*arguments),
        input=stdin,
        cwd=folder,
        env=environment(**variables),
        capture_output=True,
        timeout=TIMEOUT,
        check=False,
    )
    return Result(done.returncode, done.stdout, done.stderr.decode("utf-8"))


def shell(line: str, folder: Path, **variables: str) -> Result:
    """Run a line of a shell in which `gtb` is the command under test."""
    folder_of_command = folder / ".bin"
    if not folder_of_command.exists():
        folder_of_command.mkdir()
        script = folder_of_command / "gtb"
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gtb_cli "$@"\n', encoding="utf-8")
        script.chmod(0o755)
    path = f"{folder_of_command}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        cwd=folder,
        env=environment(PATH=path, **variables),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=TIMEOUT,
        check=False,
    )
    return Result(done.returncode, done.stdout, done.stderr.decode("utf-8"))


def script(text: str, folder: Path) -> Result:
    """Run lines of a shell up to the first that fails, with `gtb` in this process, where all it takes is pipes.

    It shows the same as `shell` in a fraction of the time; a line with a redirection is left to that.
    """
    result = Result(0, b"", "")
    for line in re.sub(r"\s# .*$", "", text, flags=re.MULTILINE).replace("&&", "\n").strip().splitlines():
        done = shell(line, folder) if ">" in line else pipeline(line.split("|"), folder)
        result = Result(done.status, result.out + done.out, result.err + done.err)
        if done.status:
            break
    return result


def pipeline(stages: list[str], folder: Path) -> Result:
    """One after the other; its status is the first that is not 0."""
    status, out, err = 0, b"", ""
    with contextlib.chdir(folder):
        for stage in stages:
            name, *words = shlex.split(stage)
            if name == "gtb":
                arguments = [path for word in words for path in (sorted(glob.glob(word)) or [word])]
                done = gtb(*arguments, stdin=out)
            else:
                other = subprocess.run(["bash", "-c", stage], input=out, capture_output=True, check=False)
                done = Result(other.returncode, other.stdout, other.stderr.decode("utf-8"))
            status, out, err = status or done.status, done.out, err + done.err
    return Result(status, out, err)
