"""Places of keys and values in the text of a spec, TOML or JSON.

Neither of Python's parsers tells where a value stands, and neither bounds its work: ten megabytes of brackets or dotted
keys can take minutes or exhaust the stack. One scanner over words does both jobs. It measures every text before a
parser sees it, and it finds the lines of errors.
"""

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

Format: TypeAlias = Literal["toml", "json"]
Path: TypeAlias = tuple[str | int, ...]

# values, keys and signs in a spec. A list of numbers, or of lists of numbers, counts as one. A model
# of 5000 patches has half as many.
MAX_WORDS = 150_000

# numbers in such lists: 5000 bicubic patches have half as many; reading all takes about two seconds
# and 100 MB
MAX_NUMBERS = 1_000_000
MAX_WORD_LENGTH = 1000  # longest string or number, in characters; an expression has at most 256
MAX_NESTING = 16  # deepest nesting of lists and tables; a spec needs four


_GAP = r"(?:[ \t\r\n]++|#[^\n]*+)*+"
_STRING = r'"(?:[^"\\\n]++|\\[^\n])*+"?'
# Every match succeeds where it starts, and strings may lack their end: any text costs one pass.
_WORDS = {
    "toml": (
        rf'{_GAP}(?P<word>(?P<string>"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{{3,5}})?'
        rf"|'''(?:[^']++|'(?!''))*+(?:'{{3,5}})?|{_STRING}|'[^'\n]*+'?)"
        r"|(?P<sign>[\[\]{},=])|[^\s\[\]{},=\"'#]++|.|\Z)"
    ),
    "json": rf'{_GAP}(?P<word>(?P<string>{_STRING})|(?P<sign>[\[\]{{}},:])|[^\s\[\]{{}},:"#]++|.|\Z)',
}

_ENTRY = r"[-+.\deE_]{1,60}(?![-+.\deE_])|[, \t\r\n]"
# A list of numbers, or of lists of numbers, with the groups of other words, which match nothing here
_NUMBERS = re.compile(rf"{_GAP}(?P<word>(?P<string>\0\0)?(?P<sign>\0\0)?\[(?:{_ENTRY}|\[(?:{_ENTRY})*+\])*+\])")


class TooMuch(Exception):
    """The line and the reason why no parser gets a text."""


class Place(NamedTuple):
    """The place of a key or list entry, and whether it is a key that must not be repeated."""

    path: Path
    line: int
    is_definition: bool


class _Open:
    """A list or table around the scanner: its path, the index of a list's current entry, a table's current key."""

    __slots__ = ("index", "key", "path")

    def __init__(self, path: Path, index: int | None, key: Path | None = None) -> None:
        self.path, self.index, self.key = path, index, key


