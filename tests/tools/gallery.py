"""The pictures of specs/README.md: each is drawn by the command that stands beside it.

``python -m tests.tools.gallery`` draws all of them into specs/pictures, which ``make gallery`` is for.
"""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

from gtb_cli.commands.cli import run
from tests.shell import REPOSITORY

README = REPOSITORY / "specs" / "README.md"
PICTURES = REPOSITORY / "specs" / "pictures"


LARGEST = 60_000  # bytes of a picture that the repository keeps


class Picture(NamedTuple):
    """A picture of the gallery."""

    name: str
    arguments: list[str]

    @property
    def path(self) -> Path:
        return PICTURES / self.name

    def draw(self, target: Path) -> int:
        """Draw it into a file, and return the exit status."""
        command, spec, *options = self.arguments
        return run([command, str(REPOSITORY / spec), *options, "-q", "-o", str(target)])


def pictures() -> list[Picture]:
    """All, in the order of the page."""
    command = re.compile(r"`gtb (plot [^`]*) -o specs/pictures/([\w.-]+)`")
    text = README.read_text(encoding="utf-8")
    return [Picture(name, shlex.split(line)) for line, name in command.findall(text)]


def main() -> int:
    """Draw all pictures anew, and remove those that the page no longer has."""
    PICTURES.mkdir(exist_ok=True)
    drawn = pictures()
    for old in set(PICTURES.iterdir()) - {picture.path for picture in drawn}:
        old.unlink()
    return max(picture.draw(picture.path) for picture in drawn)


if __name__ == "__main__":
    raise SystemExit(main())
