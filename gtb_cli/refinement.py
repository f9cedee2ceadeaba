"""Refinement of a complex until the surface is within a tolerance of the mesh.

Edges carry the state: each is sampled once, when it is made, and is split in the middle if the surface leaves it by
more than the tolerance. Both cells beside an edge see the same decision, so that no vertex hangs. When all edges
hold, every cell that was not sampled yet is sampled densely, and cells that fail have their worst edge split.
"""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray
from gtb_cli.complex import Complex, Sampler
from gtb_cli.distance import cross, dot, to_segments, to_triangles
from gtb_cli.domain import EPS
from gtb_cli.errors import ToleranceError
from gtb_cli.flatness import is_flat, left_out, turned_over
from gtb_cli.lattice import BULGES, CENTROID, LATTICE, lattice, quadratic_heights, steps_for
from gtb_cli.nearest import NearestCells
from gtb_cli.splitting import (
    Cells,
    Edges,
    Growth,
    cells_needed,
    divide_segments,
    divide_triangles,
    knots_inside,
    sides_of,
    slimness,
)

ROUNDINGS = 64
"""A tolerance below this many roundings of the largest coordinate cannot be verified and is refused."""

SHORTEST = 1e-13
"""Edges are not split below this fraction of the domain's size: their ends' parameters are too few roundings apart."""

MARGIN = 0.9
"""Part of the tolerance that samples may use up: between them, near creases, the surface was seen 6 % farther away."""

THIN = 12.0
"""A triangle that is split, and longer than this many times its height, has its longest edge split too: slivers do not
get thinner, and refinement ends."""

SLIM = {"linear": 0.01, "toric": 1e-12}
"""Height of a triangle in Δ, in units of its longest side and of the slimmest one's at the start, that is thin. In
toric parameters triangles along edges of Δ have to be."""

ROUGH = 0.1
"""Part of the tolerance by which samples may differ from a quadratic surface's before a finer lattice is used."""

EVEN = 0.02
"""The same at one quarter of an edge, before the other one is sampled, too."""

SLIDE = 0.1
"""Part of an edge by which its curve may run ahead along it; else it may turn back beyond the other end."""

HIDDEN = 5.0
"""How many times higher than that difference a bump between the samples may be: 4 was seen, across creases."""

FINE_LATTICE = 12

NEARBY = 0.01
"""Part of the tolerance by which a sample may be beside the place it is asked for: it is found sooner."""

FOLDS = 256
"""How many cells of a flat patch that are turned over or leave samples out are split before all its edges count."""

KNOWN = 1000
"""Cells from which on it is estimated how many there will be."""

SURE = 4.0
"""How many times the cells that are allowed they must be, so that it is given up."""

FEW_OF = 16
"""Of so many cells one is sampled first, where most complexes are not good enough."""


def refine(
    start: Complex, sampler: Sampler, tolerance: float, max_cells: int, witnesses: FloatArray | None = None
) -> tuple[Complex, FloatArray]:
    """Refine a complex until every sample of the surface is within a distance of its cell.

    Parameters
    ----------
    start : Complex
        Simplicial.
    sampler : Sampler
    tolerance : float
        Largest distance from the surface to the mesh, in model units.
    max_cells : int
    witnesses : (m, 3) float, optional
        Points of the surface, known otherwise, that must be as near to the mesh.

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
    Verified at quarters of the sides and in the middle of each cell; where these are not as a quadratic surface would
    have them, on a lattice of `FINE_LATTICE` steps; and at the knots inside. `MARGIN` is for what happens between.
    """
    work = _Refinement(start, sampler, tolerance, max_cells)
    while work.step() or (witnesses is not None and work.step_towards(witnesses)):
        pass
    return work.result()


