"""How many cells a tolerance will need, before they are made."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gtb_cli.arrays import FloatArray

FIRST_CELLS = 1000
"""Cells from which on the final number is estimated, whenever there are twice as many."""

ESTIMATE_RATIO = 2.0
"""Ratio of the estimate to the cells allowed from which on refinement gives up. On eight specs, from 1,000 cells to the
end, the estimate was 0.6 to 1.0 times the final number."""

TRUSTED_SHARE = 1 / 16
"""Part of the estimate, in cells made, from which on it is trusted without `ESTIMATE_RATIO`: spikes have shown."""

TRIAL_FACTORS = (256, 64)
"""Factors by which the tolerances of two trials are larger: as cells are halved, powers of four have like patterns."""

DOUBTFUL_SHARE = 0.4
"""Part of the cells allowed from which on an estimate is checked by trials: on ten specs it was 0.47 to 0.88 of the
final number."""

WORTH_TRIALS = 1 << 18
"""Cells allowed from which on a late refusal costs more than trials."""

TRIAL_RATIO = 1.15
"""Ratio of what trials foresee to the cells allowed from which on refinement gives up: on eleven specs they foresaw 0.6
to 1.11 times the final number."""


class Forecast:
    """Whether a mesh that is being refined will have too many cells.

    Parameters
    ----------
    max_cells : int
    count : callable
        How many cells a tolerance takes that is larger by a factor.
    """

    def __init__(self, max_cells: int, count: Callable[[int], int]) -> None:
        self.max_cells, self.count = max_cells, count
        self.estimated, self.tried = 0, False

    def is_due(self, cells: int) -> bool:
        """Whether there are enough more cells than at the last estimate."""
        return cells > max(FIRST_CELLS, 2 * self.estimated)

    def excess(self, errors: FloatArray) -> str:
        """How many cells there will be if that is too many, in words; see `cells_needed` for the errors."""
        sides, self.estimated = errors.shape
        needed = cells_needed(errors)
        ratio = 1.0 if self.estimated > TRUSTED_SHARE * needed else ESTIMATE_RATIO
        if needed > ratio * self.max_cells:
            return f"{needed:.1g}"
        is_doubtful = needed > DOUBTFUL_SHARE * self.max_cells and self.max_cells >= WORTH_TRIALS
        if sides == 3 and is_doubtful and not self.tried:
            self.tried = True
            foreseen = cells_foreseen(self.count)
            if foreseen > TRIAL_RATIO * self.max_cells:
                return f"{foreseen:.2g}"
        return ""


def cells_needed(errors: FloatArray) -> float:
    """How many cells there will be if halving the width divides errors by four.

    Given are (1 or 3, k) errors of the sides, in units of the tolerance. A triangle is taken to bend in a second
    direction only as much as its straightest side does.
    """
    parts = np.exp2(np.ceil(np.log2(np.maximum(errors, 1.0)) / 2))
    return float((parts.max(axis=0) * (parts.min(axis=0) if len(parts) == 3 else 1.0)).sum())


def cells_foreseen(count: Callable[[int], int]) -> float:
    """How many cells there will be, from those that `count` finds for the tolerance times both of `TRIAL_FACTORS`.

    Most are inversely proportional to the tolerance. The surplus at creases and edges, which is what one trial has more
    than the other one predicts, is so to its square root.
    """
    few, many = map(count, TRIAL_FACTORS)
    ratio = TRIAL_FACTORS[0] // TRIAL_FACTORS[1]
    surplus = max(ratio * few / many - 1, 0.0)
    halvings = round(math.log(TRIAL_FACTORS[1], ratio))
    return float(TRIAL_FACTORS[1] * many / math.prod(1 + surplus / 2**k for k in range(1, halvings + 1)))
