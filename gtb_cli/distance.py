"""Distances from points to segments and triangles, pair by pair."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) scalar products of (m, 3) vectors."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(m, 3) vector products of (m, 3) vectors; `numpy.cross` takes several times longer."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.subtract(a[:, i] * b[:, j], a[:, j] * b[:, i], out=result[:, k])
    return result


def to_segments(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """(m,) distances of (m, 3) points, each from its own segment from (m, 3) `a` to `b`; equal ends are a point."""
    direction, relative = b - a, points - a
    square = dot(direction, direction)
    t = dot(relative, direction) / np.where(square > 0, square, 1.0)
    nearest = relative - np.clip(t, 0.0, 1.0)[:, None] * direction
    return np.asarray(np.sqrt(dot(nearest, nearest)))


def to_triangles(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(m,) distances of (m, 3) points, each from its own triangle; triangles may be flat or a point."""
    ab, ac, relative = b - a, c - a, points - a
    normal = cross(ab, ac)
    square = dot(normal, normal)
    safe = np.where(square > 0, square, 1.0)
    v = dot(cross(relative, ac), normal) / safe
    w = dot(cross(ab, relative), normal) / safe
    inside = (square > 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    result = np.abs(dot(relative, normal)) / np.sqrt(safe)
    other = ~inside
    if other.any():
        p, x, y, z = points[other], a[other], b[other], c[other]
        result[other] = np.minimum(np.minimum(to_segments(p, x, y), to_segments(p, y, z)), to_segments(p, z, x))
    return np.asarray(result)
