"""Refinement of a complex until the surface is within a tolerance; shared vertices are made in `complexes`.

Each edge is sampled when it is made, and split in the middle if the surface is farther from it than the tolerance. Both
cells beside an edge see the same decision, so there are no hanging vertices. When all edges hold, segments of curves
are certified, and new triangles are sampled densely; the worst edge of each cell that fails is split.
"""

from functools import reduce

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, column_dot, cross, dot, groups, row_blocks, rows_of
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.nearest import cell_distances
from gtb_cli.models.openings import above
from gtb_cli.tessellation.chords import ChordProofs
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.tessellation.edge_splitting import Subdivision
from gtb_cli.tessellation.refinement_samples import MIN_SAMPLES, SIDE_STEPS, PeakParameters, Sampling, inner_points
from gtb_cli.tessellation.sampler import Sampler

FINE_LATTICE_STEPS = 12  # steps of the lattice on which triangles are sampled over which the surface is not quadratic


def refine(
    start: Complex, sampler: Sampler, tolerance: float, max_cells: int, points_in_all: int = MIN_SAMPLES
) -> tuple[Complex, FloatArray]:
    """Refine a simplicial complex until a curve, or samples of a surface, are within a tolerance of their cells.

    Return the complex, whose edges are edges of the start or parts of them, and the (v, 3) points of its vertices. The
    sampler takes linear parameters: toric ones are too close to tell apart where exponents are small. Segments are
    certified. Triangles are sampled at the quarters of their sides, at their centroids, and at and between knots; on a
    lattice of `FINE_LATTICE_STEPS` steps, if samples differ from a quadratic surface; and, if cells are few, on a
    lattice on which all have about `points_in_all` points. `ToleranceError` is raised if more than `max_cells` cells
    would be needed, or the tolerance is below rounding, and says what was reached.
    """
    mesh = _Refinement(start, sampler, tolerance, max_cells, points_in_all).finished()
    return mesh.result(), mesh.points


