"""The scanner against texts whose lines are known, and against texts made to be slow."""

import json
import random

import pytest
from hypothesis import given, strategies as st

from gtb_cli.errors import SpecError
from gtb_cli.language import scanner
from gtb_cli.language.document import MAX_BYTES, MAX_LINES, read
from gtb_cli.language.scanner import MAX_NESTING, MAX_WORD_LENGTH, MAX_WORDS, Path
from tests.marks import mostly_long
from tests.specs import quickly
from tests.tables import cases


def written(data: dict[str, object], seed: int, toml: bool) -> tuple[str, dict[Path, int]]:
    """Write data as TOML or JSON with random blanks, line ends and comments; also return the line of each value."""
    rng = random.Random(seed)
    text, lines = "", dict[Path, int]()

    def write(*choices: str) -> None:
        nonlocal text
        text += rng.choice(choices)

    def gap(breaks: bool = True) -> None:
        write("", " ", "\t", *(("\n", "\r\n", "\n\n  ") if breaks else ()))
        write("", *(('# ], } = """ \' [[x]]\n', " #\n# a = 1\n") if breaks and toml else ()))

    def mark(path: Path) -> None:
        lines.setdefault(path, text.count("\n") + 1)

    def key(name: str) -> None:
        is_plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
        write(json.dumps(name), name if toml and is_plain else json.dumps(name))

    def entry(path: Path, content: object, breaks: bool) -> None:
        mark(path)
        key(str(path[-1]))
        gap(breaks)
        write("=" if toml else ":")
        gap(breaks)
        value(path, content)
        gap(breaks)

    def value(path: Path, content: object) -> None:
        match content:
            case list():
                write("[")
                for i, inner in enumerate(content):
                    gap()
                    mark((*path, i))
                    value((*path, i), inner)
                    gap()
                    write("," if i + 1 < len(content) else "", "," if toml or i + 1 < len(content) else "")
                gap()
                write("]")
            case dict():
                write("{")
                for i, (name, inner) in enumerate(content.items()):
                    write("," if i else "")
                    gap(not toml)
                    entry((*path, name), inner, not toml)
                write("}")
            case str():
                quoted = json.dumps(content, ensure_ascii=not toml)
                is_plain = content.isprintable() and not set(content) & set("'\\")
                plain = (f"'{content}'", f"'''\n{content}'''") if toml and is_plain else ()
                write(quoted, f'"""\n{quoted[1:-1]}"""' if toml else quoted, *plain)
            case _:
                write(json.dumps(content))

    def table(path: Path, content: dict[str, object], header: str = "") -> None:
        if header:
            write(header)
            key(str(next(part for part in path if isinstance(part, str))))
            write("]" * len(header) + "\n")
        for name, inner in content.items():
            gap()
            entry((*path, name), inner, breaks=False)
            write("\n")

    if not toml:
        gap()
        value((), data)
        gap()
        return text, lines
    headed = {}
    for name, content in data.items():
        is_list = isinstance(content, list) and content and all(isinstance(inner, dict) for inner in content)
        if is_list or (isinstance(content, dict) and rng.random() < 0.8):
            headed[name] = content
    table((), {name: content for name, content in data.items() if name not in headed})
    for name, content in headed.items():
        for i, inner in enumerate(content) if isinstance(content, list) else ((None, content),):
            gap()
            mark((name,))
            path = (name,) if i is None else (name, i)
            mark(path)
            table(path, inner, "[" if i is None else "[[")
    return text, lines


KEYS = st.sampled_from(["a", "knots", "x-1", "a.b", "a b", "", 'q"', "[c]", "#", "ß", "=", "back\\slash", "\t"])
LEAVES = st.one_of(
    st.integers(-99, 99), st.floats(-1e9, 1e9), st.booleans(), st.text(st.sampled_from("ab [],={}#'\"\\\n:é😀."))
)
VALUES = st.recursive(
    LEAVES, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=3)), max_leaves=8
)


@given(st.dictionaries(KEYS, VALUES, max_size=4), st.integers(0, 2**32), st.booleans())
def test_lines_of_all_values(data: dict[str, object], seed: int, toml: bool) -> None:
    text, lines = written(data, seed, toml)
    if not text.strip():
        return
    document = read(text, "x", "toml" if toml else "json")
    assert document.data == data  # the text says what it should
    assert document.repeated == ()
    assert document.lines(set(lines)) == lines


