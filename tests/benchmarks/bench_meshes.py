"""Even meshes of a million vertices, beside the evaluation of their points alone, and linear beside toric ones."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from gtb_cli.language.loading import load
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model, joints_of
from gtb_cli.tessellation.complexes import Complex, joined_complex
from gtb_cli.tessellation.sampler import Sampler, torically
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import LinearParametrization
from gtb_cli.vocabulary import Parametrization
from tests.benchmarks import Row, paired, segments, sized
from tests.benchmarks.bench_evaluate import scattered, spec
from tests.shell import SPECS


def rows() -> Iterator[Row]:
    yield from beside_evaluation()
    yield from beside_toric()


def beside_evaluation() -> Iterator[Row]:
    """Without normals, as `gtb mesh` does it."""
    fixed = 0.15  # seconds that a mesh may take besides its evaluation
    patch = spec("bicubic")
    n = segments(1000)
    mosaic = joined_complex((patch,), joints_of(patch), n)
    for parametrization in ("toric", "linear"):
        points = evaluation(patch, parametrization, mosaic, n)

        def made(kind: Parametrization = parametrization) -> Mesh:
            return tessellate(patch, n, parametrization=kind, normals=False)

        assert (made().vertices == points()).all()
        what = f"{parametrization} mesh -n 1000 of the bicubic less 150 ms, beside its points alone"
        yield paired(what, made, points, budget=2.0, allowance=fixed)


def evaluation(patch: Patch, kind: Parametrization, mosaic: Complex, resolution: int) -> Callable[[], np.ndarray]:
    """The points of an even mesh, by a parametrisation that has not learnt anything yet."""

    def run() -> np.ndarray:
        even = partial(LinearParametrization.locations, resolution=resolution)
        sampler = Sampler((patch,), torically if kind == "toric" else even)
        return sampler.points(mosaic.patch, mosaic.parameters, mosaic.face)

    return run


def beside_toric() -> Iterator[Row]:
    """What the default parametrisation costs, for knots on a lattice and others."""
    # Segments of each edge of a polygon with so many corners whose mesh has a million vertices
    million = {3: 1413, 4: 999, 5: 632, 6: 577}
    teapot = load(SPECS / "teapot.toml")
    assert isinstance(teapot, Model)
    body = next(patch for patch in teapot.patches if patch.name == "body-upper-1")
    for what, patch in (
        ("bicubic, weights not 1", spec("bicubic")),
        ("teapot's body, weights 1", body),
        ("pentagon, 8 rational knots", spec("pentagon")),
        ("hexagon, 19 irrational knots", spec("hexagon")),
    ):
        n = segments(million[len(patch.domain.vertices)])
        mosaic = joined_complex((patch,), joints_of(patch), n)
        yield paired(
            f"1M vertices of an even mesh ({what}), linear beside toric",
            evaluation(patch, "linear", mosaic, n),
            evaluation(patch, "toric", mosaic, n),
            budget=3.5,
            runs=5,
        )
    for what, patch in (("pentagon", spec("pentagon")), ("hexagon", spec("hexagon"))):
        u = scattered(patch, sized(1_000_000))
        yield paired(
            f"1M scattered points of the {what}, linear beside toric",
            lambda patch=patch, u=u: patch.evaluate(u, "linear"),  # type: ignore[misc]
            lambda patch=patch, u=u: patch.evaluate(u),  # type: ignore[misc]
            budget=15.0,
            runs=3,
        )
