"""The lines of keys and values in the text of a spec, TOML or JSON; `document` has columns.

Neither of Python's parsers tells where a value stands, and neither bounds its work: ten megabytes of brackets or dotted
keys can take minutes or exhaust the stack. So every text is read here first, word by word, and measured. What a parser
would refuse is passed over: it gives the better message, with line and column.
"""

import math
import re
from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import TypeAlias

from gtb_cli.vocabulary import SpecFormat

Path: TypeAlias = tuple[str | int, ...]
Place: TypeAlias = tuple[Path, int, bool]  # of a key or list entry: its line, and whether it must not be repeated

MAX_WORDS = 150_000  # values, keys and signs, a list of numbers being one; 5000 patches have half as many
MAX_NUMBERS = 1_000_000  # in such lists, which take 2 s and 100 MB to read; 5000 bicubic patches have half as many
MAX_WORD_LENGTH = 1000  # longest string or number, in characters; an expression has at most 256
MAX_KEY_PARTS = 4  # parts of a dotted key; a spec needs one
MAX_NESTING = 16  # deepest nesting of lists and tables; a spec needs four

_GAP = r"(?:[ \t\r\n]++|#[^\n]*+)*+"
_STRING = r'"(?:[^"\\\n]++|\\[^\n])*+"?'
# Every match succeeds where it starts, and strings may lack their end: any text costs one pass.
_WORDS = {
    "toml": (
        rf'{_GAP}(?P<word>"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{{3,5}})?'
        rf"|'''(?:[^']++|'(?!''))*+(?:'{{3,5}})?|{_STRING}|'[^'\n]*+'?"
        r"|[\[\]{},=]|[^\s\[\]{},=\"'#]++|.|\Z)"
    ),
    "json": rf'{_GAP}(?P<word>{_STRING}|[\[\]{{}},:]|[^\s\[\]{{}},:"#]++|.|\Z)',
}
_SIGNS = frozenset("[]{},=:")
_ENTRY = r"[-+.\deE_]{1,60}(?![-+.\deE_])|[, \t\r\n]"
# A list of numbers, or of lists of numbers
_NUMBERS = re.compile(rf"\[(?:{_ENTRY}|\[(?:{_ENTRY})*+\])*+\]")


class TooMuch(Exception):
    """The line and the reason why no parser gets a text."""


def places(text: str, format: SpecFormat, wanted: Collection[Path] = ()) -> Iterator[Place]:
    """Yield the place of every key and list entry, but of numbers only those in lists with a wanted path.

    A text that is not well-formed has some of them. Unless paths are wanted, `TooMuch` is raised with the line of the
    first place at which a limit is exceeded.
    """
    words = _Words(text, format, wanted)
    return _statements(words) if format == "toml" else _inside(words, ())


class _Words:
    """The words of a text, one at a time: strings, signs, and what stands between them; "" is the end.

    `line` is the line on which the word starts, and `begins_line` says whether it is the first one there.
    """

    def __init__(self, text: str, format: SpecFormat, wanted: Collection[Path]) -> None:
        self.wanted = wanted
        self.max_words = math.inf if wanted else MAX_WORDS
        self.nesting = 0
        self._text, self._match = text, re.compile(_WORDS[format], re.DOTALL).match
        self._count = self._numbers = self._end = 0
        self._line_of_end = 1
        self.advance()

    def advance(self) -> None:
        """Go to the next word."""
        match = self._match(self._text, self._end)
        assert match is not None  # it matches anything, and the end
        self.word = match["word"]
        newlines = self._text.count("\n", self._end, match.start("word"))
        self.line = self._line_of_end + newlines
        self.begins_line = newlines > 0 or self._end == 0
        self._end = match.end()
        self._line_of_end = self.line + self.word.count("\n")
        self._count += bool(self.word)  # the end is none
        if self._count > self.max_words:
            raise TooMuch(self.line, f"is too large, a spec has at most {MAX_WORDS} values, keys and signs")
        if len(self.word) > MAX_WORD_LENGTH:
            raise TooMuch(self.line, f"a word of {len(self.word)} characters, at most {MAX_WORD_LENGTH} are allowed")

    def skips_numbers(self, path: Path) -> bool:
        """Go to the end of a list of numbers, or of lists of numbers, that begins here; unless its path is wanted."""
        is_deep = self.nesting + 2 > MAX_NESTING
        match = None if is_deep or path in self.wanted else _NUMBERS.match(self._text, self._end - 1)
        if match is None:
            return False
        self._end = match.end()
        self._line_of_end += match[0].count("\n")
        self._numbers += match[0].count(",")
        if self._numbers > MAX_NUMBERS:
            raise TooMuch(self.line, f"is too large, a spec has at most {MAX_NUMBERS} numbers")
        return True


