"""Folds of a surface, at which its normal turns over at once, and sharp turns, where it turns over in some distance."""

import math

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.fairing.energy import samples
from gtb_cli.knots.triangulation import central_triangulation
from gtb_cli.moment.torus import block_length, exponents, shares
from gtb_cli.solids.solidity import folded_pairs
from gtb_cli.theory.patch import Patch


def sharp_turns(patch: Patch) -> FloatArray:
    """(k, 3) places of a mesh of some thousand sides at which the image turns by more than a right angle."""
    rings = 16
    part = central_triangulation(patch.domain, rings)
    points = patch.evaluate(part.parameters, "linear")
    return np.asarray(points[part.cells[folded_pairs(points, part.cells)[:, 0]]].mean(axis=1))


def folds(patch: Patch) -> int:
    """Count the folds between neighbouring places of the energy's quadrature, which are dense near edges and corners.

    At a fold the normal turns by more than a right angle in an ever smaller step; elsewhere it only turns fast. A
    surface without normals has no folds.
    """
    # Of the places, of which there are no more with many sides, and of the way from one to the next
    resolution, halvings = math.ceil(24 * math.sqrt(min(1.0, 8 / len(patch.domain.vertices)))), 10
    knots, weights, s, _ = samples(patch.domain, patch.log_products, resolution)
    points = patch.control_points - patch.control_points.mean(axis=0)
    points /= np.abs(points).max() or 1.0

    columns = np.column_stack([points, *(axis[:, None] * points for axis in knots.T), knots])

    def directions(s: FloatArray) -> FloatArray:
        """(m, 3) unit normals at (2, m) torus coordinates, or 0."""
        p, *rates, mean = np.split(columns.T @ shares(exponents(knots, weights, s)), [3, 6, 9])
        normals = np.cross(rates[0] - mean[0] * p, rates[1] - mean[1] * p, axis=0).T
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.asarray(normals / np.where(lengths > 0, lengths, 1.0))

    blocks = np.array_split(s, 1 + s.shape[1] // block_length(len(knots)), axis=1)
    normals = np.concatenate([directions(block) for block in blocks])
    if not normals.any():
        return 0
    numbers = np.arange(len(normals)).reshape(-1, resolution, resolution)  # by edge, depth and place along the edge
    rings = numbers.swapaxes(0, 1).reshape(resolution, -1)
    pairs = np.concatenate(
        [np.stack(pair, axis=-1).reshape(-1, 2) for pair in ((rings, np.roll(rings, -1, 1)), (rings[:-1], rings[1:]))]
    )
    pairs = pairs[(normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) <= 0]
    start, end, before, after = s[:, pairs[:, 0]], s[:, pairs[:, 1]], normals[pairs[:, 0]], normals[pairs[:, 1]]
    for _ in range(halvings):
        middle = (start + end) / 2
        between = directions(middle)
        first = (before * between).sum(axis=1) <= (between * after).sum(axis=1)  # the half that turns more
        start, end = np.where(first, start, middle), np.where(first, middle, end)
        before, after = np.where(first[:, None], before, between), np.where(first[:, None], between, after)
    return int(((before * after).sum(axis=1) <= 0).sum())