def sampled(start: Complex, sampler: Sampler, tolerance: float) -> tuple[FloatArray, float]:
    """(v, 3) vertices of a complex, and the largest distance from the surface to its cells, over `MARGIN`.

    Sampled like `refine` does; where edges alone, or some of the cells, are beyond the tolerance already, no further.
    """
    if len(start.cells) > FEW_OF * LATTICE:
        few = _Refinement(start.part(slice(None, None, FEW_OF)), sampler, tolerance, len(start.cells))
        if float(few.error.max()) > few.tolerance:
            return few.points, float(few.error.max()) / MARGIN
    work = _Refinement(start, sampler, tolerance, len(start.cells))
    # Cells that bulge, or do not cover a flat patch, fail though no sample may be far from its own cell.
    beyond = np.nextafter(tolerance, np.inf) if work.marks().any() else 0.0
    return work.points, max(work.worst / MARGIN, float(work.error.max()) / MARGIN, beyond)


class _Refinement:
    """The growing arrays of `refine`; the order of everything depends on the input alone."""

    def __init__(self, start: Complex, sampler: Sampler, tolerance: float, max_cells: int) -> None:
        self.sampler, self.asked, self.max_cells = sampler, tolerance, max_cells
        self.tolerance = MARGIN * tolerance
        self.collapsed = start.collapsed
        self.patch, self.parameters, self.face = start.patch, start.parameters, start.face
        self.points = sampler.points(start.patch, start.parameters, start.face)
        self.verified = np.zeros(len(start.cells), dtype=bool)
        self.sizes = np.array([patch.domain.size for patch in sampler.patches])
        scale = float(np.abs(self.points).max())
        if not tolerance > ROUNDINGS * EPS * scale:
            raise ToleranceError(
                f"tolerance: {tolerance:g} is below the rounding of coordinates of size {scale:.3g}, "
                f"at least {ROUNDINGS * EPS * scale:.2g} can be verified"
            )
        self.nearby = 0.0
        surfaces = [patch.dimension == 2 for patch in sampler.patches]
        # Inside flat patches a parameter may slide out of its cell: that is no error of the mesh.
        self.flat = np.array(
            [surface and is_flat(p, tolerance) for surface, p in zip(surfaces, sampler.patches, strict=True)]
        )
        self.folds = np.zeros(len(sampler.patches), dtype=np.int64)
        self.slimmest = SLIM[sampler.parametrization]
        if start.cells.shape[1] == 3:
            self.slimmest *= min(1.0, float(slimness(start.corners)[0].min()))
        self.edges, sides = sides_of(start, sampler.patches)
        self.cells = Cells(start.cells, sides, start.corners, start.cell_patch)
        self.growth = Growth()
        self.middle = np.empty((0, 3))
        self.error = np.empty(0)
        self.roughness = np.empty(0)
        self.worst, self.estimated = 0.0, 0
        self.measure()
        self.bulging = self.bulge(np.arange(len(start.cells))) > self.tolerance

    def measure(self) -> None:
        """Sample the middle of the edges that were not sampled yet."""
        new = np.arange(len(self.error), len(self.edges.ends))
        sample, distance = self.along(new, np.array([0.5]), 0.0)
        distance[self.flat[self.edges.patch[new]] & (self.edges.face[new] == 0)] = 0.0
        self.middle = self.growth.append("middle", self.middle, sample[:, 0])
        self.error = self.growth.append("error", self.error, distance[:, 0])
        self.roughness = self.growth.append("roughness", self.roughness, np.full(len(new), np.nan))

    def along(self, rows: IntArray, fractions: FloatArray, within: float) -> tuple[FloatArray, FloatArray]:
        """(e, f, 3) points at fractions of some edges' curves, and their (e, f) distances from the edges."""
        edges = self.edges[np.repeat(rows, len(fractions))]
        t = np.tile(fractions, len(rows))[:, None]
        u = (1 - t) * edges.parameters[:, 0] + t * edges.parameters[:, 1]
        sample = self.sampler.points(edges.patch, u, edges.face, within)
        distance = to_segments(sample, *np.moveaxis(self.points[edges.ends], 1, 0))
        return sample.reshape(-1, len(fractions), 3), distance.reshape(-1, len(fractions))

    def step(self) -> bool:
        """Split what is too far from the surface; False when nothing is."""
        marked = self.marks()
        if not marked.any():
            return False
        self.advance(marked)
        return True

    def step_towards(self, witnesses: FloatArray) -> bool:
        """Split the cells that are nearest to points that are too far from all; False when none is."""
        nearest = NearestCells(self.points[self.cells.cells])
        distance, cell = nearest.search(witnesses, *nearest.start(witnesses))
        failing = np.unique(cell[distance > self.tolerance])
        if not len(failing):
            return False
        marked = np.zeros(len(self.error), dtype=bool)
        self.mark_worst(marked, failing)
        self.advance(marked)
        return True

    def advance(self, marked: BoolArray) -> None:
        """Split edges and sample what is new."""
        if self.cells.cells.shape[1] == 3:
            self.mark_thin(marked)
        changed = self.split(marked)
        self.measure()
        self.bulging[changed] = self.bulge(changed) > self.tolerance

    def marks(self) -> BoolArray:
        """(e,) which edges are to be split, by what is known of them, or else by verifying cells."""
        again = True
        while again:
            marked = np.zeros(len(self.error), dtype=bool)
            for side in self.cells.sides.T:
                marked[side] = self.error[side] > self.tolerance
            if self.cells.cells.shape[1] == 3:
                self.mark_worst(marked, np.flatnonzero(self.bulging))
            again = not marked.any() and self.verify(marked)
        return marked

    def has_mark(self, marked: BoolArray, rows: IntArray | slice) -> BoolArray:
        """Whether any side of some cells is marked; column by column, as reductions along short rows are slow."""
        columns = [marked[side[rows]] for side in self.cells.sides.T]
        return np.asarray(np.logical_or.reduce(columns))

    def lengths(self, sides: IntArray) -> FloatArray:
        """Lengths of edges."""
        ends = self.edges.ends[sides.ravel()]
        chord = self.points[ends[:, 1]] - self.points[ends[:, 0]]
        return np.asarray(np.sqrt(dot(chord, chord)).reshape(sides.shape))

    def mark_worst(self, marked: BoolArray, failing: IntArray) -> None:
        """Mark the edge that is farthest from the surface, of cells that fail with no edge marked yet."""
        sides = self.cells.sides[failing[~self.has_mark(marked, failing)]]
        length = self.lengths(sides)
        # Where no edge is off, the longest: errors then are rounding.
        rank = np.where(self.error[sides] > 0.05 * self.tolerance, self.error[sides], 0.0) + 1e-6 * self.tolerance * (
            length / np.maximum(length.max(axis=1, keepdims=True), np.finfo(float).tiny)
        )
        marked[sides[np.arange(len(sides)), rank.argmax(axis=1)]] = True

    def mark_thin(self, marked: BoolArray) -> None:
        """Mark the longest edge of thin triangles that have another one marked, until there is none.

        Of those thin in Δ, too: else parts of a surface that bends to and fro along one could be split for ever.
        """
        before = np.zeros(len(self.cells.cells), dtype=bool)
        while True:
            touched = self.has_mark(marked, slice(None))
            rows = np.flatnonzero(touched & ~before)
            if not len(rows):
                return
            before = touched
            a, b, c = (self.points[corner[rows]] for corner in self.cells.cells.T)
            normal = cross(b - a, c - a)
            length = self.lengths(self.cells.sides[rows])
            thin = THIN * np.sqrt(dot(normal, normal)) < length.max(axis=1) ** 2
            marked[self.cells.sides[rows[thin], length[thin].argmax(axis=1)]] = True
            share, longest = slimness(self.cells.corners[rows])
            thin = share < self.slimmest
            marked[self.cells.sides[rows[thin], longest[thin]]] = True

    def heights(self, rows: IntArray) -> FloatArray:
        """(3, k) heights of the sides' middles over some triangles."""
        corners = [self.points[corner[rows]] for corner in self.cells.cells.T]
        normal = cross(corners[1] - corners[0], corners[2] - corners[0])
        length = np.sqrt(dot(normal, normal))
        scale = 1 / np.where(length > 0, length, np.inf)
        middles = [
            self.middle[side[rows]] - (corners[k] + corners[k - 2]) / 2 for k, side in enumerate(self.cells.sides.T)
        ]
        return np.stack([dot(middle, normal) * scale for middle in middles])

    def bulge(self, rows: IntArray) -> FloatArray:
        """Largest height over some cells of the quadratic surface through their corners and their sides' middles."""
        if self.cells.cells.shape[1] == 2:
            return np.zeros(len(rows))
        return np.asarray(np.abs(BULGES @ self.heights(rows)).max(axis=0))

    def verify(self, marked: BoolArray) -> bool:
        """Sample the cells that were not verified yet on a lattice, and mark the worst edge of those that fail.

        Cells that hold, but not because the surface is quadratic there, are sampled on a finer lattice. The result is
        whether what is known of edges has changed instead.
        """
        todo = np.flatnonzero(~self.verified)
        if not len(todo):
            return False
        chosen = np.zeros(len(self.error), dtype=bool)
        chosen[self.cells.sides[todo]] = True
        sides = np.flatnonzero(chosen)
        width = np.ptp(self.edges.parameters[sides], axis=1).max(axis=1)
        speed = float((self.lengths(sides) * self.sizes[self.edges.patch[sides]] / width).max())
        self.nearby = NEARBY * self.tolerance / speed if speed > 0 else 0.0
        flat = self.flat[self.cells.patch[todo]]
        bent = todo[~flat]
        steps_at = self.steps_at(todo)
        failing = np.zeros(len(self.verified), dtype=bool)
        doubt = np.zeros(len(self.verified), dtype=bool)
        for steps in np.unique(steps_at[~flat]).tolist():
            rows = todo[~flat & (steps_at == steps)]
            doubt[rows] = self.sample(rows, steps, failing, marked) & (steps < FINE_LATTICE)
        doubtful = np.flatnonzero(doubt)
        if not failing.any() and not marked.any() and len(doubtful):
            self.sample(doubtful, FINE_LATTICE, failing, marked)
            doubtful = todo[:0]
        if self.cells.cells.shape[1] == 3:
            cell, u = knots_inside(self.cells, bent, self.sampler.patches)
            failing[cell[self.distance(cell, u) > self.tolerance]] = True
            self.mark_worst(marked, np.flatnonzero(failing))
        self.verified[todo] = ~failing[todo]
        self.verified[doubtful] = False
        if marked.any():
            # Flat patches wait until the others hold.
            self.verified[todo[flat]] = False
            return False
        return bool(flat.any()) and self.verify_flat(todo[flat], marked)

    def steps_at(self, rows: IntArray) -> IntArray:
        """(k,) steps of the lattices of some cells."""
        corners = list(np.moveaxis(self.cells.corners[rows], 1, 0))
        extent = np.maximum.reduce(corners) - np.minimum.reduce(corners)
        return steps_for(np.maximum(extent[:, 0], extent[:, -1]) / self.sizes[self.cells.patch[rows]])

    def verify_flat(self, todo: IntArray, marked: BoolArray) -> bool:
        """Mark the boundaries of flat patches, or else see whether the mesh covers the surface and does not fold.

        Where it does not, the patch is refined like others: the result is whether there is such a patch.
        """
        sides = np.unique(self.cells.sides[todo])
        sides = sides[self.edges.face[sides] > 0]
        self.sample_sides(sides, np.arange(1, FINE_LATTICE) / FINE_LATTICE)
        marked[sides] = self.error[sides] > self.tolerance
        if marked.any():
            self.verified[todo] = False
            return False
        bent = False
        for index in np.unique(self.cells.patch[todo]).tolist():
            rows = np.flatnonzero(self.cells.patch == index)
            failing = self.folded_or_not_covering(rows)
            if not failing.any():
                continue
            self.verified[rows] = False
            self.folds[index] += int(failing.sum())
            if self.folds[index] <= FOLDS:
                self.mark_worst(marked, rows[failing])
                continue
            bent = True
            self.flat[index] = False
            inner = np.flatnonzero((self.edges.patch == index) & (self.edges.face == 0))
            self.error[inner] = to_segments(self.middle[inner], *np.moveaxis(self.points[self.edges.ends[inner]], 1, 0))
        return bent and not marked.any()

    def folded_or_not_covering(self, rows: IntArray) -> BoolArray:
        """Which cells of a flat patch, all given, are turned over, or have samples beyond the tolerance from all."""
        corners = self.points[self.cells.cells[rows]]
        failing = turned_over(corners)
        if failing.any():
            return failing
        steps_at = self.steps_at(rows)
        places, owners = [], []
        for steps in np.unique(steps_at).tolist():
            part = np.flatnonzero(steps_at == steps)
            weights = lattice(steps if steps > LATTICE else CENTROID)
            places.append(np.einsum("wc,kcd->kwd", weights, self.cells.corners[rows[part]]).reshape(-1, 2))
            owners.append(np.repeat(part, len(weights)))
        u, own = np.concatenate(places), np.concatenate(owners)
        sample = self.sampler.points(self.cells.patch[rows[own]], u, np.zeros(len(own), dtype=np.int64), self.nearby)
        failing[own[left_out(sample, own, corners, self.tolerance)]] = True
        return failing

    def sample(self, rows: IntArray, steps: int, failing: BoolArray, marked: BoolArray) -> BoolArray:
        """Sample cells on a lattice; note which fail, or mark their sides; (rows,) which are in doubt."""
        chosen = np.zeros(len(self.error), dtype=bool)
        for side in self.cells.sides.T:
            chosen[side[rows]] = True
        if steps <= LATTICE:
            chosen &= np.isnan(self.roughness)
            sides = np.flatnonzero(chosen)
            quarter = self.sample_sides(sides, np.array([0.25]))
            sides = sides[(self.roughness[sides] > EVEN * self.tolerance) | self.slides(sides, quarter[:, 0])]
            self.sample_sides(sides, np.array([0.75]))
        else:
            self.sample_sides(np.flatnonzero(chosen), np.arange(1, steps) / steps)
        marked[chosen] = self.error[chosen] > self.tolerance
        rough = np.maximum.reduce([self.roughness[side[rows]] for side in self.cells.sides.T])
        seen = np.maximum.reduce([self.error[side[rows]] for side in self.cells.sides.T])
        weights = lattice(steps if steps > LATTICE else CENTROID)
        expected_of = quadratic_heights(weights)
        length = max(1, 200_000 // len(weights))
        for begin in range(0, len(rows) if self.cells.cells.shape[1] == 3 else 0, length):
            part = rows[begin : begin + length]
            u = np.einsum("wc,kcd->kwd", weights, self.cells.corners[part]).reshape(-1, 2)
            distance = self.distance(np.repeat(part, len(weights)), u).reshape(len(part), -1)
            failing[part] = (distance > self.tolerance).any(axis=1)
            expected = np.abs(expected_of @ self.heights(part)).T
            block = slice(begin, begin + length)
            rough[block] = np.maximum(rough[block], np.abs(distance - expected).max(axis=1))
            seen[block] = np.maximum(seen[block], distance.max(axis=1))
        return np.asarray((rough > ROUGH * self.tolerance) & (seen + HIDDEN * rough > self.tolerance))

    def slides(self, rows: IntArray, quarter: FloatArray) -> BoolArray:
        """Whether points at the quarter or in the middle of edges are not nearly there along the chords, either."""
        start, end = np.moveaxis(self.points[self.edges.ends[rows]], 1, 0)
        chord = end - start
        square = dot(chord, chord)
        places = [(dot(point - start, chord), at) for point, at in ((quarter, 0.25), (self.middle[rows], 0.5))]
        return np.asarray(np.logical_or.reduce([np.abs(along - at * square) > SLIDE * square for along, at in places]))

    def sample_sides(self, rows: IntArray, fractions: FloatArray) -> FloatArray:
        """(e, f, 3) points of edges at fractions, quarters among them; how far and how rough they are is noted."""
        if not len(rows):
            return np.empty((0, len(fractions), 3))
        samples, distance = self.along(rows, fractions, self.nearby)
        middle = to_segments(self.middle[rows], *np.moveaxis(self.points[self.edges.ends[rows]], 1, 0))
        # A parabola is three quarters as far from its chord at the quarters as in the middle.
        off = np.abs(distance[:, np.isin(fractions, (0.25, 0.75))] - 0.75 * middle[:, None]).max(axis=1)
        self.roughness[rows] = np.fmax(self.roughness[rows], off)
        self.error[rows] = np.maximum(self.error[rows], distance.max(axis=1))
        return samples

    def distance(self, cell: IntArray, u: FloatArray) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        sample = self.sampler.points(self.cells.patch[cell], u, np.zeros(len(cell), dtype=np.int64), self.nearby)
        distance = to_triangles(sample, *(self.points[corner] for corner in self.cells.cells[cell].T))
        self.worst = max(self.worst, float(distance.max(initial=0.0)))
        return distance

    def split(self, marked: BoolArray) -> IntArray:
        """Split marked edges in the middle, and the cells beside them by pattern; the cells that are new."""
        chosen = np.flatnonzero(marked)
        count = len(self.cells.cells) + int(marked[self.cells.sides].sum())
        reached = float(self.error[self.cells.sides].max())
        old = self.edges[chosen]
        width = np.abs(old.parameters[:, 1] - old.parameters[:, 0]).max(axis=1)
        why, needed = "", 0.0
        if len(self.verified) > max(KNOWN, 2 * self.estimated):
            self.estimated, needed = len(self.verified), cells_needed(self.error[self.cells.sides] / self.tolerance)
        if count > self.max_cells:
            why = f"needs more than {self.max_cells} faces"
        elif needed > SURE * self.max_cells:
            why = f"needs about {needed:.1g} faces, more than {self.max_cells}"
        elif (width < SHORTEST * self.sizes[old.patch]).any():
            why = f"is not reached where {self.sampler.parametrization} parameters are too close to tell apart"
        if why:
            raise ToleranceError(
                f"tolerance: {self.asked:g} {why}; with {len(self.verified)} the distance is still {reached:.3g}"
            )
        vertex = np.full(len(marked), -1)
        vertex[chosen] = len(self.points) + np.arange(len(chosen))
        middles = old.middles
        self.patch = self.growth.append("patch", self.patch, old.patch)
        self.parameters = self.growth.append("parameters", self.parameters, middles)
        self.face = self.growth.append("face", self.face, old.face)
        self.points = self.growth.append("points", self.points, self.middle[chosen])
        child = np.full((len(marked), 2), -1)
        child[chosen] = len(marked) + np.arange(2 * len(chosen)).reshape(2, -1).T
        halves = [
            Edges(
                np.stack([old.ends[:, end], vertex[chosen]], axis=1),
                old.patch,
                np.stack([old.parameters[:, end], middles], axis=1),
                old.face,
            )
            for end in (0, 1)
        ]
        self.edges = self.edges.followed_by(self.growth, *halves)
        rows = np.flatnonzero(self.has_mark(marked, slice(None)))
        divide = divide_segments if self.cells.cells.shape[1] == 2 else divide_triangles
        pieces, made = divide(self.cells[rows], self.edges, self.points, vertex, child)
        if made:
            self.edges = self.edges.followed_by(self.growth, *made)
        before = len(self.verified)
        self.cells = self.cells.replaced(self.growth, rows, pieces)
        changed = np.concatenate([rows, np.arange(before, len(self.cells.cells))])
        unknown = np.zeros(len(self.cells.cells) - before, dtype=bool)
        self.verified = self.growth.append("verified", self.verified, unknown)
        self.bulging = self.growth.append("bulging", self.bulging, unknown)
        self.verified[rows] = False
        return changed

    def result(self) -> tuple[Complex, FloatArray]:
        """The refined complex; cells ordered by patch, else in the order in which they were made."""
        order = np.argsort(self.cells.patch, kind="stable")
        refined = Complex(
            self.patch,
            self.parameters,
            self.face,
            self.cells.cells[order],
            self.cells.patch[order],
            self.cells.corners[order],
            self.collapsed,
        )
        return refined, self.points
