"""Sequences of meshes with their distances from the limit, beside the meshes alone."""

from collections import deque
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from gtb_cli.sequences.sequence import MeshSequence, degeneration, knot_sequence
from tests.benchmarks import Row, paired, sized
from tests.benchmarks.bench_evaluate import spec


def rows() -> Iterator[Row]:
    steps = sized(20)
    example, sweep = spec("example-4.4"), np.geomspace(1, 1e6, steps).tolist()
    moving = partial(knot_sequence, spec("example-4.2"), {3: 1}, [0.0, 0.4, 0.8])
    sequences: list[tuple[str, Callable[..., MeshSequence], int]] = [
        ("Example 4.4 -n 8, x = 5, 100, 600", partial(degeneration, example, [5.0, 100.0, 600.0]), 3),
        (f"Example 4.4 -n 8, {steps} steps from 1 to 1e6", partial(degeneration, example, sweep), 1),
        ("Example 4.2 -n 8, 3 steps of a knot", moving, 3),
    ]
    for what, make, runs in sequences:
        yield paired(
            f"{what}, distances beside none",
            lambda make=make: deque(make(resolution=8), maxlen=0),  # type: ignore[misc]
            lambda make=make: deque(make(resolution=8, distances=False), maxlen=0),  # type: ignore[misc]
            budget=2.0,  # distances take as long as the sequence itself
            runs=runs,
        )
