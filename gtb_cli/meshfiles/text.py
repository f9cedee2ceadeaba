"""Numbers in text, read in blocks: fast, and every bad one named with its line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError

LINES = 1 << 16
"""Lines that are taken apart together: their words are objects, and many more would fill the memory."""

SAMPLE = 30_000
"""Words from which the digits of a file are told."""

SHOWN = 30
"""Characters of a bad word in a message."""


def lines_of(data: bytes, start: int = 0) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the lines of a text from some place on, many at a time, with the number (from 0) of the first of each."""
    if b"\r" in data:
        data, start = data[start:].replace(b"\r\n", b"\n").replace(b"\r", b"\n"), 0
    number, size = 0, 32 * LINES
    while start < len(data):
        end = data.find(b"\n", start + size) + 1 or len(data)
        lines = data[start:end].split(b"\n")
        if not lines[-1]:
            lines.pop()
        yield number, lines
        number, start = number + len(lines), end


def floats(words: Sequence[bytes]) -> FloatArray:
    """(m,) numbers; what is no number is named in the error."""
    try:
        return np.array(list(map(float, words)), dtype=np.float64)
    except ValueError:
        bad = next(word for word in words if not _is(float, word))
        raise GtbError(f"{shown(bad)} is no number") from None


def integers(words: Sequence[bytes]) -> IntArray:
    """(m,) whole numbers; what is none is named in the error."""
    try:
        return np.array(list(map(int, words)), dtype=np.int64)
    except (ValueError, OverflowError):
        bad = next(word for word in words if not _is(int, word) or abs(int(word)) >= 2**63)
        raise GtbError(f"{shown(bad)} is no whole number") from None


def _is(kind: type[float] | type[int], word: bytes) -> bool:
    try:
        kind(word)
    except ValueError:
        return False
    return True


def shown(word: bytes) -> str:
    """A word for a message: printable, quoted and not long."""
    text = ascii(word[:SHOWN].decode("utf-8", "replace"))
    return f"{text[:-1]}…{text[-1]}" if len(word) > SHOWN else text


def half_step(words: Sequence[bytes], largest: float) -> float:
    """How far a number may be from what was written as one of these words, at the size of the largest.

    Half a unit of the last place: of the decimals that all words have, or else of the most significant digits that
    one has. Zero for the digits of a double that reads back exactly.
    """
    mantissas = {word.lower().partition(b"e")[0] for word in words[:SAMPLE]}
    decimals = {len(mantissa.partition(b".")[2]) for mantissa in mantissas}
    if len(decimals) == 1 and len(mantissas) > 1 and not any(b"e" in word.lower() for word in words[:SAMPLE]):
        return float(0.5 * 10.0 ** -min(decimals.pop(), 300))
    digits = max((len(mantissa.lstrip(b"+-0.").replace(b".", b"")) for mantissa in mantissas), default=0)
    if digits >= 16 or not 0.0 < largest < np.inf:
        return 0.0
    return float(0.5 * 10.0 ** (np.floor(np.log10(largest)) + 1 - max(digits, 1)))
