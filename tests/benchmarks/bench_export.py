"""Writing a million vertices and two million triangles, beside trimesh's exporters on the same arrays."""

from __future__ import annotations

from collections.abc import Iterator

import trimesh
from trimesh.exchange.obj import export_obj
from trimesh.exchange.ply import export_ply
from trimesh.exchange.stl import export_stl

from gtb_cli.formats.digits import BLOCK_ROWS, decimals
from gtb_cli.formats.export import encode_mesh
from gtb_cli.meshes.mesh import Mesh
from tests.benchmarks import Row, paired
from tests.tiny_meshes import surface

SEGMENTS = 1000


def consume(blocks) -> None:
    """Take all blocks and keep none, as a file does."""
    for _ in blocks:
        pass


def percent_blocks(mesh: Mesh) -> Iterator[bytes]:
    """The plain way to fast text: one `%` for each block of rows."""
    digits = decimals(mesh.vertices)
    for line, rows in ((f"v %.{digits}f %.{digits}f %.{digits}f\n", mesh.vertices), ("f %d %d %d\n", mesh.cells + 1)):
        for start in range(0, len(rows), BLOCK_ROWS):
            block = rows[start : start + BLOCK_ROWS]
            yield (line * len(block) % tuple(block.ravel().tolist())).encode()


def rows() -> list[Row]:
    mesh = surface(SEGMENTS)
    digits = decimals(mesh.vertices)

    def bare() -> trimesh.Trimesh:
        return trimesh.Trimesh(mesh.vertices, mesh.cells, process=False)

    text = b"".join(encode_mesh(mesh, "obj"))
    # The budget is for the same bytes.
    assert text.decode() == export_obj(bare(), include_normals=False, digits=digits, header=None).rstrip("\n") + "\n"
    assert text == b"".join(percent_blocks(mesh))
    return [
        paired(
            "OBJ, 1M vertices, 2M triangles, beside trimesh's exporter",
            lambda: consume(encode_mesh(mesh, "obj")),
            lambda: export_obj(bare(), include_normals=False, digits=digits, header=None),
            budget=0.15,
            runs=3,
        ),
        paired(
            "OBJ, the same, beside % on blocks",
            lambda: consume(encode_mesh(mesh, "obj")),
            lambda: consume(percent_blocks(mesh)),
            runs=3,
        ),
        paired(
            "PLY, the same, beside trimesh's exporter",
            lambda: consume(encode_mesh(mesh, "ply")),
            lambda: export_ply(bare(), vertex_normal=False),
            budget=1.2,
        ),
        paired(
            "STL, the same, beside trimesh's exporter",
            lambda: consume(encode_mesh(mesh, "stl")),
            lambda: export_stl(bare()),
            budget=1.2,
        ),
    ]
