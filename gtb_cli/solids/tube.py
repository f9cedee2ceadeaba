"""Tubes: a circle swept along a polyline, without twist and mitred at turns, so that a curve can be printed."""

import math
from types import MappingProxyType
from typing import Any

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, cross, dot, merged
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.paths import MIN_SEGMENT_ROUNDINGS, MIN_TANGENT_COSINE, Path, paths
from gtb_cli.meshes.shading import normals_of_corners
from gtb_cli.meshes.topology import are_proper, compacted
from gtb_cli.values import frozen
from gtb_cli.vocabulary import MAX_FACES

RING_SIDES = 24  # the polygon deviates from the circle by 0.9 % of the radius, and has corners on both axes
ZERO_TOLERANCE = 1e-9  # of cosines, and of distances in radii: 90° is no sharp turn, where rings may share vertices


def tube(
    mesh: Mesh,
    radius: float,
    *,
    sides: int | None = None,
    tolerance: float | None = None,
    tangents: FloatArray | None = None,
    max_faces: int = MAX_FACES,
) -> Mesh:
    """Sweep a circle of a radius along a polyline, or along several.

    A ring has `sides` vertices, or so many that its polygon is within `tolerance` of the circle; else `RING_SIDES`. The
    tube is then within the tolerance of the points at `radius` from the polyline, by tangents and mitres. Tangents are
    (k, 2, 3) unit vectors at both ends of each segment, as `Patch.tangents` finds them, NaN where undefined; without
    them, the directions of the segments are used.

    The mesh is closed, with outward unit normals. Each polyline between ends or branchings makes one tube, and one
    group if there are several: a ring if its ends coincide, else with flat caps. Attributes are those of the curve.

    Raises `DomainError` if the mesh is not a polyline, a polyline is a single point, or the radius is below rounding,
    and `ToleranceError` if the tube would have more than `max_faces` triangles.

    A turn at a vertex is mitred, one of more than 90° in two steps, so that no vertex is farther than √2 radii from the
    curve. With a tolerance, as many steps are taken as it needs, outside the bend; and the direction of a segment
    replaces a tangent at an angle φ to it if the tube, ``radius (1 − cos φ)`` thin there, would not hold it.
    """
    count = ring_size(radius, tolerance) if sides is None else sides
    planned = _planned(mesh, radius, tolerance, tangents)
    along = sum(len(sections.at) - (not sections.path.closed) for sections in planned)
    if 2 * count * along > max_faces:
        faces = f"{2 * count * along} faces, {count} around and {along} along, more than {max_faces}"
        raise ToleranceError(f"the tube would have {faces}")
    sweeps = [_sweep(sections, radius, count) for sections in planned]
    vertices, vectors, owner, *columns = (np.concatenate(parts) for parts in zip(*sweeps, strict=True))
    firsts, breaks = (np.cumsum([0, *(len(sweep[k]) for sweep in sweeps)]).tolist() for k in (0, 3))
    cells, rows = (column + np.repeat(firsts[:-1], np.diff(breaks))[:, None] for column in columns)
    starts = [int(sections.path.segments[0]) for sections in planned]
    names = [next((name for name, low, high in mesh.groups if low <= k < high), mesh.name) for k in starts]
    return Mesh(
        vertices,
        cells,
        normals=lambda: normals_of_corners(cells, len(owner), vectors, rows),
        groups=tuple(zip(names, breaks[:-1], breaks[1:], strict=True)) if len(names) > 1 else (),
        attributes=MappingProxyType({name: values[owner] for name, values in mesh.attributes.items()}),
        name=mesh.name,
    )


def ring_size(radius: float, tolerance: float | None = None) -> int:
    """The number of sides of a polygon within `tolerance` of its circumscribed circle; by default `RING_SIDES`."""
    if tolerance is None:
        return RING_SIDES
    # radius (1 − cos(π/n)) ≤ tolerance, without cancellation.
    half = math.asin(min(1.0, math.sqrt(tolerance / radius / 2)))
    return max(3, math.ceil(math.pi / (2 * half) * (1 - 4 * EPS)))


def folded_segments(
    mesh: Mesh, radius: float, *, tolerance: float | None = None, tangents: FloatArray | None = None
) -> IntArray:
    """(f,) segments, ascending, beside which a tube runs backwards, as the radius of curvature is less than `radius`.

    Parameters are those of `tube`. Distant parts of a tube that meet are not found.
    """
    found = [np.empty(0, dtype=np.int64)]
    for sections in _planned(mesh, radius, tolerance, tangents):
        path, (rings, _, shift) = sections.path, _rings(sections, radius, RING_SIDES)
        ahead = _ahead(rings, shift, path.closed)
        start = sections.at[: len(ahead)]
        end = np.append(sections.at, 0)[1 : len(ahead) + 1]
        chords = np.roll(path.points, -1, axis=0)[start] - path.points[start]
        backwards = (((ahead - rings[: len(ahead)]) * chords[:, None]).sum(axis=2) <= 0).any(axis=1) & (end != start)
        found.append(path.segments[start[backwards]])
    return np.unique(np.concatenate(found))


