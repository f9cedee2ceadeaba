"""Regular decompositions of Δ by upper hulls of lifted knots (`upper_faces`), and the control nets they induce."""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, planar_cross, read_only
from gtb_cli.display import notebook_html
from gtb_cli.errors import DomainError
from gtb_cli.knots.hull import border_of, knot_tolerance
from gtb_cli.knots.upper_faces import lifted_knots, upper_faces
from gtb_cli.values import by_value


@by_value
class RegularDecomposition:
    """Cells of knots under the upper faces of the lifted knots (a_i, λ_i). Made by `regular_decomposition`.

    Attributes
    ----------
    knots : (n, d) float
    lifting : (n,) float
    cells : tuple of tuple of int
        All knots on each upper face, ascending; cells in lexicographic order. They overlap only in the knots of common
        borders.
    absent : tuple of int
        Knots below the upper hull, ascending; they do not belong to any cell.
    gradients : (k, d) float
        g_F of each cell: λ_i = <g_F, a_i> + o_F for the knots of the cell, and less for all others.
    offsets : (k,) float
        o_F of each cell, rounded from the exact value, like `gradients`. Far from the origin the sum above cancels;
        `gaps` has its differences with all digits.
    polygons : tuple of tuple of int
        Corners of each cell as knot indices, counter-clockwise from the lowest, then leftmost, one; for d = 1 the left
        and the right end. The lowest index in the cell stands for all knots at the same place. The polygons tile Δ and
        meet edge to edge.
    """

    knots: FloatArray
    lifting: FloatArray
    cells: tuple[tuple[int, ...], ...]
    absent: tuple[int, ...]
    gradients: FloatArray
    offsets: FloatArray
    polygons: tuple[tuple[int, ...], ...]
    _repr_html_ = notebook_html

    def __repr__(self) -> str:
        return f"<RegularDecomposition: {len(self.knots)} knots, {len(self.cells)} cells, {len(self.absent)} absent>"

    @property
    def dimension(self) -> int:
        """1 for a curve, 2 for a surface."""
        return int(self.knots.shape[1])

    def gaps(self, cell: int) -> FloatArray:
        """Return the heights of a cell's plane above the lifted knots, (n,), exactly 0 for the knots of the cell.

        Under weights x^λ ω, knot i fades like x^-gap relative to the knots of the cell.
        """
        members = list(self.cells[cell])
        corner = self.polygons[cell][0]
        plane = (self.knots - self.knots[corner]) @ self.gradients[cell] + self.lifting[corner]
        gaps = np.maximum(plane - self.lifting, 0.0)
        gaps[members] = 0.0
        return read_only(gaps)


def regular_decomposition(knots: ArrayLike, lifting: ArrayLike) -> RegularDecomposition:
    """Decompose knots by the upper faces of the convex hull of the lifted knots (a_i, λ_i).

    A knot belongs to the cell of every upper face on which it lies, whether it is a vertex of that face or not; knots
    below the upper hull do not belong to any cell. An affine lifting gives one cell. See Sections 3 and 4 of the paper,
    property (f), before Theorems 3.2 and 4.2; Ex. 3.4, Ex. 4.4.

    Knots a_i are (n, d), d = 1 or 2, or (n,) for d = 1, in any order, and the lifting λ is (n,). Among repeated knots
    only the highest count, all of them if several are. `DomainError` is raised where `domain` refuses the knots (all on
    one line, say), shapes disagree, or lifting values are not finite or beyond 1e100.

    The hull is computed exactly, in integers, since floats are binary fractions. Simplices split by rounding of the
    input are then joined, the largest first: a knot lies on a face within 1e-12 of the lifting's range plus the effect
    of rounding of the data. Gaps near this bound may be decided either way, but cells are joined only into convex
    polygons, so that they always tile Δ. Quickhull, O(n log n) on average: 60 knots take 10 ms, 1000 about 0.3 s.
    """
    lifted = lifted_knots(knots, lifting)
    faces = upper_faces(lifted)
    cells = tuple(tuple(sorted(face.knots)) for face in faces)
    present = {i for cell in cells for i in cell}
    gradients, offsets = map(read_only, zip(*(face.affine() for face in faces), strict=True))
    representative = {lifted.places[i]: i for i in sorted(present, reverse=True)}
    absent = tuple(i for i in range(len(lifted.points)) if i not in present)
    polygons = tuple(tuple(representative[i] for i in face.polygon) for face in faces)
    return RegularDecomposition(lifted.points, lifted.heights, cells, absent, gradients, offsets, polygons)


def control_net(decomposition: RegularDecomposition) -> list[tuple[int, int]]:
    """Return the control net that a lifting induces: sorted pairs of knots that are neighbours along borders of cells.

    For d = 1 it is the control polygon. Knots inside a cell are left out; the lowest index stands for all knots at the
    same place.
    """
    knots, tolerance = decomposition.knots - decomposition.knots[0], knot_tolerance(decomposition.knots)
    net: set[tuple[int, int]] = set()
    for polygon, cell in zip(decomposition.polygons, decomposition.cells, strict=True):
        members = np.array(cell)
        for a, b in border_of(polygon):
            direction = knots[b] - knots[a]
            length = float(np.hypot.reduce(direction))
            along = (knots[members] - knots[a]) @ direction / length
            on = (along > tolerance) & (along < length - tolerance)
            if decomposition.dimension == 2:
                on &= np.abs(planar_cross(direction, knots[members] - knots[a])) <= tolerance * length
            stops, reached = [a], 0.0
            for i in np.flatnonzero(on)[np.argsort(along[on], kind="stable")].tolist():
                if along[i] - reached <= tolerance:
                    stops[-1] = min(stops[-1], int(members[i]))
                else:
                    stops.append(int(members[i]))
                reached = along[i]
            stops.append(b)
            net.update((min(pair), max(pair)) for pair in pairwise(stops))
    return sorted(net)


def lifting_of_knot(n: int, k: int) -> FloatArray:
    """Return the lifting that is 1 at knot k and 0 at the others, (n,): its degeneration is ω_k → ∞ (property (g))."""
    if not 0 <= k < n:
        raise DomainError(f"knot: expected an index from 0 to {n - 1}, got {k}")
    return read_only(np.arange(n) == k)
