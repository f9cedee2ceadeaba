"""Refinement of a complex until the surface is within a tolerance of the mesh.

Edges carry the state: each is sampled once, when it is made, and split in the middle if the surface is farther from it
than the tolerance. Both cells beside an edge see the same decision, so there are no hanging vertices. When all edges
hold, segments of curves are certified, and triangles that were not sampled yet are sampled densely; the worst edge of
each that fails is split. Triangles are certified last, if that is asked for.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, cross_of_columns, dot
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.distance import to_segments
from gtb_cli.moment.newton import dot as column_dot
from gtb_cli.process.status import described
from gtb_cli.tessellation.certificate import Certificates
from gtb_cli.tessellation.complex import Complex
from gtb_cli.tessellation.flatness import folded_or_uncovered, is_flat
from gtb_cli.tessellation.forecast import Forecast
from gtb_cli.tessellation.lattice import (
    BULGE_FACTORS,
    MIN_SAMPLES,
    SIDE_STEPS,
    inner_points,
    quadratic_heights,
    steps_for,
)
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.sampling import Sampling
from gtb_cli.tessellation.sharing import shared
from gtb_cli.tessellation.splitting import Growth
from gtb_cli.tessellation.subdivision import Subdivision

MIN_TOLERANCE_ROUNDINGS = 64
"""A tolerance of fewer roundings of the largest coordinate cannot be verified and is refused."""

MIN_EDGE = 1e-13
"""Fraction of the domain's size below which edges are not split: their ends are too few roundings apart."""

SAMPLE_SHARE = 0.9
"""Part of the tolerance that samples may use up: between samples near creases, distances up to 6 % larger were seen."""

THIN_HEIGHT = 0.01
"""Height of a triangle in Δ over its longest side, in units of the smallest such ratio at the start, that is thin."""

QUADRATIC_SHARE = 0.1
"""Part of the tolerance by which samples may differ from a quadratic surface before a finer lattice is used."""

QUARTER_SHARE = 0.02
"""The same at one quarter of an edge, before the other quarter is sampled, too."""

MAX_SLIDE = 0.1
"""Part of an edge by which its curve may run ahead along it; one that runs farther may overshoot the other end."""

BUMP_FACTOR = 5.0
"""How many times the difference from a quadratic surface a bump between samples may be: 4 was seen, across creases."""

FINE_LATTICE_STEPS = 12

PLACE_SHARE = 0.01
"""Part of the tolerance by which a sample may be off along the surface: it is found sooner."""

MAX_FOLD_SPLITS = 256
"""Cells of a flat patch, turned over or leaving samples out, that are split before all its edges count."""


def refine(
    start: Complex,
    sampler: Sampler,
    tolerance: float,
    max_cells: int,
    points_in_all: int = MIN_SAMPLES,
    certify: bool = False,
) -> tuple[Complex, FloatArray]:
    """Refine a complex until every point of a curve, or every sample of a surface, is within a distance of its cell.

    Parameters
    ----------
    start : Complex
        Simplicial.
    sampler : Sampler
        In the linear parametrisation: toric parameters are too close to tell apart where exponents are small, and
        parts of the surface would be left out.
    tolerance : float
        Largest distance from the surface to the mesh, in model units.
    max_cells : int
    points_in_all : int
        If cells are few, they are sampled at about so many points together.
    certify : bool
        Whether every point of a surface must be within the tolerance, not only every sample.

    Returns
    -------
    complex : Complex
        With the edges it started from, or parts of them.
    points : (v, 3) float

    Raises
    ------
    ToleranceError
        More than `max_cells` cells would be needed, or the tolerance is below rounding; says what was reached.

    Notes
    -----
    Segments are certified (`gtb_cli.tessellation.certificate`). Triangles are sampled at the quarters of their sides,
    at their centroids, and at and between knots; if the samples differ from a quadratic surface, on a lattice of
    `FINE_LATTICE_STEPS` steps.
    """
    work = _Refinement(start, sampler, tolerance, max_cells, points_in_all, certify)
    with described(work.status):
        while (marked := work.marks()).any():
            work.advance(marked)
    return work.mesh.result(), work.mesh.points


