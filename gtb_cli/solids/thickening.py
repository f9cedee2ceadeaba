"""Solids: a surface mesh and its offset, joined along the rim, so that an open surface can be printed."""

import math

import numpy as np

from gtb_cli.arrays import (
    EPS,
    BoolArray,
    FloatArray,
    IntArray,
    bounds_of,
    cross,
    distinct,
    dot,
    merged,
    paired,
    point_text,
    shifted,
    unit,
)
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.shading import Normals, facet_normals, normals_of_corners
from gtb_cli.meshes.topology import are_proper, are_used, compacted, sides_of
from gtb_cli.vocabulary import SIDES, thickness_of

# Roundings of the largest coordinate: a smaller thickness is refused, and a shorter boundary edge is a point
MIN_THICKNESS_ROUNDINGS = 64
# Cosine of the largest angle between a vertex normal and the facets of a patch around it for which the facets share the
# normal. A solid is 3 % too thin on an edge between patches at this angle.
SMOOTH_COSINE = math.cos(math.radians(15))
MAX_MITRE = 4.0  # largest offset at a sharp edge or corner, in units of the thickness: the offset at an edge of 29°


def thicken(mesh: Mesh, thickness: float) -> Mesh:
    """Close a surface, an oriented manifold with unit normals, with its offset, to a solid between the two.

    The offset is at this distance along the normals, or against them if it is negative; the surface remains one side.
    The solid is closed, its faces and normals outwards: for each group the faces of one side, of the other, and of its
    part of the rim, which has normals of its own; a closed mesh gets a second shell. Vertices are those of the surface,
    then those of the offset, with the surface's parameters and attributes on both.

    Raises `DomainError` for a curve, a thickness below rounding, and an edge of more than two, or two opposite, faces.

    If patches meet at an angle, the vertex moves to where the offsets of all patches meet, but at most by `MAX_MITRE`
    times the thickness. If the surface bends more sharply than the thickness, the offset folds: see `folded_faces`.
    """
    mesh = _welded(_checked(mesh, thickness))
    count = len(mesh.vertices)
    vertices = np.concatenate([mesh.vertices, _offset(mesh, thickness)])
    rim, rim_cell = _boundary(mesh)
    below, above = (0, count) if thickness > 0 else (count, 0)
    start, end = rim.T.astype(np.int64)
    sides = np.stack([start + below, end + below, end + above, start + below, end + above, start + above], axis=1)
    sides = sides.reshape(-1, 3)
    cells = np.concatenate([shifted(mesh.cells, above), shifted(mesh.cells[:, ::-1], below), sides])
    part = _cell_groups(mesh)
    parts = np.concatenate([part, part, np.repeat(part[rim_cell], 2)])
    order = np.argsort(parts, kind="stable")
    breaks = np.searchsorted(parts[order], np.arange(len(mesh.groups) + 1)).tolist()
    own = mesh.normals

    def normals() -> Normals:
        """Those of the surface on both sides, and the facets' on the rim."""
        around = facet_normals(vertices, sides)
        assert own is not None
        assert around.corners is not None
        corners = (mesh.normal_of, len(own) + mesh.normal_of[:, ::-1], 2 * len(own) + around.corners)
        vectors = np.concatenate([own, -own, around.vectors])
        return normals_of_corners(cells[order], len(vertices), vectors, np.concatenate(corners)[order])

    return Mesh(
        vertices,
        cells[order],
        normals=normals,
        groups=tuple(zip((name for name, _, _ in mesh.groups), breaks, breaks[1:], strict=False)),
        **mesh.carried(np.tile(np.arange(count), 2)),
    )