class Scanner:
    """A walk over the words of a text. It also finds some places in a text that is not well-formed.

    Parameters
    ----------
    text : str
    format : "toml" or "json"
    passes_numbers : bool
        Whether lists of numbers are skipped, without the places of their entries.
    """

    def __init__(self, text: str, format: Format, passes_numbers: bool = False) -> None:
        self._passes_numbers = passes_numbers
        self._text = text
        self._words = re.compile(_WORDS[format], re.DOTALL)
        self._is_toml = format == "toml"
        self._separator = "=" if self._is_toml else ":"
        self._stack = [_Open((), None, None if self._is_toml else ())]
        self._last_tables: dict[Path, int] = {}  # index of the last [[table]] of each list of tables
        self._line = 1
        self._new_key()
        self._brackets = 0  # which open a [table] or [[table]]
        self._key_line = 1

    def places(self) -> Iterator[Place]:
        """Yield the place of every key and list entry.

        Raises
        ------
        TooMuch
            A limit is exceeded; the line is that of the first such place.
        """
        position = count = numbers = 0
        before = ""
        while True:
            count += 1
            match = _NUMBERS.match(self._text, position) if self._passes_numbers and before in "=:[," else None
            if match is not None and self._expects_value and len(self._stack) < MAX_NESTING:
                numbers += match["word"].count(",")
            else:
                match = self._words.match(self._text, position)
                assert match is not None  # it matches anything, and the end
            word = before = match["word"]
            if not word:
                return
            newlines = self._text.count("\n", position, match.start("word"))
            position = match.end()
            self._line += newlines
            if self._passes_numbers and count > MAX_WORDS:
                raise TooMuch(self._line, f"is too large, a spec has at most {MAX_WORDS} values, keys and signs")
            if numbers > MAX_NUMBERS:
                raise TooMuch(self._line, f"is too large, a spec has at most {MAX_NUMBERS} numbers")
            if len(word) > MAX_WORD_LENGTH and word[0] != "[":
                raise TooMuch(self._line, f"a word of {len(word)} characters, at most {MAX_WORD_LENGTH} are allowed")
            if newlines and self._is_toml and len(self._stack) == 1:  # the end of a line ends a key and its value
                self._stack[0].key, self._brackets = None, 0
                self._new_key()
            if self._expects_value:
                yield from self._at_value(word)
            elif match["sign"] is None:
                self._add_to_key(word, is_string=match["string"] is not None)
            else:
                yield from self._at_key(word)
                self._new_key()
            self._line += word.count("\n")

    @property
    def _expects_value(self) -> bool:
        return self._stack[-1].index is not None or self._stack[-1].key is not None

    def _new_key(self) -> None:
        self._parts: list[str] = []
        self._dots = 0

    def _add_to_key(self, word: str, *, is_string: bool) -> None:
        max_key_parts = 4  # parts of a dotted key; a spec needs one
        self._dots += 0 if is_string else word.count(".")
        if self._dots >= max_key_parts:
            raise TooMuch(self._line, f"is not a spec: a key of more than {max_key_parts} parts")
        before = self._parts if self._is_toml else []
        self._parts = (before + _key_parts(word))[: max_key_parts + 1]
        self._key_line = self._line

    def _at_key(self, sign: str) -> Iterator[Place]:
        """Take a sign at the place of a key: it ends the key, the table, or a table's header."""
        top = self._stack[-1]
        if sign == self._separator:
            if self._is_toml:
                for length in range(1, len(self._parts)):
                    yield Place((*top.path, *self._parts[:length]), self._key_line, False)
            top.key = (*top.path, *self._parts)
            yield Place(top.key, self._key_line, bool(self._parts))
        elif sign == "}" and len(self._stack) > 1:
            self._stack.pop()
        elif sign == "[" and self._is_toml and len(self._stack) == 1:
            self._brackets += 1
        elif sign == "]" and self._brackets:
            paths = self._header()
            for path in paths:
                yield Place(path, self._key_line, self._brackets == 1 and path is paths[-1])
            top.path = paths[-1] if paths else ()
            self._brackets = 0

    def _header(self) -> list[Path]:
        """Return the paths of the tables around a [table] or [[table]], and then its own."""
        path: Path = ()
        paths = []
        for number, part in enumerate(self._parts, 1):
            path = (*path, part)
            paths.append(path)
            if self._brackets > 1 and number == len(self._parts):
                self._last_tables[path] = self._last_tables.get(path, -1) + 1
            if path in self._last_tables:
                path = (*path, self._last_tables[path])
                paths.append(path)
        return paths

    def _at_value(self, word: str) -> Iterator[Place]:
        """Take a word at the place of a value or after one."""
        top = self._stack[-1]
        if word == ",":
            if top.index is None:
                top.key = None
            else:
                top.index += 1
            return
        if word in ("]", "}"):
            if len(self._stack) > 1:
                self._stack.pop()
            return
        here = top.key or ()
        if top.index is not None:
            here = (*top.path, top.index)
            yield Place(here, self._line, False)
        if word in ("[", "{"):
            if len(self._stack) > MAX_NESTING:
                raise TooMuch(self._line, f"is nested more than {MAX_NESTING} deep")
            self._stack.append(_Open(here, 0 if word == "[" else None))


def _key_parts(word: str) -> list[str]:
    if word[0] not in "\"'":
        return [part for part in word.split(".") if part]
    inside = word[1:-1]
    if word[0] == '"' and "\\" in inside:
        import json

        try:
            return [str(json.loads(word))]
        except ValueError:
            pass  # an escape that only TOML knows: the key as written is good enough to find a line
    return [inside]
