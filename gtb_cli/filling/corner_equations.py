"""The equations that join the quadratic forms of a filling at its corners, so that curvature stays bounded there.

Control points at sums p_i + p_j of the first knots of a corner (`corner_knots`) have heights h over its plane that
give the surface's form there: ℓ_i(b_j) = W_ij h_ij / (W_i W_j) and ℓ_i(b_i) = 2 W_ii h_ii / W_i². The forms of the ways
between b₀, b₁, b₂ and b₃ join if ℓ_1 and ℓ_2 are linear, each with three values. So there are two equations, linear in
the heights at 2 p₁, p₁ + p₂ and 2 p₂. A row without given planes also has to begin in the corner's plane.
"""

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, cross, unit
from gtb_cli.values import frozen

POINT = 1e-9  # size of a first way of an edge, of the longest at its corner, that is 0: such corners have other forms


@frozen
class CornerForms:
    """Equations ``Σ factor ⟨normal, P − V⟩ = target``: (c, 3) members P and factors, (c,) origins V, (c, 3) normals."""

    members: IntArray
    origins: IntArray
    factors: FloatArray
    normals: FloatArray
    targets: FloatArray

    @classmethod
    def of(cls, points: FloatArray, log_weights: FloatArray, corners: IntArray, given: BoolArray) -> "CornerForms":
        """Return the equations of (r, 10) `corners`, with coefficients as (n, 3) points have them.

        `given` tells for each of r sides whether its row has planes.
        """
        straight, crossing = 1e-3, 0.04  # sine of the angle of edges; how far rows are from them, of their first way
        short = 1e-2  # a first way, of the longest: without planes they hold only by a wave as large as its neighbours
        b = points[corners] - points[corners[:, :1]]
        w = np.exp(log_weights[corners] - log_weights[corners[:, :1]])
        before: BoolArray = np.roll(given, 1)
        neither: BoolArray = ~given & ~before
        lengths = np.linalg.norm(b[:, 1:5], axis=-1)
        own = cross(b[:, 1], b[:, 4])
        # Where the edges run on straight, their plane is rounding, and rows tell it.
        is_straight = neither & (np.linalg.norm(own, axis=1) <= straight * lengths[:, 0] * lengths[:, 3])
        own[is_straight] = cross(b[:, 1] - b[:, 4], b[:, 2] + b[:, 3])[is_straight]
        planes = [unit(cross(b[:, i], b[:, i + 1])) for i in (1, 3)]
        normals = unit(np.where(neither[:, None], own, planes[0] * given[:, None] + planes[1] * before[:, None]))
        known = given & before | (lengths.min(axis=1) > short * lengths.max(axis=1))
        equations = []
        for i, j, k, sums in ((1, 2, 3, (5, 6, 7)), (4, 3, 2, (9, 8, 7))):
            across = cross(normals, b[:, j])
            (x0, y0), (x2, y2) = ((np.vecdot(b[:, a], b[:, j]), np.vecdot(b[:, a], across)) for a in (i, k))
            size = np.maximum(np.vecdot(across, across), 1e-300)
            row = [
                -y2 * w[:, sums[0]] / (w[:, i] * w[:, j]),
                2 * (x0 * y2 - x2 * y0) / size * w[:, sums[1]] / w[:, j] ** 2,
                y0 * w[:, sums[2]] / (w[:, j] * w[:, k]),
            ]
            factors = np.stack(row, axis=1) / np.maximum(np.abs(row).max(axis=0), 1e-300)[:, None] * known[:, None]
            equations.append((corners[:, list(sums)], corners[:, 0], factors, normals, np.zeros(len(corners))))
        # Rows without planes begin in the corner's, and where edges run on straight on the hole's side of them.
        places = points[corners[:, 0]]
        inward = unit(cross(cross(places, np.roll(places, -1, axis=0)).sum(axis=0), b[:, 1] - b[:, 4]))
        for column, free in ((2, ~given), (3, ~before)):
            least = crossing * lengths[:, column * 3 - 6]
            near: BoolArray = is_straight & (np.vecdot(b[:, column], inward) <= least * (1 + 1e-9))
            for on, ways, targets in ((free, normals, 0 * least), (near, inward, least)):
                members, alone = np.tile(corners[on, column, None], 3), np.tile([1.0, 0, 0], (int(on.sum()), 1))
                equations.append((members, corners[on, 0], alone, ways[on], targets[on]))
        return cls(*(np.concatenate(parts) for parts in zip(*equations, strict=True)))

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return what is missing: (c,) sums at (n, 3) points."""
        ways = points[self.members] - points[self.origins[:, None]]
        return np.asarray((self.factors * np.vecdot(ways, self.normals[:, None])).sum(axis=1) - self.targets)

    def matrix(self, count: int) -> FloatArray:
        """Return the (c, n) factors of n points."""
        table = np.zeros((len(self.members), count))
        np.add.at(table, (np.arange(len(table))[:, None], self.members), self.factors)
        return table
