"""Expressions: their values against mpmath, and everything else refused."""

import json
import math
import re
from pathlib import Path

import mpmath
import pytest
from hypothesis import assume, example, given, strategies as st

from gtb_cli.errors import SpecError
from gtb_cli.language.expression import MAX_CHARACTERS, MAX_NESTING, degrees_in, evaluate_expression
from tests.specs import quickly

VALUES, REFUSED = (
    [(text, line[end + 1 :]) for line in part.splitlines()[1:] for text, end in [json.JSONDecoder().raw_decode(line)]]
    for part in (Path(__file__).parent / "expressions.txt").read_text(encoding="utf-8").split("\n\n")
)


@pytest.mark.parametrize(("text", "value"), VALUES)
def test_values(text: str, value: str) -> None:
    assert evaluate_expression(text) == pytest.approx(float(value), rel=4e-16, abs=0)


@st.composite
def expressions(draw: st.DrawFn) -> tuple[str, mpmath.mpf, float]:
    """An expression, its value, and the largest size of anything on the way to it."""
    numbers = st.one_of(
        st.integers(0, 50).map(str), st.floats(0, 20, allow_subnormal=False).map(repr), st.sampled_from(["pi", "e"])
    )

    def leaf(text: str) -> tuple[str, mpmath.mpf, float]:
        value = {"pi": mpmath.pi, "e": mpmath.e}.get(text) or mpmath.mpf(text)
        return text, mpmath.mpf(value), float(value)

    def grow(children: st.SearchStrategy) -> st.SearchStrategy:
        def binary(sign: str, a: tuple, b: tuple) -> tuple[str, mpmath.mpf, float]:
            value = {"+": a[1] + b[1], "-": a[1] - b[1], "*": a[1] * b[1]}.get(sign)
            if value is None:
                assume(b[1] > 1e-3)
                value = a[1] / b[1]
            return f"({a[0]}) {sign} ({b[0]})", value, max(abs(float(value)), a[2] * max(b[2], 1), b[2] * max(a[2], 1))

        def call(name: str, a: tuple) -> tuple[str, mpmath.mpf, float]:
            assume(a[2] < 50 and (name not in ("sqrt", "log") or a[1] > 1))
            value = getattr(mpmath, name)(a[1])
            return f"{name}({a[0]})", value, max(abs(float(value)) * max(a[2], 1), a[2])

        return st.one_of(
            st.builds(binary, st.sampled_from("+-*/"), children, children),
            st.builds(call, st.sampled_from(["sqrt", "sin", "cos", "exp", "log"]), children),
            children.map(lambda a: (f"-({a[0]})", -a[1], a[2])),
        )

    return draw(st.recursive(numbers.map(leaf), grow, max_leaves=6))


@given(expressions())
def test_values_agree_with_mpmath(case: tuple[str, mpmath.mpf, float]) -> None:
    # Relative to the largest number on the way: at most some dozen float operations and six functions' errors
    rounding = 1e-12
    text, value, size = case
    assume(len(text) <= MAX_CHARACTERS and size < 1e12)
    assert abs(evaluate_expression(text) - value) <= rounding * max(size, 1.0)


@pytest.mark.parametrize(("text", "reason"), REFUSED)
def test_refused(text: str, reason: str) -> None:
    with quickly(), pytest.raises(SpecError, match=re.escape(reason)):  # as integers, 9**9**9**9 would never end
        evaluate_expression(text)


@pytest.mark.parametrize(
    "nested",
    [
        lambda depth: "(" * depth + "1" + ")" * depth,
        lambda depth: "-" * depth + "1",
        lambda depth: "1**" * depth + "1",
        lambda depth: "(-" * (depth // 2) + "(" * (depth % 2) + "1" + ")" * (depth // 2 + depth % 2),
        lambda depth: "1**(" * (depth // 2) + "-" * (depth % 2) + "1" + ")" * (depth // 2),
        lambda depth: "sqrt(" * depth + "1" + ")" * depth,
    ],
    ids=["parentheses", "signs", "powers", "signed", "powers-of-parentheses", "functions"],
)
def test_depth_counts_parentheses_powers_and_signs(nested) -> None:
    assert abs(evaluate_expression(nested(MAX_NESTING))) == 1
    with pytest.raises(SpecError, match=f"is nested more than {MAX_NESTING} deep"):
        evaluate_expression(nested(MAX_NESTING + 1))


def test_depth_is_of_the_deepest_part_not_of_all_parts_together() -> None:
    for text in ("+".join("1" * 128), "-".join("1" * 128), "1*" * 127 + "1", "-1+" * 85 + "1"):
        assert len(text) <= MAX_CHARACTERS
        assert math.isfinite(evaluate_expression(text))
    assert evaluate_expression("+".join(["(-1)**2"] * 30)) == 30


def test_angles_near_a_whole_number_of_degrees_are_not_doubted() -> None:
    assert [bool(degrees_in("cos(x)", {"x": x})) for x in (7.0, 7.0005, 6.0)] == [True, False, False]


@given(st.text(st.sampled_from("0123456789.eE+-*/() \tpisqrtcoxlgan_,'\"\\\n²j#=<")))
@example("1e")
@example("e1")
@example("1 .e")
@example("1e5e5")
def test_any_text_gives_a_finite_float_or_an_error(text: str) -> None:
    try:
        value = evaluate_expression(text)
    except SpecError as error:
        value, message = None, str(error)
    if value is None:
        assert message.startswith("expression ")
        assert "\n" not in message
    else:
        assert type(value) is float
        assert math.isfinite(value)
