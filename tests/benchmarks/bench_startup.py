"""Whole processes of the command line, beside Python importing what they cannot do without."""

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.benchmarks import Row, paired
from tests.shell import PENTAGON, environment


def inherited(*without: str, **variables: str) -> dict[str, str]:
    """This environment without some variables: Python finds its compiled modules where the run before has left them."""
    left_out = {"PYTHONDONTWRITEBYTECODE", *without}
    return {name: value for name, value in environment(**variables).items() if name not in left_out}


def process(*arguments: object, **variables: str) -> Callable[[], None]:
    """A process of Python, whose linear algebra has as many threads as it likes if their number is not given."""
    found = inherited(*{"OPENBLAS_NUM_THREADS"} - variables.keys(), **variables)

    def run() -> None:
        subprocess.run([sys.executable, *map(str, arguments)], env=found, stdout=subprocess.DEVNULL, check=True)

    return run


def rows() -> Iterator[Row]:
    runs = 21
    with tempfile.TemporaryDirectory() as folder:
        mesh = process("-m", "gtb_cli", "mesh", "-q", "-n", 8, PENTAGON, "-o", Path(folder) / "x.obj")
        floor = ("-c", "import numpy, click")
        alone, one_thread = process(*floor), process(*floor, OPENBLAS_NUM_THREADS="1")
        what = "gtb mesh -n 8 of the pentagon to OBJ, whole, beside import numpy, click"
        yield paired(what, mesh, alone, budget=1.3, runs=runs)
        yield paired("the same, beside the same import with one thread, as gtb does it", mesh, one_thread, runs=runs)
        help_, click = process("-m", "gtb_cli", "--help"), process("-c", "import click")
        yield paired("gtb --help, whole, beside import click", help_, click, runs=runs)
        for name in ("numpy", "click", "scipy.spatial", "trimesh"):
            what = f"import {name}, whole, beside Python alone"
            yield paired(what, process("-c", f"import {name}"), process("-c", ""))
