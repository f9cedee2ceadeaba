"""Reports on what changed: Markdown, or a page, old and new side by side under one camera, coloured by distance."""

import os
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from gtb_cli.files import StagedFiles
from gtb_cli.pages.page import encoded, page_with
from gtb_cli.review.changes import MAX_SHOWN_FACES, Change, Review, change, review
from gtb_cli.review.markdown import markdown
from gtb_cli.verdicts.comparing import Comparing
from gtb_cli.verdicts.verdict import Verdict
from gtb_cli.vocabulary import printable, suffix_of

MAX_ALL_FACES = 2_000_000  # of all meshes of a page, with which a browser still opens it


def reviewed(names: tuple[str, str], verdicts: Iterable[Verdict], comparing: Comparing) -> Review:
    """Return the review of what was compared; where many large meshes differ, the last are shown with fewer faces."""

    def changes() -> Iterator[Change | None]:
        left, fewest = MAX_ALL_FACES, 100
        for each in verdicts:
            made = None if each.same else change(comparing.shown(each), max(fewest, min(MAX_SHOWN_FACES, left // 50)))
            left -= sum(len(mesh.cells) for mesh in made.meshes) if made else 0
            yield made

    return review(names, changes())


def write_reports(found: Review, paths: Sequence[str]) -> None:
    """Write reports, pages or Markdown as their suffixes say, which appear together or not at all."""
    pages = [path for path in paths if suffix_of(path) == "html"]
    with StagedFiles() as files:
        for path in paths:
            text = page(found) if path in pages else markdown(found, os.path.basename("".join(pages[:1])))
            files.add(path, [text.encode("utf-8", "backslashreplace")])


def page(review: Review) -> str:
    """Return the text of a page that works offline; no name or message can become a part of its script."""
    names = [printable(name) for name in review.names]
    changes = [_data(change) for change in review.changes]
    data = {"names": names, "counts": review.counts, "changes": changes}
    return page_with(data, f"{' and '.join(names)}: {len(review.changes)} changed", "gtb_cli.review")


def _data(change: Change) -> dict[str, Any]:
    is_measured = change.found is not None and change.found.same_kind
    uncoloured = "nowhere farther apart than the tolerance" if is_measured else "no distances"
    data: dict[str, Any] = {
        "name": printable(change.verdict.name),
        "verdict": change.verdict.word,
        "approvable": len({*map(suffix_of, change.verdict.paths)}) == 1,  # a spec does not take a mesh's place
        "reasons": [printable(reason) for reason in change.reasons],
        **dict(zip(("amount", "tolerance"), change.amounts, strict=True)),
        "rows": change.rows,
        "uncoloured": uncoloured,  # why there are no distances to be shown, if there are none
        **dict.fromkeys(("old", "new")),
    }
    if change.frames is None:
        return data
    data["alone"] = change.frames[0] is not change.frames[1]
    for key, side, frame in zip(("old", "new"), (change.old, change.new), change.frames, strict=True):
        if side is None or side.mesh is None:
            continue
        vertices, cells = frame.inside(side.mesh.vertices), side.mesh.cells
        full = float(np.abs(vertices).max()) or 1.0 if data["alone"] else 1.0
        data[key] = {
            "positions": encoded(vertices / full, "<f4"),
            "cells": encoded(cells, "<u2" if len(vertices) < 1 << 16 else "<u4"),
            "wide": len(vertices) >= 1 << 16,
            "corners": cells.shape[1],
            "faces": side.faces,
            "shown": len(cells),
        }
        if side.turned is not None:
            data["coloured"] = {"side": key, "turned": True, "values": encoded(255 * side.turned, "<u1")}
        elif side.distances is not None and change.found is not None and change.largest is not None:
            top = change.found.distance  # points between those that were compared may be farther
            data["coloured"] = {
                "side": key,
                "vertices": change.found.method == "vertices",
                "values": encoded(np.rint((side.distances / top).clip(0, 1) * 255), "<u1"),
                "top": f"{top:.3g}",
                "at": (frame.inside(np.array(change.largest)) / full).tolist(),
                "place": " ".join(f"{x:.6g}" for x in change.largest),
            }
    return data
