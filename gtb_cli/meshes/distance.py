"""Distances from points to segments and triangles, pair by pair."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray, column_dot, cross_of_columns

BLOCK_POINTS = 8192
"""Number of points that are measured together: their arrays stay in the processor's cache."""


def to_segments(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) distances of (m, 3) points, each from its own segment from (m, 3) `a` to `b`; equal ends are a point."""
    result = np.empty(len(points))
    for start in range(0, len(points), BLOCK_POINTS):
        rows = slice(start, start + BLOCK_POINTS)
        p, origin, end = (np.ascontiguousarray(each[rows].T) for each in (points, a, b))
        result[rows] = np.sqrt(_to_side(p - origin, end - origin))
    return result


def to_triangles(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(m,) distances of (m, 3) points, each from its own triangle; triangles may be flat or a point."""
    result = np.empty(len(points))
    for start in range(0, len(points), BLOCK_POINTS):
        rows = slice(start, start + BLOCK_POINTS)
        result[rows] = _to_triangles(*(np.ascontiguousarray(each[rows].T) for each in (points, a, b, c)))
    return result


def _to_triangles(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """The same for (3, m) arrays: whole columns are several times faster than rows of three."""
    ab, ac, relative = b - a, c - a, points - a
    normal = cross_of_columns(ab, ac)
    square = column_dot(normal, normal)
    safe = np.where(square > 0, square, 1.0)
    v = column_dot(relative, cross_of_columns(ac, normal)) / safe
    w = column_dot(relative, cross_of_columns(normal, ab)) / safe
    result = np.abs(column_dot(relative, normal)) / np.sqrt(safe)
    other = np.flatnonzero((square <= 0) | (v < 0) | (w < 0) | (v + w > 1))
    if len(other):
        relative, ab, ac = (each.take(other, axis=1) for each in (relative, ab, ac))  # faster than [:, other]
        sides = (_to_side(relative, ab), _to_side(relative, ac), _to_side(relative - ab, ac - ab))
        result[other] = np.sqrt(np.minimum(np.minimum(sides[0], sides[1]), sides[2]))
    return result


def _to_side(relative: FloatArray, direction: FloatArray) -> FloatArray:
    """(m,) squares of the distances of (3, m) points from the segments from the origin to `direction`."""
    square = column_dot(direction, direction)
    t = np.clip(column_dot(relative, direction) / np.where(square > 0, square, 1.0), 0.0, 1.0)
    apart = relative - t * direction
    return column_dot(apart, apart)
