"""Bounds of the distance between a surface and its triangles that hold for every point, not only for samples.

In the linear parametrisation Σ T_i a_i = u. So for the affine map l from a triangle of Δ to its triangle in space,
``P(u) − l(u) = Σ T_i (b_i − l(a_i))``: bounds of T over the triangle bound the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, cross, dot, groups, joined, rows_of
from gtb_cli.certificates.deadline import Deadline
from gtb_cli.certificates.enclosures import Coverings, TorusTriangles, barycentric
from gtb_cli.moment.torus import block_length
from gtb_cli.theory.patch import Patch

SPENT_SHARE = 0.02  # of the tolerance: what is known this well, yet not to hold, is too far
MAX_CUTS = 4  # of a triangle of Δ in quarters, if it is too curved in torus coordinates; then it fails
SLIVER_RATIO = 1e-6  # height of a triangle over its longest side, below which it counts as this side

# (4, 3): corners of the quarters of a triangle; 3 … 5 are the middles of its sides
QUARTER_CORNERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])

# (4, 3, 3): barycentric coordinates of the corners of the quarters of a triangle
QUARTERS = np.concatenate([np.eye(3), (np.eye(3) + np.roll(np.eye(3), 1, axis=1)) / 2])[QUARTER_CORNERS]


class Triangles(NamedTuple):
    """Triangles of Δ and their images in a mesh, by their (k, 3, 2) and (k, 3, 3) corners.

    Side i is opposite corner i; unit vectors are (k, 3) each, heights are 0 if the triangle is only a line.
    """

    u: FloatArray
    points: FloatArray
    along: FloatArray  # the longest side
    out: FloatArray  # across it in the plane
    normal: FloatArray
    outwards: FloatArray  # (k, 3, 3) unit normals of the sides in the plane
    heights: FloatArray  # (k, 3) over the sides
    cosines: FloatArray  # (k, 3) of the angles


def triangles(u: FloatArray, points: FloatArray) -> Triangles:
    """Measure triangles, given by (k, 3, 2) corners in Δ and (k, 3, 3) in space."""
    sides = np.roll(points, -2, axis=1) - np.roll(points, -1, axis=1)  # side i from corner i + 1 to i + 2
    lengths = np.sqrt((sides**2).sum(axis=2))
    unit = sides / np.where(lengths > 0, lengths, 1.0)[:, :, None]
    area = cross(sides[:, 0], sides[:, 1])
    size = np.sqrt(dot(area, area))
    longest = lengths.max(axis=1)
    flat = size <= SLIVER_RATIO * longest**2
    along = unit[np.arange(len(u)), lengths.argmax(axis=1)]
    along[longest == 0] = [1.0, 0.0, 0.0]
    # For a line, any vector across it serves as the normal.
    least = np.eye(3)[np.abs(along).argmin(axis=1)]
    normal = np.where(flat[:, None], cross(along, least), area)
    normal /= np.sqrt(dot(normal, normal))[:, None]
    outwards = np.stack([cross(unit[:, k], normal) for k in range(3)], axis=1)
    heights = np.where(flat, 0.0, size / np.where(lengths > 0, lengths, np.inf).T).T
    cosines = np.column_stack([-dot(unit[:, k - 2], unit[:, k - 1]) for k in range(3)])
    return Triangles(u, points, along, cross(normal, along), normal, outwards, heights, cosines)


class Parts(NamedTuple):
    """Parts of triangles of Δ, their owners; corners from `Coverings.located`; and how often each may still be cut."""

    owner: IntArray
    u: FloatArray
    face: IntArray
    s: FloatArray
    cuts: IntArray

    def quartered(self, coverings: Coverings, at_corner: BoolArray) -> Parts:
        """Cut each part in quarters."""
        middles = (self.u + np.roll(self.u, -1, axis=1)) / 2
        face, s = coverings.located(middles.reshape(-1, 2))
        own = (self.u, self.face, self.s)
        new = (middles, face.reshape(-1, 3), s.reshape(-1, 3, 2))
        columns = [np.concatenate(pair, axis=1)[:, QUARTER_CORNERS] for pair in zip(own, new, strict=True)]
        cuts = np.where(at_corner, MAX_CUTS, self.cuts - 1)
        owner, cuts = (np.repeat(each, len(QUARTERS)) for each in (self.owner, cuts))
        u, face, s = (each.reshape(-1, *each.shape[2:]) for each in columns)
        return Parts(owner, u, face, s, cuts)


class _SideErrors(NamedTuple):
    """(m,) errors of parts of the surface at one side of their triangles, in the triangles' planes."""

    beyond: FloatArray  # upper bounds of the distance beyond the side; negative inside
    off: FloatArray  # the same, but not negative; at parts on the side itself also of the distance inside it
    doubt: FloatArray  # how well they are known
    is_outside: BoolArray  # whether the whole part of Δ is beyond the side
    is_inside: BoolArray  # whether none of it is


