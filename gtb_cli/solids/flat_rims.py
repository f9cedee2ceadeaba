"""Flat rims: the wall of `thickening`, with its offset trimmed and extended to the planes of the surface's rims."""

from dataclasses import replace

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, cross, distinct, dot, merged, paired, point_text, unit
from gtb_cli.errors import DomainError, one_of_alike
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.shading import Normals, facet_normals, normals_of_corners
from gtb_cli.meshes.topology import adjacent, are_used, sides_of
from gtb_cli.solids.offsets import evened
from gtb_cli.values import grouped

STEEPEST = 0.2  # sine of the angle of wall and plane above which a rim is not along the normals; flat from 3 times it


def with_flat_rims(solid: Mesh, thickness: float, other: str) -> tuple[Mesh, list[str]]:
    """Move the offset's part of each rim of a solid made by `thicken` into the plane of the surface's part.

    Where the offset ends before the plane, it continues in its tangent planes. Where it goes beyond, it ends in the
    plane: vertices next to the plane move there along edges, and those beyond are projected onto it, as parts of the
    rim. So the wall keeps its thickness up to the rim, and vertices and cells keep their numbers. Where the surface
    lies in the plane the rim changes smoothly to the normals; at corners it is said, and of rims that
    are not plane, such as the peaks of a crown, which stay along the normals.

    A message calls the wall on the other side `other`.

    Raises `DomainError` if no rim is plane, the surface leaves a rim's plane to both sides, the offset goes beyond it
    only where the surface does not lie in it, or the wall reaches another rim.
    """
    count = len(solid.vertices) // 2
    vertices = solid.vertices.copy()
    surface, offset = vertices[:count], vertices[count:]
    is_offset = solid.cells >= count
    is_side = is_offset.any(axis=1) & ~is_offset.all(axis=1)
    cells = solid.cells[~is_offset.any(axis=1)]
    sides = sides_of(cells)
    edges = sides.edges
    label = merged(count, sides.directed[sides.alone])
    is_rim = are_used(sides.directed[sides.alone], count)
    kept, uneven, rims = list[str](), list[str](), distinct(label[is_rim]).tolist()
    is_mitred = np.linalg.norm(offset - surface, axis=1) > (1 + 1e-6) * abs(thickness)
    for number in rims:
        rim = label == number
        centre, normal, nearly = _plane_of(surface, rim, cells)
        away = np.abs((surface[rim] - centre) @ normal)
        if away.max() > nearly:
            farthest = surface[rim][away.argmax()]
            uneven.append(f"leaves its plane by {away.max():.3g} near {point_text(farthest, surface)}")
            continue
        near = f"near {point_text(surface[rim.argmax()], surface)}"
        height = (offset - centre) @ normal
        share, way = _continuation(solid, rim, normal)
        if not share.any():  # as around a hole in a floor
            continue
        if not share.all():
            kept.append(f"in part {near}")
        if ((share < 1) & (height[rim] > nearly)).any():
            what = f"almost in its rim's plane near {point_text(surface[rim][share.argmin()], surface)}"
            cure = f'beyond which the wall would go: {other} does not, or take `rim="normal"`'
            raise DomainError(f"rim: the surface lies {what}, as a patch does at a corner between two edges, {cure}")
        short = rim & (height < 0)
        offset[rim] += (share * np.minimum(height[rim], 0.0))[:, None] * way
        height[rim] = np.where(height[rim] < 0, (1 - share) * height[rim], height[rim])
        beyond = height > nearly  # and, of these, what such vertices connect to those of the rim
        reached = merged(count, edges[beyond[edges].all(axis=1)])
        beyond &= are_used(reached[rim & beyond, None], count)[reached]
        if (beyond & ((surface - centre) @ normal > nearly)).any():
            raise DomainError(f"rim: the surface goes to both sides of the plane of its rim {near}")
        if (beyond & is_rim & ~rim).any():
            raise DomainError(f"rim: the wall at the rim {near} reaches another rim")
        moved, places = _landings(offset, height, edges, beyond, is_mitred, nearly)
        offset[moved], height[moved], beyond[moved] = places, 0.0, False
        offset[beyond] -= height[beyond, None] * normal
        height[beyond] = 0.0
        in_plane = np.concatenate([rim, height == 0])[solid.cells].all(axis=1)
        vertices[:] = _between(vertices, beyond, short & ~is_mitred, rim, solid.cells[in_plane], normal)
        is_side |= in_plane
    if uneven and len(uneven) == len(rims):
        cure = 'only a plane rim can be flat; `rim="normal"` leaves it as it is'
        raise DomainError(f"rim: a rim {uneven[0]}, and {cure}")
    own, rows = solid.normals, solid.normal_of.astype(np.int64)
    around = facet_normals(vertices, solid.cells[is_side])
    assert own is not None
    assert around.corners is not None
    rows[is_side] = len(own) + around.corners

    def normals() -> Normals:
        """The facets' in the planes of rims, and the surface's elsewhere."""
        return normals_of_corners(solid.cells, len(vertices), np.concatenate([own, around.vectors]), rows)

    flat = replace(solid, vertices=vertices, normals=normals, normal_of=None, exact_normals=False)  # type: ignore[arg-type]
    kept = [f"the surface lies in the plane of a rim, which is along the normals {' and '.join(kept)}"] * bool(kept)
    kept += one_of_alike(("", f"a rim {fault}, and stays along the normals") for fault in uneven)
    kept += _thin_wall(vertices, solid.cells, np.asarray(is_side), abs(thickness))
    return flat, kept + _knife_edge(vertices, solid.cells, np.asarray(is_side), abs(thickness))


