"""Colours that print, and that readers who see fewer colours can tell apart."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray

LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Of curves, one after the other: those of Okabe and Ito, but for the yellow, which is too light for a line."""

DASHES = ("-", "--", ":", "-.")
"""Of curves, when all colours were used."""

PATCHES = ("#8FBCD9", "#F2B48A", "#86CDB5", "#E3B5CE", "#F1CF85", "#AEDBF3", "#C9C9C9", "#E9E39A")
"""Of patches and cells: lighter ones of the same family."""

SURFACE = PATCHES[0]
INK, FAINT, OPEN, NET = "#222222", "#9A9A9A", "#D6001C", "#404A54"

TWO_SIDED = ("PuOr", "RdBu")
"""Maps that have a middle, which is 0."""

TRIMMED = 2.0
"""Percent of the values at either end that the ends of a scale may leave out: curvature often is infinite."""


def line_style(index: int) -> tuple[str, str]:
    """Colour and dashes of the curve with this number."""
    turn, place = divmod(index, len(LINES))
    return LINES[place], DASHES[turn % len(DASHES)]


def patch_colour(index: int) -> str:
    """Colour of the patch with this number."""
    return PATCHES[index % len(PATCHES)]


def rgb(colour: str) -> FloatArray:
    """(3,) red, green and blue from 0 to 1 of ``#rrggbb``."""
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def scale_of(values: FloatArray, name: str) -> tuple[float, float]:
    """Ends of the scale on which numbers are shown: most of them are between, and 0 in the middle of a two-sided one.

    Numbers that differ by rounding only get a scale around them.
    """
    low, high = np.percentile(values, [TRIMMED, 100 - TRIMMED]).tolist()
    if name in TWO_SIDED:
        high = max(abs(low), abs(high))
        low = -high
    size = float(np.abs(values).max())
    if high - low <= 1e-9 * size or size == 0:
        middle, half = (low + high) / 2, 0.1 * size or 1.0
        return middle - half, middle + half
    return low, high
