"""Reports on files that were compared: from answers to pages and Markdown."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from gtb_cli.errors import ExportError, GtbError
from gtb_cli.shell.streams import file_stem, write_text
from gtb_cli.verdicts.comparing import Answer, Comparing
from gtb_cli.vocabulary import FORMATS, suffix_of

if TYPE_CHECKING:
    from gtb_cli.meshes.mesh import Mesh
    from gtb_cli.review.changes import Change, Review


def refuse_reports(paths: Sequence[str], folders: Sequence[str] = ()) -> None:
    """Refuse reports that could not be written, or would be among the files of folders, before these are compared."""
    for path in paths:
        place = os.path.dirname(path) or os.curdir
        if os.path.isdir(path) or not os.path.isdir(place):
            why = "it is a folder" if os.path.isdir(path) else f"the folder {place} does not exist"
            raise ExportError(f"cannot write {path}: {why}")
        refuse_within(path, folders)


def refuse_within(path: str, folders: Sequence[str]) -> None:
    """Refuse to write a file or folder that would be in one of the folders that are compared."""
    for folder in folders:
        inner, outer = (os.path.join(os.path.realpath(each), "") for each in (path, folder))
        if inner.startswith(outer):
            raise click.UsageError(f"{path} would be in {folder}, and be compared the next time")


def write_pictures(folder: str, found: Review) -> dict[str, str]:
    """Write pictures of the largest changes, and return their paths by the names of what changed."""
    from gtb_cli.files import StagedFiles
    from gtb_cli.review.drawing import drawing

    most = 20  # each takes about half a second
    drawn = [change for change in found.changes if change.frames is not None][:most]
    places = {}
    with StagedFiles(folder) as files:
        for number, change in enumerate(drawn, start=1):
            places[change.name] = os.path.join(folder, f"{number:02}-{file_stem(change.name)}.png")
            files.add(places[change.name], [drawing(change)])
    return places


def write_reports(paths: Sequence[str], found: Review, pictures: Mapping[str, str] | None = None) -> None:
    """Write reports on what was compared: pages or Markdown, as the suffixes of their paths say.

    Markdown shows the pictures, which are paths by the names of what changed.
    """
    from urllib.parse import quote

    from gtb_cli.review.markdown import markdown
    from gtb_cli.review.review_page import page

    pages = [path for path in paths if suffix_of(path) == "html"]
    for path in paths:
        name = os.path.basename(pages[0]) if pages else ""
        here = os.path.dirname(path) or os.curdir
        addresses = {key: quote(os.path.relpath(place, here)) for key, place in (pictures or {}).items()}
        write_text(path, page(found) if path in pages else markdown(found, name, addresses))


def reviewed(names: tuple[str, str], answers: Iterable[Answer], comparing: Comparing) -> Review:
    """Return the review of what was compared; of a file that cannot be compared, the meshes are read that there are."""
    from gtb_cli.review.changes import review

    def changes() -> Iterator[Change | None]:
        for answer in answers:
            yield None if answer.verdict == "same" else _change(answer, comparing)

    return review(names, changes())


def _change(answer: Answer, comparing: Comparing) -> Change:
    from gtb_cli.review.changes import change

    assert answer.verdict != "same"
    old, new = answer.meshes
    if answer.verdict in ("missing", "unreadable"):
        old = _mesh(answer.paths[0], comparing)
    if answer.verdict in ("extra", "unreadable"):
        new = _mesh(answer.paths[1], comparing)
    faults = answer.found.faults if answer.found else ()
    reasons = [*map(str, answer.errors), *faults, *answer.warnings, *answer.notes]
    if answer.verdict == "different" and answer.found is None:
        reasons.append("other bytes")
    if answer.found is not None and not answer.found.same_kind:
        reasons.append("one is a curve, the other a surface")
    return change(answer.name, answer.verdict, old, new, answer.found, reasons)


def _mesh(path: str, comparing: Comparing) -> Mesh | None:
    """Return the mesh in a file; None if it cannot be read, or is not a mesh."""
    try:
        is_mesh = suffix_of(path) in FORMATS and os.path.isfile(path)  # reading a pipe would wait for its writer
        return comparing.read(path).known.mesh if is_mesh else None
    except (GtbError, OSError):
        return None
