"""Specs for tests: the good ones of `specs/`, the bad ones of `bad_specs/`, and small ones as text."""

import re
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from gtb_cli.language import loading
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch

SPECS = Path(__file__).parent.parent / "specs"
BAD_SPECS = Path(__file__).parent / "bad_specs"
GOOD_SPECS = sorted(SPECS.glob("*.toml"))

# What takes longer hangs: bad input takes up to two on a slow machine; minutes, where time outgrows size
SECONDS = 15.0


@contextmanager
def quickly() -> Iterator[None]:
    """Fail where the processor takes longer than `SECONDS`."""
    start = time.process_time()
    yield
    assert time.process_time() - start < SECONDS


@contextmanager
def memory_below(most: float) -> Iterator[None]:
    """Fail where more bytes are in use at one time."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < most


ARC = "knots = [0, 1, 2]\ncontrol_points = [[0, 0], [1, 1], [2, 0]]\n"
TRIANGLE = "knots = [[0, 0], [1, 0], [0, 1]]\ncontrol_points = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]\n"


@cache
def _good(path: Path) -> Patch | Model:
    return loading.load(path)


def load(path: Path | str) -> Patch | Model:
    """What is in a file; the specs of `specs/`, which nobody changes, are read once."""
    path = Path(path)
    return _good(path) if path.parent == SPECS else loading.load(path)


def spec(name: str) -> Patch:
    """A patch of `specs/`."""
    patch = load(SPECS / f"{name}.toml")
    assert isinstance(patch, Patch)
    return patch


def is_curve(shape: Patch | Model) -> bool:
    return isinstance(shape, Patch) and shape.dimension == 1


@dataclass(frozen=True)
class Case:
    """A file of `bad_specs/`, and the lines it must be refused with, without its name; … stands for anything."""

    file: str
    kind: str
    lines: tuple[str, ...]

    def matches(self, path: str, message: str) -> bool:
        """Whether a message is the expected one."""
        lines = message.split("\n")
        patterns = [".*".join(map(re.escape, f"{path}{line}".split("…"))) for line in self.lines]
        return len(lines) == len(patterns) and all(map(re.fullmatch, patterns, lines))


def bad_specs() -> list[Case]:
    """All cases of `bad_specs/expected.txt`."""
    cases: list[Case] = []
    kind = ""
    for line in (BAD_SPECS / "expected.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            kind = line.strip("[]")
        elif line.startswith("    "):
            cases[-1] = replace(cases[-1], lines=(*cases[-1].lines, line[4:]))
        elif line and not line.startswith("#"):
            cases.append(Case(line, kind, ()))
    return cases


def arrays(spec: Patch | Model) -> list[tuple[str | None, dict[str, object]]]:
    """All that a spec says but its own name, as plain data."""
    return [
        (
            patch.name,
            {
                "knots": patch.knots.tolist(),
                "control_points": patch.control_points.tolist(),
                "weights": patch.weights.tolist(),
                "coefficients": patch.coefficients.tolist(),
                "lifting": None if patch.lifting is None else patch.lifting.tolist(),
                "edge_normals": patch.edge_normals,
                "edge_scale": np.asarray(patch.edge_scale).tolist(),
            },
        )
        for patch in (spec.patches if isinstance(spec, Model) else (spec,))
    ]
