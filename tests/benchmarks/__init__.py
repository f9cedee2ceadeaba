"""Measurements beside a peer or a floor in the same run; `python -m tests.benchmarks` prints them all.

A module `bench_*.py` has a function `rows() -> Iterable[Row]`.
"""

import gc
import math
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

_scale = 1.0


@dataclass(frozen=True)
class Row:
    """One line of the table: medians of seconds, or numbers whose `unit` says of what, and the median of their ratios.

    `budget` is what the ratio should not exceed, `apart` the largest difference between both results in units of the
    model, unless they are compared exactly or not at all. `missing` says why there is no peer; then numbers are NaN.
    """

    what: str
    measured: float
    beside: float
    ratio: float
    budget: float | None = None
    apart: float | None = None
    unit: str = "s"
    missing: str = ""


def has_avx512() -> bool:
    """Whether numpy found AVX-512 in this processor, which makes exponentials several times as fast."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return any(name.startswith(("AVX512", "X86_V4")) for name in found)


@contextmanager
def scaled(scale: float) -> Iterator[None]:
    """Measure with sizes that are a fraction of what they are named after, and once: to see that all still works."""
    global _scale
    before, _scale = _scale, scale
    try:
        yield
    finally:
        _scale = before


def sized(count: int) -> int:
    """How many points, faces or steps are measured in place of `count`."""
    return max(4, round(count * _scale))


def segments(count: int) -> int:
    """The same for segments of an edge, of which meshes have the square."""
    return max(2, round(count * math.sqrt(_scale)))


def coarser(tolerance: float) -> float:
    """The same for a tolerance, as a part of the diagonal, to which the number of triangles is nearly inverse."""
    coarsest = 0.05  # tolerance, as a part of the diagonal, that is coarse enough to see that all still works
    return tolerance if _scale == 1 else min(coarsest, tolerance / _scale)


def paired(
    what: str,
    measured: Callable[[], object],
    beside: Callable[[], object],
    *,
    budget: float | None = None,
    runs: int = 7,
    allowance: float = 0.0,
    apart: float | None = None,
) -> Row:
    """Time two functions in turn, `runs` times each after a first time that is not counted.

    The ratio leaves out `allowance` seconds of `measured`.
    """
    pairs = []
    for _ in range(1 + runs if _scale == 1 else 1):
        seconds = []
        for run in (measured, beside):
            if _scale == 1:
                gc.collect()
            start = time.perf_counter()
            run()
            seconds.append(time.perf_counter() - start)
        pairs.append(seconds)
    counted = pairs[1:] or pairs
    ours, theirs = (statistics.median(seconds) for seconds in zip(*counted, strict=True))
    ratio = statistics.median((first - allowance) / second for first, second in counted)
    return Row(what, ours, theirs, ratio, budget, apart)


def compared(
    what: str,
    ours: Callable[[], np.ndarray],
    peer: Callable[[], Callable[[], np.ndarray]],
    *,
    within: float,
    budget: float | None = None,
) -> Row:
    """Compare the result with a peer's, from which it may differ by `within`, and time both.

    `peer` imports the library, and returns the function that is timed; a line says so where it is not installed.
    """
    try:
        theirs = peer()
    except ImportError as error:
        return missing(what, error)
    apart = float(np.abs(ours() - theirs()).max())
    assert apart <= within, f"{what}: results are {apart:g} apart"
    return paired(what, ours, theirs, budget=budget, apart=apart)


def missing(what: str, error: ImportError) -> Row:
    """A line for a peer that could not be imported."""
    return Row(what, math.nan, math.nan, math.nan, missing=f"not installed: {error.name or error}")
