"""Tiny named meshes, made by formula, and what tests of files do with their bytes."""

import struct

import numpy as np

from gtb_cli.formats.export import encode_mesh
from gtb_cli.meshes.mesh import Mesh


def surface(n: int = 4) -> Mesh:
    """A bent square of 2 n² triangles, with exact normals."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 2, n + 1), indexing="ij"))
    corner = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2).reshape(-1, 3)
    normals = np.column_stack([-3 * np.cos(3 * x) * y, -np.sin(3 * x), np.ones_like(x)])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    vertices = np.column_stack([x, y, np.sin(3 * x) * y])
    return Mesh(vertices, triangles, np.column_stack([x, y]), normals, name="bent square")


def plane(n: int) -> Mesh:
    """The same square, flat."""
    mesh = surface(n)
    return Mesh(mesh.vertices * [1, 1, 0], mesh.cells)


def model() -> Mesh:
    """Two bent squares of different sizes, apart from each other."""
    one, two = surface(3), surface(5)
    count = len(one.vertices)
    return Mesh(
        np.vstack([one.vertices, two.vertices + np.array([3.0, 0.0, 0.0])]),
        np.vstack([one.cells, two.cells + count]),
        np.vstack([one.parameters, two.parameters]),
        np.vstack([one.normals, two.normals]),
        groups=(("left half", 0, len(one.cells)), ("right", len(one.cells), len(one.cells) + len(two.cells))),
        name="two",
    )


def curve(n: int = 10) -> Mesh:
    t = np.linspace(0, 1, n + 1)
    steps = np.arange(n)
    return Mesh(np.column_stack([t, t * t, -t]), np.column_stack([steps, steps + 1]), t[:, None], name="parabola")


def two_curves() -> Mesh:
    one, two = curve(4), curve(7)
    return Mesh(
        np.vstack([one.vertices, two.vertices + 2.0]),
        np.vstack([one.cells, two.cells + 5]),
        np.vstack([one.parameters, two.parameters]),
        groups=(("a", 0, 4), ("b", 4, 11)),
    )


def encoded(mesh: Mesh, format: str, **options: bool) -> bytes:
    return b"".join(encode_mesh(mesh, format, **options))


def glb_file(text: bytes, binary: bytes) -> bytes:
    """A GLB file with this description and these numbers."""
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def lines(text: bytes | str, *kinds: str) -> list[str]:
    if isinstance(text, bytes):
        text = text.decode()
    return [line for line in text.splitlines() if line.split(" ")[0] in kinds]
