"""Files that `--watch` follows, and whether they have changed; `gtb mesh` then meshes again, `view_server` serves."""

import functools
import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import click

from gtb_cli.errors import ExportError
from gtb_cli.shell.faults import faults_about
from gtb_cli.shell.folders import specs_among
from gtb_cli.shell.gathering import option
from gtb_cli.shell.messages import STANDARD, finish, tell
from gtb_cli.shell.streams import Streams


class Files:
    """Files and folders that are looked at again and again, with the files that specs among them include."""

    def __init__(self, paths: Callable[[], Sequence[str]]) -> None:
        self._paths = paths
        self._stamps: dict[str, object] = {}

    def changed(self) -> bool:
        """Tell whether one of them is another than at the last question, or there are others; at first, they are."""
        paths = self._paths()
        if all(path in self._stamps for path in paths) and all(stamp(f) == old for f, old in self._stamps.items()):
            return False
        from gtb_cli.language.includes import sources

        files = [file for path in paths for file in (sources(path) if os.path.isfile(path) else [path])]
        self._stamps = {file: stamp(file) for file in files}
        return True


def stamp(path: str) -> object:
    """Return a value that changes when a file, or a file in a folder, is written or replaced."""
    try:
        inner = [os.path.join(path, name) for name in sorted(os.listdir(path))] if os.path.isdir(path) else [path]
        stamps = [(name, os.stat(name)) for name in inner]
        return [(name, at.st_mtime_ns, at.st_ctime_ns, at.st_size, at.st_ino) for name, at in stamps]
    except OSError as error:
        return str(error)


def watched(function: Callable[..., object]) -> Callable[..., object]:
    """Add ``--watch`` to a command with `specs` and `streams`, which then runs again when a spec has changed."""
    seconds = 0.2  # between two looks at the files

    @functools.wraps(function)
    def command(*, watch: bool, **values: Any) -> object:
        if not watch:
            return function(**values)
        specs, streams = values["specs"], values["streams"]
        assert isinstance(streams, Streams)
        if streams.output == STANDARD or STANDARD in specs:
            raise click.UsageError("--watch follows files and renews files: it needs -o, and no standard input")
        streams.console.note(f"follows {', '.join(specs)}; Ctrl-C ends it")
        files, runs, is_new = Files(functools.partial(_specs, specs)), 0, False
        while True:
            if is_new or files.changed():
                runs, is_new = runs + 1, False
                try:
                    function(**values)
                except Exception as error:  # whatever it is, the next edit may mend it
                    if runs == 1 and isinstance(error, click.UsageError | ExportError):  # no edit does
                        raise
                    time.sleep(seconds)
                    if is_new := files.changed():  # it was being written
                        continue
                    for fault in faults_about(error):
                        tell(fault, "error")
                    finish(2)
            time.sleep(seconds)

    return option("--watch", bool)(
        help="Go on until Ctrl-C, and make the files again when a spec changes, or a file that it includes. An error "
        "is printed, and the old files stay."
    )(command)


def _specs(given: Sequence[str]) -> Sequence[str]:
    """Return the specs that paths stand for now; the paths themselves if that cannot be told."""
    try:
        return specs_among(given)
    except Exception:  # noqa: BLE001 -- the command itself says what is wrong
        return given