def signed_thickness(mesh: Mesh, thickness: float | str) -> float:
    """Return a thickness that names a side, as `gtb_cli.vocabulary.thickness_of` reads it, with the normals' sign.

    The inside of a part is what it bounds with lids, fans from the middles of its rims. Either these are less than a
    quarter of its area; or the part is not flat, and three quarters of it and its lids, by the volumes of cones from
    the middle of its box, look to one side of this.

    Raises `DomainError` for a curve, for parts of which neither is so, or whose normals look to different sides.
    """
    side, length = thickness_of(thickness)
    if side is None:
        return length
    sides, count = sides_of(_checked(mesh, length).cells), len(mesh.vertices)
    rim, part = sides.directed[sides.alone], merged(count, sides.edges)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, mesh.vertices)
    np.maximum.at(high, part, mesh.vertices)
    points = mesh.vertices - (low[part] + high[part]) / 2
    loop = merged(count, rim)[rim[:, 0]]
    sums = np.stack([np.bincount(loop, points[rim[:, 0], k], count) for k in range(3)], axis=1)
    around = sums / np.maximum(np.bincount(loop, minlength=count), 1)[:, None]
    lids = np.stack([around[loop], points[rim[:, 1]], points[rim[:, 0]]], axis=1)
    corners = np.concatenate([points[mesh.cells], lids])
    normals, middles = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), corners.mean(axis=1)
    cones, areas, far = dot(middles, normals), np.sqrt(dot(normals, normals)), np.sqrt(dot(middles, middles))
    used, number = np.unique(part[np.concatenate([mesh.cells[:, 0], rim[:, 0]])], return_inverse=True)
    own = np.arange(len(corners)) < len(mesh.cells)
    parts = cones, np.abs(cones), areas * own, areas * ~own, 1e-3 * areas * far
    volume, most, area, lid, flat = (np.bincount(number, each, len(used)) for each in parts)
    lost = np.flatnonzero((np.abs(volume) <= np.maximum(most / 2, flat)) & (lid > area / 4))
    if len(lost) or np.ptp(np.sign(volume)):
        first = used[lost[0] if len(lost) else np.sign(volume).argmin()]
        near = f"near {point_text(mesh.vertices[first], mesh.vertices)}"
        differs = f"some normals look inwards, as {near}, and others outwards"
        why = f"no side of the surface {near} is its inside" if len(lost) else differs
        cure = f"`thickness` {length:g} grows along the normals, and {-length:g} against them"
        raise DomainError(f"thickness: {side} says nothing, as {why}: {cure}")
    return math.copysign(length, volume[0] if side == SIDES[1] else -volume[0])


def side_of_wall(solid: Mesh, otherwise: str) -> str:
    """Say on which side of an open surface the wall of a solid made by `thicken` lies, if a word holds.

    Each word is true at all vertices: up or down if no place is steeper than 60 degrees, else away from the middle of
    the surface's box, or from the upright axis there, or towards it, or again up or down. A plane surface is named.
    """
    surface, offset = np.split(solid.vertices, 2)
    around = surface - bounds_of(surface).mean(axis=0)
    moves, ways = unit(offset - surface), unit(around)
    plane = 1e-6 * np.abs(around).max() + 64 * EPS * np.abs(surface).max()  # as of rims
    is_flat = np.abs(dot(around, moves[:1])).max() <= plane and dot(moves, moves[:1]).min() > 0
    flat = ", a flat plate" * bool(is_flat)
    rounding = 1e-6  # sine of the angle by which a wall may lean to the other side, as a plane floor does from an axis
    for along, least, words in (
        (moves[:, 2], 0.5, ("upwards", "downwards")),
        (dot(moves, ways), -rounding, ("outwards, away from its middle", "inwards, towards its middle")),
        (dot(moves, ways * [1, 1, 0]), -rounding, ("outwards, away from its axis", "inwards, towards its axis")),
        (moves[:, 2], -rounding, ("upwards", "downwards")),
    ):
        for signed, word in zip((along, -along), words, strict=True):
            if signed.min() > least and signed.max() > rounding:
                return word + flat
    return otherwise + flat


