"""Loops to fill: random ones, and figures that are known."""

import math

import numpy as np

from gtb_cli.filling.sides import HoleSide, raised
from gtb_cli.filling.strips import strip_side

ARC = np.array([[1.0, 0, 0, 1], [math.sqrt(0.5), math.sqrt(0.5), 0, math.sqrt(0.5)], [0, 1, 0, 1]])
"""A quarter of a circle, in homogeneous coordinates."""


def homogeneous(points: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    weights = np.ones(len(points)) if weights is None else weights
    return np.column_stack([points * weights[:, None], weights])


def random_sides(
    n: int, seed: int, degrees: tuple[int, int] = (1, 6), rational: bool = False, noise: float = 0.08
) -> list[HoleSide]:
    """A closed loop of curves of different degrees, with ribbons that agree at the corners."""
    rng = np.random.default_rng([n, seed])
    angles = (np.arange(n) + 0.5 * rng.random(n)) * 2 * np.pi / n
    corners = np.column_stack([np.cos(angles), np.sin(angles), 3.75 * noise * rng.normal(size=n)])
    curves = []
    for k in range(n):
        degree = int(rng.integers(degrees[0], degrees[1] + 1))
        share = np.arange(degree + 1)[:, None] / degree
        points = (1 - share) * corners[k] + share * corners[(k + 1) % n]
        points[1:-1] += noise * rng.normal(size=(degree - 1, 3))
        curves.append(points)
    sides = []
    for k, points in enumerate(curves):
        degree = max(len(points) - 1, 2)
        points = raised(points, degree - len(points) + 1)
        weights = np.concatenate([[1.0], rng.uniform(0.7, 1.4, degree - 1), [1.0]]) if rational else None
        before, after = curves[k - 1], curves[(k + 1) % n]
        ribbon = points - 0.3 * np.column_stack([points[:, :2], np.zeros(len(points))])
        ribbon += 0.375 * noise * rng.normal(size=ribbon.shape)
        ribbon[0], ribbon[-1] = before[-2], after[1]
        curve, row = homogeneous(points, weights), homogeneous(ribbon, weights)
        sides.append(strip_side(f"side {k}", (curve, row), 2))
    return sides
