"""Whole processes of the command line, beside Python importing what they cannot do without."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
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


def rows() -> list[Row]:
    runs = 21
    with tempfile.TemporaryDirectory() as folder:
        spec = REPOSITORY / "specs" / "pentagon.toml"
        mesh = process("-m", "gtb_cli", "mesh", "-q", "-n", 8, spec, "-o", Path(folder) / "x.obj")
        floor = ("-c", "import numpy, click")
        return [
            paired(
                "gtb mesh -n 8 of the pentagon to OBJ, whole, beside import numpy, click",
                mesh,
                process(*floor),
                budget=1.3,
                runs=runs,
            ),
            paired(
                "the same, beside the same import with one thread, as gtb does it",
                mesh,
                process(*floor, OPENBLAS_NUM_THREADS="1"),
                runs=runs,
            ),
            paired(
                "gtb --help, whole, beside import click",
                process("-m", "gtb_cli", "--help"),
                process("-c", "import click"),
                runs=runs,
            ),
            *(
                paired(f"import {name}, whole, beside Python alone", process("-c", f"import {name}"), process("-c", ""))
                for name in ("numpy", "click", "scipy.spatial", "trimesh")
            ),
        ]
