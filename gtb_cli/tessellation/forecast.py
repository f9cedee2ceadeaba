"""How many cells a tolerance will need, before they are made."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gtb_cli.arrays import FloatArray

COARSER = (256, 64)
"""How many times larger the tolerances of two trials are: as cells are halved, powers of four have like patterns."""

DOUBTFUL = 0.4
"""Part of the cells that are allowed from which on an estimate is checked by trials: on ten specs it was 0.47 to 0.88
of what there came to be."""

WORTH_TRIALS = 1 << 18
"""Cells allowed from which on a late refusal costs more than trials."""

FORESEEN = 1.15
"""How many times the cells that are allowed trials must foresee, to give up: on eleven specs it was 0.6 to 1.11
of what there came to be."""


def cells_needed(errors: FloatArray) -> float:
    """How many cells there will be, if errors fall with the square of the width, which is halved.

    (1 or 3, k) errors of the sides, in units of the tolerance. A triangle is taken to bend in two directions only as
    far as its straightest side bends.
    """
    parts = np.exp2(np.ceil(np.log2(np.maximum(errors, 1.0)) / 2))
    return float((parts.max(axis=0) * (parts.min(axis=0) if len(parts) == 3 else 1.0)).sum())


def cells_foreseen(count: Callable[[int], int]) -> float:
    """How many cells there will be, from those that a `count` finds for the tolerance times both of `COARSER`.

    Most fall with the tolerance; the surplus at creases and edges, what is more than that between both trials, with
    its square root.
    """
    few, many = map(count, COARSER)
    ratio = COARSER[0] // COARSER[1]
    surplus = max(ratio * few / many - 1, 0.0)
    halvings = round(math.log(COARSER[1], ratio))
    return float(COARSER[1] * many / math.prod(1 + surplus / 2**k for k in range(1, halvings + 1)))
