"""`-x`, `--lifting`, `--merge` and `--steps`: the options that ask for a degeneration or a knot limit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from gtb_cli.shell.gathering import gathered, option
from gtb_cli.shell.options import numbers_of

if TYPE_CHECKING:
    from gtb_cli.plots.panels import Approach


def xs_of(texts: Sequence[str]) -> tuple[float, ...]:
    """Read several x: each a positive number, a number expression, or inf."""
    xs = tuple(math.inf if text.strip() == "inf" else numbers_of(text, [text])[0] for text in texts)
    if negative := [text for text, x in zip(texts, xs, strict=True) if x < 0]:
        raise ValueError(f"{negative[0]!r} is negative")
    return xs


def lifting_from(text: str) -> tuple[float, ...] | int:
    """Read lifting values, or the index of a knot."""
    if not text.strip().startswith("knot:"):
        return numbers_of(text)
    match = re.fullmatch(r"\s*knot:(\d{1,9})\s*", text, re.ASCII)
    if not match:
        raise ValueError(f"{text!r}: expected the index of a knot, such as knot:3")
    return int(match[1])


def moves_of(texts: Sequence[str]) -> dict[int, int]:
    """Read pairs K:Q."""
    moves: dict[int, int] = {}
    for text in texts:
        match = re.fullmatch(r"\s*(\d{1,9})\s*:\s*(\d{1,9})\s*", text, re.ASCII)
        if not match:
            raise ValueError(f"{text!r}: expected two knot indices, such as 3:1")
        k, q = int(match[1]), int(match[2])
        if moves.setdefault(k, q) != q:
            raise ValueError(f"knot {k} cannot move to both {moves[k]} and {q}")
    return moves


def _approach(x: Any, lifting: Any, merge: Any, steps: Any) -> Approach:
    from gtb_cli.plots.panels import Approach

    return Approach(x, lifting, merge, steps)


x_option = option("-x, --x X", xs_of, multiple=True)
heights_option = option("--lifting L,…", lifting_from)
merge_option = option("--merge K:Q", moves_of, multiple=True)
steps_option = option("--steps S,…", numbers_of)
limit_options = gathered(
    "limit",
    _approach,
    x_option(help="Sequence: x of a degeneration."),
    heights_option(help="A lifting value for each knot, or knot:K, as for degenerate."),
    merge_option(help="Sequence: knot K moves to knot Q."),
    steps_option(help="Sequence: fractions of that way."),
)
