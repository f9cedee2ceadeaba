"""Meshes to a tolerance, beside uniform ones in the same parametrisation: time of a triangle, and how many it takes."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gtb_cli.language.loading import load
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import cell_distances
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch
from tests.benchmarks import Row, coarser, missing, paired
from tests.benchmarks.bench_evaluate import SPECS, spec
from tests.benchmarks.peers import by_open_cascade

PLACES = np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=float)
PLACES /= PLACES.sum(axis=1, keepdims=True)
"""Where in a triangle, in barycentric coordinates, its distance from the surface is measured."""


def rows() -> Iterator[Row]:
    """Tolerances small enough for some ten thousand triangles, and for a thousand where they are counted."""
    for name, part in (("pentagon", 2e-5), ("example-4.4", 1e-4), ("bicubic", 2e-5), ("teapot", 1e-4)):
        yield cost_of_a_triangle(name, coarser(part))
    for name, part, ratio in (("teapot", 2e-3, 4.0), ("teapot", 5e-4, 2.5), ("hebesphenorotunda", 2e-3, 3.4)):
        yield beside_open_cascade(name, coarser(part), ratio)
    for name in ("pentagon", "example-4.4", "bicubic", "hexagon"):
        yield triangles_at_equal_error(name, coarser(1e-3))


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
    model = load(SPECS / f"{name}.toml")
    assert isinstance(model, Model)
    tolerance = tolerance_of(model, part)
    what = f"{name} to {part:g} of its diagonal beside Open CASCADE's mesher"
    try:
        with TemporaryDirectory() as folder:
            run = by_open_cascade(model, tolerance, Path(folder))
    except ImportError as error:
        return missing(what, error)
    count = len(tessellate(model, tolerance=tolerance).faces)
    fresh = [load(SPECS / f"{name}.toml") for _ in range(8)]  # patches keep what they found: each is used once
    return paired(
        f"{what}, {count} triangles beside {run()}",
        lambda: tessellate(fresh.pop(), tolerance=tolerance, normals=False),
        run,
        budget=budget,
    )


def triangles_at_equal_error(name: str, part: float) -> Row:
    """Compare the number of triangles with that of the coarsest uniform mesh which is as near to the surface."""
    step = 1.1  # by how much more than expected a uniform mesh that is not near enough is made finer
    patch = spec(name)
    mesh = tessellate(patch, tolerance=tolerance_of(patch, part))
    error, n = largest_error(patch, mesh), max(1, round((len(mesh.faces) / len(patch.domain.vertices)) ** 0.5))
    errors = {0: math.inf}
    while errors[max(errors)] > error:
        errors[n] = largest_error(patch, tessellate(patch, n))
        # Errors go down with the square of n, or more slowly.
        n = math.ceil(step * n * (errors[n] / error) ** 0.5)
    fine = max(errors)
    coarse = max(n for n, found in errors.items() if found > error)
    while fine > coarse + 1:
        n = (coarse + fine) // 2
        coarse, fine = (coarse, n) if largest_error(patch, tessellate(patch, n)) <= error else (n, fine)
    count, beside = len(mesh.faces), len(tessellate(patch, fine).faces)
    what = f"{name} to {part:g} of its diagonal, triangles beside a uniform mesh's with the same error"
    return Row(what, count, beside, count / beside, unit="triangles")


def largest_error(patch: Patch, mesh: Mesh) -> float:
    """Largest distance of points of the surface from the triangles over which they are."""
    assert mesh.parameters is not None
    u = np.einsum("pk,tkd->ptd", PLACES, mesh.parameters[mesh.faces]).reshape(-1, 2)
    corners = np.tile(mesh.vertices[mesh.faces], (len(PLACES), 1, 1))
    a, b, c = corners.transpose(1, 0, 2)
    return float(cell_distances(patch.evaluate(u, "linear"), a, b, c).max())
