"""Knots and weights of a patch that fills a hole: edges, a row inside each, and rings of inner knots.

The row determines the tangent plane along its edge, so all other knots are at least twice as far from the edge (which
keeps curvature finite); the rings are closer together near the boundary than in the middle. The inner weights give each
knot the same share of T at its own place, so that no control point is too weak or too strong.
"""

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.values import frozen

SECOND_LAYER = 2.0  # distance from an edge, relative to the row's: curvature would be infinite with less
THIRD_LAYER = 3.0  # where a second row gives the curvature


@frozen
class Net:
    """(n, 2) knots and (n,) log weights, given on edges, and in each row up to a common factor.

    `edges` have the m + 1 knots of each edge, from corner to corner, `rows` the m of each row, and `seconds` the m − 1
    of a second row, or none.
    """

    knots: FloatArray
    log_weights: FloatArray
    edges: tuple[IntArray, ...]
    rows: tuple[IntArray, ...]
    seconds: tuple[IntArray, ...]
    inner: IntArray


def net(
    lengths: FloatArray,
    edge_weights: Sequence[FloatArray],
    row_weights: Sequence[FloatArray],
    second_weights: Sequence[FloatArray | None],
) -> Net:
    """Lay out the knots of a patch whose domain has sides like the (r,) lengths in space, and choose its weights.

    Products c ω of the knots are given: (m + 1,) of each edge, 1 at the corners, (m,) of its row, up to a factor, and
    of its second row, if it has one, (m − 1,), up to the square of this factor.
    """
    corners = polygon(lengths)
    degrees = np.array([len(weights) - 1 for weights in edge_weights])
    logs_of_seconds = [np.log([] if weights is None else weights) for weights in second_weights]
    layer = THIRD_LAYER if any(map(len, logs_of_seconds)) else SECOND_LAYER
    distance = _row_distance(corners, degrees, layer)
    edges, rows, seconds, knots = _boundary(corners, degrees, distance, [len(row) for row in logs_of_seconds])
    inner_knots = _rings(corners, degrees, distance, layer)
    inner = np.arange(len(knots), len(knots) + len(inner_knots))
    knots = np.concatenate([knots, inner_knots])
    logs = np.full(len(knots), np.log(4.0))
    given = (*map(np.log, edge_weights), *map(np.log, row_weights), *logs_of_seconds)
    for members, own in zip((*edges, *rows, *seconds), given, strict=True):
        logs[members] = own
    return Net(knots, _even_weights(knots, logs, rows, seconds, inner), edges, rows, seconds, inner)


def polygon(lengths: FloatArray) -> FloatArray:
    """Return (r, 2) corners, counter-clockwise, of a polygon in a circle with sides like `lengths` and mean side 1."""
    shortest = 0.4  # of the mean side: the inner knots of a more elongated domain would crowd
    longest_share = 0.7  # of the sum of the other sides: corners stay convex by tens of degrees
    sides = np.maximum(lengths / lengths.mean(), shortest)
    for _ in range(3):
        sides = np.minimum(sides, longest_share * (sides.sum() - sides))
    sides = sides / sides.mean()
    longest = int(sides.argmax())

    def excess(radius: float) -> float:
        return float(_angles(sides, radius, longest, wide).sum()) - 2 * np.pi

    low, high = float(sides[longest]) / 2, float(sides.sum())
    wide = False
    wide = excess(low) < 0  # the centre is beyond the longest side
    for _ in range(200):
        middle = (low + high) / 2
        if (excess(middle) > 0) != wide:
            low = middle
        else:
            high = middle
    turn = np.concatenate([[0.0], np.cumsum(_angles(sides, high, longest, wide))[:-1]])
    start = -np.pi / 2 - _angles(sides, high, longest, wide)[0] / 2
    return high * np.column_stack([np.cos(start + turn), np.sin(start + turn)])


def _angles(sides: FloatArray, radius: float, longest: int, wide: bool) -> FloatArray:
    """Return the angles of sides as seen from the centre of a circle."""
    angles = 2 * np.arcsin(np.minimum(sides / (2 * radius), 1.0))
    if wide:
        angles[longest] = 2 * np.pi - angles[longest]
    return np.asarray(angles)


