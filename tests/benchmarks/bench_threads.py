"""Whole commands with a thread for each processor, beside one thread: the same bytes, sooner."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from gtb_cli.shell.processes import processors
from tests.benchmarks import Row, paired, segments, sized
from tests.benchmarks.bench_startup import REPOSITORY, process


def rows() -> Iterator[Row]:
    yield of_threads("-n 1000", "bicubic", "-n", segments(1000))
    yield of_threads("-n 577, irrational knots", "hexagon", "-n", segments(577))
    numbers, many = np.ones(8192), np.ones(2**22)
    for what, work, times in (("exponentials", partial(np.exp, numbers), 4000), ("copies", many.copy, 32)):
        runs = (partial(shared, work, sized(times), count) for count in (processors(), 1))
        yield paired(f"{what}, all processors beside one: a floor, as nothing is serial or handed over", *runs)


def shared(work: Callable[[], object], times: int, count: int) -> None:
    """Do the same many times, in copies of this process."""
    copies = []
    for _ in range(count):
        copies.append(os.fork())
        if not copies[-1]:
            for _ in range(times // count):
                work()
            os._exit(0)
    for copy in copies:
        os.waitpid(copy, 0)


def of_threads(what: str, name: str, *options: object) -> Row:
    """One command both ways; processes have all processors, whatever this one limits itself to."""
    # On two processors; more should need less. Starting Python, numpy and click, and reading the spec, are not shared.
    budget = 1 / 1.7
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
        return paired(f"gtb mesh {what} of the {name} to OBJ, all threads beside one", *runs, budget=budget, runs=3)
