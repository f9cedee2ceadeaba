"""Specs that are refused: a table of files, specs made to be slow, and random changes of good ones."""

import copy
import json
import random
import re
import time
import tomllib
from collections.abc import Iterator

import pytest

from gtb_cli.errors import SpecError
from gtb_cli.language.document import Faults
from gtb_cli.language.loading import load, parse
from gtb_cli.language.reader import MAX_KNOTS, MAX_PATCHES, MAX_UNITY
from gtb_cli.language.values import MAX_EXPRESSIONS
from gtb_cli.language.writer import dump
from tests.specs import ARC, BAD_SPECS, GOOD_SPECS, SECONDS, Case, arrays, bad_specs


@pytest.mark.parametrize("case", bad_specs(), ids=lambda case: case.file)
def test_bad_specs(case: Case) -> None:
    path = BAD_SPECS / case.file
    start = time.process_time()
    with pytest.raises(SpecError) as caught:
        load(path)
    assert time.process_time() - start < SECONDS
    assert case.matches(str(path), str(caught.value)), str(caught.value)


def test_every_bad_spec_is_in_the_table() -> None:
    cases = bad_specs()
    assert sorted(case.file for case in cases) == sorted({path.name for path in BAD_SPECS.iterdir()} - {"expected.txt"})
    assert all(case.lines for case in cases)
    assert len(cases) >= 90


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"knots = [{'0, 1, ' * (MAX_KNOTS // 2)}2]\n", f"knots: must be at most {MAX_KNOTS}, got {MAX_KNOTS + 1}"),
        (f"patches = [{'{}, ' * MAX_PATCHES}{{}}]", f"patches: must be at most {MAX_PATCHES}, got {MAX_PATCHES + 1}"),
        (
            "knots = [" + ", ".join(f"[{i}, {i * i}]" for i in range(1500)) + "]\n",
            "knots: 1500 knots times 1500 edges, at most 2000000 are allowed",
        ),
        (
            f"knots = [{', '.join(map(str, range(MAX_UNITY + 1)))}]\ncoefficients = 'partition-of-unity'\n"
            f"control_points = [{'[0, 0], ' * (MAX_UNITY + 1)}]\n",
            f"coefficients: partition-of-unity is for at most {MAX_UNITY} knots, got {MAX_UNITY + 1}",
        ),
        (
            f"knots = [{', '.join(map(str, range(1031)))}]\ncoefficients = 'binomial'\n"
            f"control_points = [{'[0, 0], ' * 1031}]\n",
            "coefficients: binomial goes up to degree 1029, got 1030",
        ),
        (
            "knots = [" + ", ".join(f"'{i}{' + 1' * 50}'" for i in range(2000)) + "]\n",
            f"expressions may have {MAX_EXPRESSIONS} characters together, write others as numbers",
        ),
        ("knots = [" + "'sqrt(-1)', " * 5_000 + "]\n", "sqrt(-1) is not a finite real number"),
        ("".join(f"k{i} = 1\n" for i in range(30_000)), "k0: is not a key of a spec"),
        ("[[patches]]\n" * 900, "patches[0].knots: is missing"),
        ("{" + ", ".join(f'"k{i % 9}": {{"a": 1}}' for i in range(10_000)) + "}", "k0: is given twice"),
        ("knots = [" + "[], " * 5_000 + "]\n", "knots[0]: must be a list of 2 coordinates, got a list of 0"),
    ],
    ids=lambda value: value[:20],
)
def test_large_specs_are_judged_quickly(text: str, message: str) -> None:
    start = time.process_time()
    with pytest.raises(SpecError, match=re.escape(message)):
        parse(text, "x")
    assert time.process_time() - start < SECONDS


# Random changes of good specs: a patch or an error, nothing else

