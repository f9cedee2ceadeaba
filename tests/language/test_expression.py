"""Expressions: their values against mpmath, and everything else refused."""

from __future__ import annotations

import math
import time

import mpmath
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gtb_cli.errors import SpecError
from gtb_cli.language.expression import MAX_CHARACTERS, MAX_NESTING, evaluate_expression
from tests.specs import SECONDS

ROUNDING = 1e-12
"""Relative to the largest number on the way: at most some dozen float operations and six functions' errors."""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0.0),
        ("42", 42.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("1e3", 1000.0),
        ("2.5E-3", 0.0025),
        ("6/5", 1.2),
        ("8/7", 8 / 7),
        ("sqrt(2)/4", 0.3535533905932738),
        ("9 - 4*sqrt(2)", 3.3431457505076194),
        ("-2**2", -4.0),
        ("(-2)**2", 4.0),
        ("2**3**2", 512.0),
        ("2**-1", 0.5),
        ("7 - 4 - 2", 1.0),
        ("16/4/2", 2.0),
        ("+-+-3", 3.0),
        ("\t ( 1 + 2 ) * 3 ", 9.0),
        ("log(e)", 1.0),
        ("exp(1)", math.e),
        ("cos(pi)", -1.0),
        ("tan(pi/4)", 1.0),
        ("sin(pi/6)", 0.5),
        ("(8)**(1/3)", 2.0),
    ],
)
def test_values(text: str, value: float) -> None:
    assert evaluate_expression(text) == pytest.approx(value, rel=4e-16, abs=0)


def test_integers_are_floats_from_the_start() -> None:
    assert evaluate_expression("9007199254740993 - 9007199254740992") == 0.0
    assert evaluate_expression("9" * MAX_CHARACTERS) == 1e256


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
    text, value, size = case
    assume(len(text) <= MAX_CHARACTERS and size < 1e12)
    assert abs(evaluate_expression(text) - value) <= ROUNDING * max(size, 1.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty"),
        (" \t", "is empty"),
        ("1 +", "is not a complete expression"),
        ("1 2", "is not a complete expression"),
        ("2 pi", "is not a complete expression"),
        ("2e", "is not a complete expression"),
        ("01", "is not a complete expression"),
        ("1..2", "is not a complete expression"),
        ("()", "may hold numbers"),
        ("sqrt(*2)", "may hold numbers"),
        ("(1", "'(' is never closed"),
        ("1)", "')' without '('"),
        (")(", "')' without '('"),
        ("sqrt", "sqrt needs a number in parentheses"),
        ("sqrt()", "sqrt needs one number in parentheses"),
        ("sqrt(1)(2)", "a product needs '*'"),
        ("2(3)", "a product needs '*'"),
        ("pi(2)", "a product needs '*'"),
        ("sqr(2)", "unknown name 'sqr'"),
        ("Sqrt(2)", "unknown name 'Sqrt'"),
        ("True", "unknown name 'True'"),
        ("None", "unknown name 'None'"),
        ("nan", "unknown name 'nan'"),
        ("inf", "unknown name 'inf'"),
        ("lambda", "unknown name 'lambda'"),
        ("1 if 1 else 2", "unknown name 'if'"),
        ("1 and 2", "unknown name 'and'"),
        ("0x1F", "unknown name 'x1F'"),
        ("0b1", "unknown name 'b1'"),
        ("2j", "unknown name 'j'"),
        ("1_000", "unexpected '_'"),
        ("__import__('os')", "unexpected '_'"),
        ("pi.real", "unexpected '.'"),
        ("sqrt(1, 2)", "unexpected ','"),
        ("[1][0]", "unexpected '['"),
        ("{1}", "unexpected '{'"),
        ("1 // 2", "unexpected '//'"),
        ("5 % 2", "unexpected '%'"),
        ("1 @ 2", "unexpected '@'"),
        ("1 << 2", "unexpected '<'"),
        ("~1", "unexpected '~'"),
        ("1 ^ 2", "unexpected '^'"),
        ("1 = 1", "unexpected '='"),
        ("1; 2", "unexpected ';'"),
        ("1\n+ 2", r"unexpected '\\n'"),
        ("1\x002", r"unexpected '\\x00'"),
        ("f'1'", "unknown name 'f'"),
        ("'1'", 'unexpected "\'"'),
        ("# 1", "unexpected '#'"),
        ("1\\", r"unexpected '\\\\'"),
        ("²", "unexpected '²'"),
        ("١", "unexpected '١'"),
        ("1\N{NO-BREAK SPACE}", "unexpected"),
        ("−1", "unexpected '−'"),
        ("ｐｉ", "unexpected 'ｐ'"),
        ("\ud800", "unexpected"),
        ("1/0", "1/0 divides by zero"),
        ("0**-1", "is not a finite real number"),
        ("sqrt(-1)", r"sqrt\(-1\) is not a finite real number"),
        ("log(0)", r"log\(0\) is not a finite real number"),
        ("(-8)**(1/3)", r"\(-8\)\*\*0.333333 is not a finite real number"),
        ("(-1)**0.5", "is not a finite real number"),
        ("exp(1000)", r"exp\(1000\) is not finite"),
        ("1e400", "is not finite"),
        ("1e308*10", r"1e\+308\*10 is not finite"),
        ("1/(1e308*10)", r"1e\+308\*10 is not finite"),
        ("1e308*10 - 1e308*10", "is not finite"),
    ],
)
def test_refused(text: str, reason: str) -> None:
    escaped = reason if "\\" in reason else "".join("\\" + c if c in "()*+?[]^$.|{}" else c for c in reason)
    with pytest.raises(SpecError, match=escaped):
        evaluate_expression(text)


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9**9",
        "9**9**9",
        "2**99999999**99999999",
        "(" * 255,
        "-" * 255 + "1",
        "2**" * 80 + "2",
        "sqrt(" * 50 + "2" + ")" * 6,
        "1" * 255 + "**" + "9" * 3,
    ],
)
def test_hostile_text_is_refused_at_once(text: str) -> None:
    start = time.process_time()
    with pytest.raises(SpecError):
        evaluate_expression(text)
    assert time.process_time() - start < SECONDS  # takes microseconds; as integers, the first would never end


