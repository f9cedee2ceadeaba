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
_NUMBERS = re.compile(rf"{_GAP}(?P<word>\[(?:{_ENTRY}|\[(?:{_ENTRY})*+\])*+\])")


class TooMuch(Exception):
    """The line and the reason why no parser gets a text."""


class Place(NamedTuple):
    """The place of a key or list entry, and whether it is a key that must not be repeated."""

    path: Path
    line: int
    is_definition: bool


def places(text: str, format: Format, is_measured: bool = False) -> Iterator[Place]:
    """Yield the place of every key and list entry; of a text that is not well-formed, some of them.

    If the text is measured, numbers in lists of numbers have no places. Raises `TooMuch` with the line of the first
    place at which a limit is exceeded.
    """
    words = re.compile(_WORDS[format], re.DOTALL)
    around: list[tuple[Path, bool]] = [((), False)]  # tables and lists around the word, and whether each is a list
    here: Path | None = None if format == "toml" else ()  # path of the value that is expected, or has just ended
    last_tables: dict[Path, int] = {}  # index of the last [[table]] of each list of tables
    key: list[str] = []
    dots = brackets = 0  # in the key, and before it
    line = key_line = 1
    position = count = numbers = 0
    word = ""
    while True:
        count += 1
        may_be_list = is_measured and here is not None and word in _SIGNS and len(around) < MAX_NESTING
        match = _NUMBERS.match(text, position) if may_be_list else None
        if match is not None:
            numbers += match["word"].count(",")
        else:
            match = words.match(text, position)
            assert match is not None  # it matches anything, and the end
        word = match["word"]
        if not word:
            return
        newlines = text.count("\n", position, match.start("word"))
        position = match.end()
        line += newlines
        if is_measured and count > MAX_WORDS:
            raise TooMuch(line, f"is too large, a spec has at most {MAX_WORDS} values, keys and signs")
        if numbers > MAX_NUMBERS:
            raise TooMuch(line, f"is too large, a spec has at most {MAX_NUMBERS} numbers")
        if len(word) > MAX_WORD_LENGTH and word[0] != "[":
            raise TooMuch(line, f"a word of {len(word)} characters, at most {MAX_WORD_LENGTH} are allowed")
        if newlines and format == "toml" and len(around) == 1:  # the end of a line ends a key and its value
            here, key, dots, brackets = None, [], 0, 0
        path, is_list = around[-1]
        if here is None and word not in _SIGNS:
            dots += 0 if word[0] in "\"'" else word.count(".")
            if dots >= MAX_KEY_PARTS:
                raise TooMuch(line, f"is not a spec: a key of more than {MAX_KEY_PARTS} parts")
            key_line = line
            if len(key) <= MAX_KEY_PARTS:
                key += _key_parts(word)
        elif here is None:
            if word in "=:":
                for length in range(1, len(key)):
                    yield Place((*path, *key[:length]), key_line, False)
                here = (*path, *key)
                yield Place(here, key_line, bool(key))
            elif word == "}" and len(around) > 1:
                here, _ = around.pop()
            elif word == "[" and len(around) == 1:
                brackets += 1
            elif word == "]" and brackets:
                tables = _header(key, brackets > 1, last_tables)
                for table in tables:
                    yield Place(table, key_line, brackets == 1 and table is tables[-1])
                around[0] = (tables[-1] if tables else ()), False
                brackets = 0
            key, dots = [], 0
        elif word == ",":
            here = (*path, int(here[-1]) + 1) if is_list else None
        elif word in ("]", "}"):
            if len(around) > 1:
                here, _ = around.pop()
        else:
            if is_list:
                yield Place(here, line, False)
            if word in ("[", "{"):
                if len(around) > MAX_NESTING:
                    raise TooMuch(line, f"is nested more than {MAX_NESTING} deep")
                around.append((here, word == "["))
                here = (*here, 0) if word == "[" else None
        line += word.count("\n")


def _header(key: list[str], is_entry: bool, last_tables: dict[Path, int]) -> list[Path]:
    """Return the paths of the tables around a [table] or, as an entry of a list, [[table]], and then its own."""
    path: Path = ()
    paths = []
    for number, part in enumerate(key, 1):
        path = (*path, part)
        paths.append(path)
        if is_entry and number == len(key):
            last_tables[path] = last_tables.get(path, -1) + 1
        if path in last_tables:
            path = (*path, last_tables[path])
            paths.append(path)
    return paths


def _key_parts(word: str) -> list[str]:
    if word[0] not in "\"'":
        return [part for part in word.split(".") if part]
    if word[0] == '"' and "\\" in word:
        import json

        try:
            return [str(json.loads(word))]
        except ValueError:
            pass  # an escape that only TOML knows: the key as written is good enough to find a line
    return [word[1:-1]]
