"""Tubes: a circle swept along a polyline, so that a curve can be printed.

Rings of vertices lie in planes across the curve, and a rotation-minimising frame says where each ring begins, so that
the tube has no twist. If the direction changes at a vertex, its ring lies in the mitre plane, halfway between the two;
a sharp turn has several rings, like a fan.
"""

import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, cross, dot
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.paths import MIN_SEGMENT_ROUNDINGS, MIN_TANGENT_COSINE, Path, paths
from gtb_cli.meshes.shading import normals_of_corners
from gtb_cli.meshes.topology import are_proper, compacted
from gtb_cli.meshes.welding import merged
from gtb_cli.values import frozen
from gtb_cli.vocabulary import MAX_FACES

# Vertices of a ring: the polygon deviates from the circle by 0.9 % of the radius, and has corners on both axes
RING_SIDES = 24
# Cosines, and distances as fractions of the radius, that count as zero: a turn of 90° is not sharp, and the two rings
# of a sharp turn may share vertices
ZERO_TOLERANCE = 1e-9


def tube(
    mesh: Mesh,
    radius: float,
    *,
    sides: int | None = None,
    tolerance: float | None = None,
    tangents: FloatArray | None = None,
    max_faces: int = MAX_FACES,
) -> Mesh:
    """Sweep a circle along a polyline.

    Parameters
    ----------
    mesh : Mesh
        A polyline, or several.
    radius : float
        Radius of the circle, in model units.
    sides : int, optional
        Vertices of each ring, at least 3.
    tolerance : float, optional
        Largest distance between the circle and its polygon, instead of `sides`; and between the tube and points at
        `radius` from the polyline, by tangents and mitres. Without either, a ring has `RING_SIDES` sides.
    tangents : (k, 2, 3) float, optional
        Unit tangents of the curve at both ends of each segment, as `curve_tangents` returns them; NaN where undefined.
        Without them, the directions of the segments are used.
    max_faces : int
        A tube with more triangles is refused before it is made.

    Returns
    -------
    Mesh
        Closed, with outward unit normals. Each polyline between ends or branchings makes one tube, and one group if
        there are several. The tube is a ring if the ends of the polyline coincide; otherwise it has flat caps.
        Attributes are those of the curve.

    Raises
    ------
    DomainError
        The mesh is not a polyline, a polyline is a single point, or a number is out of range.
    ToleranceError
        The tube would have too many triangles.

    Notes
    -----
    A turn at a vertex is mitred, and a turn of more than 90° is mitred in two steps, so that no vertex is farther than
    √2 radii from the curve. With a tolerance, as many steps are taken as it needs, outside the bend; and the direction
    of a segment replaces a tangent at an angle φ to it if the tube, ``radius (1 − cos φ)`` thin there, would not hold
    it. The frame comes from double reflection; its error is of fourth order in the length of
    segments. The frame of a closed tube misses itself by an angle; this angle, less whole sides, is spread over the
    length. If the curve bends more sharply than the radius, the tube meets itself: see `folded_segments`. Caps have
    normals of their own.

    References
    ----------
    W. Wang, B. Jüttler, D. Zheng, Y. Liu, Computation of rotation minimizing frames, ACM Trans. Graph. 27 (2008).
    """
    _check(mesh, radius, tangents)
    count = ring_size(radius, tolerance) if sides is None else sides
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 3:
        raise DomainError(f"sides: expected a whole number of at least 3, got {sides!r}")
    _refuse_too_many(len(mesh.cells), int(count), max_faces)
    planned = [
        (path, _sections(path, radius, tolerance)) for path in paths(mesh, tangents, least_cosine(radius, tolerance))
    ]
    _refuse_too_many(sum(len(sections.at) - (not path.closed) for path, sections in planned), int(count), max_faces)
    sweeps = [_sweep(path, sections, radius, int(count)) for path, sections in planned]
    first = np.cumsum([0, *(len(sweep.vertices) for sweep in sweeps)]).tolist()
    breaks = np.cumsum([0, *(len(sweep.cells) for sweep in sweeps)]).tolist()
    names = [_name(mesh, path) for path, _ in planned]
    owner = np.concatenate([sweep.owners for sweep in sweeps])
    cells, rows = (
        np.concatenate([part + start for part, start in zip(parts, first, strict=False)])
        for parts in ([sweep.cells for sweep in sweeps], [sweep.normal_of for sweep in sweeps])
    )
    vectors = np.concatenate([sweep.normals for sweep in sweeps])
    return Mesh(
        np.concatenate([sweep.vertices for sweep in sweeps]),
        cells,
        normals=lambda: normals_of_corners(cells, len(owner), vectors, rows),  # type: ignore[arg-type]
        groups=tuple(zip(names, breaks[:-1], breaks[1:], strict=True)) if len(names) > 1 else (),
        attributes=MappingProxyType({name: values[owner] for name, values in mesh.attributes.items()}),
        name=mesh.name,
    )