def _frames(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the lengths, directions and inward normals of a polygon's sides."""
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    along = sides / lengths[:, None]
    return lengths, along, np.column_stack([-along[:, 1], along[:, 0]])


def _row_distance(corners: FloatArray, degrees: IntArray, layer: float) -> float:
    """Return the distance of rows from their edges: the largest that the ends of neighbouring rows allow."""
    row_spacing = 0.98  # at 1, rows would be in each other's second layer
    lengths, along, _ = _frames(corners)
    steps = lengths / degrees
    cosine = -(np.roll(along, 1, axis=0) * along).sum(axis=1)  # of the angle inside corner k, between k − 1 and k
    sine = np.sqrt(1 - cosine**2)
    step = np.minimum(np.roll(steps, 1), steps)
    found = step / 2 * sine / (layer + cosine)
    if layer > SECOND_LAYER:
        found = np.minimum(found, step * sine / (layer + 2 * cosine))
    return float(row_spacing * found.min())


def _boundary(
    corners: FloatArray, degrees: IntArray, distance: float, seconds: Sequence[int]
) -> tuple[tuple[IntArray, ...], tuple[IntArray, ...], tuple[IntArray, ...], FloatArray]:
    """Return the knots of edges, m + 1 each, and of rows, m each and shifted by half a step."""
    lengths, along, inward = _frames(corners)
    r = len(corners)
    steps = lengths / degrees
    knots, edges, rows = [*corners], [], []
    for side in range(r):
        edges.append(np.array([side, *range(len(knots), len(knots) + degrees[side] - 1), (side + 1) % r]))
        knots += [corners[side] + j * steps[side] * along[side] for j in range(1, degrees[side])]
    for side in range(r):
        rows.append(np.arange(len(knots), len(knots) + degrees[side]))
        start = corners[side] + distance * inward[side]
        knots += [start + (j + 0.5) * steps[side] * along[side] for j in range(degrees[side])]
    second_rows = []
    for side in range(r):
        second_rows.append(np.arange(len(knots), len(knots) + seconds[side]))
        start = corners[side] + 2 * distance * inward[side]
        knots += [start + (j + 1) * steps[side] * along[side] for j in range(seconds[side])]
    return tuple(edges), tuple(rows), tuple(second_rows), np.array(knots)


def _rings(corners: FloatArray, degrees: IntArray, distance: float, layer: float) -> FloatArray:
    """Return the knots inside, ring by ring, then the centre."""
    # Of the first gap between rings, and of the domain; with fewer steps, curvature varies more, as few knots are left
    # to choose it with. Where a second row gives the curvature, it is met less exactly with more.
    gap_growth, last_size, first_ring_steps = (0.35, 0.1, 48) if layer == SECOND_LAYER else (0.5, 0.15, 36)
    # About: if there would be many more, rings have fewer steps, or there are fewer rings
    inner_knots = 320 if layer == SECOND_LAYER else 440
    lengths, _, inward = _frames(corners)
    centre = corners.mean(axis=0)
    depth = float(((centre - corners) * inward).sum(axis=1).min())
    while True:
        gaps, sizes = [distance], [1 - layer * distance / depth]
        while (size := sizes[-1] - gaps[-1] / depth) > last_size:
            sizes.append(size)
            gaps.append(gaps[-1] + gap_growth * distance)
        if len(sizes) * len(corners) <= inner_knots:
            break
        gap_growth *= 1.2
    coarser = 1.0
    while True:
        steps = coarser * np.minimum(lengths / degrees, lengths.sum() / first_ring_steps)
        counts = [
            np.maximum(1, np.rint(size * lengths / np.maximum(gap, steps)).astype(np.int64))
            for size, gap in zip(sizes, gaps, strict=True)
        ]
        if coarser > 100 or sum(int(count.sum()) for count in counts) <= inner_knots:
            break
        coarser *= 1.1
    knots = []
    for size, count in zip(sizes, counts, strict=True):
        ring = centre + size * (corners - centre)
        for side, pieces in enumerate(count.tolist()):
            shares_along = np.arange(pieces)[:, None] / pieces
            knots.append(ring[side] + shares_along * (np.roll(ring, -1, axis=0)[side] - ring[side]))
    return np.concatenate([*knots, centre[None]])


def _even_weights(
    knots: FloatArray, logs: FloatArray, rows: Sequence[IntArray], seconds: Sequence[IntArray], inner: IntArray
) -> FloatArray:
    """Return log weights with which inner knots, and rows on average, have a certain share at their own places."""
    # Most of the rest belongs to a knot's neighbours: the bumps of inner knots overlap so much that no ripple is left.
    # A row with less than this hides its planes in a strip too thin to be seen; with more, it is a crease.
    inner_share, row_share = (0.06, 0.13) if any(map(len, seconds)) else (0.04, 0.15)
    rounds, damping = 15, 0.6  # towards weights right if the others stayed; a few per cent of a share remain
    logs = logs.copy()
    free = np.concatenate([*rows, inner])
    ends = np.cumsum([len(row) for row in rows])
    columns = np.arange(len(free))
    s = None
    share = np.where(columns < ends[-1], row_share, inner_share)
    wanted = np.log(share / (1 - share))
    for _ in range(rounds):
        s = MomentMap(knots, logs).inverse(knots[free], 1e-6, s)
        t = shares(exponents(knots, logs, s))[free, columns]
        with np.errstate(divide="ignore"):
            change = wanted - np.log(t) + np.log1p(-np.minimum(t, 1 - 1e-9))
        for row in np.split(change, ends)[:-1]:
            row[:] = row.mean()
        change = damping * np.clip(change, -3, 3)
        logs[free] += change
        for row, end in zip(seconds, ends, strict=True):
            logs[row] += 2 * change[end - 1]
    return logs
