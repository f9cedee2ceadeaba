"""Sequences of meshes with their distances from the limit, beside the meshes alone."""

from collections.abc import Callable, Iterator

import numpy as np

from gtb_cli.sequences.sequence import MeshSequence, degeneration, knot_sequence
from gtb_cli.theory.patch import Patch
from tests.benchmarks import Row, paired, sized
from tests.benchmarks.bench_evaluate import spec


def rows() -> Iterator[Row]:
    steps = 20
    example, other = spec("example-4.4"), spec("example-4.2")
    sweep = np.geomspace(1, 1e6, sized(steps)).tolist()
    for what, x, runs in (("x = 5, 100, 600", [5.0, 100.0, 600.0], 3), (f"{steps} steps from 1 to 1e6", sweep, 1)):
        yield with_distances(
            f"Example 4.4 -n 8, {what}",
            lambda distances, x=x: degeneration(example, x, resolution=8, distances=distances),  # type: ignore[misc]
            runs,
        )
    yield with_distances("Example 4.2 -n 8, 3 steps of a knot", lambda distances: moving(other, distances), 3)


def with_distances(what: str, sequence: Callable[[bool], MeshSequence], runs: int) -> Row:
    """Time all members of a sequence, made one by one."""
    budget = 2.0  # distances take as long as the sequence itself

    cells: dict[bool, int] = {}

    def consume(distances: bool) -> None:
        cells[distances] = sum(len(member.mesh.cells) for member in sequence(distances))

    row = paired(
        f"{what}, distances beside none", lambda: consume(True), lambda: consume(False), budget=budget, runs=runs
    )
    assert cells[True] == cells[False]
    return row


def moving(patch: Patch, distances: bool) -> MeshSequence:
    return knot_sequence(patch, {3: 1}, [0.0, 0.4, 0.8], resolution=8, distances=distances)
