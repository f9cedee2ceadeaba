"""Specs that are refused: a table of files, specs made to be slow, and random changes of good ones."""

import contextlib
import random
import re

import pytest

from gtb_cli.errors import SpecError
from gtb_cli.language.keys_and_values import MAX_EXPRESSIONS
from gtb_cli.language.loading import load, parse
from gtb_cli.language.patch_reader import MAX_KNOTS, MAX_PATCHES, MAX_UNITY
from tests.marks import mostly_long
from tests.specs import BAD_SPECS, Case, bad_specs, quickly
from tests.tools.judge import judge
from tests.tools.mutations import mutation


@pytest.mark.parametrize("case", bad_specs(), ids=lambda case: case.file)
def test_bad_specs(case: Case) -> None:
    path = BAD_SPECS / case.file
    with quickly(), pytest.raises(SpecError) as caught:
        load(path)
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
            "knots = [" + ", ".join(f"'{i}{' ' * 200}'" for i in range(2000)) + "]\n",
            f"expressions may have {MAX_EXPRESSIONS} characters together, write others as numbers",
        ),
        ("knots = [" + "'sqrt(-1)', " * 5_000 + "]\n", "sqrt(-1) is not a finite real number"),
        ("".join(f"k{i} = 1\n" for i in range(10_000)), "k0: is not a key of a spec"),
        ("[[patches]]\n" * 900, "patches[0].knots: is missing"),
        ("{" + ", ".join(f'"k{i % 9}": {{"a": 1}}' for i in range(4_000)) + "}", "k0: is given twice"),
        ("knots = [" + "[], " * 5_000 + "]\n", "knots[0]: must be a list of 2 coordinates, got a list of 0"),
    ],
    ids=lambda value: value[:20],
)
def test_large_specs_are_judged_quickly(text: str, message: str) -> None:
    with quickly(), pytest.raises(SpecError, match=re.escape(message)):
        parse(text, "x")


@pytest.mark.parametrize("first", mostly_long([0, 100]))
def test_changed_specs_are_patches_or_errors(first: int) -> None:
    good = 0
    for number in range(first, first + 100):
        text, _ = mutation(random.Random(number))
        with quickly():
            assert judge("spec", text) is None, text
        with contextlib.suppress(SpecError):
            good += bool(parse(text, "x"))
    assert 0 < good < 50  # the changes are neither all harmless nor all fatal
