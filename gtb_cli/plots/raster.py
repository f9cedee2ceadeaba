"""Triangles to pixels: the nearest triangle at each pixel, and the position of the pixel in it."""

from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, planar_cross
from gtb_cli.values import frozen

NO_TRIANGLE = -1  # index at pixels that no triangle covers


@frozen
class Raster:
    """The visible parts of triangles at the centres of pixels, row 0 the lowest."""

    triangle: IntArray  # (height, width) the nearest, or `NO_TRIANGLE`
    weights: FloatArray  # (height, width, 3) barycentric coordinates in it
    nearness: FloatArray  # (height, width) its third coordinate there, or -inf

    @cached_property
    def farthest_around(self) -> FloatArray:
        """Return the nearness behind which lines are hidden at each pixel, (height, width): the least around it."""
        # Pixels without triangles do not count: a line just behind an outline is hidden, too.
        found = np.where(self.triangle == NO_TRIANGLE, np.inf, self.nearness)
        for axis in (0, 1):
            found = np.minimum(found, np.minimum(np.roll(found, -1, axis), np.roll(found, 1, axis)))
        return np.where(np.isinf(found), -np.inf, found)

    def values(self, faces: IntArray, scalars: FloatArray) -> FloatArray:
        """Interpolate (m, …) values at the triangles' corners at the covered pixels, row by row: (p, …)."""
        covered = self.triangle >= 0
        return np.asarray(np.einsum("pk...,pk->p...", scalars[faces[self.triangle[covered]]], self.weights[covered]))


def rasterised(points: FloatArray, faces: IntArray, width: int, height: int) -> Raster:
    """Find the nearest triangle at each pixel, the first of equally near ones.

    The (m, 3) points are in pixels to the right and upwards from the lower left corner, and nearness to the eye.
    """
    pixels, triangles, shares = _fragments(points, faces, width, height)
    near = np.einsum("pk,pk->p", points[:, 2][faces[triangles]], shares)
    nearest = np.full(width * height, -np.inf)
    np.maximum.at(nearest, pixels, near)
    order = np.flatnonzero(near == nearest[pixels])[::-1]  # triangles are in their order: the first is written last
    triangle = np.full(width * height, NO_TRIANGLE, dtype=np.int64)
    weights = np.zeros((width * height, 3))
    triangle[pixels[order]] = triangles[order]
    weights[pixels[order]] = shares[order]
    return Raster(triangle.reshape(height, width), weights.reshape(height, width, 3), nearest.reshape(height, width))


def _fragments(points: FloatArray, faces: IntArray, width: int, height: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Pixels whose centres triangles cover, with the triangle and the barycentric coordinates of each."""
    pixel_batch = 1 << 21  # number of pixels in bounding boxes of triangles that are tested together
    plane = points[:, :2][faces]
    a, b, c = plane[:, 0], plane[:, 1], plane[:, 2]
    doubled = planar_cross(b - a, c - a)
    low = np.ceil(plane.min(axis=1) - 0.5).clip(0).astype(np.int64)
    spans = np.floor(plane.max(axis=1) - 0.5).clip(None, [width - 1, height - 1]).astype(np.int64) - low + 1
    used = np.flatnonzero((spans > 0).all(axis=1) & (doubled != 0))
    boxes = spans.prod(axis=1)
    found = [(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)))]
    for batch in np.split(used, np.flatnonzero(np.diff(np.cumsum(boxes[used]) // pixel_batch)) + 1):
        t = np.repeat(batch, boxes[batch])
        number = np.arange(len(t)) - np.repeat(np.cumsum(boxes[batch]) - boxes[batch], boxes[batch])
        row, column = np.divmod(number, spans[t, 0])
        x, y = low[t, 0] + column, low[t, 1] + row
        middle = np.column_stack([x, y]) + 0.5
        from_a, from_b, from_c = (corner[t] - middle for corner in (a, b, c))
        share_a, share_b = planar_cross(from_b, from_c) / doubled[t], planar_cross(from_c, from_a) / doubled[t]
        shares = np.stack([share_a, share_b, 1 - share_a - share_b], axis=1)
        inside = (shares >= 0).all(axis=1)
        found.append(((y * width + x)[inside], t[inside], shares[inside]))
    pixels, triangles, shares = (np.concatenate(part) for part in zip(*found, strict=True))
    return pixels, triangles, shares
