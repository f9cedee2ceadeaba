"""The group of commands in this process: help, errors and messages; what only processes show is in test_shell.py."""

import io
import json
import os
import platform
from contextlib import nullcontext
from importlib.metadata import version

import click
import pytest

from gtb_cli.commands.cli import COMMANDS, gtb as group
from gtb_cli.shell import messages
from gtb_cli.version import __version__
from tests.shell import BICUBIC, PENTAGON, gtb


def test_help_lists_every_command():
    text = gtb("--help", status=0).text
    assert all(f"  {name} " in text for name in COMMANDS)
    assert all(summary in " ".join(text.split()) for summary in COMMANDS.values())
    assert gtb("help").text == text


@pytest.mark.parametrize("name", COMMANDS)
def test_help_opens_with_an_example_and_says_what_every_option_does(name):
    shown = gtb(name, "--help").text
    lines = [line for line in shown.splitlines() if line.strip()]
    assert lines[0].startswith(f"Usage: gtb {name}")
    assert lines[1].startswith("  Example: ")
    assert f"gtb {name}" in lines[1]
    assert not {"INTEGER", "TEXT"} & set(shown.split())  # click's words name neither the unit nor the number
    assert gtb("help", name).text == shown
    for parameter in group.get_command(click.Context(group), name).params:
        if isinstance(parameter, click.Option):
            assert parameter.help.endswith(".")
            assert any(option.startswith("--") for option in parameter.opts)
            assert all(option in shown for option in parameter.opts)


# --- errors


def test_unexpected_errors_are_reported_without_traceback(monkeypatch):
    def broken(*arguments):
        raise RuntimeError("surprise")

    gtb("elevate", PENTAGON, status=0)  # a room that is imported later would keep what is broken here
    monkeypatch.setattr("gtb_cli.language.loading.parse", broken)
    monkeypatch.delenv("GTB_TRACEBACK", raising=False)
    shown = gtb("elevate", PENTAGON, status=2).err
    assert shown.startswith("gtb: error: internal error, please report it: RuntimeError: surprise")
    assert shown.count("\n") == 1
    (error,) = json.loads(gtb("--json", "elevate", PENTAGON, status=2).err)["errors"]
    assert error["message"].startswith("internal error, please report it: RuntimeError: surprise")
    monkeypatch.setenv("GTB_TRACEBACK", "1")
    assert "Traceback" in gtb("elevate", PENTAGON, status=2).err


@pytest.mark.parametrize("error", [MemoryError(), SystemError("error return without exception set")])
def test_too_little_memory_is_an_error(error, monkeypatch):
    def hungry(*arguments, **options):
        raise error

    monkeypatch.setattr("gtb_cli.tessellation.tessellate.tessellate", hungry)
    result = gtb("mesh", PENTAGON, status=2)
    assert (result.out, result.err) == (b"", f"gtb: error: {PENTAGON}: not enough memory for this\n")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(24, "Too many open files"), "too many open files"),
        (BlockingIOError(11, "Resource temporarily unavailable"), "no more processes or threads"),
        (FileNotFoundError(2, "No such file or directory"), "the working folder is gone"),
        (OSError(28, "No space left on device"), "cannot write standard output: No space left on device"),
        (OSError(13, "Permission denied", "x.toml"), "x.toml: Permission denied"),
    ],
)
def test_errors_of_the_system_are_said_in_words_of_what_they_are_about(error, words, monkeypatch):
    def broken(*arguments):
        raise error

    monkeypatch.setattr("gtb_cli.language.loading.parse", broken)
    monkeypatch.setattr("gtb_cli.commands.cli.abandon", lambda stream: None)
    result = gtb("elevate", PENTAGON, status=2)
    assert result.err.startswith(f"gtb: error: {words}")


# --- messages


@pytest.mark.parametrize("quiet", [False, True])
def test_what_takes_long_is_counted_on_a_terminal(quiet, monkeypatch):
    class Terminal(io.StringIO):
        isatty = staticmethod(lambda: True)
        fileno = staticmethod(lambda: 2)

    shown, clock = Terminal(), iter([0.0, 1.0, 3.0, 4.0, 5.0, 8.0])
    monkeypatch.setattr(messages.sys, "stderr", shown)
    monkeypatch.setattr(messages.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(messages.os, "get_terminal_size", lambda descriptor: os.terminal_size((12, 24)))
    with messages.Console(quiet).counter(3) as begin:
        for label in ("a.toml", "b.toml", "c.toml"):
            begin(label)
    with messages.Console(quiet).clock("fill", 0.0):
        while not quiet and "fill" not in shown.getvalue():
            pass
    counted = "\r\r[2/3] b.tom\r" + " " * 11 + "\r[3/3] c.tom\r" + " " * 11 + "\r"
    counted += "\r\rfill: 3 s\r" + " " * 9 + "\r"
    assert shown.getvalue() == ("" if quiet else counted)


@pytest.mark.parametrize("command", ["fill", "fair", "mesh"])
def test_a_clock_runs_while_a_surface_is_made(command, monkeypatch, tmp_path):
    """Also of a loop that is refused as it is filled."""
    file = tmp_path / "open.toml" if command == "fill" else BICUBIC
    (tmp_path / "open.toml").write_text(3 * "[[patches]]\nknots = [0, 1]\ncontrol_points = [[0, 0], [1, 0]]\n")
    timed: list[str] = []
    monkeypatch.setattr(messages.Console, "clock", lambda _, label: timed.append(label) or nullcontext(timed.append))
    gtb(command, file, status=2 if command == "fill" else 0)
    as_it_is_read_and_made = ["mesh", "mesh", str(file)]
    assert timed == (as_it_is_read_and_made if command == "mesh" else [command])


# --- versions


@pytest.mark.parametrize("arguments", [["--version", "--json"], ["--json", "--version"]])
def test_versions_as_json(arguments):
    found = json.loads(gtb(*arguments, status=0).out)
    packages = {name: version(name) for name in ("numpy", "scipy", "trimesh", "click")}
    assert {**found, "gtb": __version__, "python": platform.python_version()} | packages == found
    assert found.keys() - packages.keys() == {"schema", "gtb", "sources", "python", "system", "processor"}
