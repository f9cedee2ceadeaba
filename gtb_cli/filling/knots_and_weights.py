"""Knots and weights of a patch that fills a hole: edges, a row inside each, knots for its corners, and rings inside.

The row determines the tangent plane along its edge, so all other knots are at least twice as far from the edge (which
keeps curvature finite); the rings are closer together near the boundary than in the middle. Knots that would break the
plane or the curvature of a corner are left out (`corner_knots`). The inner weights give each knot the same share of
T at its own place, so that no control point is too weak or too strong.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, planar_cross, unit
from gtb_cli.filling.corner_knots import FREE, SUMS, corner_places, frames, keeps_corners
from gtb_cli.filling.osculation import polar
from gtb_cli.filling.sides import binomials, points_and_tangents
from gtb_cli.filling.tangent_rows import EdgeRows
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.values import frozen

SECOND_LAYER = 2.0  # distance from an edge, relative to the row's: curvature would be infinite with less
THIRD_LAYER = 3.0  # where a second row gives the curvature


@frozen
class Net:
    """(n, 2) knots and (n,) log weights, given on edges, and in each row up to a common factor.

    `edges` have the m + 1 knots of each edge, from corner to corner, `rows` the m of each row, `seconds` the m − 1 of a
    second row, or none, and `inner` all others. The (r, 10) `corners` are the knots that rule each corner, as in
    `corner_knots.corner_places`.
    """

    knots: FloatArray
    log_weights: FloatArray
    edges: tuple[IntArray, ...]
    rows: tuple[IntArray, ...]
    seconds: tuple[IntArray, ...]
    inner: IntArray
    corners: IntArray


def net(rows_at: Sequence[EdgeRows]) -> Net:
    """Lay out the knots of a patch whose domain has sides like the edges in space, and choose its weights.

    Those of edges are the weights of their curves, those of a row are given up to a factor, and those of its second
    row, if it has one, up to the square of this factor.
    """
    curves = [each.curve for each in rows_at]
    t = np.linspace(0, 1, 33)
    lengths = [np.linalg.norm(np.diff(points_and_tangents(c, t)[0], axis=0), axis=1).sum() for c in curves]
    vertices = polygon(np.array(lengths))
    degrees = np.array([len(curve) - 1 for curve in curves])
    # Products c ω, of edges and of rows
    weights = [binomials(len(points) - 1) * points[:, 3] for points in (*curves, *map(polar, curves))]
    logs_of_seconds = [np.log([] if each.second is None else each.second.weights) for each in rows_at]
    layer = THIRD_LAYER if any(map(len, logs_of_seconds)) else SECOND_LAYER
    distances = _row_distances(vertices, degrees, layer)
    edges, rows, seconds, boundary = _boundary(vertices, degrees, distances, [len(row) for row in logs_of_seconds])
    places = corner_places(vertices, degrees, distances)
    known, same = np.concatenate([boundary, places[:, FREE].reshape(-1, 2)]), 1e-6 * distances.min()
    sums = known[[k for k in range(len(boundary), len(known)) if not _near(known[k : k + 1], known[:k], same)]]
    legs = [unit(np.diff(c[:, :3] / c[:, 3:], axis=0)[[0, -1]]) for c in curves]
    smooth = max(float(a[1] @ b[0]) for a, b in pairwise([legs[-1], *legs])) > 0.87  # turns by less than 30 degrees
    rings = _rings(vertices, degrees, distances, layer, 48 if smooth or min(lengths) < max(lengths) / 20 else 52)
    rings = rings[keeps_corners(rings, places) & ~_near(rings, sums, 0.8 * distances.min())]
    knots = np.concatenate([boundary, sums, rings])
    logs = np.full(len(knots), np.log(4.0))
    for members, own in zip((*edges, *rows, *seconds), (*map(np.log, weights), *logs_of_seconds), strict=True):
        logs[members] = own
    corners = np.linalg.norm(knots - places[:, :, None], axis=3).argmin(axis=2)
    found = Net(knots, logs, edges, rows, seconds, np.arange(len(boundary), len(knots)), corners)
    return replace(found, log_weights=_even_weights(found))


def _near(points: FloatArray, others: FloatArray, distance: float) -> BoolArray:
    return np.asarray((np.linalg.norm(points[:, None] - others, axis=2) <= distance).any(axis=1))


def polygon(lengths: FloatArray) -> FloatArray:
    """Return (r, 2) corners of a polygon in a circle with sides like `lengths` and mean side 1.

    They are counter-clockwise from the lower left, so that sides are edges of the domain in its order.
    """
    # Of the mean side: the inner knots of a more elongated domain would crowd, and at its wide corners between short
    # sides no row would be near enough to its edge
    shortest = 0.9
    longest_share = 0.7  # of the sum of the other sides: corners stay convex by tens of degrees
    sides = np.maximum(lengths / lengths.mean(), shortest)
    for _ in range(3):
        sides = np.minimum(sides, longest_share * (sides.sum() - sides))
    sides = sides / sides.mean()
    longest, wide = int(sides.argmax()), False

    def angles(radius: float) -> FloatArray:
        """Return the angles of sides as seen from the centre of a circle."""
        found = 2 * np.arcsin(np.minimum(sides / (2 * radius), 1.0))
        if wide:
            found[longest] = 2 * np.pi - found[longest]
        return np.asarray(found)

    low, high = float(sides[longest]) / 2, float(sides.sum())
    wide = bool(angles(low).sum() < 2 * np.pi)  # the centre is beyond the longest side
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if (angles(middle).sum() > 2 * np.pi) != wide else (low, middle)
    turn = np.concatenate([[0.0], np.cumsum(angles(high))[:-1]]) + (-np.pi / 2 - angles(high)[0] / 2)
    return high * np.column_stack([np.cos(turn), np.sin(turn)])


def _row_distances(vertices: FloatArray, degrees: IntArray, layer: float) -> FloatArray:
    """Return (r,) distances of rows from their edges: the largest that the ends of neighbouring rows allow.

    At each corner the first knots of both rows have to lie below the line of the next knots on the edges, or these
    would carry the twists of both sides.
    """
    spacing = 0.98  # at 1, rows would be in each other's second layer
    least_turn, shrinking = 0.01, 0.98  # sine of the angle at a first knot, and factor of distances in each round
    most_sum = 0.95  # of the exponents of a row's first knot: at 1 it would lie on the line
    lengths, along, _ = frames(vertices)
    steps = lengths / degrees
    before = np.roll(steps, 1)
    cosine = -(np.roll(along, 1, axis=0) * along).sum(axis=1)  # of the angle inside corner k, between k − 1 and k
    sine = np.sqrt(1 - cosine**2)
    even = spacing * np.minimum(before, steps) / 2 * sine / (layer + cosine)
    ahead = 1 / (before * sine) - cosine / (sine * steps)  # what a unit of distance adds to the sum of exponents
    back = 1 / (steps * sine) - cosine / (sine * before)
    with np.errstate(divide="ignore"):
        of_ahead, of_back = ((most_sum - 0.5) / np.maximum(slope, 0.0) for slope in (ahead, back))
    found = np.minimum(even.min(), np.minimum(of_ahead, np.roll(of_back, -1)))
    for _ in range(50):  # lowered, at wide corners, until the ends of rows are in the neighbours' layers
        of_ahead = spacing / 2 * before * sine - cosine * np.roll(found, 1)
        of_back = np.roll(spacing / 2 * steps * sine - cosine * found, -1)
        found = np.minimum(found, np.minimum(of_ahead, of_back) / layer)
    # Knots p, q, r, t about a corner bound a convex region, and p + r and q + t lie in the second layer.
    for _ in range(100):  # down to an eighth; a few rounds are enough
        p, q, r, t = corner_places(vertices, degrees, found)[:, 1:5].swapaxes(0, 1)
        ways, across = (q - p, r - q, t - r), p + r - q - t
        lengths = np.linalg.norm(ways, axis=2)
        room = least_turn * lengths[:-1] * lengths[1:]
        turns = planar_cross(ways[1], ways[0]), planar_cross(ways[2], ways[1])
        flat = (turns < room) | (np.stack([planar_cross(q - t, across), planar_cross(across, p - r)]) < room)
        if not flat.any():
            break
        found[flat[0]] *= shrinking
        found[np.roll(flat[1], -1)] *= shrinking
    return np.asarray(found)


def _boundary(
    vertices: FloatArray, degrees: IntArray, distances: FloatArray, seconds: Sequence[int]
) -> tuple[tuple[IntArray, ...], tuple[IntArray, ...], tuple[IntArray, ...], FloatArray]:
    """Return the knots of edges, m + 1 each, and of rows, m each and shifted by half a step."""
    lengths, along, inward = frames(vertices)
    steps = lengths / degrees
    knots = [*vertices]

    def lines(height: float, first: float, counts: Sequence[int] | IntArray) -> list[IntArray]:
        """Add knots along each side, at a multiple of its row's distance, from so many steps after its corner on."""
        members = []
        for side, count in enumerate(counts):
            members.append(np.arange(len(knots), len(knots) + count))
            start = vertices[side] + height * distances[side] * inward[side]
            knots.extend(start + (j + first) * steps[side] * along[side] for j in range(count))
        return members

    edges = [np.array([k, *own, (k + 1) % len(vertices)]) for k, own in enumerate(lines(0, 1, degrees - 1))]
    return tuple(edges), tuple(lines(1, 0.5, degrees)), tuple(lines(2, 1, seconds)), np.array(knots)


