"""Seams of sewn faces, measured in the surfaces of the file: angles between their tangent planes, and gaps."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, angles_between
from gtb_cli.importers.cad_files import face_forms, face_frames, kernel, uses_of_edges

CLOSER = (1 - np.cos(np.pi * (np.arange(256) + 0.5) / 256)) / 2  # towards the ends, to 1e-5, where angles are largest


class Seams(NamedTuple):
    """The largest angle in degrees, and the largest gap, of new faces to those of a part, and between new ones.

    A gap is what is across the edge: along it, faces may have it at parameters of their own.
    """

    angle: float
    gap: float
    inner_angle: float
    inner_gap: float


def seams_of(shape: Any, fresh: Iterable[Any]) -> Seams:
    """Measure the edges of new faces that two faces of a shape share."""
    new = {hash(face) for face in fresh}
    worst = {False: [0.0, 0.0], True: [0.0, 0.0]}
    for pair in uses_of_edges(shape).values():
        olds = [hash(face) not in new for _, face in pair]
        if len(pair) != 2 or all(olds):
            continue
        (points, normals, ways, _), (others, other_normals, *_) = (along_edge(edge, face) for edge, face in pair)
        gaps = np.linalg.norm(np.cross(points - others, ways), axis=1)
        angles = angles_between(normals, other_normals)  # 180 where the faces turn back
        found = worst[any(olds)]
        found[:] = max(found[0], float(np.nanmax(angles))), max(found[1], float(gaps.max()))
    return Seams(*worst[True], *worst[False])


def along_edge(edge: Any, face: Any, shares: FloatArray = CLOSER) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (n, 3) points and unit outward normals of a face, tangents, and `face_forms`, at shares of its edge."""
    curve, gp = kernel("BRepAdaptor").BRepAdaptor_Curve2d(edge, face), kernel("gp")
    first, last = curve.FirstParameter(), curve.LastParameter()
    rows = []
    for share in shares.tolist():
        place, way = gp.gp_Pnt2d(), gp.gp_Vec2d()
        curve.D1(first + share * (last - first), place, way)
        rows.append((place.X(), place.Y(), way.X(), way.Y()))
    at, ways = np.split(np.array(rows), 2, axis=1)
    points, along, across, normals = face_frames(face, at.tolist())
    tangents = ways[:, :1] * along + ways[:, 1:] * across
    return points, normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True), face_forms(face, at.tolist())
