"""Parameters near which samples may miss much of a surface: knots, and the middles between them."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups, planar_cross
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.moment.torus import block_length
from gtb_cli.tessellation.splitting import Cells, Edges


class PeakParameters:
    """Parameters, inside the domains of surfaces and on their edges, near which samples may miss much.

    They are the knots, whose weights may be extreme, the middles between neighbouring knots, which may crowd, and
    places between knots in a narrow layer at an edge; found once for all domains of one kind, see `kinds_of`.
    """

    def __init__(self, domains: Sequence[Domain], kinds: IntArray) -> None:
        self.kinds = kinds
        self.of_kind = {kind: _peaks_of(domains[kind]) for kind in np.unique(kinds).tolist()}

    def along(self, edges: Edges) -> tuple[IntArray, FloatArray]:
        """Find (q,) edges on the boundary of Δ with peaks between their ends, and (q, 2) these peaks."""
        return _together(
            _held(own[members], edges.parameters, self.of_kind[kind][face], _is_between)
            for kind, own in groups(self.kinds[edges.patch])
            for face, members in groups(edges.face[own])
            if face != INTERIOR
        )

    def inside(self, cells: Cells) -> tuple[IntArray, FloatArray]:
        """Find (q,) triangles with peaks inside, and (q, 2) these peaks."""
        alike = groups(self.kinds[cells.patch])
        return _together(_held(rows, cells.corners, self.of_kind[kind][0], _is_inside) for kind, rows in alike)


def _peaks_of(domain: Domain) -> list[FloatArray]:
    """The peaks inside Δ, and those on each edge of it."""
    knots = domain.knots
    inner = np.unique(knots[~domain.incidence.any(axis=1)], axis=0)
    middles, length = [], block_length(len(knots))
    for begin in range(0, len(inner), length):
        block = inner[begin : begin + length]
        apart = sum(np.subtract.outer(x, y) ** 2 for x, y in zip(block.T, knots.T, strict=True))
        middles.append((block + knots[np.where(apart > 0, apart, np.inf).argmin(axis=1)]) / 2)
    peaks = [np.concatenate([inner, *middles, *map(partial(_peaks_of_layer, domain), range(len(domain.vertices)))])]
    for edge in range(len(domain.vertices)):
        ordered = knots[domain.edge_knots(edge)]
        peaks.append(np.concatenate([ordered, (ordered[1:] + ordered[:-1]) / 2]))
    return peaks


def _peaks_of_layer(domain: Domain, edge: int) -> FloatArray:
    """PeakParameters between knots so near to an edge that the surface may turn in a narrow layer there.

    They are on the segments from each such knot to its neighbours along the edge: among all of them, and on the edge.
    """
    slope = 0.1  # height over the edge of the farther end of such a segment, by its length
    height, place = domain.heights[:, edge] / domain.normal_lengths[edge], domain.along(edge, domain.knots)
    on = domain.edge_knots(edge)
    near = np.setdiff1d(np.flatnonzero(height < slope * np.ptp(place[on])), on)
    found = [np.empty((0, 2))]
    for knot in near.tolist():
        for others in (on, np.setdiff1d(np.union1d(on, near), knot)):
            for side in (-1, 1):
                gaps = side * (place[others] - place[knot])
                if (gaps > 0).any():
                    other = others[np.where(gaps > 0, gaps, np.inf).argmin()]
                    if max(height[knot], height[other]) < slope * gaps[gaps > 0].min():
                        share = np.arange(1, 16)[:, None] / 16
                        found.append((1 - share) * domain.knots[knot] + share * domain.knots[other])
    return np.unique(np.concatenate(found), axis=0)


def _held(
    rows: IntArray, corners: FloatArray, peaks: FloatArray, holds: Callable[[FloatArray, FloatArray], BoolArray]
) -> tuple[IntArray, FloatArray]:
    """Find (q,) cells that hold peaks, among given rows of (k, c, 2) corners, and (q, 2) these peaks."""
    x = corners[rows, :, 0]
    low, high = x.min(axis=1)[:, None], x.max(axis=1)[:, None]
    cell, peak = np.nonzero((low <= peaks[:, 0]) & (peaks[:, 0] <= high))
    found = holds(corners[rows[cell]], peaks[peak])
    return rows[cell[found]], peaks[peak[found]]


def _together(found: Iterable[tuple[IntArray, FloatArray]]) -> tuple[IntArray, FloatArray]:
    none = np.empty(0, dtype=np.int64), np.empty((0, 2))
    rows, u = zip(none, *found, strict=True)
    return np.concatenate(rows), np.concatenate(u)


def _is_between(ends: FloatArray, peak: FloatArray) -> BoolArray:
    start, end = np.moveaxis(ends, 1, 0)
    along = ((peak - start) * (end - start)).sum(axis=1)
    return np.asarray((along > 0) & (along < ((end - start) ** 2).sum(axis=1)))


def _is_inside(corners: FloatArray, peak: FloatArray) -> BoolArray:
    a, b, c = np.moveaxis(corners, 1, 0)
    signs = np.stack([planar_cross(b - a, peak - a), planar_cross(c - b, peak - b), planar_cross(a - c, peak - c)])
    return np.asarray((signs > 0).all(axis=0) | (signs < 0).all(axis=0))