def _planned(mesh: Mesh, radius: float, tolerance: float | None, tangents: FloatArray | None) -> list["_Sections"]:
    if not mesh.is_curve:
        raise DomainError("radius: expected a curve; a surface takes a thickness instead")
    largest = float(np.abs(mesh.vertices).max())
    if not radius > MIN_SEGMENT_ROUNDINGS * EPS * largest:
        raise DomainError(f"radius: {radius:g} is below the rounding of coordinates of size {largest:.3g}")
    # A tube is not thinner than the tolerance where tangents have at least this cosine with segments.
    least_cosine = MIN_TANGENT_COSINE if tolerance is None else max(MIN_TANGENT_COSINE, 1 - tolerance / radius)
    return [_sections(path, radius, tolerance) for path in paths(mesh, tangents, least_cosine)]


@frozen
class _Sections:
    """Positions of rings, and the directions before and after them: (m,) vertices of the path and (m, 3) vectors.

    `fans` has the (f, 2) first and last rings of turns in several steps which one mitre would fit, too.
    """

    path: Path
    at: IntArray
    before: FloatArray
    after: FloatArray
    fans: IntArray


def _sections(path: Path, radius: float, tolerance: float | None) -> _Sections:
    """Sections of a path: one at each vertex, and at a sharp turn two, or so many that the mitres hold a tolerance."""
    before = np.concatenate([path.directions[-1:, 1] if path.closed else path.directions[:1, 0], path.directions[:, 1]])
    after = np.concatenate([path.directions[:, 0], path.directions[-1:, 1]])
    count = len(path.vertices)
    cosine = dot(before[:count], after[:count])
    steps = np.where(cosine < -ZERO_TOLERANCE, 2, 1)
    if tolerance is not None:
        # Mitres of a turn φ are at 1 / cos(φ/2) radii.
        share = tolerance / radius
        widest = 2 * math.atan(math.sqrt(share * (2 + share)))
        turn = np.arctan2(np.linalg.norm(cross(before[:count], after[:count]), axis=1), cosine)
        steps = np.maximum(steps, np.ceil(turn / widest * (1 - ZERO_TOLERANCE)).astype(np.intp))
    at = np.repeat(np.arange(count), steps)
    last = np.cumsum(steps) - 1
    first = last + 1 - steps
    before, after = before[at], after[at]
    number = np.arange(len(at)) - first[at]
    rows = np.flatnonzero(number)
    middle, across = before[rows] + after[rows], after[rows] - before[rows]
    length = np.linalg.norm(middle, axis=1, keepdims=True)
    back = length[:, 0] < ZERO_TOLERANCE
    middle[back], length[back] = _perpendicular(before[rows][back]), 1.0
    middle /= length
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.arccos(np.clip(dot(before[rows], middle), -1.0, 1.0)) * (2 * number[rows] / steps[at[rows]] - 1)
    after[rows - 1] = before[rows] = np.cos(angle)[:, None] * middle + np.sin(angle)[:, None] * across
    # The vertices of a mitre slide along the segments as far as radius tan(φ/2).
    lengths = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    shorter = np.minimum(np.append(lengths, lengths[0])[:count], np.insert(lengths, 0, lengths[-1])[:count])
    fits = (cosine >= -ZERO_TOLERANCE) & (radius**2 * (1 - cosine) <= shorter**2 * (1 + cosine))
    return _Sections(path, at, before, after, np.stack([first, last], axis=1)[(steps > 1) & fits])


def _sweep(
    sections: _Sections, radius: float, sides: int
) -> tuple[FloatArray, FloatArray, IntArray, IntArray, IntArray]:
    """A ring at each section of a path, a band of triangles between rings, and caps at the ends of an open path.

    Returns (m, 3) vertices and normals, (m,) vertices of the curve to which they belong, (k, 3) cells, and (k, 3)
    vertices whose normals the corners have: in a cap, its centre.
    """
    path, (rings, across, shift) = sections.path, _rings(sections, radius, sides)
    vertices, normals = rings.reshape(-1, 3), across.reshape(-1, 3)
    owners = np.repeat(path.vertices[sections.at], sides)
    index = np.arange(len(vertices)).reshape(-1, sides)
    ahead = _ahead(index, shift, path.closed)
    behind = index[: len(ahead)]
    b, c = np.roll(behind, -1, axis=1), np.roll(ahead, -1, axis=1)
    cells = np.stack([behind, b, c, behind, c, ahead], axis=2).reshape(-1, 3)
    rows = cells
    if not path.closed:
        (first, last), count = index[[0, -1]], len(vertices)
        caps = [(count, np.roll(first, -1), first), (count + 1, last, np.roll(last, -1))]
        vertices = np.concatenate([vertices, path.points[[0, -1]]])
        normals = np.concatenate([normals, -sections.before[:1], sections.after[-1:]])
        owners = np.concatenate([owners, path.vertices[[0, -1]]])
        cells = np.concatenate([cells, *(np.stack(np.broadcast_arrays(*cap), axis=1) for cap in caps)])
        rows = np.concatenate([rows, np.repeat([count, count + 1], sides)[:, None].repeat(3, axis=1)])
    # The rings of a sharp turn may share vertices; triangles between these vanish.
    twins = np.flatnonzero(np.diff(sections.at) == 0)
    if (met := np.linalg.norm(rings[twins + 1] - rings[twins], axis=2) <= ZERO_TOLERANCE * radius).any():
        label = merged(len(vertices), np.stack([index[twins][met], index[twins + 1][met]], axis=1))
        cells, rows = label[cells], label[rows]
        proper = are_proper(cells)
        used, cells = compacted(cells[proper])
        rows = np.searchsorted(used, rows[proper])
        vertices, normals, owners = vertices[used], normals[used], owners[used]
    return vertices, normals, owners, cells, rows


