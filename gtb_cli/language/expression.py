"""Numbers written as expressions, such as ``"sqrt(2)/4"``: a whitelist over `ast`, evaluated in floats."""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from itertools import accumulate
from typing import NoReturn

from gtb_cli.errors import SpecError

MAX_CHARACTERS = 256  # longest expression, in characters
MAX_NESTING = 32  # deepest nesting of parentheses, powers and signs
FUNCTIONS = {name: getattr(math, name) for name in ["sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log"]}
COUNTER = "k"  # name of a copy's number, in the expressions of copies
# Constants known in every expression; ``deg`` is a degree in radians
CONSTANTS = {"pi": math.pi, "e": math.e, "deg": math.pi / 180}
# Words are checked before Python's parser sees the text, as it would also accept 0x1f, 1_000, 2j, keywords and strings.
_WORDS = re.compile(
    r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|(?P<name>[A-Za-z][A-Za-z0-9_]*)|[-+*/() \t]|(?P<other>.|\n)"
)
# Signs of other programs, and of web pages
_HINTS = {"^": "powers are written **", "°": "degrees are written *deg, but not in `degrees`"}
_HINTS |= dict.fromkeys("×·", "a product is written *") | dict.fromkeys("−–", "a minus sign is -")
_HINTS |= dict.fromkeys("[]{}", "brackets are ( )") | {"÷": "a quotient is written /", "\xa0": "type a plain blank"}
_WORD_HINTS = dict.fromkeys(("mm", "cm", "m", "inch", "in"), "lengths are numbers without a unit")
_WORD_HINTS |= {COUNTER: "which is the number of a copy, in moves of copies with `repeat` alone", "pow": _HINTS["^"]}
_WORD_HINTS |= {f"{name}d": f"angles are radians: {name}(x*deg) takes degrees" for name in ("sin", "cos", "tan")}
_OPERATORS: dict[type[ast.operator], tuple[str, Callable[[float, float], float]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.Pow: ("**", math.pow),
}


def evaluate_expression(text: str, names: Mapping[str, float] = {}) -> float:
    """Evaluate a number expression of at most `MAX_CHARACTERS` characters, nested at most `MAX_NESTING` deep.

    Digits, ``+ - * / ** ( )``, the functions ``sqrt sin cos tan asin acos atan exp log`` (natural, radians), the
    constants ``pi e deg`` and further `names`, with Python's precedence: ``-2**2`` is −4, ``2**3**2`` is 512. Every
    step is a float operation, for integers as well: ``9**9**9**9`` overflows at once. Raises `SpecError` for anything
    else, and where a final or intermediate result is not a finite real number.
    """
    if len(text) > MAX_CHARACTERS:
        _refuse(text, f"has {len(text)} characters, at most {MAX_CHARACTERS} are allowed")
    words = text.strip(" \t")
    if not words:
        _refuse(words, "is empty")
    for word in _WORDS.finditer(words):
        if word["other"]:
            hint = _HINTS.get(word["other"], "decimals have a point" if re.search(r"\d,\d", words) else "")
            _refuse(words, f"unexpected {word['other']!r}{hint and ', '}{hint}")
        if word["name"] and not any(word["name"] in known for known in (FUNCTIONS, CONSTANTS, names)):
            _refuse(words, _unknown(word["name"], names))
    parentheses = max(accumulate((sign == "(") - (sign == ")") for sign in words))
    try:
        # Python's own parser is recursive: the signs alone are few enough for it.
        tree = ast.parse(words, mode="eval").body if parentheses <= MAX_NESTING else None
    except SyntaxError:
        missing = f": {'()'[words.count('(') > words.count(')')]} is missing" * (words.count("(") != words.count(")"))
        factors = re.search(r"(?:\b[\d.]+|\))[ \t]*[A-Za-z(]|\)[ \t]*\d", words)
        missing = missing or ": a product needs *" * bool(factors)
        _refuse(words, f"is not a complete expression{missing}")
    if tree is None or parentheses + _nesting(tree) > MAX_NESTING:
        _refuse(words, f"is nested more than {MAX_NESTING} deep")
    return _value(tree, words, names)


def degrees_in(text: str, names: Mapping[str, float]) -> str:
    """Say which angle of a valid expression is probably meant in degrees, if one is."""
    calls = re.finditer(r"\b(?:sin|cos|tan)\([ \t]*([^()]*?)[ \t]*\)", text)
    doubts = (doubted_angle(call[0], call[1], evaluate_expression(call[1], names)) for call in calls)
    return next(filter(None, doubts), "")


def doubted_angle(what: str, text: str, angle: float) -> str:
    """Say that an angle, the value of an expression, is probably meant in degrees, or nothing.

    It is above 2π, and a whole number or a half, or, if it is computed, up to 12 parts of some turns of 360.
    """
    is_simple = re.fullmatch(r"[\w.]+", text) is not None
    parts = [2 * angle] if is_simple else [number * angle / 360 for number in range(3, 13)]  # of a full turn
    if abs(angle) > 2 * math.pi and any(part and abs(part - round(part)) <= 1e-9 * abs(part) for part in parts):
        return f"{what} is of {angle:g} radians: {text if is_simple else f'({text})'}*deg is {angle:g} degrees"
    return ""


def factor_of_radians(text: object) -> str:
    """Return `deg` or `pi` if an angle is a multiple of it, beside what it does in functions; else nothing."""
    outside = re.sub(r"\w+\([^()]*\)", "1", text) if isinstance(text, str) else ""
    return found[2] if (found := re.search(r"(^|[^/\s])\s*\b(deg|pi)\b", outside)) else ""


def names_in(text: str) -> list[str]:
    """Return the names of numbers in an expression, well-formed or not."""
    found = (match["name"] for match in _WORDS.finditer(text[:MAX_CHARACTERS]))
    return [name for name in found if name and name not in FUNCTIONS and name not in CONSTANTS]


def _unknown(word: str, names: Mapping[str, float]) -> str:
    import difflib

    if word in _WORD_HINTS:
        return f"unknown name {word!r}, {_WORD_HINTS[word]}"
    known = (*FUNCTIONS, *CONSTANTS, *names)
    alike = [name for name in known if name.lower() == word.lower()]
    if likely := alike or difflib.get_close_matches(word, names, n=1):
        return f"unknown name {word!r}, did you mean {likely[0]}?"
    if product := next((f"{a}*{word[len(a) :]}" for a in names if word.startswith(a) and word[len(a) :] in known), ""):
        return f"unknown name {word!r}, did you mean {product}?"
    return f"unknown name {word!r}, known are {', '.join(known[:30])}" + ", ..." * (len(known) > 30)


def _nesting(node: ast.AST) -> int:
    """Return how deep powers and signs are nested."""
    is_counted = isinstance(node, ast.UnaryOp) or (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow))
    return is_counted + max(map(_nesting, ast.iter_child_nodes(node)), default=0)


