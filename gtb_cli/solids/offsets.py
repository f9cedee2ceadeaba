"""Offsets of surfaces: parallel to each patch, mitred where patches meet, and trimmed beside inner corners."""

import math
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, cross, distinct, dot, merged, paired, unit
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.topology import are_used, sides_of

# Cosine of the largest angle between a vertex normal and the facets of a patch around it for which the facets share the
# normal. A solid is 3 % too thin on an edge between patches at this angle.
SMOOTH_COSINE = math.cos(math.radians(15))
Sheet: TypeAlias = tuple[IntArray, NearestCells, FloatArray]  # vertices, (k,) triangles, and (k, 3, 3) normals there
MAX_MITRE = 4.0  # largest offset at a sharp edge or corner, in units of the thickness: the offset at an edge of 29°


def offset_of(mesh: Mesh, thickness: float) -> FloatArray:
    """(m, 3) vertices of the offset.

    Vertices of edges between patches go to where the offsets of the patches meet. Beside a concave edge, where offsets
    pass the corner and turn faces over, others go between their neighbours, on the offset, if fewer faces are turned
    over for it: rings of faces about those that are, half as many again in each round. Where this does not suffice,
    vertices of seams move along these as well.
    """
    vertex, normals, place = _patch_normals(mesh)
    moves = _displacements(mesh, vertex, normals)
    is_mitred = dot(moves, moves) > 1 + 1e-6
    best = mesh.vertices + thickness * moves
    if is_mitred.any():
        sheets = _sheets(mesh, normals[place], is_mitred)
        met = (_drawn(best, is_mitred, sheets, thickness) - mesh.vertices) / thickness
        moves = np.where((dot(met, met) <= MAX_MITRE**2)[:, None], met, moves)
        best = mesh.vertices + thickness * moves
    folded = turned_over(mesh, best)
    if not len(folded) or not is_mitred.any():
        return best
    count = len(best)
    links, shares, along = _links(mesh, is_mitred)
    on_seam = np.bincount(links[is_mitred[links[:, 0]], 0], minlength=count) == 2
    is_corner = are_used(boundary(mesh)[0], count) & ~along.any(axis=1)
    for stays in (is_mitred | is_corner, (is_mitred & ~on_seam) | is_corner):
        is_moving, latest, numbers = np.zeros(count, dtype=bool), folded, list[int]()
        for rings in np.ceil(1.5 ** np.arange(11)).astype(int):  # a rim that they reach holds them back
            before = is_moving.copy()
            is_moving[mesh.cells[latest]] = True
            for _ in range(rings):
                is_moving[mesh.cells[is_moving[mesh.cells].any(axis=1)]] = True
            is_moving &= ~stays
            moved = mesh.vertices + thickness * evened(moves, links, shares, along, is_moving)
            if (is_moving == before).all() or not np.isfinite(moved).all():
                break
            moved = _drawn(moved, is_moving, sheets, thickness)
            latest = turned_over(mesh, moved)
            if len(latest) < len(folded):
                best, folded = moved, latest
            if not len(folded):
                return best
            numbers.append(len(latest))
            if numbers[0] > min(numbers[:-2], default=math.inf) <= min(numbers[-2:]):  # two rounds made it no better
                break
    return best


def turned_over(mesh: Mesh, moved: FloatArray) -> IntArray:
    """(f,) faces, ascending, that have area and are turned over by moving the vertices to (m, 3) places."""
    pairs = (mesh.vertices[mesh.cells], moved[mesh.cells])
    (first, second), (to_first, to_second) = ((x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) for x in pairs)
    scale = np.abs(np.stack([first, second])).max(axis=(0, 2))[:, None]
    scale[scale == 0] = 1.0
    first, second, to_first, to_second = (x / scale for x in (first, second, to_first, to_second))
    normal = cross(first, second)
    area = dot(normal, normal)
    determinant = dot(normal, cross(to_first, to_second))
    trace = dot(normal, cross(first, to_second) + cross(to_first, second))
    return np.flatnonzero((area > EPS**2) & ((determinant <= 0) | (trace <= 0)))


