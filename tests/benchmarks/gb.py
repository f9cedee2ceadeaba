"""The generalized Bézier patch (T. Várady, P. Salvi, G. Karikó, A Multi-sided Bézier Patch with a Simple Control
Structure, 2016), for comparison only.

Over a regular n-gon with Wachspress coordinates λ, side i from corner i to i + 1 has s = λ_{i+1} / (λ_i + λ_{i+1}) and
h = 1 − λ_i − λ_{i+1}. The patch is Σ μ B_j(s_i) B_k(h_i) C_{ijk} and what is missing from 1 times the centre. In the
2 × 2 blocks of corners μ is h_{i−1} / (h_{i−1} + h_i) or h_{i+1} / (h_{i+1} + h_i), else 1, on diagonals 1/2, beyond 0.
"""

from dataclasses import dataclass
from functools import reduce
from math import comb
from pathlib import Path

import numpy as np

from tests.benchmarks.jets import constant, product, quotient, variables


def polygon(n: int) -> np.ndarray:
    """(n, 2) corners of a regular polygon in the unit circle."""
    turns = np.arange(n) * 2 * np.pi / n
    return np.column_stack([np.cos(turns), np.sin(turns)])


@dataclass(frozen=True)
class GeneralizedBezier:
    """(n, layers, d + 1, 3) control points, of which two sides have those near a corner in common, and the centre."""

    control_points: np.ndarray
    centre: np.ndarray

    @staticmethod
    def read(path: str | Path) -> "GeneralizedBezier":
        """Read a `.gbp` file: the centre, then layer by layer the points of each side that are not the next one's."""
        words = Path(path).read_text().split()
        n, degree = int(words[0]), int(words[1])
        points = iter(np.array(words[2:], dtype=float).reshape(-1, 3))
        centre = next(points)
        layers = (degree + 1) // 2
        table = np.full((n, layers, degree + 1, 3), np.nan)
        for k in range(layers):
            for side in range(n):
                for j in range(k, degree - k):
                    point = table[side, k, j] = next(points)
                    if j < layers:
                        table[side - 1, j, degree - k] = point
                    if degree - j < layers:
                        table[(side + 1) % n, degree - j, k] = point
        return GeneralizedBezier(table, centre)

    def jets(self, places: np.ndarray) -> np.ndarray:
        """The jets (10, m, 3) of the patch at (m, 2) places in the polygon, corners excepted."""
        n, layers, count, _ = self.control_points.shape
        degree = count - 1
        corners = polygon(n)
        u, v = variables(places)
        one = constant(1.0, u)
        heights = []
        for k in range(n):
            start, along = corners[k], corners[(k + 1) % n] - corners[k]
            heights.append(along[0] * (v - start[1] * one) - along[1] * (u - start[0] * one))
        # Those of corner k are all but its own two sides'
        shares = [reduce(product, (heights[j] for j in range(n) if j not in (k, (k - 1) % n))) for k in range(n)]
        total = np.sum(shares, axis=0)
        shares = [quotient(share, total) for share in shares]
        pairs = [shares[k] + shares[(k + 1) % n] for k in range(n)]
        h = [one - pair for pair in pairs]
        found, missing = np.zeros((*u.shape, 3)), one.copy()
        for side in range(n):
            along = _bernstein(degree, quotient(shares[(side + 1) % n], pairs[side]))
            across = _bernstein(degree, h[side])
            before, after = (quotient(h[k], h[k] + h[side]) for k in (side - 1, (side + 1) % n))
            for k in range(layers):
                for j in range(degree + 1):
                    blend = product(along[j], across[k])
                    if k < 2 and not 2 <= j <= degree - 2:
                        blend = product(blend, before if j < 2 else after)
                    elif j in (k, degree - k):
                        blend = blend / 2
                    elif not k < j < degree - k:
                        continue
                    found += blend[..., None] * self.control_points[side, k, j]
                    missing -= blend
        return found + missing[..., None] * self.centre


def _bernstein(degree: int, t: np.ndarray) -> list[np.ndarray]:
    one = constant(1.0, t)
    powers, others = [one], [one]
    for _ in range(degree):
        powers.append(product(powers[-1], t))
        others.append(product(others[-1], one - t))
    return [comb(degree, j) * product(powers[j], others[degree - j]) for j in range(degree + 1)]