def _ahead(rings: FloatArray | IntArray, shift: int, closed: bool) -> Any:
    """Each ring's next one; in a closed tube the last is followed by the first, `shift` sides ahead."""
    return np.concatenate([rings[1:], np.roll(rings[:1], -shift, axis=1)]) if closed else rings[1:]


def _rings(sections: _Sections, radius: float, sides: int) -> tuple[FloatArray, FloatArray, int]:
    """(m, sides, 3) vertices of the rings, and their normals; and by how many sides the last one is ahead."""
    angle, shift = _frame(sections, sides)
    turn = angle[:, None] + 2 * np.pi / sides * np.arange(sides)
    centers, before, after = sections.path.points[sections.at], sections.before, sections.after
    start = _perpendicular(before)
    radial = np.cos(turn)[:, :, None] * start[:, None] + np.sin(turn)[:, :, None] * cross(before, start)[:, None]
    # Slide each ring along the tube before it into the mitre plane, where the tube after it has the same vertices.
    rings, normals, _ = _mitred(centers, radius, radial, before, after)
    # Inside a bend, all rings of a fan have the vertices of one mitre.
    first, last = np.repeat(sections.fans, np.diff(sections.fans)[:, 0] + 1, axis=0).T
    fan = np.arange(len(first)) - np.searchsorted(first, first) + first
    *mitre, ahead = _mitred(centers[first], radius, radial[first], before[first], after[last])
    for old, new in zip((rings, normals), mitre, strict=True):
        old[fan] = np.where(ahead > 0, new, old[fan])
    return rings, normals / np.linalg.norm(normals, axis=2, keepdims=True), shift


def _mitred(
    centers: FloatArray, radius: float, radial: FloatArray, before: FloatArray, after: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, sides, 3) vertices and normals, not of unit length, of rings in mitre planes; (m, sides, 1) heights ahead."""
    before, after = before[:, None], after[:, None]
    ahead = (radial * after).sum(axis=2, keepdims=True)
    beyond = ahead / (1 + (before * after).sum(axis=2, keepdims=True))
    return centers[:, None] + radius * (radial - beyond * before), 2 * radial - beyond * (before + after), ahead


def _frame(sections: _Sections, sides: int) -> tuple[FloatArray, int]:
    """The angle from `_perpendicular` at which each ring begins, and by how many vertices the last ring is ahead.

    The frame does not rotate about the curve, to fourth order in the length of segments (W. Wang et al., Computation of
    rotation minimizing frames, 2008). A closed one misses itself by an angle: whole sides are a shift, the rest spread.
    """
    path, before, after = sections.path, sections.before, sections.after
    start = _perpendicular(before)
    # Over the joint: the least rotation that takes `before` to `after`.
    carried = start - dot(start, after)[:, None] / (1 + dot(before, after))[:, None] * (before + after)
    step = np.roll(path.points[sections.at], -1, axis=0) - path.points[sections.at]
    lengths = np.linalg.norm(step, axis=1)
    arrived = np.roll(before, -1, axis=0)
    moving = lengths > 0
    moving[-1] &= path.closed
    # Along the segment: reflect in the plane halfway, then so that the direction is right (double reflection).
    u = step[moving] / lengths[moving, None]
    direction = after[moving] - 2 * dot(u, after[moving])[:, None] * u
    carried[moving] -= 2 * dot(u, carried[moving])[:, None] * u
    u = arrived[moving] - direction
    carried[moving] -= 2 * (dot(u, carried[moving]) / dot(u, u))[:, None] * u
    target = np.roll(start, -1, axis=0)
    advance = np.arctan2(dot(carried, cross(arrived, target)), dot(carried, target))
    angle = np.concatenate([[0.0], np.cumsum(advance[:-1])])
    if not path.closed:
        return angle, 0
    missed = angle[-1] + advance[-1]
    shift = round(missed * sides / (2 * np.pi))
    along = np.concatenate([[0.0], np.cumsum(lengths[:-1])]) / lengths.sum()
    return np.asarray(angle - (missed - shift * 2 * np.pi / sides) * along), shift % sides


def _perpendicular(vectors: FloatArray) -> FloatArray:
    """(m, 3) unit vectors perpendicular to the given ones, as near as possible to the most perpendicular axis."""
    axis = np.eye(3)[np.abs(vectors).argmin(axis=1)]
    across = axis - dot(axis, vectors)[:, None] * vectors
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))