class _Refinement:
    """A subdivision with what is known of its edges and cells."""

    def __init__(
        self, start: Complex, sampler: Sampler, tolerance: float, max_cells: int, points_in_all: int, certify: bool
    ) -> None:
        self.sampler, self.asked, self.max_cells, self.points_in_all = sampler, tolerance, max_cells, points_in_all
        self.tolerance = SAMPLE_SHARE * tolerance if start.cells.shape[1] == 3 else tolerance
        points = sampler.points(start.patch, start.parameters, start.face)
        scale = float(np.abs(points).max())
        least = MIN_TOLERANCE_ROUNDINGS * EPS * scale
        if not tolerance > least:
            below = f"{tolerance:g} is below the rounding of coordinates of size {scale:.3g}"
            raise ToleranceError(f"tolerance: {below}, at least {least:.2g} can be verified")
        self.start = start
        self.mesh = Subdivision(start, points, sampler.patches, THIN_HEIGHT)
        self.samples, self.growth = Sampling(self.mesh, sampler), Growth()
        self.sizes = np.array([patch.domain.size for patch in sampler.patches])
        # Inside flat patches a point may slide out of its cell: that is not an error of the mesh.
        self.flat = np.array([not certify and patch.dimension == 2 and is_flat(patch, tolerance)
                              for patch in sampler.evaluated])  # fmt: skip
        self.folds = np.zeros(len(sampler.patches), dtype=np.int64)
        self.nearby, self.forecast = 0.0, Forecast(max_cells, self.count)
        self.certificates = Certificates(sampler)
        self.verified = np.zeros(len(start.cells), dtype=bool)
        self.certify, self.certified = certify, np.full(len(start.cells), not certify)
        # For each edge the middle of its curve, the distance of this from the edge and that of the farthest sample (0
        # for edges that were split), and how far samples are from a parabola.
        self.middle = np.empty((0, 3))
        self.bend, self.error, self.roughness = np.empty(0), np.empty(0), np.empty(0)
        self.measure()
        self.bulging = self.bulge(np.arange(len(start.cells))) > self.tolerance

    def measure(self) -> None:
        """Sample the middle of the edges that were not sampled yet."""
        edges = self.mesh.edges
        new = np.arange(len(self.error), len(edges.ends))
        middle, distance = self.samples.middles(new)
        inside = self.flat.take(edges.patch[new]) & (edges.face[new] == INTERIOR)
        self.middle = self.growth.append("middle", self.middle, middle)
        self.bend = self.growth.append("bend", self.bend, distance)
        self.error = self.growth.append("error", self.error, np.where(inside, 0.0, distance))
        self.roughness = self.growth.append("roughness", self.roughness, np.full(len(new), np.nan))

    def advance(self, marked: BoolArray) -> None:
        """Split edges and sample what is new."""
        self.mesh.mark_thin(marked)
        chosen, touched = np.flatnonzero(marked), np.flatnonzero(self.mesh.has_mark(marked))
        # Each split side adds one cell.
        before = len(self.mesh)
        self.refuse_hopeless(chosen, before + int(np.count_nonzero(marked.take(self.mesh.cells.sides[touched]))))
        changed = self.mesh.split(chosen, self.middle.take(chosen, axis=0), touched)
        self.samples.follow(chosen)
        self.error[chosen] = 0.0
        unknown, old = np.zeros(len(self.mesh) - before, dtype=bool), changed[changed < before]
        self.certified[old] = not self.certify
        self.certified = self.growth.append("certified", self.certified, unknown | (not self.certify))
        self.verified[old] = False
        self.verified = self.growth.append("verified", self.verified, unknown)
        self.bulging = self.growth.append("bulging", self.bulging, unknown)
        self.measure()
        self.bulging[changed] = shared(self.bulge, changed) > self.tolerance

    def refuse_hopeless(self, chosen: IntArray, count: int) -> None:
        """Raise `ToleranceError` if splitting some edges, into `count` cells, cannot help, or leads to too many."""
        kind, why, excess = "faces" if self.mesh.is_surface else "segments", "", ""
        if count <= self.max_cells and self.forecast.is_due(len(self.mesh)):
            excess = self.forecast.excess(self.error.take(self.mesh.cells.sides.T) / self.tolerance)
        widths = np.abs(np.subtract(*np.moveaxis(self.mesh.edges.parameters.take(chosen, axis=0), 1, 0)))
        least = MIN_EDGE * self.sizes.take(self.mesh.edges.patch.take(chosen))
        if count > self.max_cells:
            why = f"needs more than {self.max_cells} {kind}"
        elif excess:
            why = f"needs about {excess} {kind}, more than {self.max_cells}"
        elif (np.maximum(widths[:, 0], widths[:, -1]) < least).any():
            why = "is not reached where parameters are too close to tell apart"
        if why:
            raise ToleranceError(
                f"tolerance: {self.asked:g} {why}; with {len(self.mesh)} the distance is still {self.error.max():.3g}"
            )

    def status(self) -> str:
        """How far this is, in words."""
        kind = "faces" if self.mesh.is_surface else "segments"
        return f"{len(self.mesh)} {kind}, distance {self.error.max():.2g}, asked for {self.asked:.2g}"

    def count(self, factor: int) -> int:
        """How many cells a tolerance takes that is larger by a factor."""
        tried, _ = refine(self.start, self.sampler, factor * self.asked, self.max_cells, self.points_in_all)
        return len(tried.cells)

    def marks(self) -> BoolArray:
        """(e,) which edges must be split: by what is known of them, or else after sampling cells not verified yet."""
        while True:
            marked = self.error > self.tolerance
            self.mark_worst(marked, np.flatnonzero(self.bulging))
            todo = np.flatnonzero(~self.verified)
            if marked.any() or not len(todo):
                return self.mark_uncertified(marked)
            if not self.mesh.is_surface:
                self.verified[todo] = True
                marked[self.mesh.cells.sides[self.certificates.failing(self.mesh, todo, self.asked), 0]] = True
                return marked
            self.sample_peaks(self.mesh.sides_of(todo))
            is_flat, steps_at = self.flat.take(self.mesh.cells.patch[todo]), self.steps_at(todo)
            bent, flat = todo[~is_flat], todo[is_flat]
            failing, doubtful = self.sampled(bent, steps_at[~is_flat])
            marked = self.error > self.tolerance
            self.mark_worst(marked, failing)
            self.verified[bent] = True
            self.verified[failing] = self.verified[doubtful] = False
            # Flat patches wait until all others hold.
            if len(flat) and not marked.any():
                marked = self.flat_marks(flat)
            if marked.any():
                return marked

    def mark_uncertified(self, marked: BoolArray) -> BoolArray:
        """If nothing is marked, mark the worst edge of triangles that must be certified and cannot be."""
        todo = np.flatnonzero(~self.certified & (not marked.any()))
        failing = self.certificates.failing(self.mesh, todo, self.asked) if len(todo) else todo
        self.certified[todo] = ~np.isin(todo, failing)
        self.mark_worst(marked, failing)
        return marked

    def mark_worst(self, marked: BoolArray, failing: IntArray) -> None:
        """Mark the edge that is farthest from the surface in each cell that fails and has no marked edge yet."""
        sides = self.mesh.cells.sides.take(failing[~self.mesh.has_mark(marked, failing)], axis=0)
        length = self.mesh.lengths(sides)
        # If all edges hold, the longest: errors are then rounding.
        rank = np.where(self.error[sides] > 0.05 * self.tolerance, self.error[sides], 0.0) + 1e-6 * self.tolerance * (
            length / np.maximum(length.max(axis=1, keepdims=True), np.finfo(float).tiny)
        )
        marked[sides[np.arange(len(sides)), rank.argmax(axis=1)]] = True

    def heights(self, rows: IntArray) -> FloatArray:
        """(3, k) heights of the middles of the sides' curves over some triangles."""
        corners, sides = self.mesh.corner_columns(rows), self.mesh.cells.sides.take(rows, axis=0)
        normal = cross_of_columns(corners[1] - corners[0], corners[2] - corners[0])
        length = np.sqrt(column_dot(normal, normal))
        scale = 1 / np.where(length > 0, length, np.inf)
        middles = [np.ascontiguousarray(self.middle.take(side, axis=0).T) for side in sides.T]
        return np.stack([column_dot(middles[k] - (corners[k] + corners[k - 2]) / 2, normal) * scale for k in range(3)])

    def bulge(self, rows: IntArray) -> FloatArray:
        """Largest heights over some cells of the quadratic surfaces through their corners and the middles of sides."""
        if not self.mesh.is_surface:
            return np.zeros(len(rows))
        return np.asarray(np.abs(BULGE_FACTORS @ self.heights(rows)).max(axis=0))

    def sampled(self, rows: IntArray, steps_at: IntArray) -> tuple[IntArray, IntArray]:
        """Sample cells on lattices of the given steps: which of them fail, and which are doubtful.

        Doubtful cells hold, but the surface is not quadratic there. If nothing else is left to split, they are sampled
        on a finer lattice.
        """
        fails, doubts = np.zeros(len(rows), dtype=bool), np.zeros(len(rows), dtype=bool)
        for steps in np.unique(steps_at).tolist():
            at = steps_at == steps
            fails[at], doubts[at] = self.sample(rows[at], steps)
            doubts[at] &= steps < FINE_LATTICE_STEPS
        if doubts.any() and not fails.any() and not (self.error > self.tolerance).any():
            fails[doubts], _ = self.sample(rows[doubts], FINE_LATTICE_STEPS)
            doubts[:] = False
        cell, u = self.mesh.peaks_inside(rows)
        fails |= np.isin(rows, cell[self.samples.at(cell, u, self.nearby) > self.tolerance])
        return rows[fails], rows[doubts]

    def steps_at(self, rows: IntArray) -> IntArray:
        """(k,) steps of the lattices on which some cells are sampled."""
        columns = self.mesh.cells.corners.take(rows, axis=0).reshape(-1, 6).T
        extents = (reduce(np.maximum, columns[axis::2]) - reduce(np.minimum, columns[axis::2]) for axis in (0, 1))
        width = np.maximum(*extents) / self.sizes.take(self.mesh.cells.patch[rows])
        return steps_for(width, self.points_in_all)

    def flat_marks(self, todo: IntArray) -> BoolArray:
        """(e,) which edges of flat patches must be split: on boundaries first, then where the mesh folds or has gaps.

        A patch on which that happens again and again is refined like others.
        """
        sides = self.mesh.sides_of(todo)
        self.sample_sides(sides[self.mesh.edges.face[sides] > 0], np.arange(1, FINE_LATTICE_STEPS) / FINE_LATTICE_STEPS)
        marked = self.error > self.tolerance
        self.verified[todo] = not marked.any()
        if marked.any():
            return marked
        for index in np.unique(self.mesh.cells.patch[todo]).tolist():
            rows = np.flatnonzero(self.mesh.cells.patch == index)
            failing = folded_or_uncovered(
                self.mesh, rows, self.steps_at(rows), self.sampler, self.nearby, self.tolerance
            )
            if not failing.any():
                continue
            self.verified[rows] = False
            self.folds[index] += int(failing.sum())
            if self.folds[index] <= MAX_FOLD_SPLITS:
                self.mark_worst(marked, rows[failing])
                continue
            self.flat[index] = False
            sides = self.mesh.sides_of(rows)
            inner = sides[(self.mesh.edges.patch[sides] == index) & (self.mesh.edges.face[sides] == 0)]
            self.error[inner] = self.bend[inner]
        return marked

    def sample(self, rows: IntArray, steps: int) -> tuple[BoolArray, BoolArray]:
        """Sample cells and their sides on a lattice: (k,) which cells fail, and (k,) which are doubtful."""
        cells = self.mesh.cells.at(rows)
        sides = self.mesh.sides_of(rows)
        if steps <= SIDE_STEPS:
            sides = sides[np.isnan(self.roughness[sides])]
            quarter = self.sample_sides(sides, np.array([0.25]))
            slides = shared(lambda some: self.slides(sides[some], quarter[some, 0]), len(sides))
            sides = sides[(self.roughness[sides] > QUARTER_SHARE * self.tolerance) | slides]
            self.sample_sides(sides, np.array([0.75]))
        else:
            self.sample_sides(sides, np.arange(1, steps) / steps)
        fails = np.zeros(len(rows), dtype=bool)
        rough = reduce(np.maximum, [self.roughness.take(side) for side in cells.sides.T])
        seen = reduce(np.maximum, [self.error.take(side) for side in cells.sides.T])
        weights = inner_points(steps)
        expected_of = quadratic_heights(weights)
        length = max(1, 200_000 // len(weights))
        for begin in range(0, len(rows), length):
            block = slice(begin, begin + length)
            part = rows[block]
            distance = self.samples.inside(part, weights, self.nearby)
            fails[block] = (distance > self.tolerance).any(axis=1)
            expected = np.abs(expected_of @ shared(self.heights, part)).T
            rough[block] = np.maximum(rough[block], np.abs(distance - expected).max(axis=1))
            seen[block] = np.maximum(seen[block], distance.max(axis=1))
        return fails, (rough > QUADRATIC_SHARE * self.tolerance) & (seen + BUMP_FACTOR * rough > self.tolerance)

    def slides(self, rows: IntArray, quarter: FloatArray) -> BoolArray:
        """Whether the quarters or middles of the curves of edges are far from those of the edges, along these."""
        start, end = self.mesh.ends(rows)
        chord = end - start
        square = dot(chord, chord)
        points = ((quarter, 0.25), (self.middle.take(rows, axis=0), 0.5))
        slides = [np.abs(dot(point - start, chord) - at * square) for point, at in points]
        return np.asarray(np.maximum(*slides) > MAX_SLIDE * square)

    def sample_sides(self, rows: IntArray, fractions: FloatArray) -> FloatArray:
        """(e, f, 3) points of edges at fractions, quarters among them; notes how far and how rough they are."""
        if not len(rows):
            return np.empty((0, len(fractions), 3))
        samples, distance = self.samples.along(rows, fractions, self.nearby)
        # At its quarters a parabola is three quarters as far from its chord as in the middle.
        off = np.abs(distance[:, np.isin(fractions, (0.25, 0.75))] - 0.75 * self.bend[rows, None]).max(axis=1)
        self.roughness[rows] = np.fmax(self.roughness[rows], off)
        self.error[rows] = np.maximum(self.error[rows], distance.max(axis=1))
        return samples

    def sample_peaks(self, sides: IntArray) -> None:
        """Note how far the curves of edges are from them at possible peaks, and how near samples must be."""
        edges = self.mesh.edges.at(sides)
        speed = float((self.mesh.lengths(sides) * self.sizes.take(edges.patch) / edges.widths).max())
        self.nearby = PLACE_SHARE * self.tolerance / speed if speed > 0 else 0.0
        rows, u = self.mesh.peaks_along(sides)
        edges = self.mesh.edges.at(rows)
        sample = self.sampler.points(edges.patch, u, edges.face)
        np.maximum.at(self.error, rows, to_segments(sample, *self.mesh.ends(rows)))