def _thin_wall(vertices: FloatArray, cells: IntArray, is_rim: BoolArray, thickness: float) -> list[str]:
    """Say where chords make the wall thinner beside a rim, marked among the cells: in middles of faces and sides."""
    thinnest = 0.9  # even where three segments make an edge, walls are not thinner
    count = len(vertices) // 2
    own, offset = cells[(cells < count).all(axis=1)], cells[(cells >= count).all(axis=1) & ~is_rim]
    corners = vertices[offset[are_used(cells[is_rim], len(vertices))[offset].any(axis=1)]]
    places = np.concatenate([corners.mean(axis=1), *((corners[:, k] + corners[:, k - 1]) / 2 for k in range(3))])
    wall = NearestCells(vertices[own]).nearest(places)[0] / thickness if len(places) else np.ones(1)
    if wall.min() >= thinnest:
        return []
    near = point_text(places[wall.argmin()], vertices)
    return [f"beside a rim the wall is {wall.min():.0%} of the thickness near {near}: more faces make it thicker"]


def _knife_edge(vertices: FloatArray, cells: IntArray, is_rim: BoolArray, shortest: float) -> list[str]:
    """Say where a rim, marked among the cells, meets the wall at less than 45 degrees along more than a length.

    There the wall thins out to nothing within less than its thickness: a printer leaves it out or frays it.
    """
    beside = np.flatnonzero(are_used(cells[is_rim], len(vertices))[cells].any(axis=1))
    pairs, ends = adjacent(cells[beside])
    corners = vertices[cells[beside]]
    cosines = -dot(*unit(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))[pairs.T])
    sharp = np.flatnonzero((is_rim[beside[pairs]].sum(axis=1) == 1) & (cosines > np.sqrt(0.5)))
    if np.linalg.norm(np.diff(vertices[ends[sharp]], axis=1), axis=2).sum() <= shortest:  # such as at a corner
        return []
    chosen = sharp[cosines[sharp].argmax()]
    angle, near = np.degrees(np.arccos(cosines[chosen])), point_text(vertices[ends[chosen]].mean(axis=0), vertices)
    return [f'the flat rim meets the wall at {angle:.0f} degrees, a knife edge, near {near}: `rim="normal"` is blunt']


def _plane_of(surface: FloatArray, rim: BoolArray, cells: IntArray) -> tuple[FloatArray, FloatArray, float]:
    """Return a point and the (3,) normal, away from the surface, of a rim's plane, and what counts as no distance."""
    points = surface[rim]
    centre = points.mean(axis=0)
    plane = 1e-6  # of the size of a rim: its largest distance from its plane, a tenth of a micron in a decimetre
    nearly = plane * float(np.ptp(points, axis=0).max()) + 64 * EPS * float(np.abs(points).max())
    _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
    normal = axes[2]
    height = (surface - centre) @ normal
    beside = cells[rim[cells].any(axis=1)]
    return centre, -np.copysign(1.0, float(height[beside.ravel()[np.abs(height[beside]).argmax()]])) * normal, nearly


