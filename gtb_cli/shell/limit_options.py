"""Options that ask for a degeneration or a knot limit: x, lifting, merge and steps."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import click

from gtb_cli.shell.faults import in_options
from gtb_cli.shell.gathering import gathered
from gtb_cli.shell.options import evaluated, numbers_of

if TYPE_CHECKING:
    from gtb_cli.plots.panels import Approach


def x_of(ctx: click.Context, param: click.Parameter, value: str | tuple[str, ...] | None) -> object:
    """Read one x or several: each a positive number, a number expression, or inf."""
    if value is None:
        return None
    if isinstance(value, tuple):
        return tuple(x_of(ctx, param, one) for one in value)
    x = math.inf if value.strip() == "inf" else evaluated(ctx, param, value, [value])[0]
    if x < 0:
        raise click.BadParameter(f"{value!r} is negative", ctx, param)
    return x


def lifting_of(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | int | None:
    """Read lifting values, or the index of a knot."""
    text = (value or "").strip()
    if not text.startswith("knot:"):
        return numbers_of(ctx, param, value)
    match = re.fullmatch(r"knot:(\d{1,9})", text, re.ASCII)
    if not match:
        raise click.BadParameter(f"{value!r}: expected the index of a knot, such as knot:3", ctx, param)
    return int(match[1])


def moves_of(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> dict[int, int]:
    """Read pairs K:Q."""
    moves: dict[int, int] = {}
    for text in value:
        match = re.fullmatch(r"\s*(\d{1,9})\s*:\s*(\d{1,9})\s*", text, re.ASCII)
        if not match:
            raise click.BadParameter(f"{text!r}: expected two knot indices, such as 3:1", ctx, param)
        k, q = int(match[1]), int(match[2])
        if moves.setdefault(k, q) != q:
            raise click.BadParameter(f"knot {k} cannot move to both {moves[k]} and {q}", ctx, param)
    return moves


def refuse_limit(limit: Approach, path: str) -> None:
    """Refuse the options of a limit if the input is not a spec."""
    if limit.given:
        option = in_options(f"`{limit.given[0]}`")
        raise click.UsageError(f"{option} is for specs, and {path} is not a spec")


def _approach(
    x: tuple[float, ...],
    lifting: tuple[float, ...] | int | None,
    merge: dict[int, int],
    steps: tuple[float, ...] | None,
) -> Approach:
    from gtb_cli.plots.panels import Approach

    return Approach(x, lifting, merge, steps)


limit_options = gathered(
    "limit",
    _approach,
    click.option("-x", "--x", callback=x_of, multiple=True, metavar="X", help="Sequence: x of a degeneration."),
    click.option(
        "--lifting",
        callback=lifting_of,
        metavar="L,…",
        help="A lifting value for each knot, or knot:K, as for degenerate.",
    ),
    click.option("--merge", callback=moves_of, multiple=True, metavar="K:Q", help="Sequence: knot K moves to knot Q."),
    click.option("--steps", callback=numbers_of, metavar="S,…", help="Sequence: fractions of that way."),
)
