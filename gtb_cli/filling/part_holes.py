"""Holes of CAD parts: rings of edges with one face each, as sides with the tangent planes of these faces."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gtb_cli.arrays import FloatArray, point_text
from gtb_cli.errors import DomainError
from gtb_cli.filling.holes import Ring, closed_rings
from gtb_cli.filling.sides import MAX_GAP, HoleSide, points_and_tangents, stations
from gtb_cli.filling.spline_sides import nearest_curve
from gtb_cli.importers.cad_files import box_of, edge_pieces, edge_uses, kernel, kernel_faults, nearest_normals, parts
from gtb_cli.values import frozen

SEWN = 1e-6  # of the size: distance within which edges of neighbouring faces are one


@frozen
class Part:
    """A shape of the kernel, its edges with one face (name, whether in a hole's direction, edge, face), and rings."""

    shape: Any
    edges: Sequence[tuple[str, bool, Any, Any]]
    size: float
    rings: Sequence[Ring]

    @kernel_faults()
    def sides(self, ring: Ring) -> tuple[list[HoleSide], tuple[str, ...]]:
        """Return three sides of a hole or more, across which a patch continues the faces, and remarks on curves."""
        sides, remarks = [], []
        for label, along, edge, face in (self.edges[number] for number in ring.edges):
            curves = _curves(edge, self.size, -(-3 // len(ring.edges)))
            for k, (curve, distance) in [*enumerate(curves)][:: 1 if along else -1]:
                name = f"{label} part {k}" if len(curves) > 1 else label
                start = curve[0, :3] / curve[0, 3]  # far from the origin, points and derivatives lose digits
                points, tangents = points_and_tangents(curve - np.append(start, 0) * curve[:, 3:], stations())
                normals = nearest_normals(face, start, points, self.size)
                if bad := np.flatnonzero(np.isnan(normals[:, 0])).tolist():
                    near = point_text(points[bad[0]] + start, points + start)
                    raise DomainError(f"{name}: its face has no normal near {near}")
                across = np.cross(tangents, normals)
                side = HoleSide(name, curve, -across if along else across)
                sides.append(side if along else side.reversed())
                remarks += [f"{name}: a curve {distance:.3g} from its edge"] if distance > 0 else []
        return sides, tuple(remarks)


def part_of(shape: Any) -> Part:
    """Sew the faces of a shape where their edges agree, as those of IGES files do not yet, and find its holes."""
    sewing = kernel("BRepBuilderAPI").BRepBuilderAPI_Sewing(SEWN * float(np.ptp(box_of(shape), axis=0).max()))
    sewing.Add(shape)
    sewing.Perform()
    # Of faces in the file, by which `gtb import` names them, too
    numbers = {hash(sewing.ModifiedSubShape(face)): number for number, face in enumerate(parts(shape, "FACE"))}
    shape = sewing.SewedShape()
    tool, forward = kernel("BRep").BRep_Tool, kernel("TopAbs").TopAbs_Orientation.TopAbs_FORWARD
    edges, rows = list[tuple[str, bool, Any, Any]](), list[FloatArray]()
    for (edge, face), *others in edge_uses(shape).values():
        if not others and not tool.Degenerated_s(edge) and not tool.IsClosed_s(edge, face):
            along = edge.Orientation() != forward
            edges.append((f"face-{numbers[hash(face)]} edge {len(edges)}", along, edge, face))
            (pieces,) = edge_pieces(edge, 1)
            joints = np.array([*(piece[0] for piece in pieces), pieces[-1][-1]])[:: 1 if along else -1]
            rows.append(joints[:, :3] / joints[:, 3:])
    size = float(np.ptp(np.concatenate(rows), axis=0).max()) if edges else 1.0
    return Part(shape, edges, size, closed_rings(rows, [name for name, *_ in edges], MAX_GAP * size))


def _curves(edge: Any, size: float, least: int) -> list[tuple[FloatArray, float]]:
    """Return an edge as Bézier curves, and how far they are from it: as few as are near enough, of equal lengths."""
    # How many more curves than it must have, and how near, of the size; few, as many are hard to fill
    trials = [(count, within) for count in (0, 1) for within in (1e-7, 1e-6)] + [(count, 1e-5) for count in range(4)]
    degrees = range(3, 9)  # those of higher degrees waver, and so do the planes of a patch across them
    for more, within in trials:
        found = []
        for pieces in edge_pieces(edge, least + more):
            start = pieces[0][0, :3] / pieces[0][0, 3]
            if len(pieces) > 1 and any(np.ptp(piece[:, 3]) > 0 for piece in pieces):
                break  # splines with weights are not fitted
            if len(pieces) == 1:
                found.append((pieces[0], 0.0))
                continue
            if (nearest := nearest_curve([(piece[:, :3] - start) / size for piece in pieces], within, degrees)) is None:
                break
            points, distance = nearest
            found.append((np.column_stack([points * size + start, np.ones(len(points))]), distance * size))
        else:
            return found
    return [(piece, 0.0) for pieces in edge_pieces(edge, 1) for piece in pieces]
