"""Normals of meshes: one a vertex, or several where faces meet at an angle; and those of facets."""

import math
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, cross, dot, merged, paired, unit
from gtb_cli.meshes.topology import adjacent


class Normals(NamedTuple):
    """Unit normals of a mesh."""

    vectors: FloatArray  # (k, 3) first those of the m vertices, then more of some, as where further patches meet
    corners: IntArray | None = None  # (f, 3) the normal of each corner of each face; None: that of its vertex
    are_exact: bool = False  # all are the surface's own, and none is estimated from facets


def normals_of_corners(cells: IntArray, count: int, vectors: FloatArray, rows: IntArray) -> Normals:
    """Return normals of `count` vertices from the (f, 3) rows of vectors at corners; a vertex's own is its first."""
    keys, place = np.unique(paired(cells, rows, len(vectors)).ravel(), return_inverse=True)
    vertex, row = np.divmod(keys, len(vectors))
    further = np.diff(vertex, prepend=-1) == 0
    number = np.where(further, count - 1 + np.cumsum(further), vertex)
    result = np.tile([0.0, 0.0, 1.0], (count + int(further.sum()), 1))  # for vertices without faces
    result[number] = vectors[row]
    return Normals(result, number[place].reshape(cells.shape))


def facet_normals(vertices: FloatArray, cells: IntArray) -> Normals:
    """Return the means of the normals of facets around each vertex, weighted by area, on each side of sharp edges."""
    sharpest = 35.0  # degrees between facets of a mesh of a file that look like a smooth surface
    size = float(np.abs(vertices).max(initial=0.0)) or 1.0
    a, b, c = (vertices[corner] / size for corner in cells.T)
    areas = cross(b - a, c - a)
    facing = unit(areas / (np.abs(areas).max(initial=0.0) or 1.0))
    pairs, ends = adjacent(cells)
    smooth = dot(facing[pairs[:, 0]], facing[pairs[:, 1]]) >= math.cos(math.radians(sharpest))
    pairs, ends = pairs[smooth], ends[smooth]
    links = [np.column_stack([3 * pair + (cells[pair] == end[:, None]).argmax(axis=1) for pair in pairs.T])
             for end in ends.T]  # fmt: skip
    _, rows = np.unique(merged(cells.size, np.concatenate(links)), return_inverse=True)
    sums: FloatArray = np.stack([np.bincount(rows, np.repeat(column, 3)) for column in areas.T], axis=1)
    return normals_of_corners(cells, len(vertices), unit(sums), rows.reshape(cells.shape))


def filled_normals(normals: FloatArray, places: FloatArray, corners: IntArray) -> FloatArray:
    """Replace NaN among (k, 3) normals at places by means of the faces around, weighted by area: (f, 3) corners."""
    missing = np.isnan(normals[:, 0])
    if not missing.any():
        return normals
    touching = missing[corners].any(axis=1)
    a, b, c = (places[corner] for corner in corners[touching].T)
    sums = np.zeros_like(normals)
    np.add.at(sums, corners[touching].T, cross(b - a, c - a))
    scale = np.abs(sums).max(axis=1, keepdims=True)
    sums = np.where(scale > 0, sums / np.where(scale > 0, scale, 1), [0.0, 0.0, 1.0])
    return np.where(missing[:, None], unit(sums), normals)