def _value(node: ast.expr, text: str, names: Mapping[str, float]) -> float:
    match node:
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            word, function = _OPERATORS[type(sign)]
            return _step(text, word, function, _value(left, text, names), _value(right, text, names))
        case ast.Constant(value=int() | float() as number):
            return _step(text, "", float, number)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            value = _value(operand, text, names)
            return -value if isinstance(sign, ast.USub) else value
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return _step(text, name, FUNCTIONS[name], _value(argument, text, names))
        case ast.Name(id=name) if name not in FUNCTIONS:
            return CONSTANTS[name] if name in CONSTANTS else names[name]
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
            _refuse(text, f"{name} needs one number in parentheses")
        case ast.Call():
            _refuse(text, "only functions can stand before '(', a product needs '*'")
        case _:
            _refuse(text, "may hold numbers, + - * / ** ( ), functions and constants only")


def _step(text: str, word: str, function: Callable[..., float], *operands: float) -> float:
    """Apply one operator or function; the error names the one without a finite real result."""
    reason = "is not finite"
    try:
        result = function(*operands)
        if math.isfinite(result):
            return result
    except (ArithmeticError, ValueError) as error:
        reasons = {ZeroDivisionError: "divides by zero", ValueError: "is not a finite real number"}
        reason = reasons.get(type(error), reason)
    *before, last = [f"({x:g})" if x < 0 or word in FUNCTIONS else f"{x:g}" for x in operands]
    _refuse(text, f"{''.join(before)}{word}{last} {reason}")


def _refuse(text: str, reason: str) -> NoReturn:
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    raise SpecError(f"expression {shown!r}: {reason}")
