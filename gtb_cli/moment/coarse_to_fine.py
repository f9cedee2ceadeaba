"""The inner vertices of a triangulation as lattices, on which a coarser lattice is solved first.

Smooth values at every fourth vertex in each direction are interpolated to all others, along the columns of a lattice
and then along its rows, so accurately that one step of Newton's method completes them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.knots.domain import Domain
from gtb_cli.values import frozen

STRIDE = 4  # of a coarser lattice in the next finer one: 3 would solve more nodes, 6 would spoil the polynomials
ORDER = 6  # number of nodes of the polynomials along a line
NODES_BEFORE, NODES_AFTER = ORDER // 2 - 1, ORDER // 2 + 1  # by which a line is extended beyond its first and last node
MIN_COARSE_STEPS = 12  # fewest steps along a side of a coarser lattice: an even coarser one would say little near edges

# Solves for (2, m) values at (m, 2) points, with or without approximate values to start from
Solver: TypeAlias = Callable[[FloatArray, FloatArray | None], FloatArray]


def _lagrange(first: int, places: ArrayLike) -> FloatArray:
    """Return the values of Lagrange's polynomials for consecutive nodes: (ORDER, places)."""
    nodes = first + np.arange(ORDER)
    ratio = (np.asarray(places) - nodes[:, None]) / (nodes[:, None] - nodes + np.eye(ORDER))[..., None]
    ratio[np.arange(ORDER), np.arange(ORDER)] = 1.0
    return np.asarray(ratio.prod(axis=1))


