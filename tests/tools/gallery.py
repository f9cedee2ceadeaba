"""The pictures of specs/README.md and specs/GUIDE.md: each is drawn by the command that stands beside it,
and stripes, which no command draws, by `stripes`.

``python -m tests.tools.gallery`` draws all of them into specs/pictures, which ``make gallery`` is for. That of a report
is a page in Chromium, and stays as it is where there is none.
"""

import contextlib
import io
import re
import shlex
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from gtb_cli.commands.cli import run
from tests.shell import REPOSITORY, SPECS
from tests.tools import guide, stripes
from tests.tools.browser import Chromium

README = REPOSITORY / "specs" / "README.md"
PICTURES = REPOSITORY / "specs" / "pictures"
REPORT = PICTURES / "report.png"
STRIPES = PICTURES / "stripes.png"

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
    for old in set(PICTURES.iterdir()) - {REPORT, STRIPES, *(picture.path for picture in drawn)}:
        old.unlink()
    if guide.draw():
        return 1
    stripes.draw(STRIPES)
    if Chromium.THERE:
        draw_report(REPORT)
    else:
        print(f"{REPORT}: stays as it is, as chromium and chromium-driver are not installed", file=sys.stderr)
    return max(picture.draw(picture.path) for picture in drawn)


def draw_report(target: Path) -> None:
    """Let Chromium show the report on a teapot with another spout, a higher pentagon, and no vase."""
    from PIL import Image

    changes: dict[str, list[tuple[str, str]] | None] = {
        "teapot": [("2.4, -0.25, 2.025", "2.55, -0.25, 1.7"), ("2.4, 0, 2.025", "2.55, 0, 1.7")],
        "pentagon": [('"8/7", 5]', '"8/7", 5.1]')],
        "rounded-cube": [],
        "vase": None,
    }
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for name, replaced in changes.items():
            text = (SPECS / f"{name}.toml").read_text(encoding="utf-8")
            Path(f"{name}.toml").write_text(text, encoding="utf-8")
            assert run(["mesh", f"{name}.toml", "-n", "12", "-q", "-o", "golden/"]) == 0
            for old, new in replaced or ():
                assert text.count(old) == 1
                text = text.replace(old, new)
            Path(f"{name}.toml").write_text(text, encoding="utf-8")
            assert replaced is None or run(["mesh", f"{name}.toml", "-n", "12", "-q", "-o", "out/"]) == 0
        assert run(["diff", "golden", "out", "-o", "changes.txt", "--report", "changes.html"]) == 1
        profile = Path("profile").absolute()
        profile.mkdir()
        with Chromium(profile) as browser:
            browser.size(1400, 840)  # with what the browser itself shows
            browser.open(Path("changes.html").absolute().as_uri())
            image = Image.fromarray(browser.picture())
    image = image.resize((1000, round(1000 * image.height / image.width)), Image.Resampling.LANCZOS)
    data = io.BytesIO()
    image.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE).save(data, "PNG", optimize=True)
    target.write_bytes(data.getvalue())


if __name__ == "__main__":
    raise SystemExit(main())
