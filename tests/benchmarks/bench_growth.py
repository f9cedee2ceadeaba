"""How time and memory of whole commands grow with knots, patches and faces: a table of sizes, and fitted exponents.

Processor time counts, of the command and what it starts, so that a busy machine disturbs little.
"""

import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from tests.benchmarks import Row
from tests.benchmarks.bench_startup import inherited
from tests.shell import PENTAGON, command


def rows() -> Iterator[Row]:
    """Each command at each size, beside the smallest one, and then the exponent of its growth."""
    knot_counts = (10, 100, 1000, 2500, 5000)
    patch_counts = (1, 10, 100, 1000, 5000)
    faces = (1_000, 10_000, 100_000, 1_000_000, 5_000_000, 20_000_000)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        knots, patches, out = partial(scattered, place), partial(strips, place), ("-o", place / "x.obj")
        of_knots: dict[str, Callable[[int], list[object]]] = {
            "mesh -n 8": lambda n: ["mesh", knots(n), "-n", 8, *out],
            "mesh --tolerance 1%": lambda n: ["mesh", knots(n), "--tolerance", "1%", *out],
            "check": lambda n: ["check", knots(n)],
            "info": lambda n: ["info", knots(n)],
            "decompose": lambda n: ["decompose", knots(n)],
            "degenerate -x 5 -n 1": lambda n: ["degenerate", knots(n), "-x", 5, "-n", 1, "-o", place / f"x-{n}"],
        }
        for name, arguments in of_knots.items():
            yield from growth(f"gtb {name}", "knots", knot_counts, arguments)
        yield from growth("gtb mesh -n 2", "patches", patch_counts, lambda n: ["mesh", patches(n), "-n", 2, *out])
        yield from growth("gtb info", "patches", patch_counts, lambda n: ["info", patches(n)])
        fewer = patch_counts[:-1]  # 5,000 take minutes
        yield from growth("gtb check", "patches", fewer, lambda n: ["check", patches(n)])
        for kind in ("obj", "ply", "stl", "glb"):
            yield from growth(
                f"gtb mesh -f {kind}",
                "faces",
                faces,
                lambda n, kind=kind: [  # type: ignore[misc]
                    *("mesh", PENTAGON, "-n", round(math.sqrt(n / 5)), "--max-faces", 2 * n, "-o", place / f"x.{kind}")
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
    words = command(*arguments)
    quiet = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
    process = os.posix_spawn(words[0], words, inherited(), file_actions=quiet)
    _, status, used = os.wait4(process, 0)
    code = os.waitstatus_to_exitcode(status)
    if code:
        raise RuntimeError(f"exit status {code}: {' '.join(words)}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def scattered(folder: Path, count: int) -> Path:
    """Write a spec of a wavy surface with random knots, lifted at random."""
    random = np.random.default_rng(count)
    knots = random.random((count, 2))
    height = 0.2 * np.sin(6 * knots[:, 0]) * np.cos(5 * knots[:, 1])
    points = np.column_stack([knots, height]).tolist()
    lifting = random.random(count).tolist()
    return written(folder / "knots.json", {"knots": knots.tolist(), "control_points": points, "lifting": lifting})


def strips(folder: Path, count: int) -> Path:
    """Write a spec of a wavy strip of bilinear patches, each joined to the next one."""
    patches = []
    for k in range(count):
        corners = [[x, y, math.sin(0.1 * x + y)] for y in (0, 1) for x in (k, k + 1)]
        patches.append({"knots": [[0, 0], [1, 0], [0, 1], [1, 1]], "control_points": corners})
    return written(folder / "patches.json", {"patches": patches})


def written(path: Path, spec: object) -> Path:
    path.write_text(json.dumps(spec), encoding="utf-8")
    return path
