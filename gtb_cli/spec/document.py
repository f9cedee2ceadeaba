"""The text of a spec: TOML or JSON bytes → plain data, and the line each value stands on.

Neither of Python's parsers tells where a value stands, and neither bounds its work: ten megabytes of brackets or dotted
keys can take minutes or exhaust the stack. One scanner over words does both jobs: it measures every text before a
parser sees it, and finds lines when there is an error to report.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from gtb_cli.errors import SpecError

Format: TypeAlias = Literal["toml", "json"]
Path: TypeAlias = tuple[str | int, ...]
Repeated: TypeAlias = tuple[Path, int, int]

MAX_BYTES = 10_000_000
"""Largest spec; a patch of a thousand knots has a hundred kilobytes."""

MAX_WORDS = 100_000
"""Most values, keys and signs in a spec; five thousand knots with weights and lifting have as many."""

MAX_LINES = 200_000
"""Most lines in a spec, with the same reason."""

MAX_WORD_LENGTH = 1000
"""Longest string or number; an expression has at most 256 characters."""

MAX_NESTING = 16
"""Deepest nesting of lists and tables; a spec needs four."""

MAX_KEY_PARTS = 4
"""Most parts of a dotted key; a spec needs one."""

_GAP = r"(?:[ \t\r\n]++|#[^\n]*+)*+"
_STRING = r'"(?:[^"\\\n]++|\\[^\n])*+"?'
_BARE_EXPRESSION = re.compile(r"[ \t]*(?:[-+*/(]|(?:sqrt|sin|cos|tan|exp|log|pi|e)\b)")
# Every match succeeds where it starts, and strings may lack their end, so that the cost is one pass over any text.
_WORDS = {
    "toml": re.compile(
        rf'{_GAP}(?P<word>(?P<string>"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{{3,5}})?'
        rf"|'''(?:[^']++|'(?!''))*+(?:'{{3,5}})?|{_STRING}|'[^'\n]*+'?)"
        r"|(?P<sign>[\[\]{},=])|[^\s\[\]{},=\"'#]++|.|\Z)",
        re.DOTALL,
    ),
    "json": re.compile(
        rf'{_GAP}(?P<word>(?P<string>{_STRING})|(?P<sign>[\[\]{{}},:])|[^\s\[\]{{}},:"#]++|.|\Z)',
        re.DOTALL,
    ),
}


@dataclass(frozen=True)
class Document:
    """A spec that is well-formed TOML or JSON.

    Attributes
    ----------
    data : object
        What the parser gave.
    text : str
    format : "toml" or "json"
    repeated : tuple of (path, first line, line)
        Keys given twice in one JSON object, which the parser would take in silence.
    """

    data: object
    text: str
    format: Format
    repeated: tuple[Repeated, ...]

    def lines(self, paths: set[Path]) -> dict[Path, int]:
        """Find the line of each path, or of the nearest value around it that is there."""
        around = {path: self._existing(path) for path in paths}
        wanted = set(around.values()) - {()}
        known: dict[Path, int] = {}
        for path, line, _ in _values(self.text, self.format) if wanted else ():
            if path in wanted:
                known.setdefault(path, line)
                if len(known) == len(wanted):
                    break
        return {path: known[place] for path, place in around.items() if place in known}

    def _existing(self, path: Path) -> Path:
        """Return the longest part of a path that leads to a value."""
        value = self.data
        for length, part in enumerate(path):
            match value:
                case dict() if part in value:
                    value = value[part]
                case list() if isinstance(part, int) and part < len(value):
                    value = value[part]
                case _:
                    return path[:length]
        return path


class Faults:
    """What is wrong with a document, collected in any order and written in the order of the file.

    Attributes
    ----------
    count : int
        All faults; those beyond `SHOWN` are counted only.
    """

    SHOWN = 20

    def __init__(self, document: Document, source: str) -> None:
        self.count = 0
        self._document = document
        self._source = source
        self._faults: list[tuple[Path, str, int | None]] = []
        for path, first, line in document.repeated:
            self.add(path, _twice(first), line)

    def add(self, path: Path, message: str, line: int | None = None) -> None:
        """Note a fault of the value at a path; its line is found later, unless it is given."""
        self.count += 1
        if self.count <= self.SHOWN:
            self._faults.append((path, message, line))

    def __str__(self) -> str:
        lines = self._document.lines({path for path, _, _ in self._faults})
        faults = [(line or lines.get(path, 0), path, message) for path, message, line in self._faults]
        text = []
        for line, path, message in sorted(faults, key=lambda fault: fault[0]):
            file = f"{self._source}:{line}" if line else self._source
            text.append(f"{file}: {place(path)}: {message}" if path else f"{file}: {message}")
        if self.count > self.SHOWN:
            text.append(f"{self._source}: ... and {self.count - self.SHOWN} more")
        return "\n".join(text)


def place(path: Path) -> str:
    """Write a path as ``patches[1].weights[3]``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + (part if re.fullmatch(r"[\w-]{1,60}", part) else shown(part))
    return text