def ring_size(radius: float, tolerance: float | None = None) -> int:
    """The number of sides of a polygon within `tolerance` of its circumscribed circle; by default `RING_SIDES`."""
    if tolerance is None:
        return RING_SIDES
    if not tolerance > 0:
        raise DomainError(f"tolerance: must be positive, got {tolerance!r}")
    # radius (1 − cos(π/n)) ≤ tolerance, without cancellation.
    half = math.asin(min(1.0, math.sqrt(tolerance / radius / 2)))
    return max(3, math.ceil(math.pi / (2 * half) * (1 - 4 * EPS)))


def least_cosine(radius: float, tolerance: float | None) -> float:
    """Least cosine of the angle of tangents with segments, so that a tube is not thinner than the tolerance."""
    return MIN_TANGENT_COSINE if tolerance is None else max(MIN_TANGENT_COSINE, 1 - tolerance / radius)


def folded_segments(
    mesh: Mesh, radius: float, *, tolerance: float | None = None, tangents: FloatArray | None = None
) -> IntArray:
    """Segments beside which a tube runs backwards, because the radius of curvature is less than `radius`.

    Parameters are those of `tube`. Distant parts of a tube that meet are not found.

    Returns
    -------
    (f,) int
        Indices of cells, ascending.
    """
    _check(mesh, radius, tangents)
    found = [np.empty(0, dtype=np.int64)]
    for path in paths(mesh, tangents, least_cosine(radius, tolerance)):
        found.append(path.segments[_sweep(path, _sections(path, radius, tolerance), radius, RING_SIDES).folded])
    return np.unique(np.concatenate(found))


def _check(mesh: Mesh, radius: float, tangents: FloatArray | None) -> None:
    if not mesh.is_curve:
        raise DomainError("radius: expected a curve; a surface takes a thickness instead")
    if not len(mesh.cells):
        raise DomainError("radius: the curve has no segments")
    if not (math.isfinite(radius) and radius > 0):
        raise DomainError(f"radius: must be positive, got {radius!r}")
    rounding = EPS * float(np.abs(mesh.vertices).max())
    if not radius > MIN_SEGMENT_ROUNDINGS * rounding:
        raise DomainError(f"radius: {radius:g} is below the rounding of coordinates of size {rounding / EPS:.3g}")
    if tangents is not None and tangents.shape != (len(mesh.cells), 2, 3):
        raise DomainError(f"tangents: expected shape ({len(mesh.cells)}, 2, 3), got {tangents.shape}")


def _refuse_too_many(along: int, around: int, max_faces: int) -> None:
    triangles = 2 * around * along
    if triangles > max_faces:
        raise ToleranceError(
            f"the tube would have {triangles} faces, {around} around and {along} along, more than {max_faces}"
        )


def _name(mesh: Mesh, path: Path) -> str:
    """The name of the group of a path's first segment."""
    first = int(path.segments[0])
    return next((name for name, start, stop in mesh.groups if start <= first < stop), mesh.name)


@frozen
class _Sweep:
    """A tube around one path.

    Attributes
    ----------
    vertices, normals : (m, 3) float
    owners : (m,) int
        The vertex of the curve to which each vertex belongs.
    cells : (k, 3) int
    folded : (s,) bool
        Segments of the path beside which the tube runs backwards.
    """

    vertices: FloatArray
    normals: FloatArray
    owners: IntArray
    cells: IntArray
    folded: BoolArray
    is_capped: bool = False

    @property
    def normal_of(self) -> IntArray:
        """(k, 3) vertices whose normals the corners have: in a cap, its centre, one of the last two."""
        is_cap = self.is_capped & (self.cells >= len(self.vertices) - 2).any(axis=1, keepdims=True)
        return np.where(is_cap, self.cells.max(axis=1, keepdims=True), self.cells)