class _Enclosure(NamedTuple):
    """T_i over pieces, up to a common factor: (c, n, m) middles and radii, and (c, m) bounds of Σ T_i."""

    middle: FloatArray
    radius: FloatArray
    least: FloatArray
    most: FloatArray

    def at(self, rows: IntArray) -> _Enclosure:
        """Some of the pieces."""
        return _Enclosure(*(values[..., rows] for values in self))

    def sums(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(c, m) Σ T_i v_i for (n, m) values, and how far each may be off."""
        return np.einsum("nm,cnm->cm", values, self.middle), np.einsum("nm,cnm->cm", np.abs(values), self.radius)

    def highest(self, sums: FloatArray) -> FloatArray:
        """(m,) upper bounds of Σ T_i v_i / Σ T_i, from those of the (c, m) sums."""
        return np.asarray((sums / np.where(sums > 0, self.least, self.most)).max(axis=0))

    def lowest(self, sums: FloatArray) -> FloatArray:
        """(m,) lower bounds, likewise."""
        return np.asarray((sums / np.where(sums > 0, self.most, self.least)).min(axis=0))


class SurfaceCertificate:
    """Proofs, up to a deadline, that triangles are within a tolerance of a surface.

    A triangle of the mesh is certified if every point of its piece of the surface is within the tolerance of it, and
    every point on a side of that piece within the tolerance of the same side. Every point of the triangle is then
    within the tolerance of the surface, too: the points nearest to a piece with such a boundary cover the triangle.
    Errors are bounded across the plane; along it only beyond sides, as a point may slide inside the triangle. The
    bounds include rounding.
    """

    def __init__(self, patch: Patch, deadline: Deadline) -> None:
        self.coverings = Coverings(patch)
        domain = patch.domain
        self.middle = patch.control_points.mean(axis=0)
        self.points = patch.control_points - self.middle
        self.scale = float(np.abs(patch.control_points).max())
        # How far the knots are from each corner along the bisector of its edges; 0 for those at the corner.
        across = self.coverings.across
        bisectors = across + np.roll(across, 1, axis=0)
        self.bisectors = bisectors / np.sqrt(dot(bisectors, bisectors))[:, None]
        self.corners = domain.vertices - domain.center
        ahead = (self.coverings.knots[:, None] - self.corners) * self.bisectors
        at_corner = domain.incidence & np.roll(domain.incidence, 1, axis=1)
        self.ahead = np.where(at_corner, 0.0, ahead.sum(axis=2))
        alive = 6  # arrays as large as the bounds of T
        self.block = max(64, block_length(len(patch.knots)) // alive)
        self.deadline = deadline

    def failing(self, u: FloatArray, points: FloatArray, tolerance: float) -> BoolArray:
        """Mark the triangles that are not certified, by (k, 3, 2) corners in Δ and (k, 3, 3) corners nearly there.

        Raises `Uncertified` once the deadline has passed.
        """
        max_corner_cuts = 48  # of triangles at corners of Δ, which are cut until what is left is nearly a point
        coverings = self.coverings
        whole = triangles(u - coverings.domain.center, points - self.middle)
        fails = np.zeros(len(u), dtype=bool)
        face, s = coverings.located(u.reshape(-1, 2))
        todo = Parts(np.arange(len(u)), u, face.reshape(-1, 3), s.reshape(-1, 3, 2), np.full(len(u), MAX_CUTS))
        for _ in range(max_corner_cuts):
            numbers = coverings.numbers(todo.face)
            left = [np.flatnonzero(numbers < 0)]
            for number, rows in groups(numbers + 1):
                for begin in range(0, len(rows) if number else 0, self.block):
                    some = rows[begin : begin + self.block]
                    some = some[~fails[todo.owner[some]]]
                    here = rows_of(todo, some)
                    self.deadline.refuse_late()
                    found, pieces, which = coverings.covering(number - 1, here.u, here.face, here.s)
                    left.append(some[~found])
                    self._bound(number - 1, pieces, here.owner[which], whole, tolerance, fails)
            todo = rows_of(todo, np.concatenate(left))
            at_corner = todo.face.max(axis=1) > len(self.corners)
            fails[todo.owner[~at_corner & (todo.cuts == 0)]] = True
            open_ = ~fails[todo.owner]
            rows = np.flatnonzero(at_corner & open_)
            open_[rows] = ~self._near_corner(rows_of(todo, rows), rows_of(whole, todo.owner[rows]), tolerance)
            if not open_.any():
                return fails
            todo, at_corner = rows_of(todo, open_), at_corner[open_]
            quarters = []
            for begin in range(0, len(todo.owner), self.block):
                self.deadline.refuse_late()
                part = slice(begin, begin + self.block)
                quarters.append(rows_of(todo, part).quartered(coverings, at_corner[part]))
            todo = joined(quarters)
        fails[todo.owner] = True
        return fails

    def _near_corner(self, here: Parts, whole: Triangles, tolerance: float) -> BoolArray:
        """Tell whether the error is within the tolerance because all T_i but those of the corner's knots are small.

        With the bisector m of corner v, Σ T_i <a_i − v, m> = <u − v, m>, which bounds each T_i.
        """
        result = np.zeros(len(here.owner), dtype=bool)
        values = self._residuals(whole)
        size = np.sqrt((values**2).sum(axis=0))  # (n, m)
        count = len(self.corners)
        for corner in range(count):
            rows = np.flatnonzero((here.face == 1 + count + corner).any(axis=1))
            steps = here.u[rows] - self.coverings.domain.center - self.corners[corner]
            ahead = (steps @ self.bisectors[corner]).max(axis=1)
            others = self.ahead[:, corner] > 0
            rate = (size[others][:, rows] / self.ahead[others, corner][:, None]).max(axis=0)
            error = rate * ahead + size[~others][:, rows].max(axis=0)
            result[rows] = error + self._rounding(rows_of(whole, rows), 0.0) <= tolerance
        return result

    def _residuals(self, whole: Triangles) -> FloatArray:
        """(3, n, m) vectors b_i − l(a_i)."""
        shares = barycentric(whole.u, self.coverings.knots)
        images = [sum(shares[k] * whole.points[:, k, axis] for k in range(3)) for axis in range(3)]
        return np.stack([self.points[:, axis, None] - images[axis] for axis in range(3)])

    def _rounding(self, whole: Triangles, exponent: FloatArray | float) -> FloatArray:
        """(m,) amounts by which bounds may be too small."""
        count = len(self.points)
        extent = np.abs(self.points).max() + np.abs(whole.points).max(axis=(1, 2))
        return np.asarray(EPS * (8 * self.scale + (count + 16 + exponent) * extent))

    def _bound(
        self, number: int, pieces: TorusTriangles, owner: IntArray, whole: Triangles, tolerance: float, fails: BoolArray
    ) -> None:
        """Note which triangles fail; pieces of which too little is known are cut in quarters."""
        max_quarterings = 6  # the error is then known 4096 times better
        for quartering in range(max_quarterings + 1):
            left, owners = [], []
            for begin in range(0, len(owner), self.block):
                rows = np.arange(begin, min(begin + self.block, len(owner)))
                rows = rows[~fails[owner[rows]]]
                if not len(rows):
                    continue
                self.deadline.refuse_late()
                far, open_ = self._compared(number, rows_of(pieces, rows), rows_of(whole, owner[rows]), tolerance)
                fails[owner[rows[far]]] = True
                left.append(rows_of(pieces, rows[open_]))
                owners.append(owner[rows[open_]])
            if not left:
                return
            pieces, owner = joined(left), np.concatenate(owners)
            if quartering == max_quarterings:
                break
            corners = np.einsum("qvc,mcd->mqvd", QUARTERS, pieces.corners).reshape(-1, 3, 2)
            pieces = rows_of(pieces, np.repeat(np.arange(len(owner)), 4))._replace(corners=corners)
            owner = np.repeat(owner, 4)
        fails[owner] = True

    def _compared(
        self, number: int, pieces: TorusTriangles, whole: Triangles, tolerance: float
    ) -> tuple[BoolArray, BoolArray]:
        """(m,) whether the triangle fails on each piece, and whether that is still open."""
        bounds = self.coverings.coordinates[number].bounds(pieces)
        least = bounds.lower.sum(axis=1)
        known = (least > 0).all(axis=0)
        basis = _Enclosure(
            (bounds.upper + bounds.lower) / 2,
            (bounds.upper - bounds.lower) / 2,
            np.where(least > 0, least, 1.0),
            bounds.upper.sum(axis=1),
        )
        rounding = self._rounding(whole, bounds.exponent)
        errors = self._residuals(whole)
        across, doubt = basis.sums(_component(errors, whole.normal))
        height, doubts = basis.highest(np.abs(across) + doubt) + rounding, basis.highest(doubt)
        x, y = _component(errors, whole.along), _component(errors, whole.out)
        (x_sum, _), (y_sum, _), (_, doubt) = basis.sums(x), basis.sums(y), basis.sums(np.hypot(x, y))
        slide, slide_doubts = basis.highest(np.hypot(x_sum, y_sum) + doubt) + rounding, basis.highest(doubt)
        holds = known & (np.hypot(height, slide) <= tolerance)
        far, open_ = np.zeros(len(holds), dtype=bool), ~holds
        rows = np.flatnonzero(known & ~holds)
        if not len(rows):
            return far, open_
        left = rows_of(whole, rows)
        sides = self._sides(basis.at(rows), errors[:, :, rows], left, slide[rows], rounding[rows])
        lateral, lateral_doubts = _in_plane(sides, left.cosines)
        # A triangle that is a line has no sides to be beyond.
        is_line = (left.heights == 0).any(axis=1) | (slide[rows] < lateral)
        lateral = np.where(is_line, slide[rows], lateral)
        is_outside = np.any([side.is_outside for side in sides], axis=0)
        settled = (np.hypot(height[rows], lateral) <= tolerance) | is_outside
        open_[rows[settled]] = False
        certain = doubts[rows] + np.where(is_line, slide_doubts[rows], lateral_doubts) <= SPENT_SHARE * tolerance
        far[rows] = ~settled & certain & np.all([side.is_inside for side in sides], axis=0)
        open_ &= ~far
        return far, open_

    def _sides(
        self, basis: _Enclosure, errors: FloatArray, whole: Triangles, slide: FloatArray, rounding: FloatArray
    ) -> list[_SideErrors]:
        """Bound the errors at each side of triangles; those in their planes are at most `slide`."""
        # The depth λ of a point inside a triangle counts against its error along the plane at most so many times this
        # error: more would add more doubt than it takes away.
        max_depth_credit = 6.0
        found = []
        for k, share in enumerate(barycentric(whole.u, self.coverings.knots)):
            mean, doubt = basis.sums(share)
            depth = basis.lowest(mean - doubt)
            # Where λ ≥ 0, a point is beyond the side by no more than its error less a part of λ times the height.
            steep = share * np.minimum(whole.heights[:, k], max_depth_credit * slide)
            outwards = _component(errors, whole.outwards[:, k])
            (out, loose), (back, _) = basis.sums(outwards - steep), basis.sums(-outwards - steep)
            beyond = basis.highest(out + loose) + rounding
            # On the side itself the surface must not lie far inside, either.
            inwards = np.where(depth <= SLIVER_RATIO, basis.highest(back + loose) + rounding, 0.0)
            off = np.maximum(np.maximum(beyond, inwards), 0.0)
            is_outside = np.asarray((mean + doubt < 0).all(axis=0))
            found.append(_SideErrors(beyond, off, basis.highest(loose), is_outside, depth >= -SLIVER_RATIO))
        return found


def _in_plane(sides: Sequence[_SideErrors], cosines: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(m,) bounds of the errors in the planes of triangles, and how well they are known."""
    error, doubt = (np.max([side[column] for side in sides], axis=0) for column in (1, 2))
    for k, other in permutations(range(3), 2):
        # Beyond two sides, a point may be farther from the corner between them than from either.
        cosine = np.abs(cosines[:, 3 - k - other])
        sine = np.sqrt(np.maximum(1 - cosine**2, SLIVER_RATIO**2))
        over = np.maximum(sides[other].beyond + cosine * sides[k].off, 0.0) / sine
        counts = (sides[k].off > 0) & (over > 0)
        error = np.where(counts, np.maximum(error, np.hypot(sides[k].off, over)), error)
        doubt = np.where(counts, np.maximum(doubt, sides[other].doubt / sine), doubt)
    return error, doubt


def _component(errors: FloatArray, direction: FloatArray) -> FloatArray:
    """(n, m) components of (3, n, m) vectors along (m, 3) directions."""
    return np.asarray(sum(errors[axis] * direction[:, axis] for axis in range(3)))
