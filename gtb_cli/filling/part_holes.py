"""Holes of CAD parts: rings of edges with one face each, as sides with the tangent planes of these faces."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray, point_text
from gtb_cli.errors import DomainError
from gtb_cli.filling.sides import MAX_GAP, HoleSide, points_and_tangents, stations
from gtb_cli.filling.spline_sides import nearest_curves
from gtb_cli.importers.cad_files import edge_pieces, kernel, parts

DISTANCES = 1e-7, 1e-6, 1e-5
"""Of an edge's spline from one Bézier curve, tried in turn, of the size."""


def part_hole(shape: Any, hole: str | None) -> list[HoleSide]:
    """Return the sides of a hole in a part: the only one, or that nearest to a point such as "10, 0, 2.5".

    Raises `DomainError` if it has no such hole.
    """
    found = _rings(_free_sides(shape))
    if not found:
        raise DomainError("hole: the part has no closed ring of edges with one face")
    places = np.array([np.mean([side.ends[0] for side in ring], axis=0) for ring in found])
    if hole is None:
        if len(found) > 1:
            known = "; ".join(
                f"{point_text(place, places)} (of {len(ring)} sides)" for place, ring in zip(places, found, strict=True)
            )
            raise DomainError(f"hole: the part has {len(found)}, `hole` is a point near one of: {known}")
        return found[0]
    try:
        point = np.array([float(word) for word in hole.split(",")])
    except ValueError:
        point = np.empty(0)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise DomainError(f"hole: expected a point x,y,z near a hole of the part, got {hole!r}")
    return found[int(np.linalg.norm(places - point, axis=1).argmin())]


def _free_sides(shape: Any) -> list[HoleSide]:
    """Return the edges with one face, in the direction and with the fields across of a patch that continues it."""
    tool, forward = kernel("BRep").BRep_Tool, kernel("TopAbs").TopAbs_Orientation.TopAbs_FORWARD
    uses = defaultdict(list)
    for number, face in enumerate(parts(shape, "FACE")):
        for edge in parts(face, "EDGE"):
            if not tool.Degenerated_s(edge) and not tool.IsClosed_s(edge, face):
                uses[hash(edge)].append((number, face, edge))
    free = [one for (one, *others) in uses.values() if not others]
    points = [ends[[0, -1], :3] / ends[[0, -1], 3:] for _, _, edge in free for ends in edge_pieces(edge)]
    size = float(np.ptp(np.concatenate(points), axis=0).max()) if points else 1.0
    sides = []
    for count, (number, face, edge) in enumerate(free):
        curves = _curves(edge, size)
        for k, curve in enumerate(curves):
            sign = 1.0 if edge.Orientation() == forward else -1.0
            points_there, tangents = points_and_tangents(curve, stations())
            name = f"face-{number} edge {count}" + (f" part {k}" if len(curves) > 1 else "")
            side = HoleSide(name, curve, sign * np.cross(tangents, _normals(face, points_there, name)))
            sides.append(side.reversed() if sign > 0 else side)
    return sides


def _normals(face: Any, points: FloatArray, name: str) -> FloatArray:
    """Return the outward unit normals of a face at the points of it that are nearest."""
    surface, gp = kernel("BRep").BRep_Tool.Surface_s(face), kernel("gp")
    project = kernel("GeomAPI").GeomAPI_ProjectPointOnSurf
    sign = -1.0 if face.Orientation() == kernel("TopAbs").TopAbs_Orientation.TopAbs_REVERSED else 1.0
    found = []
    for point in points.tolist():
        place, along, across = gp.gp_Pnt(), gp.gp_Vec(), gp.gp_Vec()
        surface.D1(*project(gp.gp_Pnt(*point), surface).LowerDistanceParameters(), place, along, across)
        normal = along.Crossed(across)
        found.append((normal.X(), normal.Y(), normal.Z()))
    normals = np.array(found)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if lengths.min() <= 1e-9 * lengths.max():
        place_text = point_text(points[int(lengths.argmin())], points)
        raise DomainError(f"{name}: its face has no normal near {place_text}")
    return np.asarray(sign * normals / lengths)


def _curves(edge: Any, size: float) -> list[FloatArray]:
    """Return an edge as Bézier curves: one where one is near enough to all of its polynomial spans."""
    pieces = edge_pieces(edge)
    if len(pieces) < 2 or any(np.ptp(piece[:, 3]) > 0 for piece in pieces):
        return pieces
    start = pieces[0][0, :3]
    for within in DISTANCES:
        curves = nearest_curves([(piece[:, :3] - start) / size for piece in pieces], within)
        if len(curves) == 1:
            break
    return [np.column_stack([points * size + start, np.ones(len(points))]) for points, _, _ in curves]


def _rings(sides: Sequence[HoleSide]) -> list[list[HoleSide]]:
    """Return the closed rings of sides, each of which ends where the next begins."""
    left, found = list(sides), []
    size = float(np.ptp([side.ends for side in sides], axis=(0, 1)).max()) if sides else 1.0
    while left:
        ring = [left.pop(0)]
        while np.linalg.norm(ring[-1].ends[1] - ring[0].ends[0]) > MAX_GAP * size or len(ring) < 2:
            gaps = [np.linalg.norm(side.ends[0] - ring[-1].ends[1]) for side in left]
            if not gaps or min(gaps) > MAX_GAP * size:
                break
            ring.append(left.pop(int(np.argmin(gaps))))
        else:
            found.append(ring)
    return found
