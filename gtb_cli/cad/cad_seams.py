"""Seams of faces that `cad_writing` sewed, in the surfaces of the file: angles between tangent planes, and gaps."""

from collections.abc import Iterable
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from gtb_cli.arrays import FloatArray, angles_between, point_text
from gtb_cli.importers.cad_files import box_of, edge_uses, face_forms, face_frames, kernel, moved

CLOSER = (1 - np.cos(np.pi * (np.arange(256) + 0.5) / 256)) / 2  # towards the ends, to 1e-5, where angles are largest


class CurvatureGap(NamedTuple):
    """How far normal curvatures of new faces are from a part's, square to its edges from a thousandth of each on.

    `largest` is the part's largest curvature there, or if it is less, 1 / size. Where edges meet at some `corners`,
    second fundamental forms of the part `jump` by more than a hundredth of it.
    """

    difference: float
    largest: float
    place: str
    jump: float
    corners: int


class Seams(NamedTuple):
    """The largest angle in degrees, and the largest gap, of new faces to those of a part, and between new ones.

    A gap is what is across the edge: along it, faces may have it at parameters of their own.
    """

    angle: float
    gap: float
    inner_angle: float
    inner_gap: float
    curvature: CurvatureGap | None = None


def measured_seams(shape: Any, fresh: Iterable[Any], *, curved: bool = False) -> Seams:
    """Measure the edges of new faces that two faces of a shape share; curvatures if they are `curved`."""
    origin, bends = box_of(shape, rough=True).mean(axis=0), list[tuple[FloatArray, FloatArray, FloatArray]]()
    near, *new_faces = moved(origin, shape, *fresh)
    new = {hash(face) for face in new_faces}
    found = {False: [(0.0, 0.0)], True: [(0.0, 0.0)]}
    for pair in edge_uses(near).values():
        olds = [hash(face) not in new for _, face in pair]
        if len(pair) != 2 or all(olds):
            continue
        (points, normals, ways, at), (others, other_normals, _, at_other) = (along_edge(*each) for each in pair)
        gaps = np.linalg.norm(np.cross(points - others, ways), axis=1)
        angles = angles_between(normals, other_normals)  # 180 where the faces turn back
        found[any(olds)].append((float(np.nanmax(angles)), float(gaps.max())))
        if curved and any(olds):
            towards = np.cross(normals, ways)
            forms = [face_forms(face, where) for (_, face), where in zip(pair, (at, at_other), strict=True)]
            bends.append((points, np.einsum("ni,nij,nj->n", towards, forms[0] - forms[1], towards), forms[olds[1]]))
    (angle, gap), (inner_angle, inner_gap) = (map(max, zip(*found[key], strict=True)) for key in (True, False))
    return Seams(angle, gap, inner_angle, inner_gap, _curvature(bends, origin) if bends else None)


def _curvature(bends: list[tuple[FloatArray, FloatArray, FloatArray]], origin: FloatArray) -> CurvatureGap:
    """Sum up points along edges, from an origin, differences of curvatures there, and the part's forms."""
    inside, near = np.minimum(CLOSER, 1 - CLOSER) > 1e-3, 1e-3  # of an edge, and of the size
    points, differences, forms = (np.array(rows)[:, inside] for rows in zip(*bends, strict=True))
    size = float(np.ptp(points.reshape(-1, 3), axis=0).max())
    largest = max(float(np.linalg.norm(np.nan_to_num(forms), 2, axis=(2, 3)).max()), 1 / size)
    worst = np.unravel_index(np.nanargmax(np.abs(differences)), differences.shape)
    ends = [(rows[end], own[end]) for rows, _, own in bends for end in (0, -1)]
    jumps = [
        float(np.linalg.norm(np.nan_to_num(form - other), 2))
        for (point, form), (at, other) in combinations(ends, 2)
        if np.linalg.norm(point - at) <= near * size
    ]
    place = point_text(points[worst] + origin, points.reshape(-1, 3) + origin)
    most = max(jumps, default=0.0)
    return CurvatureGap(abs(float(differences[worst])), largest, place, most, sum(x > 0.01 * largest for x in jumps))


def along_edge(
    edge: Any, face: Any, shares: FloatArray = CLOSER
) -> tuple[FloatArray, FloatArray, FloatArray, list[list[float]]]:
    """Return (n, 3) points and outward unit normals of a face, unit tangents, and parameters, at shares of its edge."""
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
    return points, normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True), at.tolist()
