"""Measurements beside a peer or a floor in the same process; `python -m tests.benchmarks` prints them all.

A module `bench_*.py` has a function `rows() -> list[Row]`.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    what : str
        What is measured, and beside what.
    measured, beside : float
        Seconds; medians.
    ratio : float
        Median of `measured / beside` over the pairs of runs.
    budget : float or None
        What the ratio should not exceed; None where the line is for information.
    """

    what: str
    measured: float
    beside: float
    ratio: float
    budget: float | None = None


def paired(
    what: str,
    measured: Callable[[], object],
    beside: Callable[[], object],
    *,
    budget: float | None = None,
    runs: int = 7,
) -> Row:
    """Time two functions in turn, `runs` times each after a first time that is not counted."""
    pairs = []
    for _ in range(runs + 1):
        seconds = []
        for run in (measured, beside):
            gc.collect()
            start = time.perf_counter()
            run()
            seconds.append(time.perf_counter() - start)
        pairs.append((seconds[0], seconds[1]))
    pairs = pairs[1:]
    return Row(
        what,
        statistics.median(first for first, _ in pairs),
        statistics.median(second for _, second in pairs),
        statistics.median(first / second for first, second in pairs),
        budget,
    )
