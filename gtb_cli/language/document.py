"""The text of a spec: TOML or JSON bytes → plain data, and faults by line (as they are written: `errors`)."""

import re
from collections import Counter

from gtb_cli.errors import Fault, SpecError
from gtb_cli.language.scanner import Path, TooMuch, places
from gtb_cli.values import frozen
from gtb_cli.vocabulary import LFS_FAULT, LFS_POINTER, SPEC_FORMATS, SpecFormat, suffix_of

MAX_BYTES = 10_000_000  # a spec; a patch of a thousand knots takes a hundred kilobytes
MAX_LINES = 1_000_000  # lines in a spec; 5000 bicubic patches take a fifth of them
# Slips that a parser of TOML or JSON calls something else: its reason, what is before and after, and the fault, which
# stands after the reason if it is in parentheses. Last come names, expressions and units in the place of a value.
_QUOTED, _DECIMAL = " (names and expressions go in quotes; numbers have no unit)", " (decimals have a point)"
_UNCLOSED = "] is missing before this: the list of line {line} is not closed"
_WORD = r"^[ \t]*(?:[-+*(A-Za-z_]|/(?![/*]))"
_SLIPS = (
    (r"^(?:Illegal character '\\[rn]|Unterminated string|Expected \"'\")", "", "", "a text in quotes is not closed"),
    ("^Cannot overwrite", r"\[\[[\w-]+\Z", "", "{} is there already: [[{}]] begins each of several, the first as well"),
    ("", "", r"^[ \t]*(?://|/\*)", "a comment begins with #"),
    ("", "", r"^[ \t]*;", "a ; has no meaning: values stand apart by commas, and lines end by themselves"),
    ("", "", r"^[ \t]*[“”„‘’«»]", "quotes are straight"),
    ("", "", "^[ \t]*[\u00a0\u2007\u202f\u3000]", "a blank from a web page or text program: type a plain one"),
    ("", "", "^[ \t]*[\u2212\u2013\u2014]", "a minus sign is -"),
    ("^Invalid value", "", r"^[-+]?\.\d", "a digit stands before the point of a number"),
    ("^Unclosed array$", "", r"^(?:[\w-]+[ \t]*=|\Z)", _UNCLOSED),
    ("^Invalid value$", r"\n[ \t]*\Z", r"^(?:[\w-]+[ \t]*=|\Z)", _UNCLOSED),
    ("^Invalid value$", r"\n\[\[?\Z", r"^(?:patches\]\]|let\])[ \t\r]*(?:#.*)?\Z", _UNCLOSED),
    ("^Unclosed array$", r"\n\Z", r"^\[\[[\w-]+\]\]", _UNCLOSED),
    ("^Unclosed array$", "", r"^[)}]", "a list ends with ]"),
    ("^Invalid value$", r"[\[,=\n][ \t]*\Z", r"^\(", "a list stands in [square brackets], an expression in quotes"),
    ("^Invalid initial", "", r"^[ \t\r]*(?:#.*)?\Z", "a table in {braces} stands on one line"),
    ("^Invalid (?:initial|value$)", r",[ \t]*\Z", r"^[,}]", "this comma or the one before is too many"),
    ("^Expected newline", "", r"^,[ \t\r]*(?:#.*)?\Z", "a line ends without a comma, except in a list"),
    ("^Expected newline", r"""["'][ \t]*\Z""", "^,", "a list stands in [square brackets]"),
    ("^Expected '='", r"\w[ \t]+\Z", r"^[\w-]+[ \t]*=", "a name before = has no blank, but may have _"),
    ("^(?:Invalid statement|Expected newline)", "", r"^[\])}]", "this bracket closes none"),
    (
        "^Unclosed",
        r"""[\]\w."'}][ \t\r]*(?:#[^\n]*)?(?:\n[ \t\r]*(?:#[^\n]*)?)*$""",
        r"""^(?:[\w-]+[ \t]*=|[\[{"']|[-+]?\.?\d)""",
        "a comma is missing before this",
    ),
    ("^(?!Expected newline)(?!.*(?:key|property name))", "", _WORD, _QUOTED),
    ("^Expected newline", r"\d[ \t]*\Z", _WORD + r"(?![\w-]*[ \t]*=)", _QUOTED),
    ("^(?!.*key)", r"\d(?:,\d+)?\Z", r"^,\d", _DECIMAL),
    ("key", r"\d(?:,\d+)?\Z", "^[,}]", _DECIMAL),
)
# The beginnings of files that users mistake for specs
_OTHER_FILES = {
    "a STEP file": re.compile(rb"ISO-10303-21"),
    "an IGES file": re.compile(rb"[^\r\n]{72}S[ 0]{6}1\s"),
    "a BREP file": re.compile(rb"[^\0]{0,90}DBRep_DrawableShape"),
    "a PLY mesh": re.compile(rb"ply\r?\n"),
    "a GLB mesh": re.compile(rb"glTF"),
    "G-code for a printer": re.compile(rb"(?:;[^\n]*+\n|\s++)*+[GM]\d+[ ;\r\n]"),
    "a gzip archive (gunzip opens it)": re.compile(rb"\x1f\x8b"),
    "an STL mesh": re.compile(rb"solid\b[^\n=]*\n\s*(?:facet|endsolid)\b"),
    "HTML, SVG or XML": re.compile(rb"\s*+<[!?a-zA-Z]"),
    "an OBJ mesh": re.compile(rb"(?:[ \t\r\n]++|#[^\n]*+)*+(?:v[nt]? [-+.\d]|(?:mtllib|[og]) [^=\n]*\n)"),
}


