"""specs/GUIDE.md: its files, and its commands with what they print."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.shell import SPECS, Result, run_line

GUIDE = SPECS / "GUIDE.md"
PICTURES = SPECS / "pictures"
PREFIX = "guide-"  # of its pictures there, before the names under which its commands draw them

LARGEST = 40_000  # bytes of a picture


class Step(NamedTuple):
    """A command, and the lines that it prints, in which … stands for anything; none if these are not shown."""

    command: str
    lines: tuple[str, ...]

    @property
    def fails(self) -> bool:
        return any(line.startswith("gtb: error") for line in self.lines)


def text() -> str:
    return GUIDE.read_text(encoding="utf-8")


def steps() -> list[Step]:
    """All commands in their order."""
    found = []
    for block in re.findall(r"^```console\n(.*?)^```$", text(), re.MULTILINE | re.DOTALL):
        for command in block.split("$ ")[1:]:
            line, *lines = command.rstrip("\n").split("\n")
            found.append(Step(line, tuple(lines)))
    return found


def pictures() -> list[str]:
    """The pictures that its page shows, by their names beside the commands."""
    return re.findall(rf"\]\(pictures/{PREFIX}(.*?)\)", text())


def run(folder: Path) -> Iterator[tuple[Step, Result]]:
    """Write its files into a folder, and run its commands there; those of programs that are not there are left out."""
    for content, name in re.findall(r"^```\w+\n((?:#|//) (\S+)\n.*?)^```$", text(), re.MULTILINE | re.DOTALL):
        (folder / name).write_text(content, encoding="utf-8")
    shutil.copy(SPECS / "box.step", folder)
    for step in steps():
        if not (not shutil.which("openscad") and ("openscad" in step.command or "drained" in step.command)):
            yield step, run_line(step.command, folder)


def draw() -> int:
    """Let its commands draw its pictures anew, and keep them with few colours; return how many commands failed."""
    import tempfile

    from PIL import Image

    with tempfile.TemporaryDirectory() as name:
        failed = sum((done.status != 0) != step.fails for step, done in run(Path(name)))
        for picture in pictures():
            image = Image.open(Path(name) / picture).convert("RGB")
            few = image.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
            few.save(PICTURES / f"{PREFIX}{picture}", optimize=True)
    return failed
