"""Paths: segments of a polyline in order of traversal, with directions."""

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.values import frozen

MIN_SEGMENT_ROUNDINGS = 1024  # of the largest coordinate: shorter segments have no direction, and are skipped
MIN_TANGENT_COSINE = 0.5  # between a tangent and its segments, whose directions are used below it: the mesh is coarse


@frozen
class Path:
    """An open or closed polyline: segments with their directions at both ends."""

    segments: IntArray  # (s,) cells of the mesh
    vertices: IntArray  # (s + 1,) or, closed, (s,)
    points: FloatArray  # (s + 1, 3) the ends of the segments
    directions: FloatArray  # (s, 2, 3) unit vectors
    closed: bool


def paths(mesh: Mesh, tangents: FloatArray | None = None, least_cosine: float = MIN_TANGENT_COSINE) -> Iterator[Path]:
    """Yield the paths of a mesh of segments; raises `DomainError` for one that is a single point.

    Their directions are the tangents (k, 2, 3) where the angle with the segment has at least this cosine.
    """
    closing_gap = 1e-9  # largest distance between the ends of a closed polyline, as a fraction of its extent
    size = float(np.ptp(mesh.vertices, axis=0).max())
    shortest = MIN_SEGMENT_ROUNDINGS * EPS * float(np.abs(mesh.vertices).max())
    for vertices, segments, backwards in _chains(mesh.cells, len(mesh.vertices)):
        points = mesh.vertices[vertices]
        lengths = np.abs(np.diff(points, axis=0)).max(axis=1)
        # The segment after skipped ones begins at their start; the last segment ends at the end of the path.
        long = np.flatnonzero(lengths > shortest)
        if not len(long):
            place = ", ".join(f"{x:g}" for x in points[0])
            raise DomainError(f"radius: the curve {mesh.name!r} is a single point at ({place})")
        kept = np.append(long, len(segments))
        kept[0] = 0
        points, vertices, segments = points[kept], vertices[kept], segments[long]
        chords = np.diff(points, axis=0)
        chords /= np.abs(chords).max(axis=1, keepdims=True)
        chords /= np.linalg.norm(chords, axis=1, keepdims=True)
        directions = np.repeat(chords[:, None], 2, axis=1)
        if tangents is not None:
            given = tangents[segments]
            given = np.where(backwards[long, None, None], -given[:, ::-1], given)
            along = np.einsum("sij,sj->si", given, chords)
            directions = np.where((along > least_cosine)[:, :, None], given, directions)
        # Two segments that end where they begin are not a ring: they lead there and back.
        closed = len(segments) > 2 and bool(np.abs(points[0] - points[-1]).max() <= closing_gap * size)
        yield Path(segments, vertices[:-1] if closed else vertices, points, directions, closed)


def _chains(cells: IntArray, count: int) -> Iterator[tuple[IntArray, IntArray, BoolArray]]:
    """Order segments into chains between vertices that do not belong to exactly two segments, then into rings.

    Yields the s + 1 vertices of each, its s segments, and which of these are traversed backwards.
    """
    degree = np.bincount(cells.ravel(), minlength=count)
    incident = (np.argsort(cells.ravel(), kind="stable") // 2).tolist()
    first, inner = np.concatenate([[0], np.cumsum(degree)]).tolist(), (degree == 2).tolist()
    ends = cells.tolist()
    used = [False] * len(ends)
    starts = [k for k in range(len(ends)) if not (inner[ends[k][0]] and inner[ends[k][1]])]
    for segment in (*starts, *range(len(ends))):
        if used[segment]:
            continue
        # A chain begins at an end or a branching; a segment with two such ends is traversed forwards.
        vertex = ends[segment][inner[ends[segment][0]] and not inner[ends[segment][1]]]
        vertices, segments, backwards = [vertex], list[int](), list[bool]()
        while not used[segment]:
            used[segment] = True
            segments.append(segment)
            backwards.append(ends[segment][0] != vertex)
            vertex = sum(ends[segment]) - vertex
            vertices.append(vertex)
            if inner[vertex]:  # go on along the other one of its two segments
                segment = sum(incident[first[vertex] : first[vertex + 1]]) - segment
        yield np.array(vertices), np.array(segments), np.array(backwards)
