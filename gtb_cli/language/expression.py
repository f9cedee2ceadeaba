"""Numbers written as expressions, such as ``"sqrt(2)/4"``: a whitelist over `ast`, evaluated in floats."""

import ast
import math
import re
from collections.abc import Callable, Mapping
from typing import NoReturn

from gtb_cli.errors import SpecError

MAX_CHARACTERS = 256  # longest expression, in characters
MAX_NESTING = 32  # deepest nesting of parentheses, powers and signs
FUNCTIONS = {function.__name__: function for function in (math.sqrt, math.sin, math.cos, math.tan, math.exp, math.log)}
# Constants known in every expression; ``deg`` is a degree in radians
CONSTANTS = {"pi": math.pi, "e": math.e, "deg": math.pi / 180}
NO_NAMES: Mapping[str, float] = {}
# Words are checked before Python's parser sees the text, as it would also accept 0x1f, 1_000, 2j, keywords and strings.
_WORDS = re.compile(
    r"[ \t]*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)|(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"|(?P<sign>\*\*|//|[-+*/()]))"
)
_OPERATORS: dict[type[ast.operator], tuple[str, Callable[[float, float], float]]] = {
    ast.Add: ("+", lambda a, b: a + b),
    ast.Sub: ("-", lambda a, b: a - b),
    ast.Mult: ("*", lambda a, b: a * b),
    ast.Div: ("/", lambda a, b: a / b),
    ast.Pow: ("**", math.pow),
}


def evaluate_expression(text: str, names: Mapping[str, float] = NO_NAMES) -> float:
    """Evaluate a number expression.

    Digits, ``+ - * / ** ( )``, the functions ``sqrt sin cos tan exp log`` (natural, radians) and the constants
    ``pi e deg``, with Python's precedence: ``-2**2`` is −4, ``2**3**2`` is 512.

    Parameters
    ----------
    text : str
        At most `MAX_CHARACTERS` characters, nested at most `MAX_NESTING` deep.
    names : mapping of str to float
        Further names, other than functions, constants and Python keywords.

    Raises
    ------
    SpecError
        The text is anything else, or a final or intermediate result is not a finite real number.

    Notes
    -----
    Every step is a float operation, for integers as well: ``9**9**9**9`` overflows at once, and ``2**0.5`` and
    ``sqrt(2)`` differ by at most one rounding. ``sqrt(2)/4`` takes about 10 microseconds.
    """
    if len(text) > MAX_CHARACTERS:
        _refuse(text, f"has {len(text)} characters, at most {MAX_CHARACTERS} are allowed")
    words = text.strip(" \t")
    _check_words(words, names)
    try:
        tree = ast.parse(words, mode="eval")
    except SyntaxError:
        _refuse(words, "is not a complete expression")
    return _value(tree.body, words, names)


def names_in(text: str) -> list[str]:
    """The names of numbers in an expression, well-formed or not."""
    found = (match["name"] for match in _WORDS.finditer(text[:MAX_CHARACTERS]))
    return [name for name in found if name and name not in FUNCTIONS and name not in CONSTANTS]


def _check_words(text: str, names: Mapping[str, float]) -> None:
    """Refuse words outside the language, and nesting too deep for a recursive reader."""
    if not text:
        _refuse(text, "is empty")
    position = 0
    outer: list[tuple[int, int]] = []  # base and depth outside each open parenthesis
    base = depth = 0  # depths of the innermost parenthesis, and of the current power or sign in it
    operand = False  # whether the word before ends an operand, so that + and - are not signs
    while position < len(text):
        match = _WORDS.match(text, position)
        if match is None:
            rest = text[position:].lstrip(" \t")
            _refuse(text, f"unexpected {rest[:1]!r}")
        position = match.end()
        kind = match.lastgroup or ""
        word = match[kind]
        if kind == "name" and not any(word in known for known in (FUNCTIONS, CONSTANTS, names)):
            _refuse(text, _unknown(word, names))
        if word == "(":
            outer.append((base, depth))
            base = depth = depth + 1
        elif word == ")":
            if not outer:
                _refuse(text, "')' without '('")
            base, depth = outer.pop()
        elif word == "//":
            _refuse(text, "unexpected '//'")
        elif word == "**" or (kind == "sign" and not operand):
            depth += 1
        elif kind == "sign":
            depth = base
        operand = kind != "sign" or word == ")"
        if depth > MAX_NESTING:
            _refuse(text, f"is nested more than {MAX_NESTING} deep")
    if outer:
        _refuse(text, "'(' is never closed")


def _unknown(word: str, names: Mapping[str, float]) -> str:
    import difflib

    likely = difflib.get_close_matches(word, names, n=1)
    if likely:
        return f"unknown name {word!r}, did you mean {likely[0]}?"
    known = (*FUNCTIONS, *CONSTANTS, *names)
    return f"unknown name {word!r}, known are {', '.join(known[:30])}" + ", ..." * (len(known) > 30)


def _value(node: ast.expr, text: str, names: Mapping[str, float]) -> float:
    match node:
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            sign, function = _OPERATORS[type(operator)]
            return _step(text, sign, function, _value(left, text, names), _value(right, text, names))
        case ast.Constant(value=int() | float() as number):
            return _step(text, "", float, number)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            value = _value(operand, text, names)
            return -value if isinstance(sign, ast.USub) else value
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return _step(text, name, FUNCTIONS[name], _value(argument, text, names))
        case ast.Name(id=name) if name in CONSTANTS or name in names:
            return CONSTANTS[name] if name in CONSTANTS else names[name]
        case ast.Name(id=name):
            _refuse(text, f"{name} needs a number in parentheses")
        case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
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
    except ZeroDivisionError:
        reason = "divides by zero"
    except OverflowError:
        pass
    except ValueError:
        reason = "is not a finite real number"
    else:
        if math.isfinite(result):
            return result
    *before, last = [f"({x:g})" if x < 0 or word in FUNCTIONS else f"{x:g}" for x in operands]
    _refuse(text, f"{''.join(before)}{word}{last} {reason}")


def _refuse(text: str, reason: str) -> NoReturn:
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    raise SpecError(f"expression {shown!r}: {reason}")