@frozen
class _Sections:
    """Positions of rings, and the directions before and after them: (m,) vertices of the path and (m, 3) vectors.

    `fans` has the (f, 2) first and last rings of turns in several steps which one mitre would fit, too.
    """

    at: IntArray
    centers: FloatArray
    before: FloatArray
    after: FloatArray
    closed: bool
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
        steps = np.maximum(steps, np.ceil(turn / widest * (1 - ZERO_TOLERANCE)).astype(np.int64))
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
    fans = np.stack([first, last], axis=1)[(steps > 1) & fits]
    return _Sections(at, path.points[at], before, after, path.closed, fans)


def _sweep(path: Path, sections: _Sections, radius: float, sides: int) -> _Sweep:
    """A ring at each section of a path, a band of triangles between rings, and caps at the ends of an open path."""
    angle, shift = _frame(sections, sides)
    rings, normals = _rings(sections, radius, angle, sides)
    index = np.arange(len(rings) * sides).reshape(-1, sides)
    # Each ring with the next one; in a closed tube the last is followed by the first, `shift` sides ahead.
    ahead = np.concatenate([index[1:], np.roll(index[:1], -shift, axis=1)]) if path.closed else index[1:]
    behind = index[: len(ahead)]
    tube = _Sweep(
        rings.reshape(-1, 3),
        normals.reshape(-1, 3),
        np.repeat(path.vertices[sections.at], sides),
        _bands(behind, ahead),
        _folded(path, sections, rings.reshape(-1, 3)[ahead] - rings.reshape(-1, 3)[behind]),
    )
    if not path.closed:
        tube = _capped(tube, path, sections, sides)
    twins = np.flatnonzero(np.diff(sections.at) == 0)
    met = np.linalg.norm(rings[twins + 1] - rings[twins], axis=2) <= ZERO_TOLERANCE * radius
    return _joined(tube, np.stack([index[twins][met], index[twins + 1][met]], axis=1)) if len(twins) else tube


def _rings(sections: _Sections, radius: float, angle: FloatArray, sides: int) -> tuple[FloatArray, FloatArray]:
    """(m, sides, 3) vertices of the rings, and their normals."""
    turn = angle[:, None] + 2 * np.pi / sides * np.arange(sides)
    start = _perpendicular(sections.before)
    other = cross(sections.before, start)
    radial = np.cos(turn)[:, :, None] * start[:, None] + np.sin(turn)[:, :, None] * other[:, None]
    # Slide each ring along the tube before it into the mitre plane, where the tube after it has the same vertices.
    rings, normals, _ = _mitred(sections.centers, radius, radial, sections.before, sections.after)
    # Inside a bend, all rings of a fan have the vertices of one mitre.
    first, last = np.repeat(sections.fans, np.diff(sections.fans)[:, 0] + 1, axis=0).T
    fan = np.arange(len(first)) - np.searchsorted(first, first) + first
    *mitre, ahead = _mitred(
        sections.centers[first], radius, radial[first], sections.before[first], sections.after[last]
    )
    rings[fan], normals[fan] = (
        np.where(ahead > 0, new, old[fan]) for new, old in zip(mitre, (rings, normals), strict=True)
    )
    return rings, normals / np.linalg.norm(normals, axis=2, keepdims=True)


