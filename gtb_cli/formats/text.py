"""Numbers in text, read in blocks: fast, and every bad one named with its line."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError

T = TypeVar("T", np.float64, np.int64)

LINES = 1 << 16
"""Lines that are taken apart together: their words are objects, and many more would fill the memory."""

SAMPLE = 30_000
"""Words from which the digits of a file are told."""

FIXED = 6
"""Fewest digits, or decimals, that programs write by default; fewer are taken for exact numbers."""

EXACT = 16
"""Digits with which a double may read back exactly."""

SHOWN = 30
"""Characters of a bad word in a message."""

_WHOLE = b"0123456789- \n"
_NUMBER = _WHOLE + b"+.eE"


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


def float_table(text: bytes, rows: int) -> FloatArray | None:
    """Numbers of `rows` lines, (rows, width), fast; None unless each line has as many words, and all are numbers."""
    return None if text.translate(None, _NUMBER) else _table(text, rows, np.float64)


def integer_table(text: bytes, rows: int) -> IntArray | None:
    """The same for whole numbers."""
    return None if text.translate(None, _WHOLE) else _table(text, rows, np.int64)


def _table(text: bytes, rows: int, kind: type[T]) -> NDArray[T] | None:
    characters = np.frombuffer(text + b"\n", dtype=np.uint8)
    blank = characters <= ord(" ")
    ends = np.flatnonzero(blank[1:] & ~blank[:-1])
    breaks = np.flatnonzero(characters == ord("\n"))
    counts = np.diff(np.searchsorted(ends, breaks), prepend=0)
    if len(counts) != rows or not counts[0] or (counts != counts[0]).any():
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.fromstring(text, dtype=kind, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    return numbers.reshape(rows, -1) if len(numbers) == rows * counts[0] else None


def floats(words: Sequence[bytes]) -> FloatArray:
    """(m,) numbers; what is no number is named in the error."""
    try:
        return np.array(list(map(float, _plain(words))), dtype=np.float64)
    except ValueError:
        bad = next(word for word in words if not _is(float, word))
        raise GtbError(f"{shown(bad)} is no number") from None


def integers(words: Sequence[bytes]) -> IntArray:
    """(m,) whole numbers; what is none is named in the error."""
    try:
        return np.array(list(map(int, _plain(words))), dtype=np.int64)
    except (ValueError, OverflowError):
        bad = next(word for word in words if not _is(int, word) or abs(int(word)) >= 2**63)
        raise GtbError(f"{shown(bad)} is no whole number") from None


def _plain(words: Sequence[bytes]) -> Sequence[bytes]:
    """The words, if none has an underscore: Python, and nobody else, reads 1_0 as ten."""
    if b"_" in b"".join(words):
        raise ValueError("an underscore")
    return words


def _is(kind: type[float] | type[int], word: bytes) -> bool:
    try:
        kind(word)
    except ValueError:
        return False
    return b"_" not in word


def shown(word: bytes) -> str:
    """A word for a message: printable, quoted and not long."""
    text = ascii(word[:SHOWN].decode("utf-8", "replace"))
    return f"{text[:-1]}…{text[-1]}" if len(word) > SHOWN else text


def half_step(words: Sequence[bytes], largest: float) -> float:
    """How far a number may be from what was written as one of these words, at the size of the largest.

    Half a unit of the last place: of the decimals, where all words have as many, `FIXED` at least or some of them
    zeros; else of the most significant digits that a word has. Zero where these are so few that the numbers are plain
    ones, as a person writes them, or as many as a double needs.
    """
    sample = [word.lower() for word in words[:SAMPLE]]
    mantissas = {word.partition(b"e")[0] for word in sample}
    decimals = {len(mantissa.partition(b".")[2]) for mantissa in mantissas}
    if len(decimals) == 1 and not any(b"e" in word for word in sample):
        places = decimals.pop()
        if places >= FIXED or (places >= 2 and any(mantissa.endswith(b"0") for mantissa in mantissas)):
            return float(0.5 * 10.0 ** -min(places, 300))
    digits = max((len(mantissa.replace(b".", b"").lstrip(b"+-0")) for mantissa in mantissas), default=0)
    if not FIXED <= digits < EXACT or not 0.0 < largest < np.inf:
        return 0.0
    return float(0.5 * 10.0 ** (np.floor(np.log10(largest)) + 1 - digits))
