"""Meshes to a tolerance, beside uniform ones in the same parametrisation, and beside Open CASCADE's."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gtb_cli.language.loading import load, load_model
from gtb_cli.models.model import Model
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from tests.benchmarks import Row, coarser, missing, paired, segments
from tests.benchmarks.peers import by_open_cascade
from tests.shell import SPECS


def rows() -> Iterator[Row]:
    """Tolerances small enough for some ten thousand triangles, or as coarse as a peer's."""
    for name, part in (("pentagon", 2e-5), ("example-4.4", 1e-4), ("bicubic", 2e-5), ("teapot", 1e-4)):
        yield cost_of_a_triangle(name, coarser(part))
    for name, part, ratio in (("teapot", 2e-3, 4.0), ("teapot", 5e-4, 2.5), ("hebesphenorotunda", 2e-3, 3.4)):
        yield beside_open_cascade(name, coarser(part), ratio)


def tolerance_of(shape: Patch | Model, part: float) -> float:
    """A part of the diagonal of a shape."""
    return part * float(np.linalg.norm(np.ptp(tessellate(shape, 8).vertices, axis=0)))


def cost_of_a_triangle(name: str, part: float) -> Row:
    """Compare the time per triangle of a mesh to a part of the diagonal with a uniform one of about as many."""
    budget = 8.0  # issue: cost per triangle at most eight times the uniform mesh's
    shape = load(SPECS / f"{name}.toml")
    tolerance = tolerance_of(shape, part)
    count = len(tessellate(shape, tolerance=tolerance).faces)
    coarse = len(tessellate(shape, 1, parametrization="linear").faces) or 1
    patches = len(shape.patches) if isinstance(shape, Model) else 1
    resolution = max(1, round((count / max(coarse, patches)) ** 0.5))
    uniform = len(tessellate(shape, resolution, parametrization="linear").faces)
    row = paired(
        f"{name} to {part:g} of its diagonal, time of each of {count} triangles, beside a uniform mesh's",
        lambda: tessellate(shape, tolerance=tolerance),
        lambda: tessellate(shape, resolution, parametrization="linear"),
        runs=3,
    )
    return replace(row, ratio=row.ratio * uniform / count, budget=budget)


def beside_open_cascade(name: str, part: float, budget: float) -> Row:
    """Compare the time of a mesh of many small patches with that of Open CASCADE's, whose error is about the same."""
    model = load_model(SPECS / f"{name}.toml")
    model = model.replace(patches=model.patches[: segments(100)])
    tolerance = tolerance_of(model, part)
    what = f"{name} to {part:g} of its diagonal beside Open CASCADE's mesher"
    try:
        with TemporaryDirectory() as folder:
            run = by_open_cascade(model, tolerance, Path(folder))
    except ImportError as error:
        return missing(what, error)
    count = len(tessellate(model, tolerance=tolerance).faces)
    copies = (tuple(patch.replace() for patch in model) for _ in range(8))  # patches keep what they found
    fresh = [model.replace(patches=each) for each in copies]  # each is used once
    return paired(
        f"{what}, {count} triangles beside {run()}",
        lambda: tessellate(fresh.pop(), tolerance=tolerance, normals=False),
        run,
        budget=budget,
    )
