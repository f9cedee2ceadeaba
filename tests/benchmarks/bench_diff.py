"""Comparing two meshes of a million triangles, beside the least that a comparison by hand does."""

import io
from collections.abc import Iterator

import trimesh
from scipy.spatial import cKDTree

from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.meshfiles import decode_mesh
from gtb_cli.meshes.difference import difference
from tests.benchmarks import Row, paired, segments
from tests.tiny_meshes import surface

SEGMENTS = 707  # one million triangles, nearly


def rows() -> Iterator[Row]:
    """Reading each format twice and comparing, beside trimesh and scipy: reading it twice, and nearest vertices."""
    mesh = surface(segments(SEGMENTS))
    for kind in ("obj", "ply", "stl", "glb"):
        data = b"".join(encode_mesh(mesh, kind))

        def ours(data: bytes = data) -> None:
            assert difference(decode_mesh(data, "a"), decode_mesh(data, "b")).same

        def theirs(data: bytes = data, kind: str = kind) -> None:
            a, b = (trimesh.load_mesh(io.BytesIO(data), file_type=kind) for _ in range(2))
            assert cKDTree(a.vertices).query(b.vertices)[0].max() < 1e-9

        what = f"diff of two {kind.upper()} files, 1M faces, beside trimesh and scipy's tree"
        yield paired(what, ours, theirs, budget=1.0, runs=1)
