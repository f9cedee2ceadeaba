"""The words of a text file of numbers, one after another, and errors that name the line of a word."""

import math
import re
from bisect import bisect_right
from typing import NoReturn

from gtb_cli.arrays import FloatArray, read_only
from gtb_cli.errors import Fault, SpecError

MAX_MAGNITUDE = 1e100  # largest coordinate or weight: the product of three of them does not overflow
SHOWN_CHARACTERS = 60  # characters of a word that a message shows at most


class Words:
    """Words of a file in their order, with their lines; line ends and what follows a ``#`` do not matter."""

    def __init__(self, data: bytes, source: str) -> None:
        if b"\0" in data:
            raise SpecError(Fault("is not text", source))
        self.source = source
        self._words: list[str] = []
        self._lines: list[int] = []
        for number, line in enumerate(data.decode("utf-8-sig", "backslashreplace").split("\n"), 1):
            words = line.partition("#")[0].split()
            self._words += words
            self._lines += [number] * len(words)
        self._next = 0
        if not self._words:
            raise SpecError(Fault("is empty", source))

    @property
    def left(self) -> int:
        """Number of words that have not been read."""
        return len(self._words) - self._next

    @property
    def line(self) -> int:
        """Line of the next word, or of the last word at the end."""
        return self._lines[min(self._next, len(self._lines) - 1)]

    def fail(self, message: str, line: int | None = None) -> NoReturn:
        """Raise a `SpecError` about the next word, or about another line."""
        raise SpecError(Fault(message, self.source, self.line if line is None else line))

    def peek(self) -> str:
        """Return the next word, of which there must be one."""
        return self._words[self._next]

    def rest_of_line(self) -> list[str]:
        """Read the remaining words on the line of the next word."""
        start, self._next = self._next, bisect_right(self._lines, self.line)
        return self._words[start : self._next]

    def need(self, count: int, what: str) -> None:
        """Refuse a file with fewer remaining words, before memory is allocated for them."""
        if self.left < count:
            self.fail(f"expected {what}, {count} numbers, and the file ends after {self.left}")

    def whole(self, what: str, low: int, high: int) -> int:
        """Read a whole number within limits."""
        self.need(1, what)
        word = self.peek()
        if not re.fullmatch(r"[-+]?\d{1,9}", word, re.ASCII) or not low <= int(word) <= high:
            self.fail(f"expected {what}, a whole number from {low} to {high}, got {word[:SHOWN_CHARACTERS]!r}")
        self._next += 1
        return int(word)

    def rows(self, count: int, width: int, what: str) -> FloatArray:
        """Read (count, width) numbers, as C, C++ and Fortran write them."""
        self.need(count * width, what)
        values = []
        for word in self._words[self._next : self._next + count * width]:
            is_number = re.fullmatch(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d{1,4})?", word)
            values.append(float(word.lower().replace("d", "e")) if is_number else math.nan)
            if not abs(values[-1]) <= MAX_MAGNITUDE:
                found = f"{word[:SHOWN_CHARACTERS]!r}, which is not a number up to {MAX_MAGNITUDE:g}"
                self.fail(f"expected {what}, got {found}")
            self._next += 1
        return read_only(values).reshape(count, width)

    def end(self) -> None:
        """Refuse remaining words."""
        if self.left:
            self.fail(f"expected the end of the file, got {self.peek()[:SHOWN_CHARACTERS]!r}")
