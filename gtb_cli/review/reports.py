"""Reports on files that were compared: pages, Markdown and pictures, which appear together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from urllib.parse import quote

from gtb_cli.files import StagedFiles
from gtb_cli.review.changes import Review, change, review
from gtb_cli.review.markdown import markdown
from gtb_cli.review.review_page import page
from gtb_cli.shell.streams import file_stem
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict
from gtb_cli.vocabulary import suffix_of


def reviewed(names: tuple[str, str], verdicts: Iterable[Verdict], comparing: Comparing) -> Review:
    """Return the review of what was compared."""
    return review(names, (None if each.same else change(comparing.shown(each)) for each in verdicts))


def write_reports(found: Review, paths: Sequence[str], pictures: str | None = None) -> int:
    """Write reports, pages or Markdown as their suffixes say, and pictures of the largest changes into a folder.

    They appear together or not at all; Markdown refers to the pictures. Returns the number of pictures.
    """
    most = 20  # pictures, each of which takes about half a second
    drawn = [change for change in found.changes if change.frames is not None][:most] if pictures is not None else []
    places = {each.name: f"{number:02}-{file_stem(each.name)}.png" for number, each in enumerate(drawn, start=1)}
    pages = [path for path in paths if suffix_of(path) == "html"]
    with StagedFiles(pictures) as files:
        for each in drawn:
            from gtb_cli.review.drawing import drawing

            files.add(os.path.join(str(pictures), places[each.name]), [drawing(each)])
        for path in paths:
            away = os.path.relpath(pictures or os.curdir, os.path.dirname(path) or os.curdir)
            addresses = {name: quote(os.path.join(away, place)) for name, place in places.items()}
            name = os.path.basename(pages[0]) if pages else ""
            text = page(found) if path in pages else markdown(found, name, addresses)
            files.add(path, [text.encode("utf-8", "backslashreplace")])
    return len(drawn)
