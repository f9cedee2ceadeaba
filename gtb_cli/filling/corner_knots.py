"""Which knots rule a corner of a filling, and which would break its tangent plane or its curvature.

With the first knots p₀ and p₃ on the edges ahead and before as units, exponents x of knots rule the corner through
their Newton polygon (specs/THEORY.md). Its vertices are p₀, the first knot p₁ of the row ahead, the last knot p₂ of the
row before, and p₃. Curvature is bounded if all knots off the corner's plane have ⟨x, λ⟩ ≥ 2 ν₂(λ) for all λ > 0, where
ν₂ is the second smallest ⟨p_i, λ⟩; but for the knots at sums p_i + p_j, whose control points give it.
"""

from itertools import combinations

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray

SUMS = ((1, 2), (2, 2), (2, 3), (3, 3), (3, 4))  # columns of `corner_places` whose sums are the columns from 5 on
FREE = slice(6, 9)  # the columns of sums that are in no first row, and so are free where no second row gives them


def frames(vertices: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the lengths, directions and inward normals of a polygon's sides."""
    sides = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    along = sides / lengths[:, None]
    return lengths, along, np.column_stack([-along[:, 1], along[:, 0]])


def corner_places(vertices: FloatArray, degrees: IntArray, distances: FloatArray) -> FloatArray:
    """Return (r, 10, 2) places: of each corner, its p₀ to p₃, p₀ + p₁, 2 p₁, p₁ + p₂, 2 p₂ and p₂ + p₃."""
    lengths, along, inward = frames(vertices)
    ahead = along * (lengths / degrees)[:, None]
    before = -np.roll(ahead, 1, axis=0)
    row = distances[:, None] * inward
    first = np.stack([0 * ahead, ahead, ahead / 2 + row, before / 2 + np.roll(row, 1, axis=0), before], axis=1)
    sums = np.stack([first[:, i] + first[:, j] for i, j in SUMS], axis=1)
    return np.asarray(vertices[:, None] + np.concatenate([first, sums], axis=1))


def keeps_corners(knots: FloatArray, places: FloatArray) -> BoolArray:
    """Tell for (n, 2) knots whether they leave the curvature bounded at corners with given `corner_places`."""
    found = np.ones(len(knots), dtype=np.bool_)
    for corner, *first in places[:, :5]:
        exponents = np.linalg.inv(np.column_stack([first[0] - corner, first[3] - corner]))
        x, own = (knots - corner) @ exponents.T, (np.array(first) - corner) @ exponents.T
        steps = np.array([one - other for one, other in combinations(own, 2)])
        rays = np.column_stack([-steps[:, 1], steps[:, 0]]) * np.sign(steps[:, :1])  # on which two of them tie
        rays = rays[(rays > 0).all(axis=1)]
        second = np.sort(own @ rays.T, axis=0)[1]
        found &= (x @ rays.T >= 2 * second * (1 - 1e-9)).all(axis=1)
    return found