class _Refinement:
    """A subdivision, and what decides which of its edges are split."""

    def __init__(self, start: Complex, sampler: Sampler, tolerance: float, max_cells: int, points_in_all: int) -> None:
        sample_share = 0.9  # of the tolerance: between samples near creases, distances up to 6 % larger were seen
        self.sampler, self.asked, self.max_cells, self.points_in_all = sampler, tolerance, max_cells, points_in_all
        self.mesh = Subdivision(start, sampler)
        scale, roundings = float(np.abs(self.mesh.points).max()), 64  # fewer cannot be told from errors
        if not tolerance > (least := roundings * EPS * scale):
            below = f"{tolerance:g} is below the rounding of coordinates of size {scale:.3g}"
            raise ToleranceError(f"tolerance: {below}, at least {least:.2g} can be verified")
        is_surface = self.mesh.is_surface
        self.tolerance = sample_share * tolerance if is_surface else tolerance
        self.samples = Sampling(self.mesh, sampler)
        self.curves = [] if is_surface else [ChordProofs(patch) for patch in sampler.patches]
        self.peaks = PeakParameters(self.mesh.domains, self.mesh.kinds[: None if is_surface else 0])
        self.sizes = np.array([domain.size for domain in self.mesh.domains])
        # Inside flat patches a point may slide out of its cell: that is not an error of the mesh.
        self.flat = np.array([is_surface and self.is_flat(index) for index in range(len(sampler.patches))])
        self.folds = np.zeros(len(sampler.patches), dtype=np.int64)
        self.nearby = 0.0  # part of Δ's size by which a sample may be off along the surface

    def is_flat(self, index: int) -> bool:
        """Tell whether a patch is within a tenth of the tolerance of a plane, as all of its control points are."""
        points = self.sampler.patches[index].control_points
        centred = points - points.mean(axis=0)
        return bool(np.abs(centred @ np.linalg.svd(centred, full_matrices=False)[2][-1]).max() <= self.asked / 10)

    def finished(self) -> Subdivision:
        """Split edges until all cells are within the tolerance."""
        changed = np.arange(len(self.mesh))
        while True:
            self.sample_middles()
            marked = self.far()
            self.mark_worst(marked, changed[self.bulge(changed) > self.tolerance])
            if not marked.any():
                marked = self.marks_of_samples() if self.mesh.is_surface else self.uncertain()
            if not marked.any():
                return self.mesh
            changed = self.split(marked)

    def far(self) -> BoolArray:
        """Mark the edges, (e,), that are known to be too far from their curves."""
        return self.mesh.edges.error > self.tolerance

    def sample_middles(self) -> None:
        """Sample the middle of the edges that were not sampled yet."""
        edges = self.mesh.edges
        new = np.flatnonzero(np.isnan(edges.error))
        points, distances, guesses = self.samples.along(new, np.array([0.5]), 0.0)
        edges.middle[new], edges.bend[new], edges.guess[new] = points[:, 0], distances[:, 0], guesses[:, 0]
        inside = self.flat.take(edges.patch[new]) & (edges.face[new] == INTERIOR)
        edges.error[new] = np.where(inside, 0.0, edges.bend[new])

    def split(self, marked: BoolArray) -> IntArray:
        """Split edges, and return the cells that changed."""
        mesh = self.mesh
        mesh.mark_thin(marked)
        chosen, touched = np.flatnonzero(marked), np.flatnonzero(mesh.has_mark(marked))
        # Each split side adds one cell.
        self.refuse_hopeless(chosen, len(mesh) + int(marked.take(mesh.cells.sides[touched]).sum()))
        return mesh.split(chosen, touched)

    def refuse_hopeless(self, chosen: IntArray, count: int) -> None:
        """Raise `ToleranceError` if splitting some edges, into `count` cells, cannot help, or leads to too many."""
        first_cells = 1000  # from which on estimates on eight specs were 0.6 to 1.0 times the final number
        min_edge = 1e-13  # part of Δ's size below which the ends of an edge are too few roundings apart
        edges, cells, now = self.mesh.edges, self.mesh.cells, len(self.mesh)
        kind, why = "faces" if self.mesh.is_surface else "segments", ""
        if count > self.max_cells:
            why = f"needs more than {self.max_cells} {kind}"
        elif now > first_cells:
            # Halving the width divides errors by four. A triangle bends in a second direction as its straightest side.
            errors = np.maximum(edges.error.take(cells.sides.T) / self.tolerance, 1.0)
            parts = np.exp2(np.ceil(np.log2(errors) / 2))
            needed = float((parts.max(axis=0) * (parts.min(axis=0) if len(parts) == 3 else 1.0)).sum())
            # Until a sixteenth of the cells are there, spikes may be taken for what is usual.
            if needed > (2.0 if now < needed / 16 else 1.0) * self.max_cells:
                soon = min(self.max_cells / 2, 250_000)  # cells that take seconds
                fewer = above(self.asked * (needed / soon) ** (1 if self.mesh.is_surface else 2))
                raise ToleranceError(
                    f"tolerance: {self.asked:g} needs about {needed:.1g} {kind}, more than {self.max_cells}, "
                    f"as estimated with {now} of them; {fewer} needs fewer"
                )
        halved = rows_of(edges, chosen)
        if not why and (halved.widths < min_edge * self.sizes.take(halved.patch)).any():
            why = "is not reached where parameters are too close to tell apart"
        if why:
            farthest = float(edges.error.max())  # faces may be farther from the surface than their edges are
            if farthest > self.asked:
                why += f"; with {now} samples are still up to {farthest:.3g} from their edges"
            raise ToleranceError(f"tolerance: {self.asked:g} {why}")

    def mark_worst(self, marked: BoolArray, failing: IntArray) -> None:
        """Mark the edge that is farthest from the surface in each cell that fails and has no marked edge yet."""
        sides = self.mesh.cells.sides.take(failing[~self.mesh.has_mark(marked, failing)], axis=0)
        length, error = self.mesh.lengths(sides), self.mesh.edges.error[sides]
        # If all edges hold, the longest: errors are then rounding.
        share = length / np.maximum(length.max(axis=1, keepdims=True), np.finfo(float).tiny)
        rank = np.where(error > 0.05 * self.tolerance, error, 0.0) + 1e-6 * self.tolerance * share
        marked[sides[np.arange(len(sides)), rank.argmax(axis=1)]] = True

    def heights(self, rows: IntArray) -> FloatArray:
        """Return the heights of the middles of the sides' curves over some triangles, (3, k)."""
        corners, sides = self.mesh.corner_columns(rows), self.mesh.cells.sides.take(rows, axis=0)
        normal = cross(corners[1] - corners[0], corners[2] - corners[0], 0)
        length = np.sqrt(column_dot(normal, normal))
        scale = 1 / np.where(length > 0, length, np.inf)
        middles = [np.ascontiguousarray(self.mesh.edges.middle.take(side, axis=0).T) for side in sides.T]
        return np.stack([column_dot(middles[k] - (corners[k] + corners[k - 2]) / 2, normal) * scale for k in range(3)])

    def bulge(self, rows: IntArray) -> FloatArray:
        """Measure how high quadratic surfaces through the corners and middles of sides rise over some cells, (k,)."""
        if not self.mesh.is_surface:
            return np.zeros(len(rows))
        quarters = np.array([[2, 2, 0], [0, 2, 2], [2, 0, 2], [4 / 3, 4 / 3, 4 / 3], [2, 1, 1], [1, 2, 1], [1, 1, 2]])
        return np.asarray(np.abs(quadratic_heights(quarters / 4) @ self.heights(rows)).max(axis=0))

    def uncertain(self) -> BoolArray:
        """Mark the segments, of (e,), that are not certain to be within the tolerance of their curves."""
        marked, cells = np.zeros(len(self.mesh.edges.ends), dtype=bool), self.mesh.cells
        todo = np.flatnonzero(~cells.holds)
        for index, rows in groups(cells.patch[todo]):
            own = todo[rows]
            chords = np.stack(self.mesh.corners(own), axis=1)
            fails = self.curves[index].failing(cells.corners[own, :, 0], chords, self.asked)
            cells.holds[own] = ~fails
            marked[cells.sides[own[fails]]] = True
        return marked

    def marks_of_samples(self) -> BoolArray:
        """Sample the triangles that were not sampled yet, and mark the edges, (e,), that must be split for them."""
        mesh, marked = self.mesh, self.far()
        while not marked.any() and len(todo := np.flatnonzero(~mesh.cells.holds)):
            self.sample_peaks(mesh.sides_of(todo))
            is_flat, steps_at = self.flat.take(mesh.cells.patch[todo]), self.steps_at(todo)
            bent, flat = todo[~is_flat], todo[is_flat]
            failing, doubtful = self.sample_on_lattices(bent, steps_at[~is_flat])
            marked = self.far()
            self.mark_worst(marked, failing)
            mesh.cells.holds[bent] = True
            mesh.cells.holds[failing] = mesh.cells.holds[doubtful] = False
            # Flat patches wait until all others hold.
            if len(flat) and not marked.any():
                marked = self.flat_marks(flat)
        return marked

    def sample_peaks(self, sides: IntArray) -> None:
        """Note how far edges are from their curves at possible peaks, and how near samples must be."""
        place_share = 0.01  # part of the tolerance by which a sample may be off along the surface: it is found sooner
        mesh = self.mesh
        edges = rows_of(mesh.edges, sides)
        speed = float((mesh.lengths(sides) * self.sizes.take(edges.patch) / edges.widths).max())
        self.nearby = place_share * self.tolerance / speed if speed > 0 else 0.0
        row, u = self.peaks.along(edges)
        sample = self.sampler.points(edges.patch[row], u, edges.face[row])
        np.maximum.at(mesh.edges.error, sides[row], cell_distances(sample, *mesh.ends(sides[row])))

    def steps_at(self, rows: IntArray) -> IntArray:
        """Return the steps of the lattices on which some cells are sampled, (k,): many if cells are few or wide."""
        most = 32 / SIDE_STEPS
        columns = self.mesh.cells.corners.take(rows, axis=0).reshape(-1, 6).T
        extents = (reduce(np.maximum, columns[axis::2]) - reduce(np.minimum, columns[axis::2]) for axis in (0, 1))
        width = np.maximum(*extents) / self.sizes.take(self.mesh.cells.patch[rows])
        few = np.clip(np.sqrt(2 * self.points_in_all / len(rows)) / SIDE_STEPS, 1, most)
        parts: FloatArray = np.exp2(np.ceil(np.log2(np.maximum(most * width, 1.0)) - 1e-9))
        return SIDE_STEPS * np.maximum(int(few), parts.astype(np.int64))

    def sample_on_lattices(self, rows: IntArray, steps_at: IntArray) -> tuple[IntArray, IntArray]:
        """Sample cells at peaks and lattices; return cells that fail, and cells in doubt, where no quadratic fits."""
        fails, doubts = np.zeros(len(rows), dtype=bool), np.zeros(len(rows), dtype=bool)
        for steps, at in groups(steps_at):
            fails[at], doubts[at] = self.sample(rows[at], steps)
            doubts[at] &= steps < 2 * FINE_LATTICE_STEPS
        if doubts.any() and not fails.any() and not self.far().any():
            # A ridge between samples of the first of these lattices was 1.27 tolerances high.
            for steps in (FINE_LATTICE_STEPS, 2 * FINE_LATTICE_STEPS):
                finer = doubts & ~fails & (steps_at < steps)
                fails[finer], doubts[finer] = self.sample(rows[finer], steps)
            doubts[:] = False
        cells = rows_of(self.mesh.cells, rows)
        row, u = self.peaks.inside(cells)
        sample = self.sampler.points(cells.patch.take(row), u, np.full(len(row), INTERIOR), self.nearby)
        fails[row[cell_distances(sample, *self.mesh.corners(rows[row])) > self.tolerance]] = True
        return rows[fails], rows[doubts]

    def sample(self, rows: IntArray, steps: int) -> tuple[BoolArray, BoolArray]:
        """Sample cells and their sides on a lattice, and mark cells that fail, (k,), and doubtful cells, (k,)."""
        quadratic_share = 0.1  # part of the tolerance by which samples of a quadratic surface may differ from it
        bump_factor = 5.0  # of that difference: a bump between samples was 4 times as high, across creases
        quarter_share = 0.02  # part of the tolerance by which one quarter may differ before the other is sampled
        block_samples = 200_000
        edges, cells = self.mesh.edges, rows_of(self.mesh.cells, rows)
        sides = self.mesh.sides_of(rows)
        if steps <= SIDE_STEPS:
            sides = sides[np.isnan(edges.roughness[sides])]
            quarter = self.sample_sides(sides, np.array([0.25]))
            slides = self.slides(sides, quarter[:, 0])
            sides = sides[(edges.roughness[sides] > quarter_share * self.tolerance) | slides]
            self.sample_sides(sides, np.array([0.75]))
        else:
            self.sample_sides(sides, np.arange(1, steps) / steps)
        fails = np.zeros(len(rows), dtype=bool)
        rough = reduce(np.maximum, [edges.roughness.take(side) for side in cells.sides.T])
        seen = reduce(np.maximum, [edges.error.take(side) for side in cells.sides.T])
        weights = inner_points(steps)
        expected_of = quadratic_heights(weights)
        length = max(1, block_samples // len(weights))
        for block in row_blocks(len(rows), length):
            distance = self.samples.inside(rows[block], weights, self.nearby)
            fails[block] = (distance > self.tolerance).any(axis=1)
            expected = np.abs(expected_of @ self.heights(rows[block])).T
            rough[block] = np.maximum(rough[block], np.abs(distance - expected).max(axis=1))
            seen[block] = np.maximum(seen[block], distance.max(axis=1))
        return fails, (rough > quadratic_share * self.tolerance) & (seen + bump_factor * rough > self.tolerance)

    def sample_sides(self, rows: IntArray, fractions: FloatArray) -> FloatArray:
        """Sample edges at fractions, quarters among them, (e, f, 3), and note how far and how rough they are."""
        if not len(rows):
            return np.empty((0, len(fractions), 3))
        edges = self.mesh.edges
        points, distance, _ = self.samples.along(rows, fractions, self.nearby)
        # At its quarters a parabola is three quarters as far from its chord as in the middle.
        off = np.abs(distance[:, np.isin(fractions, (0.25, 0.75))] - 0.75 * edges.bend[rows, None]).max(axis=1)
        edges.roughness[rows] = np.fmax(edges.roughness[rows], off)
        edges.error[rows] = np.maximum(edges.error[rows], distance.max(axis=1))
        return points

    def slides(self, rows: IntArray, quarter: FloatArray) -> BoolArray:
        """Mark edges, (e,), along which the curve runs far ahead of the edge, or behind, at a quarter or the middle."""
        max_slide = 0.1  # part of an edge: a curve that runs farther ahead along it may overshoot the other end
        start, end = self.mesh.ends(rows)
        chord = end - start
        square = dot(chord, chord)
        points = ((quarter, 0.25), (self.mesh.edges.middle.take(rows, axis=0), 0.5))
        slides = [np.abs(dot(point - start, chord) - at * square) for point, at in points]
        return np.asarray(np.maximum(*slides) > max_slide * square)

    def flat_marks(self, todo: IntArray) -> BoolArray:
        """Mark the edges, (e,), of flat patches to split: on boundaries first, then at folds and gaps of the mesh."""
        max_fold_splits = 256  # cells, turned over or leaving samples out, that are split before all edges count
        edges, cells = self.mesh.edges, self.mesh.cells
        sides = self.mesh.sides_of(todo)
        self.sample_sides(sides[edges.face[sides] > 0], np.arange(1, FINE_LATTICE_STEPS) / FINE_LATTICE_STEPS)
        marked = self.far()
        cells.holds[todo] = not marked.any()
        if marked.any():
            return marked
        for index in np.unique(cells.patch[todo]).tolist():
            rows = np.flatnonzero(cells.patch == index)
            failing = self.samples.folded_or_uncovered(rows, self.steps_at(rows), self.nearby, self.tolerance)
            if not failing.any():
                continue
            cells.holds[rows] = False
            self.folds[index] += int(failing.sum())
            if self.folds[index] <= max_fold_splits:
                self.mark_worst(marked, rows[failing])
                continue
            self.flat[index] = False
            sides = self.mesh.sides_of(rows)
            inner = sides[(edges.patch[sides] == index) & (edges.face[sides] == INTERIOR)]
            edges.error[inner] = edges.bend[inner]
        return marked


def quadratic_heights(places: FloatArray) -> FloatArray:
    """Return the factors, (k, 3), of heights over the middles of sides in the heights at (k, 3) barycentric places."""
    a, b, c = places.T
    return np.asarray(4 * np.stack([a * b, b * c, c * a], axis=1))
