"""Pairs of triangles of a mesh that pass through each other or lie upon each other; how that is said: `solidity`."""

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, bounds_of, cross, dot, unit
from gtb_cli.meshes.coincident import numbered_places
from gtb_cli.meshes.nearest import NearestCells
from gtb_cli.meshes.topology import are_proper, sides_of

CROSSING_DEPTH = 1e-9  # relative to the largest extent: nearer triangles touch, as coplanar ones do after rounding
MAX_COMPARED_PAIRS = 50_000_000  # in half a minute: a smooth mesh has about 20 per triangle, one that overlaps all


def crossing_pairs(vertices: FloatArray, cells: IntArray) -> tuple[IntArray, bool]:
    """(p, 2) triangles of a mesh that pass through each other, or lie in one plane and overlap; each pair once.

    Triangles that touch along a segment, in which an edge of one lies, cross if the surface passes through there: the
    neighbour across the edge is on the other side of the surface that the edge touches. Other triangles that only touch
    do not cross, and neighbours do not cross in what they share. Vertices at exactly the same place are one, and
    triangles with two corners at one place are left out. The second value is false if more than `MAX_COMPARED_PAIRS`
    are near each other, so that not all were compared. A million triangles take about ten seconds.
    """
    found = [np.empty((0, 2), dtype=np.int64)]
    places = numbered_places(vertices)[1]
    proper = np.flatnonzero(are_proper(places[cells]))
    cells = cells[proper]
    corners = vertices[cells]
    if len(corners) < 2:
        return found[0], True
    depth = CROSSING_DEPTH * float(np.ptp(bounds_of(corners.reshape(-1, 3)), axis=0).max())
    normals = facing_of(corners)
    across = np.maximum(_across(cells), _across(places[cells]))
    compared = 0
    for pairs in _near_pairs(corners, depth):
        compared += len(pairs)
        if compared > MAX_COMPARED_PAIRS:
            break
        found.append(pairs[_cross(corners, normals, across, pairs, depth)])
    return proper[np.sort(np.concatenate(found), axis=1)], compared <= MAX_COMPARED_PAIRS


def facing_of(corners: FloatArray) -> FloatArray:
    """(k, 3) unit normals of (k, 3, 3) triangles; 0 for those that are lines."""
    a, b, c = corners.transpose(1, 0, 2)
    normals = cross(b - a, c - b)
    normals[np.sqrt(dot(normals, normals)) <= 64 * EPS * np.maximum(dot(b - a, b - a), dot(c - a, c - a))] = 0.0
    return unit(normals)


def _across(cells: IntArray) -> IntArray:
    """(k, 3) corners beyond each side, as 3 · triangle + corner; −1 where there is no neighbour, or several."""
    sides = sides_of(cells)
    edge = sides.edge.ravel()
    shared = np.flatnonzero(sides.uses[edge] == 2)
    pairs = shared[np.argsort(edge[shared], kind="stable")].reshape(-1, 2)
    result = np.full(len(edge), -1)
    for k in (0, 1):
        triangle, side = np.divmod(pairs[:, 1 - k], 3)
        result[pairs[:, k]] = 3 * triangle + (side + 2) % 3
    return result.reshape(-1, 3)


def _near_pairs(corners: FloatArray, depth: float) -> Iterator[IntArray]:
    """Blocks of (p, 2) pairs of triangles whose boxes are at most `depth` apart."""
    pair_batch = 1 << 13  # pairs of boxes whose boxes inside, 64 times as many, are compared at a time
    tree = NearestCells(corners)
    boxes = [(low.T.copy(), high.T + depth) for low, high in tree.boxes]  # an axis at a time is several times faster
    root = np.zeros(1, dtype=np.int64)  # a box above the highest level
    stack = [(len(boxes), root, root)]
    while stack:
        level, a, b = stack.pop()
        a, b = tree.inside(level, a, b)
        b, a = tree.inside(level, b, a)
        level -= 1
        left = np.flatnonzero(a <= b if level else a < b)
        for least, most in zip(*boxes[level], strict=True):
            a, b = a[left], b[left]
            left = np.flatnonzero((least[a] <= most[b]) & (least[b] <= most[a]))
        a, b = a[left], b[left]
        if level == 0:
            yield tree.order[np.stack([a, b], axis=1)]
            continue
        stack += [(level, a[k : k + pair_batch], b[k : k + pair_batch]) for k in range(0, len(a), pair_batch)]


