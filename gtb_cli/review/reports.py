"""Reports on files that were compared: pages and Markdown, which appear together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

from gtb_cli.files import StagedFiles
from gtb_cli.review.changes import Review, change, review
from gtb_cli.review.markdown import markdown
from gtb_cli.review.review_page import page
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict
from gtb_cli.vocabulary import suffix_of


def reviewed(names: tuple[str, str], verdicts: Iterable[Verdict], comparing: Comparing) -> Review:
    """Return the review of what was compared."""
    return review(names, (None if each.same else change(comparing.shown(each)) for each in verdicts))


def write_reports(found: Review, paths: Sequence[str]) -> None:
    """Write reports, pages or Markdown as their suffixes say, which appear together or not at all."""
    pages = [path for path in paths if suffix_of(path) == "html"]
    with StagedFiles() as files:
        for path in paths:
            name = os.path.basename(pages[0]) if pages else ""
            text = page(found) if path in pages else markdown(found, name)
            files.add(path, [text.encode("utf-8", "backslashreplace")])
