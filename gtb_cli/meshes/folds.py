"""Folds: pairs of triangles side by side between which a surface turns back on itself."""

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, cross
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import adjacent


def folded_pairs(vertices: FloatArray, cells: IntArray) -> IntArray:
    """(k, 2) triangles, consistently oriented, between which the surface turns by more than a right angle.

    A triangle that is a line takes a neighbour's normal, so that a fold along a row of them is found as well.
    """
    # Sine of the angle between two sides of a triangle below which it is a line, and has no normal of its own
    flat_sine = 64 * EPS
    a, b, c = (vertices[cells[:, k]] for k in range(3))
    normals = cross(b - a, c - a)
    pairs, _ = adjacent(cells)
    lengths = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1)
    looks = np.linalg.norm(normals, axis=1) > flat_sine * lengths
    normals[~looks] = 0.0
    while True:
        rows = pairs[looks[pairs].sum(axis=1) == 1]
        if not len(rows):
            break
        rows = np.where(looks[rows[:, :1]], rows, rows[:, ::-1])  # from a triangle with a normal to one without
        normals[rows[:, 1]] = normals[rows[:, 0]]
        looks[rows[:, 1]] = True
    return np.asarray(pairs[(normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) < 0])


def folded_places(mesh: Mesh) -> list[str]:
    """Say in which patches a mesh turns back on itself, and where it first does."""
    if mesh.is_curve:
        return []
    lines = []
    for name, start, stop in mesh.groups or ((mesh.name, 0, len(mesh.cells)),):
        cells = folded_pairs(mesh.vertices, mesh.cells[start:stop])[:, 0]
        if len(cells):
            place = ", ".join(f"{x:.4g}" for x in mesh.vertices[mesh.cells[start + cells[0]]].mean(axis=0))
            lines.append(f"{name} turns back on itself at {len(cells)} sides of faces, the first near ({place})")
    return lines
