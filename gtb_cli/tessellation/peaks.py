"""Parameters near which samples may miss much of a surface: knots, and the middles between them."""

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, bounds_of, groups, planar_cross
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.splitting import Cells, Edges


class Peaks:
    """Parameters, inside the domains of surfaces and on their edges, near which samples may miss much.

    They are the knots, whose weights may be extreme, and the middles between neighbouring knots, which may crowd; found
    once for all domains of one kind, see `kinds_of`.
    """

    def __init__(self, domains: Sequence[Domain], kinds: IntArray) -> None:
        self.kinds = kinds
        self.of_kind = {kind: peaks_of(domains[kind]) for kind in dict.fromkeys(kinds.tolist())}

    def along(self, edges: Edges) -> tuple[IntArray, FloatArray]:
        """Find (q,) edges on the boundary of Δ with peaks between their ends, and (q, 2) these peaks."""
        boundary = np.flatnonzero(edges.face)
        found = []
        for kind, own in groups(self.kinds[edges.patch[boundary]]):
            for face, members in groups(edges.face[boundary[own]]):
                rows = boundary[own[members]]
                found.append(held(rows, edges.parameters, self.of_kind[kind][face], _is_between))
        return _together(found)

    def inside(self, cells: Cells) -> tuple[IntArray, FloatArray]:
        """Find (q,) triangles with peaks inside, and (q, 2) these peaks."""
        alike = groups(self.kinds[cells.patch])
        return _together([held(rows, cells.corners, self.of_kind[kind][0], _is_inside) for kind, rows in alike])


def _together(found: Sequence[tuple[IntArray, FloatArray]]) -> tuple[IntArray, FloatArray]:
    rows, u = [each for each, _ in found], [each for _, each in found]
    return np.concatenate([np.empty(0, dtype=np.int64), *rows]), np.concatenate([np.empty((0, 2)), *u])


def peaks_of(domain: Domain) -> list[FloatArray]:
    """The peaks inside Δ, and those on each edge of it."""
    knots = domain.knots
    inner = np.unique(knots[~domain.incidence.any(axis=1)], axis=0)
    middles, length = [], block_length(len(knots))
    for begin in range(0, len(inner), length):
        block = inner[begin : begin + length]
        apart = sum(np.subtract.outer(x, y) ** 2 for x, y in zip(block.T, knots.T, strict=True))
        middles.append((block + knots[np.where(apart > 0, apart, np.inf).argmin(axis=1)]) / 2)
    peaks = [np.concatenate([inner, *middles])]
    for edge in range(len(domain.vertices)):
        ordered = knots[domain.edge_knots(edge)]
        peaks.append(np.concatenate([ordered, (ordered[1:] + ordered[:-1]) / 2]))
    return peaks


def held(
    rows: IntArray, corners: FloatArray, peaks: FloatArray, holds: Callable[[FloatArray, FloatArray], BoolArray]
) -> tuple[IntArray, FloatArray]:
    """Find (q,) cells that hold peaks, among given rows of (k, c, 2) corners, and (q, 2) these peaks."""
    if not len(rows) or not len(peaks):
        return rows[:0], peaks[:0]
    corners = corners.take(rows, axis=0)
    block_pairs = 1 << 18  # of a cell and a peak that are tried at once
    low, high = bounds_of(corners.reshape(-1, 2))
    axis = (high - low).argmax()
    order = np.argsort(peaks[:, axis], kind="stable")
    columns, places = corners[:, :, axis].T, peaks[order, axis]
    first = np.searchsorted(places, reduce(np.minimum, columns))
    count = np.searchsorted(places, reduce(np.maximum, columns), side="right") - first
    near = np.flatnonzero(count)
    first, count = first[near], count[near]
    cell = np.repeat(near, count)
    peak = order[np.arange(len(cell)) + np.repeat(first - np.cumsum(count) + count, count)]
    found = [np.empty(0, dtype=np.int64)]
    for begin in range(0, len(cell), block_pairs):
        block = slice(begin, begin + block_pairs)
        found.append(begin + np.flatnonzero(holds(corners.take(cell[block], axis=0), peaks.take(peak[block], axis=0))))
    pairs = np.concatenate(found)
    return rows[cell[pairs]], peaks[peak[pairs]]


def _is_between(ends: FloatArray, peak: FloatArray) -> BoolArray:
    start, end = np.moveaxis(ends, 1, 0)
    along = ((peak - start) * (end - start)).sum(axis=1)
    return np.asarray((along > 0) & (along < ((end - start) ** 2).sum(axis=1)))


def _is_inside(corners: FloatArray, peak: FloatArray) -> BoolArray:
    a, b, c = np.moveaxis(corners, 1, 0)
    signs = np.stack([planar_cross(b - a, peak - a), planar_cross(c - b, peak - b), planar_cross(a - c, peak - c)])
    return np.asarray((signs > 0).all(axis=0) | (signs < 0).all(axis=0))
