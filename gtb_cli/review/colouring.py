"""The numbers that colours show: distances of a mesh, and faces that are turned over; colours are in `page.js`."""

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray
from gtb_cli.meshes.correspondence import turned_cells
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells, middles


def distances(mesh: Mesh, other: Mesh, largest: float) -> tuple[Mesh, FloatArray]:
    """Return a mesh and the distances of its vertices from another one.

    Cells whose middles are farther away than their corners, by a part of the largest distance, are divided: so a hole
    of the other mesh is seen also if no vertex is in it.
    """
    rounds, most, part = 3, 500, 0.05  # at most so many cells are divided in each round
    frame = Frame.around(mesh.vertices, other.used)
    tree = NearestCells(frame.inside(other.vertices)[other.cells])
    vertices, cells = frame.inside(mesh.vertices), mesh.cells
    found = tree.nearest(vertices)[0]
    for _ in range(rounds):
        more = tree.nearest(middles(vertices[cells]))[0] - found[cells].max(axis=1)
        chosen = np.argsort(-more, kind="stable")[:most]
        chosen = chosen[more[chosen] > part * float(frame.length(largest, -1))]
        if not len(chosen):
            break
        corners = cells[chosen]
        points = (vertices[corners] + vertices[np.roll(corners, -1, axis=1)]) / 2
        between = len(vertices) + np.arange(corners.size).reshape(corners.shape)
        cells = np.concatenate([np.delete(cells, chosen, axis=0), *_parts(corners, between)])
        vertices = np.concatenate([vertices, points.reshape(-1, 3)])
        found = np.concatenate([found, tree.nearest(points.reshape(-1, 3))[0]])
    added = frame.outside(vertices[len(mesh.vertices) :])
    return Mesh(np.concatenate([mesh.vertices, added]), cells, name=mesh.name), frame.length(found)


def _parts(corners: IntArray, between: IntArray) -> list[IntArray]:
    """Cells in place of (k, c) others, which are divided by vertices (k, c) between each corner and the next one."""
    if corners.shape[1] == 2:
        return [np.stack([corners[:, k], between[:, k]], axis=1) for k in (0, 1)]
    around = [np.stack([between[:, k - 1], corners[:, k], between[:, k]], axis=1) for k in range(3)]
    return [between, *around]


def turned(mesh: Mesh, other: Mesh) -> BoolArray:
    """(m,) true at the corners of faces that look to the other side than the nearest faces of another mesh."""
    marked = np.zeros(len(mesh.vertices), dtype=bool)
    marked[mesh.cells[turned_cells(mesh, other)]] = True
    return marked