def shown(value: object) -> str:
    """Describe a value for a message, in a few words."""
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str() | int() | float():
            text = repr(value).removesuffix(".0")
            return text if len(text) <= 60 else f"{text[:40]}... ({len(text)} characters)"
        case list():
            return f"a list of {len(value)}"
        case dict():
            return "a table"
        case _:
            return "a date or time"


def read(data: bytes | str, source: str, format: Format | None = None) -> Document:
    """Read the text of a spec.

    Parameters
    ----------
    data : bytes or str
        UTF-8, a byte order mark allowed.
    source : str
        File name for messages.
    format : "toml", "json" or None
        None: JSON where the first character is ``{``, else TOML.

    Raises
    ------
    SpecError
        Not text, too large, nested too deeply, or not well-formed: one line, with line and column where known.

    Notes
    -----
    At most about a second and 100 MB for anything; a spec of a few kilobytes takes about a millisecond.
    """
    text = _decode(data, source)
    if format is None:
        format = "json" if text.lstrip()[:1] == "{" else "toml"
    if not text.strip():
        raise SpecError(f"{source}: is empty")
    repeated = _measure(text, source, format)
    return Document(_parse(text, source, format, repeated), text, format, repeated)


def _decode(data: bytes | str, source: str) -> str:
    if len(data) > MAX_BYTES:
        raise SpecError(f"{source}: is too large, a spec has at most {MAX_BYTES // 10**6} MB")
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise SpecError(f"{source}: is UTF-16 text, a spec must be UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = error.object[error.start]
        raise SpecError(f"{source}:{line}: is not UTF-8 text, byte 0x{byte:02x} ({error.reason})") from None


def _measure(text: str, source: str, format: Format) -> tuple[Repeated, ...]:
    """Refuse a text that a parser would choke on; return the keys that are given twice in one table."""
    if text.count("\n") >= MAX_LINES:
        raise SpecError(f"{source}: is too large, a spec has at most {MAX_LINES} lines")
    first: dict[Path, int] = {}
    repeated: dict[Path, tuple[int, int]] = {}
    try:
        for path, line, defines in _values(text, format):
            if defines and path not in first:
                first[path] = line
            elif defines and not any(path[:length] in repeated for length in range(1, len(path) + 1)):
                repeated[path] = first[path], line
    except _TooMuch as error:
        line, reason = error.args
        raise SpecError(f"{source}:{line}: {reason}") from None
    return tuple((path, *lines) for path, lines in repeated.items())


def _parse(text: str, source: str, format: Format, repeated: tuple[Repeated, ...]) -> object:
    if format == "json":
        import json

        try:
            return json.loads(text)
        except json.JSONDecodeError as error:
            reason = error.msg.removesuffix(" at").removesuffix(" starting")
            raise _malformed(text, source, "JSON", error.lineno, error.colno, reason) from None

    import tomllib

    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        # "Reason (at line 3, column 5)" or "Reason (at end of document)"
        reason, _, where = str(error).removesuffix(")").rpartition(" (at ")
        if repeated and reason.startswith(("Cannot", "Duplicate")):
            raise SpecError(
                "\n".join(f"{source}:{line}: {place(path)}: {_twice(first)}" for path, first, line in repeated)
            ) from None
        found = re.fullmatch(r"line (\d+), column (\d+)", where)
        end = text.count("\n") + 1, len(text) - text.rfind("\n")
        line, column = (int(found[1]), int(found[2])) if found else end
        raise _malformed(text, source, "TOML", line, column, reason) from None


def _malformed(text: str, source: str, language: str, line: int, column: int, reason: str) -> SpecError:
    rest = text.split("\n")[line - 1][column - 1 :]
    if _BARE_EXPRESSION.match(rest) and "property name" not in reason:
        reason += " (an expression must stand in quotes)"
    return SpecError(f"{source}:{line}:{column}: is not valid {language}, {reason[:1].lower()}{reason[1:]}")


def _twice(first: int) -> str:
    return f"is given twice, first in line {first}"


class _TooMuch(Exception):
    """Line and reason why a text goes to no parser."""


class _Open:
    """A list or table the scanner is in: its path, the index of a list's current entry, a table's current key."""

    __slots__ = ("index", "key", "path")

    def __init__(self, path: Path, index: int | None, key: Path | None = None) -> None:
        self.path, self.index, self.key = path, index, key


def _values(text: str, format: Format) -> Iterator[tuple[Path, int, bool]]:
    """Yield the path and line of every key and list entry, and whether a key is given there and may not be again.

    Of text that is not well-formed, something is yielded.

    Raises
    ------
    _TooMuch
        At the first place where a limit is passed.
    """
    toml = format == "toml"
    separator = "=" if toml else ":"
    words = _WORDS[format]
    entries: dict[Path, int] = {}  # index of the last [[table]] of each list of tables
    stack = [_Open((), None, None if toml else ())]
    parts: list[str] = []
    header = dots = position = 0
    line = key_line = 1
    for count, match in enumerate(words.finditer(text)):
        word = match["word"]
        if not word:
            return
        newlines = text.count("\n", position, match.start("word"))
        line += newlines
        position = match.end()
        if toml and newlines and len(stack) == 1:
            stack[0].key, parts, header, dots = None, [], 0, 0
        if count == MAX_WORDS:
            raise _TooMuch(line, f"is too large, a spec has at most {MAX_WORDS} values, keys and signs")
        if len(word) > MAX_WORD_LENGTH:
            raise _TooMuch(line, f"a word of {len(word)} characters, at most {MAX_WORD_LENGTH} are allowed")
        top = stack[-1]
        if top.index is None and top.key is None:
            if word == separator:
                if toml:
                    for length in range(1, len(parts)):
                        yield (*top.path, *parts[:length]), key_line, False
                top.key = (*top.path, *parts)
                yield top.key, key_line, bool(parts)
            elif word == "}" and len(stack) > 1:
                stack.pop()
            elif word == "[" and toml and len(stack) == 1:
                header += 1
            elif word == "]" and header:
                paths = _header(parts, header > 1, entries)
                yield from ((path, key_line, header == 1 and path is paths[-1]) for path in paths)
                top.path = paths[-1] if paths else ()
                header = 0
            elif match["sign"] is None:
                dots += word.count(".") if match["string"] is None else 0
                if dots >= MAX_KEY_PARTS:
                    raise _TooMuch(line, f"a key of more than {MAX_KEY_PARTS} parts")
                parts = (parts + _key_parts(word))[: MAX_KEY_PARTS + 1] if toml else _key_parts(word)
                key_line = line
                continue
            parts, dots = [], 0
        elif word == ",":
            if top.index is None:
                top.key = None
            else:
                top.index += 1
        elif word in ("]", "}"):
            if len(stack) > 1:
                stack.pop()
        else:
            here = top.key or ()
            if top.index is not None:
                here = (*top.path, top.index)
                yield here, line, False
            if word in ("[", "{"):
                if len(stack) > MAX_NESTING:
                    raise _TooMuch(line, f"is nested more than {MAX_NESTING} deep")
                stack.append(_Open(here, 0 if word == "[" else None))
        line += word.count("\n")


def _header(parts: list[str], of_list: bool, entries: dict[Path, int]) -> list[Path]:
    """Return the path of a [table] or [[table]], after those of the tables around it."""
    path: Path = ()
    paths = []
    for number, part in enumerate(parts, 1):
        path = (*path, part)
        paths.append(path)
        if of_list and number == len(parts):
            entries[path] = entries.get(path, -1) + 1
        if path in entries:
            path = (*path, entries[path])
            paths.append(path)
    return paths


def _key_parts(word: str) -> list[str]:
    if word[0] not in "\"'":
        return [part for part in word.split(".") if part]
    inside = word[1:-1]
    if word[0] == '"' and "\\" in inside:
        import json

        try:
            return [str(json.loads(word))]
        except ValueError:
            pass  # an escape only TOML knows: the key as written is near enough to find a line
    return [inside]