def _cross(corners: FloatArray, normals: FloatArray, across: IntArray, pairs: IntArray, depth: float) -> BoolArray:
    """(p,) true where the two of each pair of triangles pass through each other, or overlap in one plane.

    Triangles that reach through each other's planes meet these in two segments of one line. They cross if the segments
    have a length in common. Triangles with an edge in common cannot reach so.
    """
    result = np.zeros(len(pairs), dtype=bool)
    heights, reaching, flat, standing = _heights(corners, normals, pairs[:, 0], pairs[:, 1], depth)
    rows = np.flatnonzero(reaching | flat | standing)
    one, other = pairs[rows].T
    heights, reaching, flat, standing = heights[rows], reaching[rows], flat[rows], standing[rows]
    back, back_reaching, back_flat, back_standing = _heights(corners, normals, other, one, depth)
    near, flat = np.flatnonzero(reaching & back_reaching), flat & back_flat
    segments = [_section(corners[other[near]], heights[near]), _section(corners[one[near]], back[near])]
    along = np.stack([segment[:, 1] - segment[:, 0] for segment in segments])
    longer = np.stack([dot(direction, direction) for direction in along]).argmax(axis=0)
    direction = unit(along[longer, np.arange(len(longer))])
    places = np.stack([np.einsum("pij,pj->pi", segment - segments[0][:, :1], direction) for segment in segments])
    result[rows[near]] = places.max(axis=2).min(axis=0) - places.min(axis=2).max(axis=0) > depth
    result[rows[flat]] = _overlap(corners[one[flat]], corners[other[flat]], normals[one[flat]], depth)
    for order, over, is_upon in (([one, other], heights, standing), ([other, one], back, back_standing)):
        k = np.flatnonzero(is_upon)
        result[rows[k]] |= _passes(corners, normals, across, np.stack(order, axis=1)[k], over[k], depth)
    return result


def _heights(
    corners: FloatArray, normals: FloatArray, one: IntArray, other: IntArray, depth: float
) -> tuple[FloatArray, BoolArray, BoolArray, BoolArray]:
    """(p, 3) heights of triangles over the planes of others; where they reach through, lie in, and stand on these."""
    base, normal = corners[one, 0], normals[one]
    heights = np.stack([dot(corners[other, k] - base, normal) for k in range(3)])
    low, high = (bound(bound(heights[0], heights[1]), heights[2]) for bound in (np.minimum, np.maximum))
    touching = (np.abs(heights) <= depth).sum(axis=0)
    return heights.T, (low < -depth) & (high > depth), (touching == 3) & (dot(normal, normal) > 0), touching == 2


