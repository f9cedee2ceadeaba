"""Meshes to be looked at: with fewer faces, and with distances from another one, which colours show in `page.js`."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, bounds_of, paired
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells, middles
from gtb_cli.meshes.topology import are_proper, compacted


def simplified(mesh: Mesh, most: int) -> tuple[Mesh, IntArray]:
    """Return a mesh with at most so many faces, and the (m,) vertices of the given one that it has.

    Vertices in one cube of a grid become one of them. A mesh that is small enough only loses the vertices that no face
    uses. All vertices must be finite.
    """
    kept, cells = compacted(mesh.cells)
    points = mesh.vertices[kept]
    low, high = bounds_of(points)
    size = float((high / 2 - low / 2).max()) or 1.0  # halves, because high - low may overflow
    number = 2.0 * np.sqrt(most)  # cubes along the longest side
    found, chosen = cells, np.arange(len(kept))
    while len(found) > most:
        number *= 0.8
        x, y, z = np.floor((points / 2 - low / 2) / size * number).astype(np.int64).T
        count = int(number) + 1
        _, chosen, label = np.unique(paired(paired(x, y, count), z, count), return_index=True, return_inverse=True)
        found = label[cells]
        found = found[are_proper(found)]
    if len(found) < len(cells):  # other faces may have become the same one
        found = found[np.sort(np.unique(np.sort(found, axis=1), axis=0, return_index=True)[1])]
    used, found = compacted(found)
    kept = kept[chosen[used]]
    return Mesh(mesh.vertices[kept], found, name=mesh.name), kept


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
    return [between, *(np.stack([between[:, k - 1], corners[:, k], between[:, k]], axis=1) for k in range(3))]
