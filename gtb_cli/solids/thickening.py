"""Solids: a surface mesh and its offset, joined along the rim, so that an open surface can be printed."""

import math

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, bounds_of, cross, dot, merged, point_text, shifted, unit
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.shading import Normals, facet_normals, normals_of_corners
from gtb_cli.meshes.topology import are_proper, compacted, sides_of
from gtb_cli.solids.offsets import boundary, cell_groups, offset_of, turned_over
from gtb_cli.vocabulary import SIDES, thickness_of

# Roundings of the largest coordinate: a smaller thickness is refused, and a shorter boundary edge is a point
MIN_THICKNESS_ROUNDINGS = 64


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
    vertices = np.concatenate([mesh.vertices, offset_of(mesh, thickness)])
    rim, rim_cell = boundary(mesh)
    below, above = (0, count) if thickness > 0 else (count, 0)
    start, end = rim.T.astype(np.int64)
    sides = np.stack([start + below, end + below, end + above, start + below, end + above, start + above], axis=1)
    sides = sides.reshape(-1, 3)
    cells = np.concatenate([shifted(mesh.cells, above), shifted(mesh.cells[:, ::-1], below), sides])
    part = cell_groups(mesh)
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
                rises = moves[surface[:, 2] >= surface[:, 2].max() - plane, 2].max() > 0.99  # as of a lip, or a lid
                return word + flat + ", its level top upwards" * bool(rises and word.startswith(SIDES[0]))
    return otherwise + flat


def surface_of(solid: Mesh) -> Mesh:
    """Return the surface of a solid made by `thicken`, without faces that are a side."""
    count = len(solid.vertices) // 2
    return Mesh(solid.vertices[:count], solid.cells[(solid.cells < count).all(axis=1)])


def folded_faces(solid: Mesh) -> IntArray:
    """(f,) faces, ascending, of the surface of a solid made by `thicken`, whose offset is turned over.

    A principal radius of curvature is below the thickness there. The offset of a triangle with area, seen along its
    normal, is a linear image of it. The eigenvalues 1 − D κ of this map are positive if it is not folded; past one
    centre of curvature the determinant is negative, past both the trace.
    """
    surface = surface_of(solid)
    return turned_over(surface, solid.vertices[len(surface.vertices) :])


def thinnest_wall(solid: Mesh, thickness: float) -> tuple[float, FloatArray]:
    """Bound the wall of a solid made by `thicken`, in units of its thickness, and tell where it is thinnest.

    It is at most the mean displacement of the corners of a side or face, which is shorter where normals turn within it.
    """
    surface, cells = surface_of(solid).vertices, surface_of(solid).cells
    moves = (solid.vertices[len(surface) :] - surface)[cells] / abs(thickness)
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


def _welded(mesh: Mesh) -> Mesh:
    """Merge the ends of each boundary edge that coincide within rounding, as on a collapsed edge."""
    edges, _ = boundary(mesh)
    ends = mesh.vertices[edges]
    short = np.abs(ends[:, 1] - ends[:, 0]).max(axis=1) <= MIN_THICKNESS_ROUNDINGS * EPS * np.abs(mesh.vertices).max()
    if not short.any():
        return mesh
    cells = merged(len(mesh.vertices), edges[short])[mesh.cells]
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
