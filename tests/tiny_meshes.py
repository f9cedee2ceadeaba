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


def together(one: Mesh, two: Mesh, shift: object, names: tuple[str, str], **more: str) -> Mesh:
    """Two meshes as one, of which the second is moved."""
    count, cells = len(one.cells), np.vstack([one.cells, two.cells + len(one.vertices)])
    return Mesh(
        np.vstack([one.vertices, two.vertices + np.array(shift)]),
        cells,
        np.vstack([one.parameters, two.parameters]),
        None if one.normals is None else np.vstack([one.normals, two.normals]),
        groups=((names[0], 0, count), (names[1], count, len(cells))),
        **more,
    )


def model(left: int = 3, right: int = 5) -> Mesh:
    """Two bent squares, of different sizes unless others are asked for, apart from each other."""
    return together(surface(left), surface(right), [3.0, 0.0, 0.0], ("left half", "right"), name="two")


def curve(n: int = 10) -> Mesh:
    t = np.linspace(0, 1, n + 1)
    steps = np.arange(n)
    return Mesh(np.column_stack([t, t * t, -t]), np.column_stack([steps, steps + 1]), t[:, None], name="parabola")


def two_curves() -> Mesh:
    return together(curve(4), curve(7), 2.0, ("a", "b"))


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