def _rings(vertices: FloatArray, degrees: IntArray, distances: FloatArray, layer: float, most_steps: int) -> FloatArray:
    """Return the knots inside, ring by ring, then the centre; gaps between rings grow linearly from each side's row."""
    # Of the first gap between rings, and of the domain. Few steps leave few knots to choose curvature with; with more,
    # it varies more beside smooth corners and short sides, and that of a second row is met less exactly.
    gap_growth, last_size, first_ring_steps = (0.35, 0.1, most_steps) if layer == SECOND_LAYER else (0.5, 0.15, 36)
    # About: if there would be many more, rings have fewer steps, or there are fewer rings
    inner_knots = 320 if layer == SECOND_LAYER else 440
    lengths, along, inward = frames(vertices)
    centre, widest = vertices.mean(axis=0), float(distances.max())
    depths = ((centre - vertices) * inward).sum(axis=1)
    depth = float(depths.min())
    for growth in gap_growth * 1.2 ** np.arange(50):
        gaps = widest * (1 + growth * np.arange(inner_knots))
        sizes = 1 - (layer * widest + np.cumsum(gaps) - gaps) / depth
        sizes = sizes[: max(1, np.count_nonzero(sizes > last_size))]
        if len(sizes) * len(vertices) <= inner_knots:
            break
    steps_in = np.arange(len(sizes) - 1)
    first, last = layer * distances, (1 - sizes[-1]) * depths
    growth = ((last - first) / distances - len(steps_in)) / max(1, steps_in.sum())
    gaps_of_sides = distances * (1 + growth * steps_in[:, None])
    rings = np.array([_offset(vertices, first + gaps_of_sides[:k].sum(axis=0)) for k in range(len(sizes))])
    ways = np.roll(rings, -1, axis=1) - rings
    for coarser in 1.1 ** np.arange(50):
        steps = coarser * np.minimum(lengths / degrees, lengths.sum() / first_ring_steps)
        steps = np.maximum(gaps[: len(sizes), None], steps)
        counts = np.maximum(1, np.rint((ways * along).sum(axis=2) / steps)).astype(np.int64).ravel()
        if counts.sum() <= inner_knots:
            break
    shares = np.concatenate([np.arange(count) / count for count in counts.tolist()])
    starts, ways = (np.repeat(each.reshape(-1, 2), counts, axis=0) for each in (rings, ways))
    found = np.concatenate([starts + shares[:, None] * ways, centre[None]])
    above = ((found[:, None] - vertices) * inward).sum(axis=2)
    return np.asarray(found[(above >= (layer - 1e-6) * distances).all(axis=1)])


