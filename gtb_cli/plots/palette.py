"""Colours that print well and that colour-blind readers tell apart, and scales of curvature; patches: `vocabulary`."""

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.vocabulary import PATCH_COLOURS

# Colours of curves, in turn: those of Okabe and Ito without the yellow, which is too light for a line
LINE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
SURFACE_COLOUR = PATCH_COLOURS[0]
INK, FAINT, OPEN, NET = "#222222", "#9A9A9A", "#D6001C", "#404A54"

TWO_SIDED = ("PuOr", "RdBu")  # colour maps with a middle, which stands for 0


def line_style(index: int) -> tuple[str, str]:
    """Return the colour and dashes of the curve with this number."""
    dashes = ("-", "--", ":", "-.")  # dashes of curves, in turn, once all colours are used
    turn, place = divmod(index, len(LINE_COLOURS))
    return LINE_COLOURS[place], dashes[turn % len(dashes)]


def patch_colour(index: int) -> str:
    """Return the colour of the patch with this number."""
    return PATCH_COLOURS[index % len(PATCH_COLOURS)]


def rgb(colour: str) -> FloatArray:
    """Return (3,) red, green and blue from 0 to 1 of ``#rrggbb``."""
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def scale_of(values: FloatArray, name: str) -> tuple[float, float]:
    """Return the ends of a scale that contains most of the numbers; 0 is in the middle of a two-sided scale.

    If the numbers differ only by rounding, the scale is centred on them.
    """
    # Percentage of the values at either end that a scale may leave out: curvature is often infinite
    trimmed_percent = 2.0
    low, high = np.percentile(values, [trimmed_percent, 100 - trimmed_percent]).tolist()
    if name in TWO_SIDED:
        high = max(abs(low), abs(high))
        low = -high
    size = float(np.abs(values).max())
    if high - low <= 1e-9 * size or size == 0:
        middle, half = (low + high) / 2, 0.1 * size or 1.0
        return middle - half, middle + half
    return low, high
