"""Control nets of classical Bézier curves, rectangles and triangles as patches."""

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.theory.patch import Patch

# Highest degree of a net: a rectangle of this degree in both directions has as many knots as a spec may have
MAX_NET_DEGREE = 60


def curve(points: FloatArray, weights: FloatArray) -> Patch:
    """Return the Bézier curve of (n + 1, 3) control points, with the knots 0 … n."""
    return Patch(np.arange(len(points)), points, weights, "binomial")


def rectangle(net: FloatArray, weights: FloatArray | None = None) -> Patch:
    """Return the Bézier rectangle of an (m + 1, n + 1, 3) net, with the knot (i, j) for its point i, j."""
    m, n = net.shape[:2]
    knots = np.column_stack([np.repeat(np.arange(m), n), np.tile(np.arange(n), m)])
    return Patch(knots, net.reshape(-1, 3), None if weights is None else weights.ravel(), "binomial")


def triangle(degree: int, points: FloatArray, weights: FloatArray | None) -> Patch:
    """Return the Bézier triangle of control points in rows: n + 1, n, …, 1 of them, with the knot (i, j) in row j."""
    return Patch([(i, j) for j in range(degree + 1) for i in range(degree + 1 - j)], points, weights, "binomial")


def polygon(corners: FloatArray) -> Patch:
    """Return the patch of a polygon: its knots are the corners of a triangle, a square or a regular polygon.

    Its edges are straight, and it is planar if the corners are.
    """
    angles = 2 * np.pi * np.arange(len(corners)) / len(corners)
    simple = {3: [[0, 0], [1, 0], [0, 1]], 4: [[0, 0], [1, 0], [1, 1], [0, 1]]}
    return Patch(simple.get(len(corners), np.column_stack([np.cos(angles), np.sin(angles)])), corners)
