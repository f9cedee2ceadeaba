"""Meshes with fewer faces, to be looked at: vertices in one cube of a grid become one of them."""

import numpy as np

from gtb_cli.arrays import IntArray, bounds_of, paired
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.topology import are_proper, compacted


def simplified(mesh: Mesh, most: int) -> tuple[Mesh, IntArray]:
    """Return a mesh with at most so many faces, and the (m,) vertices of the given one that it has.

    A mesh that is small enough only loses the vertices that no face uses. All vertices must be finite.
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