def _continuation(solid: Mesh, rim: BoolArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k,) shares of the way from the offset's vertices of a rim to its plane, and (k, 3) ways for a height of 1.

    The way is e − m, with the plane's normal m, and e in the plane with ⟨n, e⟩ = ⟨n, m⟩ for the normals n of the
    patches, by least squares: in the tangent planes of all. Small angles go less than the whole way.
    """
    alike = 0.01  # squared sine of the angle, six degrees, within which normals of patches count as one
    assert solid.normals is not None
    count, place = len(rim), np.cumsum(rim) - 1
    inside = np.flatnonzero((solid.cells >= count).all(axis=1))
    corner, normal_of = solid.cells[inside] - count, solid.normal_of[inside]
    keys = distinct(paired(place[corner[rim[corner]]], normal_of[rim[corner]], len(solid.normals)))
    vertex, row = np.divmod(keys, len(solid.normals))
    along = solid.normals[row] @ normal
    flat = solid.normals[row] - along[:, None] * normal
    first = np.flatnonzero(np.diff(vertex, prepend=-1))
    sine = np.minimum.reduceat(np.linalg.norm(flat, axis=1), first)
    share = np.clip(sine / STEEPEST / 2 - 0.5, 0.0, 1.0) if sine.min() < STEEPEST else np.ones(len(sine))
    share = share**2 * (3 - 2 * share)
    squares = np.add.reduceat(flat[:, :, None] * flat[:, None, :], first)
    right = np.add.reduceat(flat * along[:, None], first)
    return share, np.einsum("kij,kj->ki", np.linalg.pinv(squares, rcond=alike, hermitian=True), right) - normal


def _landings(
    offset: FloatArray, height: FloatArray, edges: IntArray, beyond: BoolArray, is_mitred: BoolArray, nearly: float
) -> tuple[IntArray, FloatArray]:
    """Vertices that move along an edge into the plane, and their (k, 3) places there, so that no edge crosses it.

    Of edges that cross the plane the nearest ends move first. Where patches meet at an angle, they move along the seam.
    """
    crossing = edges[beyond[edges].sum(axis=1) == 1]
    above, below = np.where(beyond[crossing[:, :1]], crossing, crossing[:, ::-1]).T
    strictly = height[below] < -nearly
    above, below = above[strictly], below[strictly]
    part = height[above] / (height[above] - height[below])
    places = offset[above] + part[:, None] * (offset[below] - offset[above])
    is_lower = np.where(is_mitred[above] == is_mitred[below], part > 0.5, is_mitred[above])
    vertex, other = np.where(is_lower, [below, above], [above, below])
    way = np.linalg.norm(places - offset[vertex], axis=1)
    ends = np.stack([vertex, other], axis=1)
    crossed: dict[int, list[int]] = grouped(np.concatenate([ends, ends[:, ::-1]]).tolist())  # by each end, the others
    moved: dict[int, int] = {}
    for edge in np.lexsort((way, ~(is_mitred[above] & is_mitred[below]))).tolist():
        if moved.keys().isdisjoint(ends[edge].tolist()):
            moved[int(vertex[edge])] = edge
    for end in reversed([*moved]):  # those whose edges end at others that have moved need not
        if all(far in moved for far in crossed[end]):
            del moved[end]
    return np.array([*moved], dtype=np.int64), places[[*moved.values()]]


def _between(
    vertices: FloatArray, free: BoolArray, along: BoolArray, rim: BoolArray, cells: IntArray, normal: FloatArray
) -> FloatArray:
    """(2m, 3) vertices after some of the offset have moved between their neighbours, while faces are turned over.

    The faces are those in the plane of a rim. Some vertices are free, others move only along the rim.
    """
    count, start, no_ways = len(rim), vertices, np.zeros_like(vertices)
    edges = sides_of(cells).edges
    ends = np.concatenate([edges, edges[:, ::-1]])
    is_free, is_along, is_rim = (np.concatenate([np.zeros(count, dtype=bool), each]) for each in (free, along, rim))
    ends = ends[is_free[ends[:, 0]] | (is_along[ends[:, 0]] & is_rim[ends[:, 1]])]
    best, fewest, is_moving = vertices, len(cells) + 1, np.zeros(len(vertices), dtype=bool)
    for _ in range(8):  # long edges, or a corner that moves farther, leave vertices behind
        a, b, c = (vertices[corner] for corner in cells.T)
        turned = cross(b - a, c - a) @ normal < 0
        if np.count_nonzero(turned) < fewest:
            best, fewest = vertices, int(np.count_nonzero(turned))
        if not fewest:
            break
        is_moving[cells[turned]] = True
        vertices = evened(start, ends, np.ones(len(ends)), no_ways, is_moving & (is_free | is_along))
    return best
