"""The numbers of a review as Markdown, for a job's summary or a comment."""

import re

from gtb_cli.review.changes import Review, Row
from gtb_cli.vocabulary import printable

MAX_BYTES = 60_000  # which GitHub takes as a comment, at most 65,536 characters
COLUMNS = ("faces", "segments", "area", "length", "volume", "lowest", "highest", "open edges")


def markdown(review: Review, page: str = "") -> str:
    """Return a table of what changed, in at most `MAX_BYTES`: the largest changes, and how many more there are.

    `page` is the name of the page about the same.
    """
    counts = ", ".join(f"{count} {word}" for word, count in review.counts.items())
    text = f"### {_code(review.names[0])} → {_code(review.names[1])}\n\n{counts}.\n"
    if page and review.changes:
        text += f"Old and new side by side: {_code(page)}.\n"
    tables = [{row.label: row for row in change.rows if row.old or row.new} for change in review.changes]
    labels = [label for label in COLUMNS if any(label in table for table in tables)]
    head = ["name", "verdict", "distance", "tolerance", *labels]
    more, below = "\nAnd {} more.\n", ""
    table = f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}\n" if tables else ""
    for k, (change, numbers) in enumerate(zip(review.changes, tables, strict=True)):
        cells = [_code(change.verdict.name).replace("|", "\\|"), change.verdict.word, *change.amounts]
        for label in labels:
            row = numbers.get(label, Row(label, "", ""))
            cells.append(row.old if row.old == row.new else f"{row.old or '–'} → **{row.new or '–'}**")
        line = f"| {' | '.join(cells)} |\n"
        lines = [_code(reason) for reason in change.reasons]  # what the table does not hold
        lines += [f"most at ({' '.join(f'{x:.6g}' for x in change.largest)})"] if change.largest is not None else []
        about = f"\n{_code(change.verdict.name)}: {'; '.join(lines)}\n" if lines else ""
        left = len(review.changes) - k
        if len((text + table + line + below + about + more.format(left)).encode()) > MAX_BYTES:
            return text + table + more.format(left) + below
        table += line
        below += about
    return text + table + below


def _code(text: str) -> str:
    """Return a text as code, in which nothing is markup, on one line."""
    text = printable(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    space = " " if text.startswith(("`", " ")) or text.endswith(("`", " ")) or not text else ""
    return f"{fence}{space}{text}{space}{fence}"
