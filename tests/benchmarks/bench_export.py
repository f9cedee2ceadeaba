"""Writing a million vertices and two million triangles, beside trimesh and VTK on the same arrays."""

import gc
import tempfile
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.exchange.obj import export_obj
from trimesh.exchange.ply import export_ply
from trimesh.exchange.stl import export_stl

from gtb_cli.formats.digits import BLOCK_ROWS, decimals
from gtb_cli.formats.export import encode_mesh, write_mesh
from gtb_cli.formats.meshfiles import read_mesh
from gtb_cli.meshes.mesh import Mesh
from tests.benchmarks import Row, missing, paired, segments
from tests.benchmarks.peers import by_vtk
from tests.tiny_meshes import surface

BINARY: dict[str, Callable[[trimesh.Trimesh], bytes]] = {
    "ply": lambda mesh: export_ply(mesh, vertex_normal=False),
    "stl": export_stl,
    "glb": lambda mesh: export_glb(trimesh.Scene(mesh), include_normals=False),
}


def consume(blocks: Iterable[bytes]) -> None:
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


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.cells, process=False)


def rows() -> Iterator[Row]:
    mesh = surface(segments(1000))
    yield from text(mesh)
    for kind, export in BINARY.items():
        name, turned = kind.upper(), mesh.with_y_up if kind == "glb" else mesh
        ours, theirs = partial(written, mesh, kind), partial(exported, export, turned)
        yield paired(f"{name}, the same, beside trimesh's exporter", ours, theirs, budget=1.2)
        yield memory(f"{name}, the same, beside trimesh's exporter", ours, theirs)


def written(mesh: Mesh, kind: str) -> None:
    consume(encode_mesh(mesh, kind))


def exported(export: Callable[[trimesh.Trimesh], bytes], mesh: Mesh) -> None:
    export(as_trimesh(mesh))


def memory(what: str, measured: Callable[[], None], beside: Callable[[], None]) -> Row:
    """Compare the memory that two functions take at most, beyond what there is before."""
    peaks = []
    for run in (measured, beside):
        gc.collect()
        tracemalloc.start()
        run()
        peaks.append(tracemalloc.get_traced_memory()[1] / 1e6)
        tracemalloc.stop()
    return Row(what, *peaks, peaks[0] / peaks[1], budget=1.2, unit="MB")


def text(mesh: Mesh) -> Iterator[Row]:
    """OBJ, which trimesh writes with the same bytes; VTK writes other digits, and a file only."""
    digits = decimals(mesh.vertices)

    def ours() -> None:
        consume(encode_mesh(mesh, "obj"))

    def theirs() -> str:
        return export_obj(as_trimesh(mesh), include_normals=False, digits=digits, header=None)

    data = b"".join(encode_mesh(mesh, "obj"))
    assert data.decode() == theirs().rstrip("\n") + "\n"
    assert data == b"".join(percent_blocks(mesh))
    what = "OBJ, 1M vertices, 2M triangles"
    yield paired(f"{what}, beside trimesh's exporter", ours, theirs, budget=0.15, runs=3)
    yield paired(f"{what}, beside % on blocks", ours, lambda: consume(percent_blocks(mesh)), runs=3)
    yield beside_vtk(f"{what}, to a file, beside VTK's writer", mesh)


def beside_vtk(what: str, mesh: Mesh) -> Row:
    """Both write a file; that they have the same vertices and triangles is seen with a smaller mesh."""
    six_digits = 1e-5  # largest difference of coordinates up to 2 of which one file has six digits
    with tempfile.TemporaryDirectory() as folder:
        path, other = Path(folder) / "ours.obj", Path(folder) / "vtk.obj"
        small = surface(30)
        try:
            by_vtk(small, other)()
        except ImportError as error:
            return missing(what, error)
        write_mesh(small, path)
        a, b = read_mesh(path), read_mesh(other)
        assert (a.cells == b.cells).all()
        apart = float(np.abs(a.vertices - b.vertices).max())
        assert apart < six_digits
        return paired(what, lambda: write_mesh(mesh, path), by_vtk(mesh, other), runs=5, apart=apart)
