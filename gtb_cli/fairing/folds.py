"""Folds of a surface, at which its normal turns over at once, and sharp turns, where it turns over in some distance."""

import math
from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from gtb_cli.arrays import EPS, FloatArray, cross, dot
from gtb_cli.fairing.energy import Samples, samples
from gtb_cli.fairing.metric import blocks, frame
from gtb_cli.knots.even_triangulation import central_triangulation
from gtb_cli.moment.torus import block_length, exponents, shares
from gtb_cli.solids.solidity import folded_pairs
from gtb_cli.theory.patch import Patch

RINGS = 16  # of a mesh in which sharp turns are looked for


def sharp_turns(patch: Patch) -> FloatArray:
    """(k, 3) places of a mesh of some thousand sides at which the image turns by more than a right angle."""
    part = central_triangulation(patch.domain, RINGS)
    points = patch.evaluate(part.parameters, "linear")
    return np.asarray(points[part.cells[folded_pairs(points, part.cells)[:, 0]]].mean(axis=1))


def most_curved(patch: Patch, at: Samples, along: int) -> tuple[float, FloatArray]:
    """Return the largest curvature that is found from a quadrature's places on, so many along an edge, and where, (3,).

    It is climbed from the highest of a quarter of the places, between them and up to the ends of their region.
    """
    ends, points = 0.08, patch.control_points - patch.control_points.mean(axis=0)  # of Gauss's nodes, of a step
    s = at.s.reshape(2, len(patch.domain.vertices), -1, along)
    rows, columns = (sorted({*range(0, count, 2), count - 1}) for count in s.shape[2:])

    def curvatures(s: FloatArray) -> FloatArray:
        found = np.zeros(s[0].size)
        for block in blocks(at.knots, at.log_weights, s.reshape(2, -1)):
            xx, xy, yy = frame(block, points[:, :, None]).normal_parts(2)
            found[block.places] = (np.abs(xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))[0]
        return np.nan_to_num(found.reshape(s.shape[1:]))

    most, place = highest(curvatures, s[:, :, rows][..., columns], ends)
    return most, (patch.control_points.T @ shares(exponents(at.knots, at.log_weights, place[:, None])))[:, 0]


def highest(function: Callable[[FloatArray], FloatArray], net: FloatArray, ends: float) -> tuple[float, FloatArray]:
    """Climb from the four highest peaks of a function over (2, p, m, n) places, and return the top and its place, (2,).

    In each of p nets it is looked for between rows and columns, and beyond the last of them by `ends` of a step.
    """
    values, most = function(net), np.array(net.shape[2:]).reshape(2, 1, 1) - 1
    around = sliding_window_view(np.pad(values, ((0, 0), (1, 1), (1, 1))), (3, 3), axis=(1, 2)).max(axis=(3, 4))
    peaks = np.argsort(np.where(values == around, values, 0).ravel())[-4:]
    start, down, right = (each.reshape(2, 1, -1)[..., peaks] for each in (net, *np.gradient(net, axis=(2, 3))))
    first = np.stack(np.unravel_index(peaks, values.shape))[1:, None]
    here, heights, step = first.astype(float), np.zeros(len(peaks)), 1.0
    fan = np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 7)])).reshape(2, -1, 1)
    while True:
        tried = np.clip(here + step * fan, -ends, most + ends)
        x, y = tried - first
        found = function(places := start + x * down + y * right)
        if not (found > 1.005 * heights).any():
            return float(found.max()), places.reshape(2, -1)[:, found.argmax()]
        here = tried[:, found.argmax(axis=0), np.arange(len(peaks))][:, None]
        heights, step = found.max(axis=0), step / 3