def folded_faces(mesh: Mesh, thickness: float) -> IntArray:
    """(f,) triangles, ascending, whose offset is turned over: a principal radius of curvature is below the thickness.

    The offset of a triangle with area, seen along its normal, is a linear image of it. The eigenvalues 1 − D κ of this
    map are positive if it is not folded; past one centre of curvature the determinant is negative, past both the trace.
    """
    return _turned_over(mesh, _offset(_checked(mesh, thickness), thickness))


def _turned_over(mesh: Mesh, moved: FloatArray) -> IntArray:
    """The `folded_faces` of an offset with vertices at (m, 3) places."""
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


def thinnest_wall(solid: Mesh, thickness: float) -> tuple[float, FloatArray]:
    """Bound the wall of a solid made by `thicken`, in units of its thickness, and tell where it is thinnest.

    It is at most the mean displacement of the corners of a side or face, which is shorter where normals turn within it.
    """
    surface, offset = np.split(solid.vertices, 2)
    cells = solid.cells[(solid.cells < len(surface)).all(axis=1)]
    moves = (offset - surface)[cells] / abs(thickness)
    means = np.stack([moves.sum(axis=1) / 3, *((moves[:, k] + moves[:, k - 1]) / 2 for k in range(3))])
    squares = (means**2).sum(axis=2).min(axis=0)
    thinnest = int(squares.argmin())
    return math.sqrt(squares[thinnest]), surface[cells[thinnest]].mean(axis=0)


def _checked(mesh: Mesh, thickness: float) -> Mesh:
    if mesh.is_curve:
        raise DomainError("thickness: expected a surface; a curve takes a radius instead")
    largest = float(np.abs(mesh.vertices).max())
    if not abs(thickness) > MIN_THICKNESS_ROUNDINGS * EPS * largest:
        raise DomainError(f"thickness: {thickness:g} is below the rounding of coordinates of size {largest:.3g}")
    return mesh


