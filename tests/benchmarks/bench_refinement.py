"""What a triangle of a mesh to a tolerance costs, beside one of a uniform mesh in the same parametrisation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gtb_cli.spec.loading import load
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from tests.benchmarks import Row, paired

SPECS = Path(__file__).parents[2] / "specs"

BUDGET = 8.0
"""Issue: cost per triangle at most eight times the uniform mesh's."""


def rows() -> list[Row]:
    """Tolerances small enough for some ten thousand triangles."""
    return [
        cost_of_a_triangle("pentagon.toml", 2e-5),
        cost_of_a_triangle("example-4.4.toml", 1e-4),
        cost_of_a_triangle("bicubic.toml", 2e-5),
        cost_of_a_triangle("teapot.toml", 1e-4),
    ]


def cost_of_a_triangle(name: str, part: float) -> Row:
    """Compare the time per triangle of a mesh to a part of the diagonal with a uniform one of about as many."""
    shape = load(SPECS / name)
    tolerance = part * float(np.linalg.norm(np.ptp(tessellate(shape, 8).vertices, axis=0)))
    count = len(tessellate(shape, tolerance=tolerance).faces)
    coarse = len(tessellate(shape, 1, parametrization="linear").faces) or 1
    patches = len(shape.patches) if isinstance(shape, Model) else 1
    resolution = max(1, round((count / max(coarse, patches)) ** 0.5))
    uniform = len(tessellate(shape, resolution, parametrization="linear").faces)
    row = paired(
        f"{name} to {part:g} of its diagonal, {count} triangles / {uniform} uniform, per triangle",
        lambda: tessellate(shape, tolerance=tolerance),
        lambda: tessellate(shape, resolution, parametrization="linear"),
        runs=3,
    )
    return replace(row, ratio=row.ratio * uniform / count, budget=BUDGET)