def test_tables_within_one_are_not_that_one_again():
    assert read("[a.b]\n[a.c]\n[[d]]\n[d.e]\n[[d]]\n[d.e]\n", "a.toml").repeated == ()


def test_lines_in_patches_and_dotted_keys() -> None:
    text = """
    [[patches]]
    knots = [
        0, # [
        1,
    ]
    a.b.c = 1
    [patches.sub]
    x = 2
    [[patches]]
    "kn\\u006fts" = [[0,
        1]]
    """
    inner: list[dict[Path, int]] = [
        {(): 2, ("knots",): 3, ("knots", 0): 4, ("knots", 1): 5, ("a",): 7, ("a", "b", "c"): 7, ("sub", "x"): 9},
        {(): 10, ("knots", 0, 0): 11, ("knots", 0, 1): 12},
    ]
    expected: dict[Path, int] = {("patches", k, *path): n for k, lines in enumerate(inner) for path, n in lines.items()}
    expected |= {("patches",): 2, ("patches", 0, "sub"): 8}
    assert read(text, "x").lines(set(expected)) == expected


def test_what_is_not_there_has_the_line_of_what_is_around_it() -> None:
    document = read("\n[[patches]]\n\n[[patches]]\na = 1\n", "x")
    paths: set[Path] = {("patches", 1, "knots"), ("patches", 1, "a", 3), ("name",)}
    assert document.lines(paths) == {("patches", 1, "knots"): 4, ("patches", 1, "a", 3): 5}


LARGE_BYTES = 2_000_000  # size of a text that would take hours if the work grew with its square


@pytest.mark.parametrize(
    ("parts", "size"),
    [
        *(pytest.param(parts, LARGE_BYTES, id=name) for parts, name in cases("language/hostile", "texts")),
        pytest.param(("", "#", ""), MAX_BYTES + 1, id="too long"),
    ],
)
def test_hostile_texts_are_refused_quickly(parts: list[str], size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a tenth of the words and numbers that are allowed, which takes a tenth of the time."""
    monkeypatch.setattr(scanner, "MAX_WORDS", MAX_WORDS // 10)
    monkeypatch.setattr(scanner, "MAX_NUMBERS", scanner.MAX_NUMBERS // 10)
    start, again, end = parts
    text = start + again * ((size - len(start + end)) // len(again)) + end
    with quickly(), pytest.raises(SpecError, match=r"\Ax(:\d+)*: .*\Z"):
        read(text.encode(), "x")


@pytest.mark.parametrize(
    ("make", "limit", "message"),
    [
        (lambda n: "\n" * (n - 1) + "a = 1", MAX_LINES, "lines"),
        (lambda n: f"a = '{'x' * (n - 2)}'", MAX_WORD_LENGTH, "a word of 1001 characters"),
        (lambda n: "a = " + "[" * n + "]" * n, MAX_NESTING, "is nested more than 16 deep"),
        (lambda n: ".".join("a" * n) + " = 1", 4, "is not a spec: a key of more than 4 parts"),
        (lambda n: '"a" . ' * (n - 1) + "a = 1", 4, "is not a spec: a key of more than 4 parts"),
        *mostly_long(
            [
                (lambda n: "a = [" + "''," * (n // 2 - 2) + "]" * (1 + n % 2), MAX_WORDS, "values, keys and signs"),
                (lambda n: "a = 1" + " " * (n - 5), MAX_BYTES, "at most 10 MB"),
            ],
            quick=0,
        ),
    ],
    ids=["lines", "word", "nesting", "key", "quoted key", "words", "bytes"],
)
def test_limits(make, limit: int, message: str) -> None:
    assert read(make(limit - limit % 2), "x").data
    with pytest.raises(SpecError, match=message):
        read(make(limit + 2 - limit % 2 if "values" in message else limit + 1), "x")


def test_bytes_that_are_not_text() -> None:
    with pytest.raises(SpecError, match=r"\Ax:2: is not UTF-8 text, byte 0xff \(invalid .*\): save it as UTF-8\Z"):
        read(b"a = 1\n\xff", "x")
    with pytest.raises(SpecError, match=r"\Ax: is UTF-16 text, a spec must be UTF-8\Z"):
        read("a = 1".encode("utf-16"), "x")


# --- what is something else


@pytest.mark.parametrize("text", ["v = 1", "o = 2", "# v 1 2 3\nname = 'v 1 2 3'", "solid = 1", "ply = 3"])
def test_keys_like_the_beginnings_of_meshes_are_keys(text):
    assert read(text.encode(), "x.toml").data