def _boundary(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """(b, 2) sides that belong to one face only, and (b,) this face."""
    sides = sides_of(mesh.cells)
    if len(wrong := np.flatnonzero(~sides.is_manifold & sides.is_proper)):
        a, b = sides.edges[wrong[0]].tolist()
        why = "has more than two faces, or two that do not agree which side is up: the surface has no two sides there"
        raise DomainError(f"thickness: the edge between vertices {a} and {b} {why}")
    return sides.directed[sides.alone], sides.alone // 3


def _welded(mesh: Mesh) -> Mesh:
    """Merge the ends of each boundary edge that coincide within rounding, as on a collapsed edge."""
    edges, _ = _boundary(mesh)
    ends = mesh.vertices[edges]
    short = np.abs(ends[:, 1] - ends[:, 0]).max(axis=1) <= MIN_THICKNESS_ROUNDINGS * EPS * np.abs(mesh.vertices).max()
    if not short.any():
        return mesh
    label = merged(len(mesh.vertices), edges[short])
    cells = label[mesh.cells]
    proper = are_proper(cells)
    if not proper.any():
        raise DomainError(f"thickness: the surface {mesh.name!r} is a single point")
    before = np.concatenate([[0], np.cumsum(proper)])
    used, cells = compacted(cells[proper])
    assert mesh.normals is not None
    normals = normals_of_corners(cells, len(used), mesh.normals, mesh.normal_of[proper])
    return Mesh(
        mesh.vertices[used],
        cells,
        normals=lambda: normals._replace(are_exact=mesh.exact_normals),
        groups=tuple((name, int(before[start]), int(before[stop])) for name, start, stop in mesh.groups),
        **mesh.carried(used),
    )


def _cell_groups(mesh: Mesh) -> IntArray:
    """(k,) index of each face's group."""
    groups = mesh.groups or (("", 0, len(mesh.cells)),)
    return np.repeat(np.arange(len(groups)), [stop - start for _, start, stop in groups])


def _offset(mesh: Mesh, thickness: float) -> FloatArray:
    """(m, 3) vertices of the offset.

    Beside a concave edge, where offsets pass the corner and turn faces over, its vertices go to where the offsets of
    its patches meet, and others between their neighbours, on the offset, if fewer faces are turned over for it: rings
    of faces about those that are, twice as many in each round. Where this does not suffice, vertices of seams move
    along these as well.
    """
    moves = _displacements(mesh)
    is_mitred = dot(moves, moves) > 1 + 1e-6
    best = mesh.vertices + thickness * moves
    folded = _turned_over(mesh, best)
    if not len(folded) or not is_mitred.any():
        return best
    count, sheets = len(best), _sheets(mesh, best, is_mitred, folded)
    at_folds = is_mitred & are_used(mesh.cells[folded], count)
    met = (_drawn(best, at_folds, sheets) - mesh.vertices) / thickness
    moves = np.where((at_folds & (dot(met, met) <= MAX_MITRE**2))[:, None], met, moves)
    links, shares, along = _links(mesh, is_mitred)
    on_seam = np.bincount(links[is_mitred[links[:, 0]], 0], minlength=count) == 2
    is_corner = are_used(_boundary(mesh)[0], count) & ~along.any(axis=1)
    for stays in (is_mitred | is_corner, (is_mitred & ~on_seam) | is_corner):
        is_moving, latest = np.zeros(count, dtype=bool), folded
        for rings in 2 ** np.arange(8):
            before = is_moving.copy()
            is_moving[mesh.cells[latest]] = True
            for _ in range(rings):
                is_moving[mesh.cells[is_moving[mesh.cells].any(axis=1)]] = True
            is_moving &= ~stays
            moved = mesh.vertices + thickness * _evened(moves, links, shares, along, is_moving)
            if (is_moving == before).all() or not np.isfinite(moved).all():
                break
            moved = _drawn(moved, is_moving, sheets)
            latest = _turned_over(mesh, moved)
            if len(latest) < len(folded):
                best, folded = moved, latest
            if not len(folded):
                return best
    return best


def _sheets(
    mesh: Mesh, offset: FloatArray, is_mitred: BoolArray, folded: IntArray
) -> list[tuple[IntArray, NearestCells]]:
    """Divide an offset at edges with mitres: the vertices of each sheet, and its triangles that are not folded."""
    count, cell = len(offset), np.repeat(np.arange(len(mesh.cells)), 3)
    corners = np.stack([cell + count, mesh.cells.ravel()], axis=1)
    sheet = merged(count + len(mesh.cells), corners[~is_mitred[corners[:, 1]]])[count:]
    sound = np.delete(np.arange(len(sheet)), folded)
    return [
        (np.unique(mesh.cells[sheet == each]), NearestCells(offset[mesh.cells[sound[sheet[sound] == each]]]))
        for each in np.unique(sheet[sound])
    ]


def _drawn(points: FloatArray, chosen: BoolArray, sheets: list[tuple[IntArray, NearestCells]]) -> FloatArray:
    """(m, 3) points, the chosen ones moved the least way onto all sheets that they are on."""
    steps = 3  # of Newton's method, with the planes of the nearest triangles
    points = points.copy()
    for _ in range(steps):
        right, squares = np.zeros_like(points), np.zeros((len(points), 3, 3))
        for vertices, cells in sheets:
            rows = vertices[chosen[vertices]]
            a, b, c = np.moveaxis(cells.corners[cells.nearest(points[rows])[1]], 1, 0)
            normal = unit(cross(b - a, c - a))
            right[rows] += dot(a - points[rows], normal)[:, None] * normal
            squares[rows] += normal[:, :, None] * normal[:, None]
        inverses = np.linalg.pinv(squares[chosen], rcond=2 * (1 - SMOOTH_COSINE), hermitian=True)
        points[chosen] += np.einsum("vij,vj->vi", inverses, right[chosen])
    return points


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
    part, is_rim, rim_ways = _cell_groups(mesh), are_used(rim, len(mesh.vertices)), np.zeros_like(mesh.vertices)
    np.add.at(rim_ways, rim.T, unit(np.diff(mesh.vertices[rim], axis=1)[:, 0]) / 2)
    rim_ways[np.linalg.norm(rim_ways, axis=1) < straight] = 0.0
    is_seam = np.bincount(sides.edge.ravel(), np.repeat(part, 3)) != sides.uses * part[sides.first // 3]
    is_seam &= is_mitred[sides.edges].all(axis=1)
    links = np.concatenate([sides.edges, sides.edges[:, ::-1]])
    mitred, on_rim = is_mitred[links[:, 0]], is_rim[links[:, 0]]
    kept = np.where(mitred, np.tile(is_seam, 2), np.tile(sides.uses == 1, 2) | ~on_rim)
    shares = np.where(mitred | on_rim, np.tile(along, 2), np.tile(inside, 2))
    return links[kept], shares[kept], unit(rim_ways)


def _evened(moves: FloatArray, links: IntArray, shares: FloatArray, along: FloatArray, free: BoolArray) -> FloatArray:
    """(m, 3) displacements: free ones become means of their neighbours', but for their parts along normals."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    hold = 1e-9  # a share of its own displacement, which keeps what nothing else holds
    rows, result, number = np.flatnonzero(free), moves.copy(), np.cumsum(free) - 1
    (start, end), shares = links[free[links[:, 0]]].T, shares[free[links[:, 0]]]
    own, is_free = number[start], free[end]
    sums = np.bincount(own, shares, len(rows))
    held = np.bincount(own, hold * np.abs(shares), len(rows)) + np.finfo(float).tiny  # where all triangles are lines
    entries = np.append(sums + held, -shares[is_free])
    line, column = (np.append(np.arange(len(rows)), each[is_free]) for each in (own, number[end]))
    right = held[:, None] * moves[rows]
    np.add.at(right, own[~is_free], (shares[:, None] * moves[end])[~is_free])
    ways, along = splu(csc_array((entries, (line, column)))).solve(right) - moves[rows], along[rows]
    ways = np.where(along.any(axis=1, keepdims=True), dot(ways, along)[:, None] * along, ways)
    result[rows] += ways - (dot(ways, moves[rows]) / dot(moves[rows], moves[rows]))[:, None] * moves[rows]
    return result


def _displacements(mesh: Mesh) -> FloatArray:
    """(m, 3) displacement of each vertex for an offset by 1: its normal, if all patches around it share it.

    Otherwise ⟨n, w⟩ = 1 is solved for w by least squares, with the normals n of the patches: the mesh's, or the means
    of the facets if the mesh's are not exact, or beside an open edge, and differ from the facets.
    """
    same_normal_cosine = 1 - 1e-9  # cosine of the angle, nine seconds of arc, within which two normals count as equal
    assert mesh.normals is not None
    vertex_normals = mesh.normals[: len(mesh.vertices)]
    count, groups = len(mesh.vertices), max(1, len(mesh.groups))
    keys = paired(mesh.cells, _cell_groups(mesh)[:, None], groups)
    pairs, place = np.arange(count), keys
    if groups > 1:
        pairs, place = np.unique(keys, return_inverse=True)
    vertex = pairs // groups
    facets, by_area = _facet_normals(mesh, place.reshape(-1, 3), len(pairs))
    own = vertex_normals[vertex]
    if len(mesh.normals) > count:
        pair, normal = distinct(np.stack([place.ravel(), mesh.normal_of.ravel()], axis=1)).T
        sums = np.zeros_like(own)
        np.add.at(sums, pair, mesh.normals[normal])
        own = np.where((np.linalg.norm(sums, axis=1) > SMOOTH_COSINE)[:, None], unit(sums), own)
    is_open = are_used(_boundary(mesh)[0], count)
    # Tiny facets, as at a pole, may stand upright because of rounding: they have angles, but no area.
    agree = np.maximum(*(dot(each, own) for each in (facets, by_area))) >= SMOOTH_COSINE
    agree |= (mesh.exact_normals & ~is_open[vertex]) | ~facets.any(axis=1)
    normals = np.where(agree[:, None], own, facets)
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
