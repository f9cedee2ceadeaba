"""Corners of a hole: its angle there, in the tangent planes of its sides, and the curvature that these force."""

import math
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, angles_between, unit
from gtb_cli.filling.osculation import Rim
from gtb_cli.filling.sides import HoleSide, points_and_tangents, side_normals, stations
from gtb_cli.values import frozen


@frozen
class Corner:
    """The corner of a hole at which a side begins, its two sides by name, and (3,) unit vectors.

    `normal` is that of the tangent plane, `ahead` the direction of the side in it, and `angle` the degrees from there,
    through the hole, back to the side before.
    """

    between: str
    place: FloatArray
    normal: FloatArray
    ahead: FloatArray
    angle: float

    @property
    def concave(self) -> bool:
        """Whether the hole takes up more than half a turn, by a degree at least: a straight corner is not concave."""
        return 181 < self.angle < 359


def corners(sides: Sequence[HoleSide]) -> list[Corner]:
    """Return the corners of a closed loop, in order.

    A side without a field across has the plane of both sides at its corner or, if they are nearly parallel there, that
    of the loop's vector area. A corner is concave if it is so in the planes of both sides.
    """
    parallel_sine = 0.05  # the plane of two directions is a matter of rounding and noise below this
    points = np.concatenate([side.points[:-1] for side in sides])
    points = (points - points.mean(axis=0)) / (np.ptp(points, axis=0).max() or 1.0)
    area = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    ends = np.array([0.0, 1.0])
    found = []
    for before, side in zip([sides[-1], *sides[:-1]], sides, strict=True):
        tangents = [points_and_tangents(each.curve, ends)[1] for each in (side, before)]
        ahead, back = unit(np.stack([tangents[0][0], -tangents[1][1]]))
        plane = np.cross(ahead, back)
        plane = math.copysign(1, plane @ area) * plane if np.linalg.norm(plane) > parallel_sine else area
        own = end_normals(before)[1], end_normals(side)[0]
        normals = unit(np.stack([plane if np.isnan(normal).any() else normal for normal in own]))
        sine = max(float(np.cross(ahead, back) @ normal) for normal in normals)
        normal = unit(normals.sum(axis=0)[None])[0]
        in_plane = unit((ahead - (ahead @ normal) * normal)[None])[0]
        angle = math.degrees(math.atan2(sine, float(ahead @ back))) % 360
        found.append(Corner(f"{before.name} and {side.name}", side.ends[0], normal, in_plane, angle))
    return found


def forced_curvatures(
    curves: Sequence[FloatArray], normals: Sequence[FloatArray | None]
) -> tuple[FloatArray, FloatArray]:
    """Return (r,) curvatures that no surface with these planes can be below near corners, and their shorter edges.

    Along a curve, unit normals turn at most by the largest principal curvature times the length. Curves are homogeneous
    Bézier points, normals (96, 3) at their `stations`, and within a tenth of the shorter edge counts. 0 without planes.
    """
    near, t = 0.1, stations()
    starts = np.array([curve[0, :3] for curve in curves])
    lengths = np.linalg.norm(np.roll(starts, -1, axis=0) - starts, axis=1)
    found, edges = np.zeros(len(curves)), np.minimum(lengths, np.roll(lengths, 1))
    for k, (curve, n) in enumerate(zip(curves, normals, strict=True)):
        if n is not None:
            rim = Rim(curve, n)
            speeds = np.linalg.norm(rim.rates, axis=1)
            # Mostly, a curve is no longer between stations than at the faster end's speed
            rates = np.radians(angles_between(n[1:], n[:-1])) / np.diff(t) / np.maximum(speeds[1:], speeds[:-1])
            for corner in (k, (k + 1) % len(curves)):
                away = np.linalg.norm(rim.points - starts[corner], axis=1) <= near * edges[corner]
                found[corner] = max(found[corner], rates[away[1:] & away[:-1]].max(initial=0.0))
    return found, edges


def at_ends(values: FloatArray) -> FloatArray:
    """Return (2, …) values at both ends of a side, of (96, …) at its `stations`."""
    return between_stations(values, np.array([0.0, 1.0]))


def between_stations(values: FloatArray, t: FloatArray) -> FloatArray:
    """Return (m, …) values at (m,) parameters of a side, by barycentric interpolation of (96, …) at its `stations`.

    Stations are Chebyshev's, so that no accuracy is lost at the ends.
    """
    nodes = stations()
    weights = np.sin(np.pi * (np.arange(len(nodes)) + 0.5) / len(nodes)) * (-1.0) ** np.arange(len(nodes))
    distance = t[:, None] - nodes
    shares = weights / np.where(distance == 0, np.finfo(float).tiny ** 0.5, distance)
    return np.asarray(shares / shares.sum(axis=1, keepdims=True) @ values)


def end_normals(side: HoleSide) -> FloatArray:
    """Return (2, 3) unit normals tangent × across at both ends of a side; NaN without a field across.

    Unit normals may turn within a thousandth of an end, but the product does not: it is a polynomial, or nearly one.
    """
    vanishing = 1e-9  # of the product's largest size: its direction is rounding
    if side.across is None:
        return np.full((2, 3), math.nan)
    products = np.cross(points_and_tangents(side.curve, stations())[1], side.across)
    found = np.cross(points_and_tangents(side.curve, np.array([0.0, 1.0]))[1], at_ends(side.across))
    is_rounding = np.linalg.norm(found, axis=1) <= vanishing * np.linalg.norm(products, axis=1).max()
    return unit(np.where(is_rounding[:, None], at_ends(side_normals(side)), found) if is_rounding.any() else found)
