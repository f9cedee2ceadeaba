"""specs/GUIDE.md: its files, and its commands with what they print.

`python -m tests.tools.guide FOLDER` runs the commands with what `make mesh` installs, and after `EXTRAS=` in the text
with these extras as well; it prints a JSON object for each. `--kinds` leaves out what another command stands for.
"""

import json
import re
import shutil
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

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


def one_of_each_kind() -> list[Step]:
    """The first command of each name and formats of files that needs no extra; fills of specs take seconds."""
    found: dict[object, Step] = {}
    for step in steps():
        kind = (step.command.split()[1], *re.findall(r"\w(\.\w+)\b", step.command))
        if not step.extras and kind != ("fill", ".toml", ".toml"):
            found.setdefault(kind if step.command.startswith("gtb") else step.command, step)
    return list(found.values())


def installed(extras: Iterable[str]) -> set[str]:
    """Names of the distributions that come with the package and these extras."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    left = sum((project["optional-dependencies"][extra] for extra in extras), project["dependencies"])
    names: set[str] = set()
    while left:
        requirement = Requirement(left.pop())
        name = canonicalize_name(requirement.name)
        if name not in names and (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
            names.add(name)
            left += metadata.requires(name) or ()
    return names


class OnlyInstalled:
    """A finder that hides modules of distributions other than these."""

    def __init__(self) -> None:
        self.names = set[str]()
        self._owners = metadata.packages_distributions()
        sys.meta_path.insert(0, self)

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        owners = set(map(canonicalize_name, self._owners.get(name, ["gtb-cli"])))
        if not owners & (self.names | {"gtb-cli"}):
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


def main(folder: str, *options: str) -> None:
    """Run commands with what is installed when they come."""
    default = re.search(r"^EXTRAS \?= (\S+)$", (REPOSITORY / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)[1]
    chosen, there = one_of_each_kind() if "--kinds" in options else steps(), OnlyInstalled()

    def prepared() -> Iterator[Step]:
        for step in chosen:
            there.names = installed({*default.split(","), *step.extras})
            yield step

    for step, done in run(Path(folder), prepared()):
        print(json.dumps({"command": step.command, "status": done.status, "text": done.text + done.err}))


if __name__ == "__main__":
    main(*sys.argv[1:])
