"""A million points of a patch, beside the exponentials and logarithms they take, and beside scipy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import NdBSpline

from gtb_cli.knots.triangulation import triangulation
from gtb_cli.spec.loading import load
from gtb_cli.tessellation.complex import Sampler, joined_complex
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch
from tests.benchmarks import Row, paired

SPECS = Path(__file__).parent.parent.parent / "specs"
POINTS = 1_000_000
BLOCK = 8192
MESH = 632
"""Segments of each edge of a pentagon's mesh of a million vertices."""

EVEN = {"bicubic": 1000, "pentagon": 632, "hexagon": 577, "example-4.4": 632}
"""Segments of each edge of even meshes of a million vertices."""

NEAR = 1e-9
"""Distance from the edges, as a fraction of the size of Δ, of points where most exponentials underflow."""


def spec(name: str) -> Patch:
    patch = load(SPECS / f"{name}.toml")
    assert isinstance(patch, Patch)
    return patch


def scattered(patch: Patch, count: int = POINTS) -> np.ndarray:
    """Random points of Δ: of its triangles around the first corner."""
    random = np.random.default_rng(1)
    corners = patch.domain.vertices
    triangle = random.integers(1, len(corners) - 1, count)
    a, b = random.uniform(size=(2, count, 1))
    flip = a + b > 1
    a, b = np.where(flip, 1 - a, a), np.where(flip, 1 - b, b)
    return corners[0] + a * (corners[triangle] - corners[0]) + b * (corners[triangle + 1] - corners[0])


def along_edges(patch: Patch, distance: float, count: int = POINTS) -> np.ndarray:
    """Points at a distance from the edges of Δ, as a fraction of its size."""
    random = np.random.default_rng(2)
    corners = patch.domain.vertices
    edge = random.integers(0, len(corners), count)
    start, end = corners[edge], corners[(edge + 1) % len(corners)]
    inward = patch.domain.normals[edge] / patch.domain.normal_lengths[edge, None]
    return start + random.uniform(0.01, 0.99, (count, 1)) * (end - start) + distance * patch.domain.size * inward


def floor(knots: int, edges: int, count: int = POINTS):
    """The logarithms and exponentials of as many points, in blocks that fit the cache, and nothing else."""
    heights = np.random.default_rng(3).uniform(0.1, 3, (edges, BLOCK))
    exponents = np.random.default_rng(4).uniform(-5, 0, (knots, BLOCK))
    logs, exps = np.empty_like(heights), np.empty_like(exponents)

    def run() -> None:
        for start in range(0, count, BLOCK):
            width = min(BLOCK, count - start)
            np.log(heights[:, :width], out=logs[:, :width])
            np.exp(exponents[:, :width], out=exps[:, :width])

    return run


def spline(patch: Patch) -> NdBSpline:
    """A bicubic patch in homogeneous coordinates, as one span of scipy's tensor product splines."""
    weights = (patch.weights * patch.coefficients / np.outer([1, 3, 3, 1], [1, 3, 3, 1]).ravel())[:, None]
    points = np.column_stack([patch.control_points * weights, weights]).reshape(4, 4, 4).transpose(1, 0, 2)
    ends = np.array([0.0] * 4 + [3.0] * 4)
    return NdBSpline((ends, ends), np.ascontiguousarray(points), 3)


def even(name: str, resolution: int) -> list[Row]:
    """A million vertices of an even mesh in both parametrisations, and the mesh itself."""
    patch = spec(name)
    mosaic = joined_complex((patch,), None, resolution)

    def points(parametrization: Parametrization) -> np.ndarray:
        sampler = Sampler((patch,), parametrization, False, resolution=resolution)
        return sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)

    return [
        paired(
            f"1M vertices of an even mesh, linear beside toric: {name}",
            lambda: points("linear"),
            lambda: points("toric"),
            budget=3.5,
        ),
        paired(
            f"the mesh itself by tessellate, beside these points (2 and 150 ms): {name}",
            lambda: tessellate(patch, resolution, normals=False),
            lambda: points("linear"),
        ),
    ]


def rows() -> list[Row]:
    bicubic = spec("bicubic")
    u = scattered(bicubic)
    classical = spline(bicubic)

    def by_scipy() -> np.ndarray:
        points = classical(u)
        return points[:, :3] / points[:, 3:]

    assert np.abs(by_scipy() - bicubic.evaluate(u)).max() < 1e-13

    pentagon = spec("pentagon")
    inside = scattered(pentagon)
    linear = pentagon.rational_basis.linear()

    def linearly() -> np.ndarray:
        return pentagon.points_at(linear.locations(inside), len(inside))

    large = Patch(pentagon.knots * 50, pentagon.control_points, pentagon.weights)
    inside_large, near, on_edges = scattered(large), along_edges(large, NEAR), along_edges(large, 0.0)
    mesh = triangulation(large.domain, MESH).parameters

    return [
        paired(
            "1M points of the rational bicubic, beside their logs and exps",
            lambda: bicubic.evaluate(u),
            floor(16, 4),
            budget=3.0,
        ),
        paired(
            "the same, beside scipy's NdBSpline",
            lambda: bicubic.evaluate(u),
            by_scipy,
            budget=1 / 3,
        ),
        paired(
            "1M vertices of a mesh, knots of size 100, beside scattered points",
            lambda: large.evaluate(mesh),
            lambda: large.evaluate(inside_large),
            budget=1.3,
        ),
        paired(
            "1M points very near to its edges (exponentials underflow), likewise",
            lambda: large.evaluate(near),
            lambda: large.evaluate(inside_large),
            budget=1.3,
        ),
        paired(
            "1M points on its edges, likewise",
            lambda: large.evaluate(on_edges),
            lambda: large.evaluate(inside_large),
        ),
        paired(
            "1M points in the linear parametrisation, beside the toric one",
            linearly,
            lambda: pentagon.evaluate(inside),
            budget=12.0,
            runs=5,
        ),
        *(row for name, resolution in EVEN.items() for row in even(name, resolution)),
    ]