@frozen
class Document:
    """A spec that is well-formed TOML or JSON: the parser's result, and the text.

    `repeated` has the path, line and fault of keys given twice in one JSON object, which the parser would accept.
    """

    data: object
    text: str
    format: SpecFormat
    repeated: tuple[tuple[Path, int, str], ...]

    def lines(self, paths: set[Path]) -> dict[Path, int]:
        """Find the line of each path, or of the innermost value around it that is there."""
        wanted = {path[:length] for path in paths for length in range(1, len(path) + 1)}
        known: dict[Path, int] = {}
        for path, line, _ in places(self.text, self.format, wanted) if wanted else ():
            if path in wanted:
                known.setdefault(path, line)
                if len(known) == len(wanted):
                    break
        around = {path: [line for part, line in known.items() if path[: len(part)] == part] for path in paths}
        return {path: lines[-1] for path, lines in around.items() if lines}


_ALIKE = re.compile(r"unknown name '\w+'|must be a whole number from 1 .*|angle must .* radians|arc is written")


class Faults:
    """The faults of a document, collected in any order; `count` is the number of all, of which `SHOWN` are kept.

    An unknown name is one fault, however often it stands there, as is an expression that cannot be a count.
    """

    SHOWN = 20

    def __init__(self, document: Document, source: str, note: str = "") -> None:
        self.count = 0
        self._document, self.source, self._note = document, source, note
        self._faults: list[tuple[Path, str, int | None]] = []
        self._more = Counter[str]()  # places of faults alike, but for their first ones
        self.doubt: tuple[Path, str] | None = None  # what is probably meant otherwise, and is no fault
        for path, line, message in document.repeated:
            self.add(path, message, line)

    def add(self, path: Path, message: str, line: int | None = None) -> None:
        """Note a fault of the value at a path; its line is found later unless given."""
        if (name := _ALIKE.search(message)) and any(name[0] in other for _, other, _ in self._faults):
            self._more[name[0]] += 1
            return
        if any((path, message) == fault[:2] for fault in self._faults):  # of a table that is read for several patches
            return
        self.count += 1
        if self.count <= self.SHOWN:
            self._faults.append((path, message, line))

    def doubted(self) -> Fault | None:
        """Return what is probably meant otherwise, if anything is."""
        if self.doubt is None:
            return None
        path, message = self.doubt
        return Fault(message, self.source, self._document.lines({path}).get(path), key=place(path) or None)

    def found(self) -> list[Fault]:
        """Return the faults in the order of the file."""
        lines = self._document.lines({path for path, _, _ in self._faults})
        more = {name: f" (and at {count} more place{'s' * (count > 1)})" for name, count in self._more.items()}
        faults = [
            (line or lines.get(path, 0), path, message + more.get((_ALIKE.search(message) or [""])[0], ""))
            for path, message, line in self._faults
        ]
        return [
            Fault(message + self._note, self.source, line or None, key=place(path) or None)
            for line, path, message in sorted(faults, key=lambda fault: fault[0])
        ]


def error_about(files: list[Faults]) -> SpecError:
    """Return the error with the first faults of a spec's files, its own first, and the number of the others."""
    found = [fault for faults in files for fault in faults.found()][: Faults.SHOWN]
    more = sum(faults.count for faults in files) - len(found)
    return SpecError(*found, *([Fault(f"... and {more} more", files[0].source)] if more else []))


def place(path: Path) -> str:
    """Write a path as ``patches[1].weights[3]``."""
    names = (part if isinstance(part, int) or re.fullmatch(r"[\w-]{1,60}", part) else shown(part) for part in path)
    return "".join(f"[{name}]" if isinstance(name, int) else f".{name}" for name in names).removeprefix(".")


def shown(value: object) -> str:
    """Describe a value for a message, in a few words."""
    match value:
        case None | bool():
            return {None: "null", True: "true", False: "false"}[value]
        case str() | int() | float():
            text = repr(value).removesuffix(".0")
            return text if len(text) <= 60 else f"{text[:40]}... ({len(text)} characters)"
        case list():
            return f"a list of {len(value)}"
        case dict():
            return "a table"
        case _:
            return "a date or time"


