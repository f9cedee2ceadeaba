"""Whole commands with a thread for each processor, beside one thread: the same bytes, sooner."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.benchmarks import Row, coarser, paired, segments
from tests.benchmarks.bench_startup import REPOSITORY, process

BUDGET = 1 / 1.7
"""On two processors; more should need less. Starting Python, numpy and click, and reading the spec, are not shared."""


def rows() -> Iterator[Row]:
    yield of_threads("-n 1000", "bicubic", "-n", segments(1000))
    yield of_threads("-n 577, irrational knots", "hexagon", "-n", segments(577))
    yield of_threads("--tolerance 0.0002%", "pentagon", "--tolerance", f"{100 * coarser(2e-6)}%")


def of_threads(what: str, name: str, *options: object) -> Row:
    """One command both ways; processes have all processors, whatever this one limits itself to."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "all.obj", Path(folder) / "one.obj"]
        spec = REPOSITORY / "specs" / f"{name}.toml"
        runs = [
            process("-m", "gtb_cli", "mesh", "-q", spec, *options, "--threads", threads, "-o", path)
            for threads, path in zip((0, 1), paths, strict=True)
        ]
        for run in runs:
            run()
        assert paths[0].read_bytes() == paths[1].read_bytes()
        return paired(f"gtb mesh {what} of the {name} to OBJ, all threads beside one", *runs, budget=BUDGET, runs=3)
