"""Run every `bench_*.py` beside this file, or those named as arguments, and print one table of ratios."""

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.benchmarks import Row, has_avx512

WIDTH = 78


def main(names: Sequence[str]) -> None:
    """Print a line for each measurement as it is made; a missed budget is shown, not an error."""
    names = names or sorted(path.stem for path in Path(__file__).parent.glob("bench_*.py"))
    print(f"{os.cpu_count()} processors, {'with' if has_avx512() else 'without'} AVX-512, numpy {np.__version__}")
    print(f"{'what, beside what':{WIDTH}} {'ms':>9} {'beside':>9} {'ratio':>7} {'budget':>7} {'apart':>7}")
    for name in names:
        for row in importlib.import_module(f"{__package__}.{name}").rows():
            print(line(row), flush=True)


def line(row: Row) -> str:
    """The columns of one measurement; counts say what they count."""
    if row.missing:
        return f"{row.what:{WIDTH}} {row.missing}"
    factor, unit = (1e3, "") if row.unit == "s" else (1, f"  {row.unit}")
    digits = 1 if row.unit == "s" else 0
    budget = "" if row.budget is None else f"{row.budget:.2f}"
    apart = "" if row.apart is None else f"{row.apart:.0e}"
    missed = "  over budget" if row.budget is not None and row.ratio > row.budget else ""
    numbers = f"{row.measured * factor:9.{digits}f} {row.beside * factor:9.{digits}f} {row.ratio:7.3f}"
    return f"{row.what:{WIDTH}} {numbers} {budget:>7} {apart:>7}{unit}{missed}".rstrip()


if __name__ == "__main__":
    main(sys.argv[1:])
