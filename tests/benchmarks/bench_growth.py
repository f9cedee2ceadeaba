"""How time and memory of whole commands grow with knots, patches and faces: a table of sizes, and fitted exponents.

Processor time counts, of the command and what it starts, so that a busy machine disturbs little.
"""

import json
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks import Row
from tests.benchmarks.bench_startup import REPOSITORY


def rows() -> Iterator[Row]:
    """Each command at each size, beside the smallest one, and then the exponent of its growth."""
    knot_counts = (10, 100, 1000, 2500, 5000)
    patch_counts = (1, 10, 100, 1000, 5000)
    faces = (1_000, 10_000, 100_000, 1_000_000, 5_000_000, 20_000_000)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        knots, patches = scattered(place), strips(place)
        yield from growth(
            "gtb mesh -n 8", "knots", knot_counts, lambda n: ["mesh", knots(n), "-n", 8, "-o", place / "x.obj"]
        )
        yield from growth(
            "gtb mesh --tolerance 1%",
            "knots",
            knot_counts,
            lambda n: ["mesh", knots(n), "--tolerance", "1%", "-o", place / "x.obj"],
        )
        for name in ("check", "info", "decompose"):
            yield from growth(f"gtb {name}", "knots", knot_counts, lambda n, name=name: [name, knots(n)])  # type: ignore[misc]
        yield from growth(
            "gtb mesh -n 2", "patches", patch_counts, lambda n: ["mesh", patches(n), "-n", 2, "-o", place / "x.obj"]
        )
        yield from growth(
            "gtb degenerate -x 5 -n 1",
            "knots",
            knot_counts,
            lambda n: ["degenerate", knots(n), "-x", 5, "-n", 1, "-o", place / f"x-{n}"],
        )
        yield from growth("gtb info", "patches", patch_counts, lambda n: ["info", patches(n)])
        yield from growth(
            "gtb check (5,000 take minutes, and are left out)",
            "patches",
            patch_counts[:-1],
            lambda n: ["check", patches(n)],
        )
        pentagon = REPOSITORY / "specs" / "pentagon.toml"
        for kind in ("obj", "ply", "stl", "glb"):
            yield from growth(
                f"gtb mesh -f {kind}",
                "faces",
                faces,
                lambda n, kind=kind: [  # type: ignore[misc]
                    *("mesh", pentagon, "-n", round(math.sqrt(n / 5)), "--max-faces", 2 * n, "-o", place / f"x.{kind}")
                ],
            )


def growth(what: str, unit: str, sizes: tuple[int, ...], arguments: Callable[[int], list[object]]) -> Iterator[Row]:
    """A line for each size, with its peak of memory, and one for the exponent of the time beyond the smallest's."""
    # Exponent of n log n over these ranges, with room for caches that are too small for the largest
    linearithmic = 1.25
    fitted = 3  # sizes, the largest ones, to which the exponent is fitted
    threshold = 1.25  # time, in units of the smallest size's, from which on growth is told from the time of starting
    times: list[float] = []
    for size in sizes:
        seconds, megabytes = cost(arguments(size))
        times.append(seconds)
        yield Row(
            f"{what}, {size:,} {unit}, {megabytes:,.0f} MB, beside {sizes[0]:,}", seconds, times[0], seconds / times[0]
        )
    grown = [(n, t - times[0]) for n, t in zip(sizes, times, strict=True) if t > threshold * times[0]][-fitted:]
    exponent = 0.0
    if len(grown) > 1:
        exponent = float(np.polyfit(*np.log(np.array(grown)).T, 1)[0])
    yield Row(f"{what}: exponent of time in {unit}", times[-1], times[0], exponent, linearithmic)


def cost(arguments: list[object]) -> tuple[float, float]:
    """Seconds of processor time, and megabytes at the peak, of a whole command that must succeed."""
    command = [sys.executable, "-m", "gtb_cli", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    quiet = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
    process = os.posix_spawn(sys.executable, command, environment, file_actions=quiet)
    _, status, used = os.wait4(process, 0)
    code = os.waitstatus_to_exitcode(status)
    if code:
        raise RuntimeError(f"exit status {code}: {' '.join(command)}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def scattered(folder: Path) -> Callable[[int], Path]:
    """Specs of a wavy surface with random knots, lifted at random."""

    def spec(count: int) -> Path:
        path = folder / f"knots-{count}.json"
        if not path.exists():
            random = np.random.default_rng(count)
            knots = random.random((count, 2))
            height = 0.2 * np.sin(6 * knots[:, 0]) * np.cos(5 * knots[:, 1])
            text = {
                "knots": knots.tolist(),
                "control_points": np.column_stack([knots, height]).tolist(),
                "lifting": random.random(count).tolist(),
            }
            path.write_text(json.dumps(text), encoding="utf-8")
        return path

    return spec


def strips(folder: Path) -> Callable[[int], Path]:
    """Specs of a wavy strip of bilinear patches, each joined to the next one."""

    def spec(count: int) -> Path:
        path = folder / f"patches-{count}.json"
        if not path.exists():
            patches = []
            for k in range(count):
                corners = [[x, y, math.sin(0.1 * x + y)] for y in (0, 1) for x in (k, k + 1)]
                patches.append({"knots": [[0, 0], [1, 0], [0, 1], [1, 1]], "control_points": corners})
            path.write_text(json.dumps({"patches": patches}), encoding="utf-8")
        return path

    return spec