def folds(patch: Patch) -> FloatArray:
    """(k, 3) places of the folds between neighbours of a net of places, which is dense near edges and corners.

    At a fold the normal turns by more than a right angle in an ever smaller step; elsewhere it only turns fast. A
    place whose normal is rounding has none, as where an edge is one point.
    """
    halvings, part = 10, 0.45  # of the way from a place to the next; folds of symmetric surfaces are at its half
    turned_over = -0.99  # a cosine, where rounding hides what is between: at a fold P_s × P_t goes through 0
    points = patch.control_points - patch.control_points.mean(axis=0)
    size = np.abs(points).max() or 1.0
    knots, weights, s = _places(patch)
    columns = np.column_stack([points / size, *(axis[:, None] * points / size for axis in knots.T), knots])
    rounding = 1024 * EPS * np.abs(knots).max()

    def directions(s: FloatArray) -> FloatArray:
        """(m, 3) unit normals at (2, m) torus coordinates, or 0."""
        p, *rates, mean = np.split(columns.T @ shares(exponents(knots, weights, s)), [3, 6, 9])
        first, second = rates[0] - mean[0] * p, rates[1] - mean[1] * p
        normals, length = cross(first, second, 0), np.sqrt((first**2 + second**2).sum(axis=0))
        lengths = np.linalg.norm(normals, axis=0)
        return np.asarray((normals * (lengths > rounding * length) / np.where(lengths > 0, lengths, 1.0)).T)

    rings = np.moveaxis(np.arange(s[0].size).reshape(s.shape[1:]), 0, 1).reshape(s.shape[2], -1)
    s = s.reshape(2, -1)
    blocks = np.array_split(s, 1 + s.shape[1] // block_length(len(knots)), axis=1)
    normals = np.concatenate([directions(block) for block in blocks])
    neighbours = (rings, np.roll(rings, -1, 1)), (rings[:-1], rings[1:])
    pairs = np.concatenate([np.stack(pair, axis=-1).reshape(-1, 2) for pair in neighbours])
    pairs = pairs[dot(*np.moveaxis(normals[pairs], 1, 0)) < 0]
    start, end, before, after = s[:, pairs[:, 0]], s[:, pairs[:, 1]], normals[pairs[:, 0]], normals[pairs[:, 1]]
    most = np.zeros(len(pairs))  # of cosines at a fold
    for _ in range(halvings):
        middle = start + part * (end - start)
        between = directions(middle)
        turns_first = dot(before, between) <= dot(between, after)  # more than after the middle
        known = between.any(axis=1)
        most[~known] = turned_over
        late, early = known & ~turns_first, known & turns_first
        start, before = np.where(late, middle, start), np.where(late[:, None], between, before)
        end, after = np.where(early, middle, end), np.where(early[:, None], between, after)
    return np.asarray((patch.control_points.T @ shares(exponents(knots, weights, end[:, dot(before, after) < most]))).T)


def _places(patch: Patch) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Knots, logarithms of weights and (2, edges, rings, places of a ring) torus coordinates, outermost rings first.

    They are those of the energy's quadrature, and further ones from these to all edges and corners.
    """
    domain, edges = patch.domain, len(patch.domain.vertices)
    resolution = math.ceil(32 * math.sqrt(min(1.0, 8 / edges)))  # no more places with many sides
    knots, weights, s, _ = samples(domain, patch.log_products, resolution)
    s = s.reshape(2, edges, resolution, resolution)
    # Outwards from each edge, so that the shares of the knots beside it fall to 1 / e; in six steps to exp(-15)
    heights = np.where(domain.incidence, np.inf, knots @ domain.normals.T)
    heights -= (knots @ domain.normals.T).min(axis=0)
    ways = -(domain.normals / heights.min(axis=0)[:, None]).T[:, :, None, None]
    steps = 2.5 * np.arange(1, 7)
    before, after = np.roll(ways, 1, axis=1), np.roll(ways, -1, axis=1)
    s = np.concatenate([s[..., :1] + before * steps[::-1], s, s[..., -1:] + after * steps], axis=3)
    s = np.concatenate([s[:, :, :1] + ways * steps[::-1, None], s], axis=2)
    return knots, weights, s