def spec_format_of(path: str) -> SpecFormat | None:
    """Return the format that a file's suffix names, if any."""
    return next((format for format in SPEC_FORMATS if format == suffix_of(path)), None)


def read(data: bytes | str, source: str, format: SpecFormat | None = None) -> Document:
    """Read the text of a spec, UTF-8; unless a format is given, a first character ``{`` makes it JSON, otherwise TOML.

    Raises `SpecError`, one line with line and column if known: the data are not text, too large, nested too deeply, or
    not well-formed. Any input takes at most about three seconds and 150 MB.
    """
    if isinstance(data, bytes):
        if data.startswith(LFS_POINTER):
            raise SpecError(Fault(LFS_FAULT, source))
        if (kind := kind_of(data)) is not None:
            ways_out = {"file": ": gtb import (extra gtb-cli[cad]) makes one", "mesh": "; gtb view shows meshes"}
            raise SpecError(Fault(f"is {kind}, and a spec is expected{ways_out.get(kind[-4:], '')}", source))
    text = _decode(data, source)
    format = format or ("json" if text.lstrip()[:1] == "{" else "toml")
    if not text.strip():
        raise SpecError(Fault("is empty", source))
    repeated = _measure(text, source, format)
    return Document(_parse(text, source, format, repeated), text, format, repeated)


def kind_of(data: bytes) -> str | None:
    """Say which other kind of file begins so, such as a mesh; None if it is not known."""
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return "an STL mesh"
    return next((kind for kind, pattern in _OTHER_FILES.items() if pattern.match(data)), None)


def _decode(data: bytes | str, source: str) -> str:
    if len(data) > MAX_BYTES:
        raise SpecError(Fault(f"is too large, a spec has at most {MAX_BYTES // 10**6} MB", source))
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise SpecError(Fault("is UTF-16 text, a spec must be UTF-8", source))
    if b"\0" in data:
        raise SpecError(Fault("is not text, and a spec in TOML or JSON is expected", source))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"is not UTF-8 text, byte 0x{error.object[error.start]:02x} ({error.reason}): save it as UTF-8"
        raise SpecError(Fault(reason, source, data.count(b"\n", 0, error.start) + 1)) from None


def _measure(text: str, source: str, format: SpecFormat) -> tuple[tuple[Path, int, str], ...]:
    """Refuse a text that a parser would choke on; return the keys given twice in one table, with lines and faults."""
    if text.count("\n") >= MAX_LINES:
        raise SpecError(Fault(f"is too large, a spec has at most {MAX_LINES} lines", source))
    first: dict[Path, int] = {}
    repeated: dict[Path, int] = {}
    try:
        for path, line, defines in places(text, format):
            if defines and path not in first:
                first[path] = line
            elif defines and not any(path[:length] in repeated for length in range(1, len(path) + 1)):
                repeated[path] = line
    except TooMuch as error:
        line, reason = error.args
        raise SpecError(Fault(reason, source, line)) from None
    hint = " (a list of tables has double brackets: [[patches]])"
    return tuple(
        (path, line, f"is given twice, first in line {first[path]}{hint * (path == ('patches',))}")
        for path, line in repeated.items()
    )


def _parse(text: str, source: str, format: SpecFormat, repeated: tuple[tuple[Path, int, str], ...]) -> object:
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
            path, line, message = repeated[0]
            raise SpecError(Fault(message, source, line, key=place(path))) from None
        end = text.count("\n") + 1, len(text) - text.rfind("\n")
        line, column = map(int, re.findall(r"\d+", where) or end)
        raise _malformed(text, source, "TOML", line, column, reason) from None


def _malformed(text: str, source: str, language: str, line: int, column: int, reason: str) -> SpecError:
    lines = text.split("\n")[:line]
    before, rest = lines[-1][: column - 1], lines[-1][column - 1 :]
    texts = reason, "\n".join([*lines[:-1], before])[-1000:], rest
    if slip := next((row[3] for row in _SLIPS if all(map(re.search, row, texts))), ""):
        keys = [k for k, row in enumerate([*lines[:-1], before], 1) if re.match(r"[ \t]*[\"'\w.-]+[ \t]*=", row)]
        slip = slip.replace("{line}", f"{keys[-1] if keys else line}").replace("{}", before.lstrip("["))
        reason = f"{reason if slip[0] == ' ' else ''}{slip}"
    elif reason.startswith("Expected") and rest:
        reason += f", got {rest[0]!r}"
    if (text.lstrip()[:1] == "{") != (language == "JSON"):
        other = "TOML" if language == "JSON" else "JSON"
        reason += f"; if it is {other}, its name ends in .{other.lower()}"
    elif spec_format_of(source) is None and re.search(r"\w\.\w+$", source):
        reason += " (specs are TOML or JSON, and end in .toml or .json)"
    return SpecError(Fault(f"is not valid {language}, {reason[:1].lower()}{reason[1:]}", source, line, column))
