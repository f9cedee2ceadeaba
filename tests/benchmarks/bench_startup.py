"""Whole processes of the command line, beside Python importing what they cannot do without."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.benchmarks import Row, paired

REPOSITORY = Path(__file__).parent.parent.parent


def process(*arguments: object, **variables: str) -> Callable[[], None]:
    """A process of Python that finds its compiled modules where the run before has left them."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), **variables}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    if "OPENBLAS_NUM_THREADS" not in variables:
        environment.pop("OPENBLAS_NUM_THREADS", None)

    def run() -> None:
        subprocess.run([sys.executable, *map(str, arguments)], env=environment, stdout=subprocess.DEVNULL, check=True)

    return run


def rows() -> Iterator[Row]:
    runs = 21
    with tempfile.TemporaryDirectory() as folder:
        spec = REPOSITORY / "specs" / "pentagon.toml"
        mesh = process("-m", "gtb_cli", "mesh", "-q", "-n", 8, spec, "-o", Path(folder) / "x.obj")
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
