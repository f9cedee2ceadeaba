"""Seams of sewn faces, measured in the surfaces of the file: angles between their tangent planes, and gaps."""

from collections import defaultdict
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.importers.cad_files import kernel, parts

PLACES = 64  # of each edge, closer together towards its ends


class Seams(NamedTuple):
    """The largest angle in degrees, and the largest gap, of new faces to those of a part, and between new ones."""

    angle: float
    gap: float
    inner_angle: float
    inner_gap: float


def uses_of_edges(shape: Any) -> dict[int, list[tuple[Any, Any]]]:
    """Return the edges of a shape, by their numbers, each with its faces."""
    uses = defaultdict(list)
    for face in parts(shape, "FACE"):
        for edge in parts(face, "EDGE"):
            uses[hash(edge)].append((edge, face))
    return uses


def seams_of(shape: Any, fresh: Iterable[Any]) -> Seams:
    """Measure the edges of new faces that two faces of a shape share."""
    new = {hash(face) for face in fresh}
    worst = {False: [0.0, 0.0], True: [0.0, 0.0]}
    for pair in uses_of_edges(shape).values():
        olds = [hash(face) not in new for _, face in pair]
        if len(pair) != 2 or all(olds):
            continue
        (points, normals), (others, other_normals) = (_along(edge, face) for edge, face in pair)
        gaps = np.linalg.norm(points - others, axis=1)
        sines, cosines = np.linalg.norm(np.cross(normals, other_normals), axis=1), (normals * other_normals).sum(axis=1)
        angles = np.degrees(np.arctan2(sines, cosines))  # 180 where the faces turn back
        found = worst[any(olds)]
        found[:] = max(found[0], float(np.nanmax(angles))), max(found[1], float(gaps.max()))
    return Seams(*worst[True], *worst[False])


def _along(edge: Any, face: Any) -> tuple[FloatArray, FloatArray]:
    """Return (n, 3) points and unit normals of a face, on its outer side, at places along an edge of it."""
    curve = kernel("BRepAdaptor").BRepAdaptor_Curve2d(edge, face)
    surface, gp = kernel("BRep").BRep_Tool.Surface_s(face), kernel("gp")
    first, last = curve.FirstParameter(), curve.LastParameter()
    sign = -1.0 if face.Orientation() == kernel("TopAbs").TopAbs_Orientation.TopAbs_REVERSED else 1.0
    rows = []
    for share in (1 - np.cos(np.pi * (np.arange(PLACES) + 0.5) / PLACES)) / 2:
        at, place, along, across = curve.Value(first + share * (last - first)), gp.gp_Pnt(), gp.gp_Vec(), gp.gp_Vec()
        surface.D1(at.X(), at.Y(), place, along, across)
        normal = along.Crossed(across)
        rows.append([each() for vector in (place, normal) for each in (vector.X, vector.Y, vector.Z)])
    found = np.array(rows)
    lengths = np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return found[:, :3], sign * found[:, 3:] / lengths