def _statements(words: _Words) -> Iterator[Place]:
    """Yield the places of a TOML text: lines of keys and values, and headers of tables."""
    table: Path = ()
    last_entries: dict[Path, int] = {}  # index of the last [[table]] of each list of tables
    while words.word:
        if words.word == "[":
            words.advance()
            is_entry = words.word == "["
            if is_entry:
                words.advance()
            line, tables = words.line, _tables(_key(words), is_entry, last_entries)
            table = tables[-1] if tables else ()
            for path in tables:
                yield path, line, path == table and not is_entry
        else:
            yield from _pair(words, table)
        while words.word and not words.begins_line:  # the end of a header, or an error
            words.advance()


def _pair(words: _Words, table: Path) -> Iterator[Place]:
    """Yield the places of a key of a table and of what its value holds; go to the word after it."""
    line, key = words.line, _key(words)
    if not words.word or words.word not in "=:":
        return
    for length in range(1, len(key)):
        yield (*table, *key[:length]), line, False
    path = (*table, *key)
    yield path, line, bool(key)
    words.advance()
    yield from _inside(words, path)


def _inside(words: _Words, path: Path) -> Iterator[Place]:
    """Yield the places inside the value that begins here; go to the word after it."""
    opening, index = words.word, 0
    if opening in ("[", "{") and not words.skips_numbers(path):
        words.nesting += 1
        if words.nesting > MAX_NESTING:
            raise TooMuch(words.line, f"is nested more than {MAX_NESTING} deep")
        words.advance()
        while words.word not in ("]", "}", ""):
            if words.word == ",":
                index += 1
                words.advance()
            elif opening == "{":
                yield from _pair(words, path)
            else:
                yield (*path, index), words.line, False
                yield from _inside(words, (*path, index))
        words.nesting -= 1
    words.advance()


def _key(words: _Words) -> list[str]:
    """Return the parts of a key; go to the sign after it or, if there is none, to the next line."""
    line, dots = words.line, 0
    parts: list[str] = []
    while True:
        word = words.word
        dots += word.count(".") if word[:1] not in ('"', "'") else 0
        if dots >= MAX_KEY_PARTS:
            raise TooMuch(line, f"is not a spec: a key of more than {MAX_KEY_PARTS} parts")
        if len(parts) < MAX_KEY_PARTS:
            parts += _parts(word)
        words.advance()
        if not words.word or words.word in _SIGNS or words.begins_line:
            return parts


def _parts(word: str) -> list[str]:
    """Return the parts of a key that a word has: any number, or one if it is quoted."""
    if word[:1] not in ('"', "'"):
        return [part for part in word.split(".") if part]
    if word[0] == '"' and "\\" in word:
        import json

        with suppress(ValueError):  # an escape that only TOML knows: the key as written is good enough to find a line
            return [str(json.loads(word))]
    return [word[1:-1]]


def _tables(key: list[str], is_entry: bool, last_entries: dict[Path, int]) -> list[Path]:
    """Return the paths of the tables around a [table] or, as an entry of a list, [[table]], and then its own."""
    path: Path = ()
    paths = []
    for number, part in enumerate(key, 1):
        path = (*path, part)
        paths.append(path)
        if is_entry and number == len(key):
            last_entries[path] = last_entries.get(path, -1) + 1
        if path in last_entries:
            path = (*path, last_entries[path])
            paths.append(path)
    return paths
