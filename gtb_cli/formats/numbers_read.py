"""Numbers in text, read fast in blocks, with their rounding; errors name each bad number. 32 bits: `file_arrays`."""

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.errors import GtbError

T = TypeVar("T", np.float64, np.int64)

BLOCK_BYTES = 1 << 21  # bytes of text parsed together; lines and words are objects, which would fill the memory


def lines_of(data: bytes, start: int = 0, size: int = BLOCK_BYTES) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the lines of a text from `start`, `size` bytes at a time, with the number (from 0) of the first."""
    if b"\r" in data:
        data, start = data[start:].replace(b"\r\n", b"\n").replace(b"\r", b"\n"), 0
    number = 0
    while start < len(data):
        end = data.find(b"\n", start + size) + 1 or len(data)
        lines = data[start:end].splitlines()
        yield number, lines
        number, start = number + len(lines), end


def number_rows(text: bytes, kind: type[T]) -> tuple[NDArray[T], IntArray]:
    """Return the numbers of all lines of a text, and the count of each line; errors name the bad word."""
    fast = _plain_rows(text, kind)
    return fast or (numbers(text.split(), kind), np.array([len(line.split()) for line in text.split(b"\n")]))


def _plain_rows(text: bytes, kind: type[T]) -> tuple[NDArray[T], IntArray] | None:
    """Read a text of plain numbers fast; return None for any other text."""
    max_fast_integer = 2**62  # whole numbers that do not fit in 64 bits are read as larger ones than this
    if text.translate(None, b"0123456789+- \t\n" if kind is np.int64 else b"0123456789+- \t\n.eE"):
        return None
    characters = np.frombuffer(text + b"\n", dtype=np.uint8)
    blank = characters <= ord(" ")
    ends = np.flatnonzero(blank[1:] & ~blank[:-1])
    counts = np.diff(np.searchsorted(ends, np.flatnonzero(characters == ord("\n"))), prepend=0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = np.fromstring(text, dtype=kind, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    # Numbers that run into each other outnumber the words.
    if len(found) != len(ends) or (kind is np.int64 and (np.abs(found) > max_fast_integer).any()):
        return None
    return found, counts


def padded(numbers: NDArray[Any], counts: IntArray, width: int, fill: float) -> NDArray[Any]:
    """Return the first numbers of rows of `counts` numbers as a table, (m, width), filled up where rows are shorter."""
    table = np.full((len(counts), width), fill, numbers.dtype)
    within = np.arange(len(numbers)) - np.repeat(np.cumsum(counts) - counts, counts.astype(np.intp))
    table[np.arange(width) < counts[:, None]] = numbers[within < width]
    return table


def numbers(words: Sequence[bytes], kind: type[T]) -> NDArray[T]:
    """Return (m,) numbers, whole ones if `kind` is int64; the error names a word that is not one."""
    read, what = (int, "a whole number") if kind is np.int64 else (float, "a number")
    try:
        if b"_" in b"".join(words):
            raise ValueError("only Python reads 1_0 as ten")
        return np.array(list(map(read, words)), dtype=kind)
    except (ValueError, OverflowError):
        if len(words) == 1:
            raise GtbError(f"{shown(words[0])} is not {what}") from None
        half = len(words) // 2  # the first wrong word is in this half, or else in the other
        numbers(words[:half], kind)
        return numbers(words[half:], kind)


def shown(word: bytes) -> str:
    """A word as shown in messages: printable, quoted and short."""
    shown_characters = 30  # largest number of characters of a bad word shown in a message
    text = ascii(word[:shown_characters].decode("utf-8", "replace"))
    return f"{text[:-1]}…{text[-1]}" if len(word) > shown_characters else text


def sampled(rows: Sequence[bytes], held: int) -> list[bytes]:
    """Return rows of a block, of which `held` others are known, to infer digits: some from everywhere, and the longest.

    The first blocks give 10,000 in all, and each further one a hundred, as it may have other digits. Where rows are
    the words of points, they are taken from all axes.
    """
    step = -(-len(rows) // max(10_000 - held, 100)) or 1
    return [*rows[:: step + (step % 3 == 0)], max(rows, key=len, default=b"")]


def half_step(words: Sequence[bytes], sizes: FloatArray) -> FloatArray:
    """(3,) largest rounding of a number written as one of these words, at the sizes of three coordinates.

    This is half a unit in the last place: of the decimals, if all words have equally many, and these are at least
    six or end in zeros; otherwise of the most significant digits that a word has. It is 0 for numbers with
    so few digits that a person may have written them, or as many as a double needs.
    """
    default_digits = 6  # fewest digits, or decimals, that programs write by default; numbers with fewer count as exact
    exact_digits = 16  # number of digits from which a double may read back exactly
    sample = [word.lower() for word in words]
    mantissas = {word.partition(b"e")[0] for word in sample}
    decimals = {len(mantissa.partition(b".")[2]) for mantissa in mantissas}
    if len(decimals) == 1 and not any(b"e" in word for word in sample):
        places = decimals.pop()
        if places >= default_digits or (places >= 2 and any(mantissa.endswith(b"0") for mantissa in mantissas)):
            return np.full(3, 0.5 * 10.0 ** -min(places, 300))
    lengths = {len(mantissa.replace(b".", b"").lstrip(b"+-0")) for mantissa in mantissas}
    is_whole = not any(b"." in word or b"e" in word for word in sample) and lengths - {0} != {default_digits}
    if is_whole or not default_digits <= max(lengths, default=0) < exact_digits or not np.isfinite(sizes).all():
        return np.zeros(3)
    powers = np.floor(np.log10(np.where(sizes > 0, sizes, 1.0))) + 1 - max(lengths)
    return np.where(sizes > 0, 0.5 * 10.0**powers, 0.0)
