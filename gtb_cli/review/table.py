"""The numbers of a change, old and new: what a page and a Markdown table show of it."""

from typing import Any, NamedTuple

from gtb_cli.meshes.measures import labelled
from gtb_cli.review.changes import Change


class Row(NamedTuple):
    """A number of both versions, as text; empty where a version has none."""

    label: str
    old: str
    new: str

    @property
    def is_changed(self) -> bool:
        """Whether the texts differ."""
        return self.old != self.new


def rows(change: Change) -> list[Row]:
    """Return the measures of both versions, in the order of `gtb info`, with digits enough to show what differs.

    There are none where one file is unreadable: the other one's would look like a change.
    """
    if change.verdict.word == "unreadable":
        return []
    old, new = (
        {} if side is None or side.measures is None else labelled(side.measures.record())
        for side in (change.old, change.new)
    )
    return [_row(label, old.get(label), new.get(label)) for label in dict.fromkeys((*old, *new))]


def amount(change: Change) -> str:
    """Say in a few words how much differs."""
    return "" if change.found is None else f"{change.found.distance:.3g}"


def _row(label: str, old: object, new: object) -> Row:
    """Write two values to 6 digits; if they differ and would look the same, to 9 or 12. More are rounding."""
    for digits in (6, 9, 12):
        texts = [_text(value, digits) for value in (old, new)]
        if old == new or texts[0] != texts[1]:
            break
    return Row(label, *texts)


def _text(value: Any, digits: int) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return " ".join(_text(each, digits) for each in value)
    return str(value) if isinstance(value, int) else f"{value + 0.0:.{digits}g}"  # no -0
