"""Run every `bench_*.py` beside this file, or those named as arguments, and print one table of ratios."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

WIDTH = 72


def main() -> None:
    """Print a line for each measurement as it is made; a missed budget is shown, not an error."""
    names = sys.argv[1:] or sorted(path.stem for path in Path(__file__).parent.glob("bench_*.py"))
    print(f"{'what, beside what':{WIDTH}} {'ms':>9} {'beside':>9} {'ratio':>7} {'budget':>7}")
    for name in names:
        for row in importlib.import_module(f"{__package__}.{name}").rows():
            budget = "" if row.budget is None else f"{row.budget:.2f}"
            missed = row.budget is not None and row.ratio > row.budget
            print(
                f"{row.what:{WIDTH}} {row.measured * 1e3:9.1f} {row.beside * 1e3:9.1f} {row.ratio:7.3f} {budget:>7}"
                f"{'  over budget' if missed else ''}",
                flush=True,
            )


if __name__ == "__main__":
    main()