@frozen
class VertexLattices:
    """Lattices over equal parts of Δ: ``origin + x along + y across + x y twist`` with whole x and y from 0.

    These are (c, 2). Places go up to `last`; a triangular lattice has only those with x + y ≤ `last`.
    """

    origin: FloatArray
    along: FloatArray
    across: FloatArray
    twist: FloatArray
    last: int
    triangular: bool

    @cached_property
    def counts(self) -> IntArray:
        """Number of vertices in each row of all lattices together, (rows,), in the order of `triangulation`.

        If there are several lattices, they are sectors, and their rows form rings. Inner rings come first, and each
        ring has one end of each sector's row.
        """
        if len(self.origin) > 1:
            return np.maximum(len(self.origin) * np.arange(self.last + 1), 1)
        return self.last + 1 - np.arange(self.last + 1) * self.triangular

    @property
    def is_worth_it(self) -> bool:
        """True if a coarser lattice helps with this one."""
        return self.last >= STRIDE * MIN_COARSE_STEPS

    def solved(self, solve: Solver) -> FloatArray:
        """Return the solution at all places, (2, c, y, x), and 0 elsewhere."""
        shape = len(self.origin), self.last + 1, self.last + 1
        y, x = np.ogrid[: shape[1], : shape[2]]
        place = np.flatnonzero(np.broadcast_to(x + y * self.triangular <= self.last, shape))
        start = None
        if self.is_worth_it:
            start = _between(self.lines(solve))[..., : self.last + 1].reshape(2, -1).take(place, axis=1)
        values = np.zeros((2, math.prod(shape)))
        sheet, *steps = np.unravel_index(place, shape)
        y, x = (step[:, None] for step in steps)
        o, a, b, t = (each.take(sheet, axis=0) for each in (self.origin, self.along, self.across, self.twist))
        values[:, place] = solve(o + x * a + y * (b + x * t), start)
        return values.reshape(2, *shape)

    def lines(self, solve: Solver) -> FloatArray:
        """Return values at every `STRIDE`-th place of all rows, from a coarser lattice: (2, c, y, nodes)."""
        ends = self.last - np.arange(self.last + 1) * self.triangular
        steps = self.along * STRIDE, self.across * STRIDE, self.twist * STRIDE**2
        coarse = VertexLattices(self.origin, *steps, self.last // STRIDE, self.triangular)
        columns = _extended(np.swapaxes(coarse.solved(solve), 2, 3), ends[::STRIDE] // STRIDE)
        return _extended(np.swapaxes(_between(columns)[..., : self.last + 1], 2, 3), ends // STRIDE)

    def blocks(self, length: int) -> list[tuple[slice, slice]]:
        """Ranges of rows with about `length` vertices, and the ranges of these vertices."""
        ends = np.concatenate([[0], np.cumsum(self.counts)])
        cuts = dict.fromkeys([*np.searchsorted(ends, np.arange(0, ends[-1], length)).tolist(), len(ends) - 1])
        return [(slice(a, b), slice(int(ends[a]), int(ends[b]))) for a, b in itertools.pairwise(cuts)]

    def values(self, lines: FloatArray, rows: slice) -> FloatArray:
        """Return approximate values at the vertices of some rows, (2, m), in the order of `counts`."""
        first, end, _ = rows.indices(len(self.counts))
        rings = len(self.origin) > 1
        chosen = lines[:, :, self.last + 1 - end : self.last + 1 - first][:, :, ::-1] if rings else lines[:, :, rows]
        nodes = -(-int(self.counts[rows].max()) // (STRIDE * len(self.origin)))
        between = _between(chosen[..., : nodes + ORDER])
        shapes = [(count, max(count // len(self.origin), 1)) for count in self.counts[rows].tolist()]
        parts = [between[:, : m // width, k, :width].reshape(2, m) for k, (m, width) in enumerate(shapes)]
        return np.concatenate(parts, axis=1)


def vertex_lattices(domain: Domain, resolution: int) -> VertexLattices:
    """Return the lattices of the inner vertices of `triangulation`."""
    v, n = domain.vertices, resolution
    if len(v) > 4:
        along, across = (np.roll(v, -1, axis=0) - v) / n, (v.mean(axis=0) - v) / n
        return VertexLattices(v + across, along, across, np.zeros_like(v), n - 1, True)
    along, across = (v[1] - v[0])[None] / n, (v[-1] - v[0])[None] / n
    twist = (v[0] - v[1] + v[2] - v[-1])[None] / n**2 if len(v) == 4 else np.zeros((1, 2))
    origin = v[:1] + along + across + twist
    return VertexLattices(origin, along + twist, across + twist, twist, n - (2 if len(v) == 4 else 3), len(v) == 3)


def _extended(values: FloatArray, last: IntArray) -> FloatArray:
    """Extend values along lines beyond both ends, as far as `_between` needs: (k, c, lines, nodes + ORDER)."""
    weights_before = _lagrange(0, np.arange(-NODES_BEFORE, 0))
    # Weights that extend a line beyond its ends, by the polynomials of its first and of its last nodes
    weights_after = _lagrange(0, np.arange(ORDER, ORDER + NODES_AFTER))
    lines = np.pad(values, [(0, 0)] * 3 + [(NODES_BEFORE, NODES_AFTER)])
    lines[..., :NODES_BEFORE] = lines[..., NODES_BEFORE : NODES_BEFORE + ORDER] @ weights_before
    long = np.flatnonzero(last >= ORDER - 1)
    end = NODES_BEFORE + 1 + last[long, None]
    known = lines[..., long[:, None], end - ORDER + np.arange(ORDER)]
    lines[..., long[:, None], end + np.arange(NODES_AFTER)] = known @ weights_after
    for line in np.flatnonzero(last < ORDER - 1).tolist():  # too short for a polynomial
        lines[..., line, :NODES_BEFORE] = lines[..., line, NODES_BEFORE, None]
        lines[..., line, NODES_BEFORE + last[line] + 1 :] = lines[..., line, NODES_BEFORE + last[line], None]
    return lines


def _between(lines: FloatArray) -> FloatArray:
    """Interpolate at and between the nodes of extended lines: (..., STRIDE * nodes)."""
    # Weights of the nodes around a step, at the places between its ends
    inner_weights = _lagrange(-NODES_BEFORE, np.arange(STRIDE) / STRIDE)
    flat = np.ascontiguousarray(lines).ravel()
    count = len(flat) - ORDER + 1
    values = np.empty((len(flat), STRIDE))
    values[:count, 0] = flat[NODES_BEFORE : NODES_BEFORE + count]
    for place in range(1, STRIDE):
        value = flat[:count] * inner_weights[0, place]
        for node in range(1, ORDER):
            value += flat[node : node + count] * inner_weights[node, place]
        values[:count, place] = value
    return values.reshape(*lines.shape, STRIDE)[..., :-ORDER, :].reshape(*lines.shape[:-1], -1)
