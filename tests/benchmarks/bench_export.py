"""Writing a million vertices and two million triangles, beside trimesh on the same arrays."""

import gc
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from functools import partial

import trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.exchange.obj import export_obj
from trimesh.exchange.ply import export_ply
from trimesh.exchange.stl import export_stl

from gtb_cli.formats.export import encode_mesh
from gtb_cli.formats.numbers_written import decimals
from gtb_cli.meshes.mesh import Mesh
from tests.benchmarks import Row, paired, segments
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
    """OBJ, which trimesh writes with the same bytes."""
    digits = decimals(mesh.vertices)

    def ours() -> None:
        consume(encode_mesh(mesh, "obj"))

    def theirs() -> str:
        return export_obj(as_trimesh(mesh), include_normals=False, digits=digits, header=None)

    data = b"".join(encode_mesh(mesh, "obj"))
    assert data.decode() == theirs().rstrip("\n") + "\n"
    what = "OBJ, 1M vertices, 2M triangles"
    yield paired(f"{what}, beside trimesh's exporter", ours, theirs, budget=0.15, runs=3)
