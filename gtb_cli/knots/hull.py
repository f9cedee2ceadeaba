"""Convex polygons: the hull of the knots, depths in it, and the distance within which knots are equal or collinear."""

import math
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, planar_cross
from gtb_cli.errors import DomainError

KNOT_TOLERANCE = 1e-12  # of the hull's size, thousands of roundings: knots as near to an edge lie on it
KNOT_ULPS = 8  # of the largest coordinate: knots meant to be collinear may be off by as much, far from the origin


def knot_tolerance(points: FloatArray) -> float:
    """Return the distance within which (n, d) knots count as collinear or equal."""
    return float(KNOT_TOLERANCE * np.ptp(points, axis=0).max() + KNOT_ULPS * EPS * np.abs(points).max())


def convex_hull(points: FloatArray) -> IntArray:
    """Return the indices of the hull's corners, counter-clockwise from the lowest, then leftmost, of (n, 2) points.

    Points within `knot_tolerance` of an edge are not corners; the first of equal points is taken. Raises `DomainError`
    if all points lie on one line, within the tolerance.
    """
    tolerance = knot_tolerance(points)
    centered = points - points.mean(axis=0)
    _, first = np.unique(centered, axis=0, return_index=True)  # lexicographic, as the chains need
    order = first.tolist()
    x, y = centered[:, 0].tolist(), centered[:, 1].tolist()

    def cross(a: int, b: int, c: int) -> float:
        return float((x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]))

    def chain(indices: list[int]) -> list[int]:
        hull: list[int] = []
        for index in indices:
            while len(hull) > 1 and cross(hull[-2], hull[-1], index) <= 0:
                hull.pop()
            hull.append(index)
        return hull

    hull = chain(order)[:-1] + chain(order[::-1])[:-1]

    # The strict hull still has corners that stick out only by rounding: drop the flattest while one is left.
    def flatness(k: int) -> float:
        a, b, c = hull[k - 1], hull[k], hull[(k + 1) % len(hull)]
        return abs(cross(a, b, c)) / math.hypot(x[c] - x[a], y[c] - y[a]) if (x[a], y[a]) != (x[c], y[c]) else 0.0

    while len(hull) > 2 and flatness(thinnest := min(range(len(hull)), key=flatness)) <= tolerance:
        del hull[thinnest]
    if len(hull) < 3:
        raise DomainError(f"knots: all {len(points)} lie on one line, their hull is flat: a curve's are plain numbers")
    lowest = min(y[i] for i in hull) + tolerance
    start = min((i for i in range(len(hull)) if y[hull[i]] <= lowest), key=lambda i: x[hull[i]])
    return np.array(hull[start:] + hull[:start])


def border_of(polygon: Sequence[int]) -> list[tuple[int, int]]:
    """Return the directed edges of a polygon; for a segment, the segment itself."""
    if len(polygon) == 2:
        return [(polygon[0], polygon[1])]
    return list(zip(polygon, [*polygon[1:], polygon[0]], strict=True))


def depth_in(polygon: FloatArray, points: FloatArray) -> FloatArray:
    """Return how deep points lie in a polygon: the least signed distance from the lines of its edges, (m,)."""
    if points.shape[1] == 1:
        return np.asarray(np.minimum(points[:, 0] - polygon[0, 0], polygon[1, 0] - points[:, 0]))
    sides = np.roll(polygon, -1, axis=0) - polygon
    sides /= np.hypot(sides[:, 0], sides[:, 1])[:, None]
    return np.asarray(planar_cross(sides, points[:, None] - polygon).min(axis=1))
