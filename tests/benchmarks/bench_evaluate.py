"""A million points of a patch, beside the exponentials and logarithms they take, and beside libraries of splines."""

from collections.abc import Callable, Iterator

import numpy as np

from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.theory.patch import Patch
from tests.benchmarks import Row, compared, has_avx512, paired, segments, sized
from tests.benchmarks.peers import by_scipy, by_splinepy, by_splipy
from tests.specs import spec

POINTS = 1_000_000

SAME = 1e-13  # largest difference, in units of a model of size 3, of results that differ by rounding


def scattered(patch: Patch, count: int) -> np.ndarray:
    """Random points of Δ: of its triangles around the first corner."""
    random = np.random.default_rng(1)
    corners = patch.domain.vertices
    triangle = random.integers(1, len(corners) - 1, count)
    a, b = random.uniform(size=(2, count, 1))
    flip = a + b > 1
    a, b = np.where(flip, 1 - a, a), np.where(flip, 1 - b, b)
    return corners[0] + a * (corners[triangle] - corners[0]) + b * (corners[triangle + 1] - corners[0])


def along_edges(patch: Patch, distance: float, count: int) -> np.ndarray:
    """Points at a distance from the edges of Δ, as a fraction of its size."""
    random = np.random.default_rng(2)
    corners = patch.domain.vertices
    edge = random.integers(0, len(corners), count)
    start, end = corners[edge], corners[(edge + 1) % len(corners)]
    inward = patch.domain.normals[edge] / patch.domain.normal_lengths[edge, None]
    return start + random.uniform(0.01, 0.99, (count, 1)) * (end - start) + distance * patch.domain.size * inward


def floor(knots: int, edges: int, count: int) -> Callable[[], None]:
    """The logarithms and exponentials of as many points, in blocks that fit the cache, and nothing else."""
    block = 8192
    heights = np.random.default_rng(3).uniform(0.1, 3, (edges, block))
    exponents = np.random.default_rng(4).uniform(-5, 0, (knots, block))
    logs, exps = np.empty_like(heights), np.empty_like(exponents)

    def run() -> None:
        for start in range(0, count, block):
            width = min(block, count - start)
            np.log(heights[:, :width], out=logs[:, :width])
            np.exp(exponents[:, :width], out=exps[:, :width])

    return run


def rows() -> Iterator[Row]:
    yield from scattered_points()
    yield grid()
    yield from near_edges()


def scattered_points() -> Iterator[Row]:
    """The rational bicubic, which other libraries can evaluate, too."""
    ndbspline = 1 / 3 if has_avx512() else 1 / 1.5  # part of its time that is allowed: it computes no exponentials
    patch = spec("bicubic")
    u = scattered(patch, sized(POINTS))

    def ours() -> np.ndarray:
        return patch.evaluate(u)

    what = "1M points of the rational bicubic"
    yield paired(f"{what}, beside their logs and exps", ours, floor(16, 4, len(u)), budget=3.0)
    yield compared(f"{what}, beside scipy's NdBSpline", ours, lambda: by_scipy(patch, u), within=SAME, budget=ndbspline)
    yield compared(f"{what}, beside splinepy", ours, lambda: by_splinepy(patch, u), within=SAME)


def grid() -> Row:
    """The same patch at all pairs of a thousand parameters."""
    patch, line = spec("bicubic"), np.linspace(0, 3, segments(1000))
    u = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1)
    return compared(
        "1000 × 1000 parameters of the rational bicubic, beside splipy",
        lambda: patch.evaluate(u),
        lambda: by_splipy(patch, line),
        within=SAME,
        budget=1.5,
    )


def near_edges() -> Iterator[Row]:
    """Where exponentials underflow, beside where they do not."""
    pentagon = spec("pentagon")
    patch = Patch(pentagon.knots * 50, pentagon.control_points, pentagon.weights)
    count = sized(POINTS)
    inside, near, on_edges = scattered(patch, count), along_edges(patch, 1e-9, count), along_edges(patch, 0.0, count)
    mesh = triangulation(patch.domain, segments(632)).parameters  # a million vertices
    for what, u, budget in (
        ("1M vertices of a mesh, knots of size 100, beside scattered points", mesh, 1.3),
        ("1M points very near to its edges (exponentials underflow), likewise", near, 1.3),
        ("1M points on its edges, likewise", on_edges, None),
    ):
        yield paired(what, lambda u=u: patch.evaluate(u), lambda: patch.evaluate(inside), budget=budget)  # type: ignore[misc]
