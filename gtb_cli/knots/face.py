"""The faces of Δ (Δ itself, its edges, its corners): as values, and as numbers for arrays of many points."""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.values import frozen

INTERIOR = 0  # number of Δ itself among its faces, and thus of points that do not lie on an edge


@frozen
class Face:
    """A face of Δ: Δ itself, an edge or a corner; the ends of a curve are corners."""

    number: int  # its index in `Faces`, by which arrays refer to faces
    dimension: int  # 2 (of a curve 1), 1 or 0
    index: int  # among the edges, or among the corners
    knots: BoolArray  # (n,) the knots that lie on it
    facets: IntArray  # (g,) the edges, or ends of a curve, whose edge functions vanish on it

    @property
    def is_interior(self) -> bool:
        """True for Δ itself."""
        return self.number == INTERIOR

    @property
    def is_corner(self) -> bool:
        """True for a corner, and for an end of a curve."""
        return self.dimension == 0


@frozen
class Faces:
    """All faces of Δ, by number: Δ itself, its r edges, then its r corners; for a curve, Δ itself and its two ends."""

    dimension: int
    incidence: BoolArray  # (n, r) whether knot i lies on edge j

    @property
    def edges(self) -> IntArray:
        """Numbers of the edges, (r,); for a curve, of its ends."""
        return 1 + np.arange(self.incidence.shape[1])

    @property
    def corners(self) -> IntArray:
        """Numbers of the corners, (r,); for a curve, of its ends."""
        return self.edges + (len(self.edges) if self.dimension == 2 else 0)

    @cached_property
    def knots(self) -> BoolArray:
        """Incidence of faces and knots, (faces, n): true where the knot lies on the face."""
        edges = self.incidence.T
        corners = [edges & np.roll(edges, 1, axis=0)] if self.dimension == 2 else []
        return np.concatenate([np.ones_like(edges[:1]), edges, *corners])

    @cached_property
    def vanishing(self) -> BoolArray:
        """Edge functions that are zero on each face, (faces, r)."""
        edges = np.eye(self.incidence.shape[1], dtype=bool)
        corners = [edges | np.roll(edges, -1, axis=1)] if self.dimension == 2 else []
        return np.concatenate([np.zeros_like(edges[:1]), edges, *corners])

    @cached_property
    def _all(self) -> tuple[Face, ...]:
        r = self.incidence.shape[1]
        kinds = [(self.dimension, 0), *((self.dimension - 1, j) for j in range(r)), *((0, k) for k in range(r))]
        rows = zip(range(len(self.knots)), kinds, self.knots, map(np.flatnonzero, self.vanishing), strict=False)
        return tuple([Face(number, *kind, members, facets) for number, kind, members, facets in rows])

    def __len__(self) -> int:
        return len(self._all)

    def __iter__(self) -> Iterator[Face]:
        return iter(self._all)

    def __getitem__(self, number: int) -> Face:
        return self._all[number]

    def edge(self, j: int) -> Face:
        """Return edge j; for a curve, end j."""
        return self._all[int(self.edges[j])]

    def corner(self, k: int) -> Face:
        """Return corner k; for a curve, end k."""
        return self._all[int(self.corners[k])]

    def at(self, heights: FloatArray) -> IntArray:
        """Return the number of the face that has each point in its relative interior: (r, m) edge functions → (m,)."""
        zero = heights == 0
        count = zero.sum(axis=0)
        edge = zero.argmax(axis=0)
        found = np.where(count > 0, self.edges[edge], INTERIOR)
        if self.dimension == 2:
            r = len(zero)
            # Corner j ends edge j - 1 and starts edge j; edges 0 and r - 1 meet in corner 0.
            corner = np.where(zero[0] & zero[r - 1] & ~zero[1 % r], 0, (edge + 1) % r)
            found = np.where(count > 1, self.corners[corner], found)
        return found

    def on_boundary(self, heights: FloatArray) -> list[tuple[Face, IntArray]]:
        """Return the edges and corners on which points lie, each with their indices, from (r, m) edge functions."""
        boundary = np.flatnonzero((heights == 0).any(axis=0))
        found = list(groups(self.at(heights[:, boundary])))
        return [(self._all[number], boundary[members]) for number, members in found]

    def smallest(self, knots: int | Sequence[int]) -> Face:
        """Return the smallest face that contains the given knots."""
        holds = self.knots[:, np.atleast_1d(knots)].all(axis=1)
        return self._all[int(np.flatnonzero(holds)[-1])]
