"""The faces of Δ (Δ itself, its edges, its corners): as values, and as numbers for arrays of many points."""

from collections.abc import Sequence

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


class Faces(tuple[Face, ...]):
    """All faces of Δ, by number: Δ itself, its r edges, then its r corners; for a curve, Δ itself and its two ends."""

    edges: IntArray  # (r,) numbers of the edges; for a curve, of its ends
    corners: IntArray  # (r,) numbers of the corners; for a curve, of its ends
    knots: BoolArray  # (faces, n) where the knot lies on the face
    vanishing: BoolArray  # (faces, r) where the edge function is zero on the face

    def __new__(cls, dimension: int, incidence: BoolArray) -> "Faces":
        """Make the faces of (n, r) incidences of knots and edges."""
        r = incidence.shape[1]
        corners = ((0, k, sorted([k, (k - 1) % r])) for k in range(r if dimension == 2 else 0))
        kinds = [(dimension, 0, []), *((dimension - 1, j, [j]) for j in range(r)), *corners]
        facets = [np.array(edges, dtype=np.int64) for *_, edges in kinds]
        knots = np.array([incidence[:, edges].all(axis=1) for edges in facets])
        rows = zip(kinds, knots, facets, strict=True)
        found = super().__new__(cls, [Face(number, *kind[:2], *row) for number, (kind, *row) in enumerate(rows)])
        found.edges, found.corners = 1 + np.arange(r), len(kinds) - r + np.arange(r)
        found.knots, found.vanishing = knots, np.array([np.isin(np.arange(r), edges) for edges in facets])
        return found

    def edge(self, j: int) -> Face:
        """Return edge j; for a curve, end j."""
        return self[int(self.edges[j])]

    def corner(self, k: int) -> Face:
        """Return corner k; for a curve, end k."""
        return self[int(self.corners[k])]

    def at(self, heights: FloatArray) -> IntArray:
        """Return the number of the face that has each point in its relative interior: (r, m) edge functions → (m,)."""
        zero = heights == 0
        count = zero.sum(axis=0)
        edge = zero.argmax(axis=0)
        found = np.where(count > 0, self.edges[edge], INTERIOR)
        # Corner j ends edge j - 1 and starts edge j; edges 0 and r - 1 meet in corner 0.
        corner = np.where(zero[0] & zero[-1] & ~zero[1], 0, (edge + 1) % len(zero))
        return np.where(count > 1, self.corners[corner], found)

    def on_boundary(self, heights: FloatArray) -> list[tuple[Face, IntArray]]:
        """Return the edges and corners on which points lie, each with their indices, from (r, m) edge functions."""
        boundary = np.flatnonzero((heights == 0).any(axis=0))
        return [(self[number], boundary[members]) for number, members in groups(self.at(heights[:, boundary]))]

    def smallest(self, knots: int | Sequence[int]) -> Face:
        """Return the smallest face that contains the given knots."""
        return self[int(np.flatnonzero(self.knots[:, np.atleast_1d(knots)].all(axis=1))[-1])]