@pytest.mark.parametrize(
    "nested",
    [
        lambda depth: "(" * depth + "1" + ")" * depth,
        lambda depth: "-" * depth + "1",
        lambda depth: "1**" * depth + "1",
        lambda depth: "(-" * (depth // 2) + "(" * (depth % 2) + "1" + ")" * (depth // 2 + depth % 2),
        lambda depth: "1**(" * (depth // 2) + "-" * (depth % 2) + "1" + ")" * (depth // 2),
        lambda depth: "1**(1)**" * (depth // 2) + "-" * (depth % 2) + "1",
        lambda depth: "sqrt(" * depth + "1" + ")" * depth,
    ],
    ids=["parentheses", "signs", "powers", "signed", "powers-of-parentheses", "parentheses-in-powers", "functions"],
)
def test_depth_counts_parentheses_powers_and_signs(nested) -> None:
    assert abs(evaluate_expression(nested(MAX_NESTING))) == 1
    with pytest.raises(SpecError, match=f"is nested more than {MAX_NESTING} deep"):
        evaluate_expression(nested(MAX_NESTING + 1))


@pytest.mark.parametrize("text", ["+".join("1" * 128), "-".join("1" * 128), "1*" * 127 + "1", "-1+" * 85 + "1"])
def test_long_plain_sums_are_not_deep(text: str) -> None:
    assert len(text) <= MAX_CHARACTERS
    assert math.isfinite(evaluate_expression(text))


def test_depth_is_of_the_deepest_part_not_of_all_parts_together() -> None:
    assert evaluate_expression("+".join(["(-1)**2"] * 30)) == 30


def test_length_limit() -> None:
    assert evaluate_expression("1" + " " * (MAX_CHARACTERS - 1)) == 1
    with pytest.raises(SpecError, match=f"has {MAX_CHARACTERS + 1} characters, at most {MAX_CHARACTERS}"):
        evaluate_expression("1" + " " * MAX_CHARACTERS)


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
