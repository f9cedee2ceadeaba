"""Comparing two meshes of a million triangles, beside the least that a comparison by hand does."""

import io
from collections.abc import Iterator

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.difference import difference
from gtb_cli.meshes.mesh import Mesh, known_exactly
from tests.benchmarks import Row, paired, segments
from tests.tiny_meshes import surface

SEGMENTS, OTHER_SEGMENTS = 707, 710
"""One million triangles, nearly."""

SIZE = "1M faces"


def files() -> Iterator[Row]:
    """Reading each format twice and comparing, beside trimesh and scipy: reading it twice, and nearest vertices."""
    mesh = surface(segments(SEGMENTS))
    for kind in ("obj", "ply", "stl", "glb"):
        data = b"".join(encode_mesh(mesh, kind))

        def ours(data: bytes = data) -> None:
            assert difference(decode_mesh(data, "a"), decode_mesh(data, "b")).same

        def theirs(data: bytes = data, kind: str = kind) -> None:
            a, b = (trimesh.load_mesh(io.BytesIO(data), file_type=kind) for _ in range(2))
            assert cKDTree(a.vertices).query(b.vertices)[0].max() < 1e-9

        what = f"diff of two {kind.upper()} files, {SIZE}, beside trimesh and scipy's tree"
        yield paired(what, ours, theirs, budget=1.0, runs=1)


def meshes() -> Iterator[Row]:
    """Comparing what was read, beside nearest points for all middles of faces, both ways."""
    mesh, other = surface(segments(SEGMENTS)), surface(segments(OTHER_SEGMENTS) + 1)
    order = np.random.default_rng(1).permutation(len(mesh.cells))
    shuffled = Mesh(mesh.vertices, mesh.cells[order])

    def nearest_points() -> None:
        for here, there in ((mesh, other), (other, mesh)):
            cKDTree(there.vertices).query(here.vertices[here.cells].mean(axis=1))

    def ours(second: Mesh, same: bool) -> None:
        assert difference(known_exactly(mesh), known_exactly(second)).same == same

    peer = "beside scipy's tree"
    what = f"diff, {SIZE}"
    yield paired(f"{what} in another order, {peer}", lambda: ours(shuffled, True), nearest_points, runs=1)
    yield paired(f"{what} and {SIZE}, {peer}", lambda: ours(other, False), nearest_points, runs=1)


def rows() -> Iterator[Row]:
    yield from files()
    yield from meshes()
