"""Walls of solids: how far it is from a place straight into the solid to the other side; the least: `printability`."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, column_dot, cross, dot, unit
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.frame import Frame
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.topology import are_proper, sides_of

MAX_WALL_FACES = 200_000  # whose walls take 6 s
SLACK = 1e-9  # relative to a triangle, by which it is larger: no ray slips through between two


def wall_of_vertices(mesh: Mesh) -> FloatArray | None:
    """(m,) least thickness of the wall behind the faces at each vertex; None if it has no inside."""
    found = wall_of_faces(mesh)
    if found is None or np.isnan(faces := found[0]).all():
        return None
    walls = np.full(len(mesh.vertices), np.inf)
    np.fmin.at(walls, mesh.faces.ravel(), np.repeat(faces, 3))
    return np.where(np.isfinite(walls), walls, np.nanmax(faces))


def wall_of_faces(mesh: Mesh) -> tuple[FloatArray, IntArray] | None:
    """(k,) thickness of the wall behind each triangle, from its centre against its normal to the first way out.

    Also return the triangle, (k,), on the other side. Without one, −1 and NaN: behind triangles without area, and where
    faces look inwards, so that there is no way out. None if the mesh is not closed and consistently oriented, has no
    area, or has too many long faces across each other. It takes about 4 s for 100 000 triangles: near ways out are
    looked for first, as they bound the search.
    """
    first, places = numbered_places(mesh.vertices)
    cells = places[mesh.faces]
    proper = np.flatnonzero(are_proper(cells))
    if not len(proper) or len(sides_of(cells[proper]).open):
        return None
    frame = Frame.around(mesh.vertices)
    corners = frame.inside(mesh.vertices[first])[cells[proper]]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if dot(corners[:, 0], normals).sum() < 0:  # all look inwards
        normals = -normals
    if not (rows := normals.any(axis=1)).any():
        return None
    proper, corners, normals = proper[rows], corners[rows], normals[rows]
    starts, ways, tree = corners.mean(axis=1), -unit(normals), NearestCells(corners)
    if len(starts) > tree.most_points:
        return None
    lengths, exits = np.full(len(proper), np.nan), np.full(len(proper), -1)
    for reach in np.ptp(corners.reshape(-1, 3), axis=0).max() * np.array([0.02, 0.2, 4.0]):
        left = np.flatnonzero(exits < 0)
        lengths[left], exits[left] = _ways_out(starts[left], ways[left], tree, normals, reach)
    result, others = np.full(len(cells), np.nan), np.full(len(cells), -1)
    result[proper], others[proper] = frame.length(lengths), np.where(exits < 0, -1, proper[exits])
    return result, others


def _ways_out(
    starts: FloatArray, ways: FloatArray, tree: NearestCells, normals: FloatArray, reach: float
) -> tuple[FloatArray, IntArray]:
    """(m,) lengths of rays, along unit vectors, to the first triangle which they leave, and (m,) this triangle.

    A ray leaves through triangles whose normals point its way. NaN and −1 if there is none within the reach.
    """
    ray_batch = 1 << 13  # whose pairs with boxes are held at a time
    lengths, exits = np.full(len(starts), np.inf), np.full(len(starts), -1)
    inverses = (1 / np.where(ways == 0, 1e-300, ways)).T.copy()
    origins = starts.T * inverses
    boxes = [(low.T.copy(), high.T.copy()) for low, high in tree.boxes]  # an axis at a time is several times faster
    for begin in range(0, len(starts), ray_batch):
        ray = np.arange(begin, min(begin + ray_batch, len(starts)))
        top = boxes[-1][0].shape[1]
        ray, node = np.repeat(ray, top), np.tile(np.arange(top), len(ray))
        for level in range(len(boxes) - 1, -1, -1):
            enter, leave = np.zeros(len(ray)), np.full(len(ray), reach)
            for low, high, origin, inverse in zip(*boxes[level], origins, inverses, strict=True):
                inverse, origin = inverse[ray], origin[ray]
                one, other = low[node] * inverse - origin, high[node] * inverse - origin
                enter = np.maximum(enter, np.minimum(one, other))
                leave = np.minimum(leave, np.maximum(one, other))
            met = np.flatnonzero(enter <= leave + SLACK * reach)
            ray, node = ray[met], node[met]
            if level:
                ray, node = tree.inside(level, ray, node)
        cell = tree.order[node]
        leaves = dot(ways[ray], normals[cell]) > 0
        ray, cell = ray[leaves], cell[leaves]
        found = _lengths(starts[ray], ways[ray], tree.corners[cell])
        np.minimum.at(lengths, ray, found)
        first = np.flatnonzero((found == lengths[ray]) & (found <= reach))
        exits[ray[first]] = cell[first]
    return np.where(exits < 0, np.nan, lengths), exits


def _lengths(starts: FloatArray, ways: FloatArray, corners: FloatArray) -> FloatArray:
    """(p,) length of each ray to the plane of its own triangle, (p, 3, 3); infinite if it does not go through it."""
    a, b, c = np.moveaxis(corners, 1, 2).transpose(2, 1, 0)
    start, way = starts.T, ways.T
    normal, turned = cross(b - a, c - a, 0), cross(a - start, way, 0)
    along = column_dot(way, normal)
    v, w = column_dot(turned, c - a) / along, -column_dot(turned, b - a) / along
    inside = (v >= -SLACK) & (w >= -SLACK) & (v + w <= 1 + SLACK)
    length = column_dot(a - start, normal) / along
    # Nearer than rounding are faces that lie on that of the ray: there is nothing between them.
    return np.where(inside & (length > SLACK), length, np.inf)