def _passes(
    corners: FloatArray, normals: FloatArray, across: IntArray, pairs: IntArray, heights: FloatArray, depth: float
) -> BoolArray:
    """(p,) true where an edge of the second lies on the first, and the surfaces of which they are pass through there.

    The edge is inside the first, and the triangles beside it are on two sides of its plane; or it runs along an edge of
    the first, and of the triangles around the line every second belongs to the same surface.
    """
    result, (one, other) = np.zeros(len(pairs), dtype=bool), pairs.T
    apex = np.abs(heights).argmax(axis=1)
    beyond = across[other, (apex + 1) % 3]
    rows = np.flatnonzero((beyond >= 0) & (beyond // 3 != one))
    one, other, apex, beyond = one[rows], other[rows], apex[rows], beyond[rows]
    normal, points = normals[one], corners.reshape(-1, 3)
    start, end = corners[other, (apex + 1) % 3], corners[other, (apex + 2) % 3]
    length = np.sqrt(dot(end - start, end - start))
    offsets = [corners[other, apex] - start, points[beyond] - start]
    # Of the sides of `one`: unit vectors inwards, distances of the edge's ends, and where on the edge it is passed
    around = corners[one].swapaxes(0, 1)
    inwards = np.stack([unit(cross(normal, side)) for side in np.roll(around, -1, axis=0) - around])
    ends = np.stack([((x - around) * inwards).sum(axis=2) - depth for x in (start, end)])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = ends[0] / (ends[0] - ends[1])
    lows = np.where(ends[0] > 0, 0.0, np.where(ends[1] > 0, place, np.inf))
    highs = np.where(ends[1] > 0, 1.0, np.where(ends[0] > 0, place, -np.inf))
    up = [dot(x, normal) for x in offsets]
    is_inside = (highs.min(axis=0) - lows.max(axis=0)) * length > depth
    result[rows] = is_inside & (np.abs(up[1]) > depth) & (up[0] * up[1] < 0)
    for k, is_along in enumerate(np.abs(ends + depth).max(axis=0) <= depth):
        others = [k - 1, k - 2]
        far = across[one, k]
        is_along = is_along & (far >= 0) & ((highs[others].min(axis=0) - lows[others].max(axis=0)) * length > depth)
        chosen = np.flatnonzero(is_along)
        frame = np.stack([inwards[k, chosen], normal[chosen]])
        ours = points[far[chosen]] - start[chosen]
        turned = [np.einsum("api,pi->ap", frame, x) for x in (ours, *(x[chosen] for x in offsets))]
        angles = [np.arctan2(y, x) % (2 * np.pi) for x, y in turned]
        is_apart = np.ones(len(chosen), dtype=bool)
        for x, y in turned[1:]:
            far_x, far_y = turned[0]
            is_apart &= (np.abs(y) > depth) | (x < 0)
            is_apart &= np.abs(x * far_y - y * far_x) > depth * np.hypot(far_x, far_y)
        result[rows[chosen]] |= is_apart & ((angles[1] < angles[0]) != (angles[2] < angles[0]))
    return result


def _section(triangle: FloatArray, heights: FloatArray) -> FloatArray:
    """(p, 2, 3) ends of the segments in which (p, 3, 3) triangles meet the plane over which their corners are."""
    rows = np.arange(len(triangle))
    below = heights < 0
    # The corner that is alone on its side of the plane, and the sides from there
    top = np.where(below.sum(axis=1) == 1, below.argmax(axis=1), below.argmin(axis=1))
    rows, others = rows[:, None], (top[:, None] + [1, 2]) % 3
    height, start = heights[rows, top[:, None]], triangle[rows, top[:, None]]
    share = height / (height - heights[rows, others])
    return np.asarray(start + share[..., None] * (triangle[rows, others] - start))


def _overlap(one: FloatArray, other: FloatArray, normal: FloatArray, depth: float) -> BoolArray:
    """(p,) true where triangles in one plane have an area in common: no line along a side of one separates them."""
    left = np.arange(len(one))
    for k in range(6):
        ours, theirs = (one[left], other[left]) if k < 3 else (other[left], one[left])
        start = ours[:, k % 3]
        edge = start - ours[:, k % 3 - 1]
        inwards = cross(normal[left], edge) / np.sqrt(dot(edge, edge))[:, None]
        inside, beside, *others = (dot(x - start, inwards) for x in (ours[:, k % 3 - 2], *theirs.swapaxes(0, 1)))
        low, high = (bound.reduce([beside, *others]) for bound in (np.minimum, np.maximum))
        reach = np.minimum(np.maximum(inside, 0), high) - np.maximum(np.minimum(inside, 0), low)
        left = left[reach > depth]
    return np.isin(np.arange(len(one)), left)
