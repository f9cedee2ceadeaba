"""specs/GUIDE.md: its files, and its commands with what they print.

`python -m tests.tools.guide FOLDER` runs the commands with what `make mesh` installs, and after `EXTRAS=` in the text
with these extras as well; it prints a JSON object for each.
"""

import json
import pickle
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from gtb_cli.filling import fill
from gtb_cli.importers import cad_files
from tests.shell import REPOSITORY, SPECS, Result, run_line

GUIDE = SPECS / "GUIDE.md"
PICTURES = SPECS / "pictures"
PREFIX = "guide-"  # of its pictures there, before the names under which its commands draw them

LARGEST = 40_000  # bytes of a picture


class Step(NamedTuple):
    """A command, and the lines that it prints, in which … stands for anything; none if these are not shown."""

    command: str
    lines: tuple[str, ...]
    extras: frozenset[str] = frozenset()  # that the text before it installs

    @property
    def fails(self) -> bool:
        return any(line.startswith("gtb: error") for line in self.lines)


def text() -> str:
    return GUIDE.read_text(encoding="utf-8")


def steps() -> list[Step]:
    """All commands in their order."""
    found, page = [], text()
    for block in re.finditer(r"^```console\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        extras = frozenset(",".join(re.findall(r"make mesh EXTRAS=([\w,]+)", page[: block.start()])).split(",")) - {""}
        for command in block[1].split("$ ")[1:]:
            line, *lines = command.rstrip("\n").split("\n")
            found.append(Step(line, tuple(lines), extras))
    return found


class OnlyInstalled:
    """A finder that hides modules of distributions other than the package and what it needs with some extras."""

    def __init__(self) -> None:
        self.names = {"gtb-cli"}
        self._owners = metadata.packages_distributions()
        sys.meta_path.insert(0, self)

    def choose(self, extras: Iterable[str]) -> None:
        """Hide what neither the package nor one of these extras needs."""
        names, left = set[str](), [Requirement(f"gtb-cli[{','.join(extras)}]")]
        while left:
            given = left.pop()
            if (name := canonicalize_name(given.name)) not in names:
                names.add(name)
                asked = [{"extra": extra} for extra in given.extras or [""]]
                needed = [Requirement(line) for line in metadata.requires(name) or ()]
                left += [each for each in needed if not each.marker or any(map(each.marker.evaluate, asked))]
        self.names = names

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if not self.names & set(map(canonicalize_name, self._owners.get(name, ["gtb-cli"]))):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def pictures() -> list[str]:
    """The pictures that its page shows, by their names beside the commands."""
    return re.findall(rf"\]\(pictures/{PREFIX}(.*?)\)", text())


def run(folder: Path, chosen: Iterable[Step] | None = None) -> Iterator[tuple[Step, Result]]:
    """Write its files into a folder, and run its commands there; those of programs that are not there are left out."""
    for content, name in re.findall(r"^```\w+\n((?:#|//) (\S+)\n.*?)^```$", text(), re.MULTILINE | re.DOTALL):
        (folder / name).write_text(content, encoding="utf-8")
    shutil.copy(SPECS / "box.step", folder)
    for step in steps() if chosen is None else chosen:
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


def main(folder: str) -> None:
    """Run commands with what is installed when they come."""
    default = re.search(r"^EXTRAS \?= (\S+)$", (REPOSITORY / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)[1]
    there = OnlyInstalled()
    cad_files.subprocess = SimpleNamespace(run=lambda *_, **__: SimpleNamespace(returncode=0))  # its parts are whole
    known, make = {}, fill.fill_loop

    def once(*given: Any, **options: Any) -> Any:
        return known.get(key := pickle.dumps((given, options))) or known.setdefault(key, make(*given, **options))

    fill.fill_loop = once  # several commands fill the same hole

    def prepared() -> Iterator[Step]:
        for step in steps():
            there.choose({*default.split(","), *step.extras})
            yield step

    for step, done in run(Path(folder), prepared()):
        print(json.dumps({"command": step.command, "status": done.status, "text": done.text + done.err}))


if __name__ == "__main__":
    main(*sys.argv[1:])