WORDS = [
    *(b"nan", b"-inf", b"1e400", b"true", b"null", b"[", b"]", b"{", b"}", b'"', b"'", b'"""', b",", b"=", b":", b"\n"),
    *(b"\r", b"\0", b"\xff", b"\xef\xbb\xbf", b"#", b"-", b"0", b"1e308", b"1e-320", b'"sqrt(-1)"', b"[[patches]]\n"),
    *(b"knots", b"name=", b"[1,2,3]", b"1979-05-27", b"9" * 400, b"e", b".", b"_", b"\\u0000", b"\\ud800", b"a.b=1\n"),
    *(b'coefficients="binomial"\n', b'coefficients="partition-of-unity"\n', b"edge_scale=[1,2]\n", b"\\"),
]
VALUES = [
    *(None, True, 0, -1, 1e300, 10**400, float("nan"), float("inf"), "", "x", "1/0", "sqrt(2)", "pi", "\ud800"),
    *([], {}, [[]], [{}], [1], [[1, 2]], [[1, 2], [3, 4]], {"a": 1}, "binomial", "partition-of-unity", [[[1]]]),
]


def changed_bytes(text: bytes, rng: random.Random) -> bytes:
    result = bytearray(text)
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        at = rng.randrange(len(result) + 1)
        numbers = list(re.finditer(rb'-?\d+(?:\.\d+)?|"[^"\n]*"', result))
        match rng.randrange(6):
            case 0:
                result[at : at + 1] = bytes([rng.randrange(256)])
            case 1:
                result[at:at] = rng.choice(WORDS)
            case 2:
                del result[at : at + rng.choice([1, 2, 30, 1000])]
            case 3:
                result[at:at] = result[rng.randrange(len(result) + 1) :][:200]
            case 4:
                lines = result.split(b"\n")
                rng.shuffle(lines)
                result = bytearray(b"\n".join(lines))
            case 5 if numbers:
                number = rng.choice(numbers)
                result[number.start() : number.end()] = rng.choice(WORDS)
    return bytes(result)


def changed_data(data: object, rng: random.Random) -> object:
    result = copy.deepcopy(data)
    for _ in range(rng.choice([1, 1, 2, 4])):
        inner = result
        while True:  # walk down to a random list or table
            below = [value for value in (inner.values() if isinstance(inner, dict) else inner) if value]
            below = [value for value in below if isinstance(value, list | dict)]
            if not below or rng.random() < 0.3:
                break
            inner = rng.choice(below)
        value = copy.deepcopy(rng.choice(VALUES))
        if isinstance(inner, dict):
            key = rng.choice(
                [*inner, "weights", "lifting", "edge_scale", "edge_normals", "coefficients", "name", "kntos"]
            )
            if rng.random() < 0.2:
                inner.pop(key, None)
            else:
                inner[key] = value
        elif isinstance(inner, list):
            at = rng.randrange(len(inner) + 1)
            inner[at : at + rng.randrange(2)] = [value] * rng.randrange(3)
    return result


def changes(count: int, seed: int) -> Iterator[bytes]:
    rng = random.Random(seed)
    texts = [path.read_bytes() for path in GOOD_SPECS if path.stat().st_size < 5000]
    texts.append(f'name = "m"\n[[patches]]\n{ARC}[[patches]]\n{ARC}'.encode())
    data = [tomllib.loads(text.decode()) for text in texts]
    for _ in range(count):
        if rng.random() < 0.5:
            yield changed_bytes(rng.choice([*texts, json.dumps(rng.choice(data)).encode()]), rng)
        else:
            yield json.dumps(changed_data(rng.choice(data), rng)).encode()


def test_changed_specs_are_patches_or_errors() -> None:
    good = 0
    for text in changes(200, seed=1):
        start = time.process_time()
        try:
            spec = parse(text, "x")
        except SpecError as error:
            lines = str(error).split("\n")
            spec = None
        assert time.process_time() - start < SECONDS
        if spec is None:
            assert 1 <= len(lines) <= Faults.SHOWN + 1
            assert all(re.match(r"x(:\d+){0,2}: .", line) and line.isprintable() for line in lines), lines
        else:
            good += 1
            assert arrays(parse(dump(spec))) == arrays(spec)
    assert 10 < good < 100  # the changes are neither all harmless nor all fatal