def boundary(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """(b, 2) sides that belong to one face only, and (b,) this face."""
    sides = sides_of(mesh.cells)
    if len(wrong := np.flatnonzero(~sides.is_manifold & sides.is_proper)):
        a, b = sides.edges[wrong[0]].tolist()
        why = "has more than two faces, or two that do not agree which side is up: the surface has no two sides there"
        raise DomainError(f"thickness: the edge between vertices {a} and {b} {why}")
    return sides.directed[sides.alone], sides.alone // 3


def cell_groups(mesh: Mesh) -> IntArray:
    """(k,) index of each face's group."""
    groups = mesh.groups or (("", 0, len(mesh.cells)),)
    return np.repeat(np.arange(len(groups)), [stop - start for _, start, stop in groups])


def _sheets(mesh: Mesh, normals: FloatArray, is_mitred: BoolArray) -> list[Sheet]:
    """Divide a surface, with (k, 3, 3) normals at the corners of its faces, at seams with mitres along them."""
    sides, part = sides_of(mesh.cells), cell_groups(mesh)
    one = part[sides.first // 3]
    other = np.bincount(sides.edge.ravel(), np.repeat(part, 3)).astype(int) - one
    pair = paired(one, other, len(one))
    is_smooth = (sides.uses == 2) & ~np.isin(pair, pair[is_mitred[sides.edges].all(axis=1)])
    sheet = merged(int(part.max()) + 1, np.stack([one, other], axis=1)[is_smooth])[part]
    cells = (np.flatnonzero(sheet == each) for each in np.unique(sheet))
    corners = mesh.vertices[mesh.cells]
    return [(np.unique(mesh.cells[own]), NearestCells(corners[own]), normals[own]) for own in cells]


def _drawn(points: FloatArray, chosen: BoolArray, sheets: list[Sheet], thickness: float) -> FloatArray:
    """(m, 3) points, the chosen ones moved the least way onto the offsets of all sheets that they are on.

    A sheet rises above its triangles as the normals at their corners tell, with an error of third order.
    """
    steps, shortest = 4, 1e-3 * abs(thickness)  # of Newton's method
    points = points.copy()
    for _ in range(steps):
        right, squares = np.zeros_like(points), np.zeros((len(points), 3, 3))
        for vertices, cells, normals in sheets:
            rows = vertices[chosen[vertices]]
            nearest = cells.nearest(points[rows])[1]
            corners, own = cells.corners[nearest], normals[nearest]
            shares = _nearest_shares(points[rows], corners)
            normal = unit(np.einsum("ij,ijk->ik", shares, own))
            gap = thickness - dot(points[rows] - np.einsum("ij,ijk->ik", shares, corners), normal)
            for i, j in ((0, 1), (0, 2), (1, 2)):
                gap += shares[:, i] * shares[:, j] * dot(corners[:, j] - corners[:, i], own[:, j] - own[:, i]) / 2
            right[rows] += gap[:, None] * normal
            squares[rows] += normal[:, :, None] * normal[:, None]
        inverses = np.linalg.pinv(squares[chosen], rcond=2 * (1 - SMOOTH_COSINE), hermitian=True)
        points[chosen] += (moves := np.einsum("vij,vj->vi", inverses, right[chosen]))
        if np.abs(moves).max(initial=0.0) < shortest:
            break
    return points


def _nearest_shares(points: FloatArray, corners: FloatArray) -> FloatArray:
    """(m, 3) barycentric coordinates of the nearest points of triangles (m, 3, 3), which may be segments or points."""
    relative, sides = points[:, None] - corners, np.roll(corners, -1, axis=1) - corners
    squares = (sides**2).sum(axis=2)
    along = ((relative * sides).sum(axis=2) / np.where(squares > 0, squares, 1.0)).clip(0.0, 1.0)
    on_sides = along[:, :, None] * np.roll(np.eye(3), 1, axis=1) + (1 - along)[:, :, None] * np.eye(3)
    apart = ((relative - along[:, :, None] * sides) ** 2).sum(axis=2).argmin(axis=1)
    normal = cross(sides[:, 0], sides[:, 1])
    inside = np.stack([dot(cross(sides[:, k - 2], relative[:, k - 2]), normal) for k in range(3)], axis=1)
    is_outside = ((inside < 0).any(axis=1) | (inside <= 0).all(axis=1)).reshape(-1, 1)
    inside /= np.where(is_outside, 1.0, inside.sum(axis=1, keepdims=True))
    return np.where(is_outside, on_sides[np.arange(len(points)), apart], inside)


def _links(mesh: Mesh, is_mitred: BoolArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return (l, 2) vertices and neighbours: of mitred ones along their seams, and of those of the rim along the rim.

    Also return how much the displacement of a vertex takes after that of the neighbour, (l,), and (m, 3) unit vectors
    along the rim, 0 elsewhere and where the rim has a corner. With these shares, displacements that are linear on plane
    patches are the mean of their neighbours': inside patches they are cotangents of the opposite angles, and along
    seams and rims reciprocals of lengths.
    """
    steepest = 1e6  # cotangent: triangles with smaller angles are lines
    straight = math.cos(math.radians(20))  # of half the angle by which a rim turns: beyond, it has a corner
    sides, corners = sides_of(mesh.cells), mesh.vertices[mesh.cells]
    ways = np.roll(corners, -1, axis=1) - corners
    ahead, back = np.roll(ways, -1, axis=1), np.roll(ways, 1, axis=1)
    areas = np.linalg.norm(np.cross(ahead, back), axis=2)
    cotangents = -(ahead * back).sum(axis=2) / np.where(areas > 0, areas, np.inf)
    inside = np.bincount(sides.edge.ravel(), cotangents.clip(-steepest, steepest).ravel())
    lengths = np.linalg.norm(np.diff(mesh.vertices[sides.edges], axis=1)[:, 0], axis=1)
    along = 1 / np.maximum(lengths, EPS * lengths.max())
    rim = sides.directed[sides.alone]
    part, is_rim, rim_ways = cell_groups(mesh), are_used(rim, len(mesh.vertices)), np.zeros_like(mesh.vertices)
    np.add.at(rim_ways, rim.T, unit(np.diff(mesh.vertices[rim], axis=1)[:, 0]) / 2)
    rim_ways[np.linalg.norm(rim_ways, axis=1) < straight] = 0.0
    is_seam = np.bincount(sides.edge.ravel(), np.repeat(part, 3)) != sides.uses * part[sides.first // 3]
    is_seam &= is_mitred[sides.edges].all(axis=1)
    links = np.concatenate([sides.edges, sides.edges[:, ::-1]])
    mitred, on_rim = is_mitred[links[:, 0]], is_rim[links[:, 0]]
    kept = np.where(mitred, np.tile(is_seam, 2), np.tile(sides.uses == 1, 2) | ~on_rim)
    shares = np.where(mitred | on_rim, np.tile(along, 2), np.tile(inside, 2))
    return links[kept], shares[kept], unit(rim_ways)


def evened(moves: FloatArray, links: IntArray, shares: FloatArray, along: FloatArray, free: BoolArray) -> FloatArray:
    """(m, 3) displacements: free ones become means of their neighbours', on the rim but for their parts across it."""
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    hold = 1e-9  # a share of its own displacement, which keeps what nothing else holds
    rows, fixed, result = np.flatnonzero(free), np.flatnonzero(~free), moves.copy()
    weights = csc_array((shares, links.T), shape=(len(moves), len(moves)))[rows]
    held = hold * abs(weights).sum(axis=1) + np.finfo(float).tiny  # where all triangles are lines
    matrix = csc_array(diags_array(weights.sum(axis=1) + held) - weights[:, rows])
    means, along = splu(matrix).solve(held[:, None] * moves[rows] + weights[:, fixed] @ moves[fixed]), along[rows]
    slid = moves[rows] + dot(means - moves[rows], along)[:, None] * along
    result[rows] = np.where(along.any(axis=1, keepdims=True), slid, means)
    return result


def _patch_normals(mesh: Mesh) -> tuple[IntArray, FloatArray, IntArray]:
    """Return (p,) vertices, each once for each patch around it, (p, 3) unit normals there, and (k, 3) rows for corners.

    The normals are the mesh's, or the means of the facets if the mesh's are not exact, or beside an open edge, and
    differ from the facets.
    """
    assert mesh.normals is not None
    vertex_normals = mesh.normals[: len(mesh.vertices)]
    count, groups = len(mesh.vertices), max(1, len(mesh.groups))
    pairs, place = np.unique(paired(mesh.cells, cell_groups(mesh)[:, None], groups), return_inverse=True)
    vertex, place = pairs // groups, place.reshape(-1, 3)
    facets, by_area = _facet_normals(mesh, place, len(pairs))
    own = vertex_normals[vertex]
    if len(mesh.normals) > count:
        pair, normal = distinct(np.stack([place.ravel(), mesh.normal_of.ravel()], axis=1)).T
        sums = np.zeros_like(own)
        np.add.at(sums, pair, mesh.normals[normal])
        own = np.where((np.linalg.norm(sums, axis=1) > SMOOTH_COSINE)[:, None], unit(sums), own)
    # Tiny facets, as at a pole, may stand upright because of rounding: they have angles, but no area.
    agree = np.maximum(*(dot(each, own) for each in (facets, by_area))) >= SMOOTH_COSINE
    agree |= (mesh.exact_normals & ~are_used(boundary(mesh)[0], count)[vertex]) | ~facets.any(axis=1)
    return vertex, np.where(agree[:, None], own, facets), place


def _displacements(mesh: Mesh, vertex: IntArray, normals: FloatArray) -> FloatArray:
    """(m, 3) displacement of each vertex for an offset by 1: its normal, if all patches around it share it.

    Otherwise ⟨n, w⟩ = 1 is solved for w by least squares, with the (p, 3) normals n of patches at (p,) vertices.
    """
    same_normal_cosine = 1 - 1e-9  # cosine of the angle, nine seconds of arc, within which two normals count as equal
    assert mesh.normals is not None
    vertex_normals = mesh.normals[: len(mesh.vertices)]
    wrong = np.unique(vertex[dot(normals, vertex_normals[vertex]) < same_normal_cosine])
    if not len(wrong):
        return vertex_normals
    chosen = np.flatnonzero(np.isin(vertex, wrong))
    first = np.flatnonzero(np.diff(vertex[chosen], prepend=-1))
    normals = normals[chosen]
    right = np.add.reduceat(normals, first)
    values, vectors = np.linalg.eigh(np.add.reduceat(normals[:, :, None] * normals[:, None, :], first))
    # The bound discards directions in which the normals hardly differ.
    inverse = 1 / np.maximum(values, 2 * (1 - SMOOTH_COSINE))
    w = np.einsum("vij,vj,vkj,vk->vi", vectors, inverse, vectors, right, optimize=True)
    # At the edge of a blade the only direction left is the one between its sides.
    blade = np.linalg.norm(w, axis=1) < SMOOTH_COSINE
    w[blade] = MAX_MITRE * unit(right[blade])
    length = np.linalg.norm(w, axis=1, keepdims=True)
    result = vertex_normals.copy()
    result[wrong] = np.where(length > 0, w * np.minimum(1.0, MAX_MITRE / np.maximum(length, 1.0)), result[wrong])
    return result


def _facet_normals(mesh: Mesh, place: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """(count, 3) mean unit normals of the facets with corners in each (k, 3) `place`, 0 where they have no area.

    The first mean is weighted by the angle at the corner, whatever the triangulation; the second, by area.
    """
    a, b, c = (mesh.vertices[corner] for corner in mesh.cells.T)
    sides = [unit(side) for side in (b - a, c - b, a - c)]
    normals = unit(cross(sides[0], sides[1]))
    areas = cross(b - a, c - b) / float(np.abs(mesh.vertices).max() or 1.0) ** 2
    sums, by_area = np.zeros((count, 3)), np.zeros((count, 3))
    for k in range(3):
        angle = np.arccos(np.clip(-dot(sides[k], sides[k - 1]), -1.0, 1.0))
        for axis in range(3):
            sums[:, axis] += np.bincount(place[:, k], angle * normals[:, axis], count)
            by_area[:, axis] += np.bincount(place[:, k], areas[:, axis], count)
    return unit(sums), unit(by_area)