def _offset(vertices: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the corners of the polygon whose sides are moved inwards by (r,) heights."""
    _, _, inward = frames(vertices)
    values = (vertices * inward).sum(axis=1) + heights
    lines = np.stack([np.roll(inward, 1, axis=0), inward], axis=1)
    return np.linalg.solve(lines, np.column_stack([np.roll(values, 1), values])[:, :, None])[:, :, 0]


def _even_weights(net: Net) -> FloatArray:
    """Return log weights with which inner knots, and rows on average, have a certain share at their own places.

    Knots at sums of two first ones have a small multiple of the product of their weights.
    """
    # Most of the rest belongs to a knot's neighbours: the bumps of inner knots overlap so much that no ripple is left.
    # A row with less than this hides its planes in a strip too thin to be seen; with more, it is a crease.
    inner_share, row_share = (0.06, 0.13) if any(map(len, net.seconds)) else (0.04, 0.15)
    tie = 0.05  # curvature varies most with even shares, and little between 0.03 and 0.1
    rounds, damping = 15, 0.6  # towards weights right if the others stayed; a few per cent of a share remain
    logs, pairs, corners = net.log_weights.copy(), np.array(SUMS), net.corners
    owners, sums = np.nonzero(corners[:, 5:] >= net.inner[0])
    tied, (first, other) = corners[owners, sums + 5], (corners[owners, pairs[sums, k]] for k in (0, 1))
    products = np.log(tie * np.where(first == other, 1, 2)) - logs[corners[owners, 0]]
    free = np.concatenate([*net.rows, net.inner[~np.isin(net.inner, tied)]])
    ends = np.cumsum([len(row) for row in net.rows])
    columns, s = np.arange(len(free)), None
    share = np.where(columns < ends[-1], row_share, inner_share)
    wanted = np.log(share / (1 - share))
    for _ in range(rounds):
        logs[tied] = products + logs[first] + logs[other]
        s = MomentMap(net.knots, logs).inverse(net.knots[free], 1e-6, s)
        t = shares(exponents(net.knots, logs, s))[free, columns]
        with np.errstate(divide="ignore"):
            change = wanted - np.log(t) + np.log1p(-np.minimum(t, 1 - 1e-9))
        for row in np.split(change, ends)[:-1]:
            row[:] = row.mean()
        change = damping * np.clip(change, -3, 3)
        logs[free] += change
        for row, end in zip(net.seconds, ends, strict=True):
            logs[row] += 2 * change[end - 1]
    return logs