def _mitred(
    centers: FloatArray, radius: float, radial: FloatArray, before: FloatArray, after: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, sides, 3) vertices and normals, not of unit length, of rings in mitre planes; (m, sides, 1) heights ahead."""
    before, after = before[:, None], after[:, None]
    ahead = (radial * after).sum(axis=2, keepdims=True)
    beyond = ahead / (1 + (before * after).sum(axis=2, keepdims=True))
    return centers[:, None] + radius * (radial - beyond * before), 2 * radial - beyond * (before + after), ahead


def _bands(behind: IntArray, ahead: IntArray) -> IntArray:
    """Two triangles for each side of each ring, between it and the ring ahead."""
    b, c = np.roll(behind, -1, axis=1), np.roll(ahead, -1, axis=1)
    return np.stack([behind, b, c, behind, c, ahead], axis=2).reshape(-1, 3)


def _folded(path: Path, sections: _Sections, steps: FloatArray) -> BoolArray:
    """(s,) true where a (rings, sides, 3) step from ring to ring along each segment of the path leads backwards."""
    start = sections.at[: len(steps)]
    end = np.append(sections.at, 0)[1 : len(steps) + 1]
    chords = np.roll(path.points, -1, axis=0)[start] - path.points[start]
    backwards = ((steps * chords[:, None]).sum(axis=2) <= 0).any(axis=1) & (end != start)
    folded = np.zeros(len(path.segments), dtype=bool)
    folded[start[backwards]] = True
    return folded


def _capped(tube: _Sweep, path: Path, sections: _Sections, sides: int) -> _Sweep:
    """The tube with a vertex at each end, and triangles around it."""
    count = len(tube.vertices)
    first, last = np.arange(sides), np.arange(count - sides, count)
    caps = [(count, np.roll(first, -1), first), (count + 1, last, np.roll(last, -1))]
    return replace(
        tube,
        vertices=np.concatenate([tube.vertices, sections.centers[[0, -1]]]),
        normals=np.concatenate([tube.normals, -sections.before[:1], sections.after[-1:]]),
        owners=np.concatenate([tube.owners, path.vertices[[0, -1]]]),
        cells=np.concatenate([tube.cells, *(np.stack(np.broadcast_arrays(*cap), axis=1) for cap in caps)]),
        is_capped=True,
    )


def _joined(tube: _Sweep, pairs: IntArray) -> _Sweep:
    """The tube with (c, 2) pairs of vertices merged, without the triangles that vanish."""
    cells = merged(len(tube.vertices), pairs)[tube.cells]
    used, cells = compacted(cells[are_proper(cells)])
    return replace(
        tube, vertices=tube.vertices[used], normals=tube.normals[used], owners=tube.owners[used], cells=cells
    )


def _frame(sections: _Sections, sides: int) -> tuple[FloatArray, int]:
    """The angle from `_perpendicular` at which each ring begins, and by how many vertices the last ring is ahead.

    All rings of a tube begin at the same angle in a frame that does not rotate about the curve. A closed tube's frame
    misses itself by some angle: its whole sides are a shift, the rest is spread over the length.
    """
    before, after, centers = sections.before, sections.after, sections.centers
    start = _perpendicular(before)
    # Over the joint: the least rotation that takes `before` to `after`.
    carried = start - dot(start, after)[:, None] / (1 + dot(before, after))[:, None] * (before + after)
    step = np.roll(centers, -1, axis=0) - centers
    lengths = np.linalg.norm(step, axis=1)
    arrived = np.roll(before, -1, axis=0)
    moving = lengths > 0
    moving[-1] &= sections.closed
    # Along the segment: reflect in the plane halfway, then so that the direction is right (double reflection).
    u = step[moving] / lengths[moving, None]
    direction = after[moving] - 2 * dot(u, after[moving])[:, None] * u
    carried[moving] -= 2 * dot(u, carried[moving])[:, None] * u
    u = arrived[moving] - direction
    carried[moving] -= 2 * (dot(u, carried[moving]) / dot(u, u))[:, None] * u
    target = np.roll(start, -1, axis=0)
    advance = np.arctan2(dot(carried, cross(arrived, target)), dot(carried, target))
    angle = np.concatenate([[0.0], np.cumsum(advance[:-1])])
    if not sections.closed:
        return angle, 0
    missed = angle[-1] + advance[-1]
    shift = round(missed * sides / (2 * np.pi))
    rest = missed - shift * 2 * np.pi / sides
    along = np.concatenate([[0.0], np.cumsum(lengths[:-1])]) / lengths.sum()
    return np.asarray(angle - rest * along), shift % sides


def _perpendicular(vectors: FloatArray) -> FloatArray:
    """(m, 3) unit vectors perpendicular to the given ones, as near as possible to the most perpendicular axis."""
    axis = np.eye(3)[np.abs(vectors).argmin(axis=1)]
    across = axis - dot(axis, vectors)[:, None] * vectors
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))
