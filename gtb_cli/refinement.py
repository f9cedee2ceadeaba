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
from gtb_cli.splitting import Cells, Edges, divide_segments, divide_triangles, sides_of

ROUNDINGS = 64
"""A tolerance below this many roundings of the largest coordinate cannot be verified and is refused."""

SHORTEST = 1e-13
"""Edges are not split below this fraction of the domain's size: their ends' parameters are too few roundings apart."""

LATTICE = 4
"""Edges are verified at this many steps; all numbers of steps are multiples of it."""

CENTROID = 3
"""Steps of the lattice that has one inner point: enough for a triangle on which all samples are a quadratic's."""

MARGIN = 0.9
"""Part of the tolerance that samples may use up: between them, near creases, the surface was seen 6 % farther away."""

THIN = 12.0
"""A triangle that is split, and longer than this many times its height, has its longest edge split too: slivers do not
get thinner, and refinement ends."""

ROUGH = 0.1
"""Part of the tolerance by which samples may differ from a quadratic surface's before a finer lattice is used."""

HIDDEN = 5.0
"""How many times higher than that difference a bump between the samples may be: 4 was seen, across creases."""

FINE_LATTICE = 12

SAMPLES = 20_000
"""A coarse mesh is verified on a finer lattice: at least about this many points in all."""

FINEST_LATTICE = 32


def refine(start: Complex, sampler: Sampler, tolerance: float, max_cells: int) -> tuple[Complex, FloatArray]:
    """Refine a complex until every sample of the surface is within a distance of its cell.

    Parameters
    ----------
    start : Complex
        Simplicial.
    sampler : Sampler
    tolerance : float
        Largest distance from the surface to the mesh, in model units.
    max_cells : int

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
    while work.step():
        pass
    return work.result()


def sampled(start: Complex, sampler: Sampler, tolerance: float) -> tuple[FloatArray, float]:
    """(v, 3) vertices of a complex, and the largest distance from the surface to its cells, over `MARGIN`.

    Sampled like `refine` does; where edges alone are beyond the tolerance already, no further.
    """
    work = _Refinement(start, sampler, tolerance, len(start.cells))
    work.marks()
    return work.points, max(work.worst, float(work.error.max())) / MARGIN


def covers(start: Complex, sampler: Sampler, tolerance: float) -> FloatArray | None:
    """(v, 3) vertices of a complex of few cells if the surface is within the tolerance of any of them, else None.

    For flat surfaces, on which a parameter may slide out of its cell: that is no error of the mesh. Edges of the
    domain must still be followed by the complex's own.
    """
    work = _Refinement(start, sampler, tolerance, len(start.cells))
    outer = np.flatnonzero(work.edges.face)
    if (work.along(outer, FINEST_LATTICE)[1] > work.tolerance).any():
        return None
    cell = np.repeat(np.arange(len(start.cells)), len(_lattice(FINEST_LATTICE)))
    u = np.einsum("wc,kcd->kwd", _lattice(FINEST_LATTICE), start.corners).reshape(-1, 2)
    points = sampler.points(start.cell_patch[cell], u, np.zeros(len(cell), dtype=np.int64))
    distance = np.full(len(points), np.inf)
    for corners in work.points[start.cells]:
        distance = np.minimum(distance, to_triangles(points, *(np.broadcast_to(c, points.shape) for c in corners)))
    return work.points if (distance <= work.tolerance).all() else None


class _Refinement:
    """The growing arrays of `refine`; the order of everything depends on the input alone."""

    def __init__(self, start: Complex, sampler: Sampler, tolerance: float, max_cells: int) -> None:
        self.sampler, self.asked, self.max_cells = sampler, tolerance, max_cells
        self.tolerance = MARGIN * tolerance
        self.collapsed = start.collapsed
        self.patch, self.parameters, self.face = start.patch, start.parameters, start.face
        self.points = sampler.points(start.patch, start.parameters, start.face)
        self.cells, self.cell_patch, self.corners = start.cells, start.cell_patch, start.corners
        self.verified = np.zeros(len(self.cells), dtype=bool)
        self.sizes = np.array([patch.domain.size for patch in sampler.patches])
        scale = float(np.abs(self.points).max())
        if not tolerance > ROUNDINGS * EPS * scale:
            raise ToleranceError(
                f"tolerance: {tolerance:g} is below the rounding of coordinates of size {scale:.3g}, "
                f"at least {ROUNDINGS * EPS * scale:.2g} can be verified"
            )
        edges, self.sides = sides_of(start, sampler.patches)
        self.edges = edges
        self.middle = np.empty((0, 3))
        self.error = np.empty(0)
        self.roughness = np.empty(0)
        self.worst = 0.0
        self.measure()
        self.bulging = self.bulge(np.arange(len(self.cells))) > self.tolerance

    def measure(self) -> None:
        """Sample the middle of the edges that were not sampled yet."""
        new = np.arange(len(self.error), len(self.edges.ends))
        sample, distance = self.along(new, 2)
        self.middle = np.concatenate([self.middle, sample[:, 0]])
        self.error = np.concatenate([self.error, distance[:, 0]])
        self.roughness = np.concatenate([self.roughness, np.full(len(new), np.nan)])

    def along(self, rows: IntArray, steps: int) -> tuple[FloatArray, FloatArray]:
        """(e, steps − 1, 3) inner points of some edges' curves, and their (e, steps − 1) distances from the edges."""
        edges = self.edges[np.repeat(rows, steps - 1)]
        t = np.tile(np.arange(1, steps) / steps, len(rows))[:, None]
        u = (1 - t) * edges.parameters[:, 0] + t * edges.parameters[:, 1]
        sample = self.sampler.points(edges.patch, u, edges.face)
        distance = to_segments(sample, *np.moveaxis(self.points[edges.ends], 1, 0))
        return sample.reshape(-1, steps - 1, 3), distance.reshape(-1, steps - 1)

    def step(self) -> bool:
        """Split what is too far from the surface; False when nothing is."""
        marked = self.marks()
        if not marked.any():
            return False
        if self.cells.shape[1] == 3:
            self.mark_thin(marked)
        kept = self.split(marked)
        self.measure()
        bulging = self.bulge(np.arange(kept, len(self.cells))) > self.tolerance
        self.bulging = np.concatenate([self.bulging, bulging])
        return True

    def marks(self) -> BoolArray:
        """(e,) which edges are to be split, by what is known of them, or else by verifying cells."""
        marked = np.zeros(len(self.error), dtype=bool)
        for side in self.sides.T:
            marked[side] = self.error[side] > self.tolerance
        if self.cells.shape[1] == 3:
            self.mark_worst(marked, np.flatnonzero(self.bulging))
        if not marked.any():
            self.verify(marked)
        return marked

    def has_mark(self, marked: BoolArray, rows: IntArray | slice) -> BoolArray:
        """Whether any side of some cells is marked; column by column, as reductions along short rows are slow."""
        columns = [marked[side[rows]] for side in self.sides.T]
        return np.asarray(np.logical_or.reduce(columns))

    def lengths(self, sides: IntArray) -> FloatArray:
        """(k, 3) lengths of edges."""
        ends = self.edges.ends[sides.ravel()]
        chord = self.points[ends[:, 1]] - self.points[ends[:, 0]]
        return np.asarray(np.sqrt(dot(chord, chord)).reshape(sides.shape))

    def mark_worst(self, marked: BoolArray, failing: IntArray) -> None:
        """Mark the edge that is farthest from the surface, of cells that fail with no edge marked yet."""
        sides = self.sides[failing[~self.has_mark(marked, failing)]]
        length = self.lengths(sides)
        # Where no edge is off, the longest: errors then are rounding.
        rank = np.where(self.error[sides] > 0.05 * self.tolerance, self.error[sides], 0.0) + 1e-6 * self.tolerance * (
            length / np.maximum(length.max(axis=1, keepdims=True), np.finfo(float).tiny)
        )
        marked[sides[np.arange(len(sides)), rank.argmax(axis=1)]] = True

    def mark_thin(self, marked: BoolArray) -> None:
        """Mark the longest edge of thin triangles that have another one marked, until there is none."""
        before = np.zeros(len(self.cells), dtype=bool)
        while True:
            touched = self.has_mark(marked, slice(None))
            rows = np.flatnonzero(touched & ~before)
            if not len(rows):
                return
            before = touched
            a, b, c = (self.points[corner[rows]] for corner in self.cells.T)
            normal = cross(b - a, c - a)
            length = self.lengths(self.sides[rows])
            thin = THIN * np.sqrt(dot(normal, normal)) < length.max(axis=1) ** 2
            marked[self.sides[rows[thin], length[thin].argmax(axis=1)]] = True

    def heights(self, rows: IntArray) -> FloatArray:
        """(3, k) heights of the sides' middles over some triangles."""
        corners = [self.points[corner[rows]] for corner in self.cells.T]
        normal = cross(corners[1] - corners[0], corners[2] - corners[0])
        length = np.sqrt(dot(normal, normal))
        scale = 1 / np.where(length > 0, length, np.inf)
        middles = [self.middle[side[rows]] - (corners[k] + corners[k - 2]) / 2 for k, side in enumerate(self.sides.T)]
        return np.stack([dot(middle, normal) * scale for middle in middles])

    def bulge(self, rows: IntArray) -> FloatArray:
        """Largest height over some cells of the quadratic surface through their corners and their sides' middles."""
        if self.cells.shape[1] == 2:
            return np.zeros(len(rows))
        return np.asarray(np.abs(_QUADRATIC.T @ self.heights(rows)).max(axis=0))

    def verify(self, marked: BoolArray) -> None:
        """Sample the cells that were not verified yet on a lattice, and mark the worst edge of those that fail.

        Cells that hold, but not because the surface is quadratic there, are sampled on a finer lattice.
        """
        todo = np.flatnonzero(~self.verified)
        if not len(todo):
            return
        steps = 4 * int(np.clip(np.sqrt(2 * SAMPLES / len(todo)) / 4, 1, FINEST_LATTICE / 4))
        failing = np.zeros(len(self.cells), dtype=bool)
        doubt = self.sample(todo, steps, failing, marked)
        doubtful = todo[doubt] if steps < FINE_LATTICE else todo[:0]
        if not failing.any() and not marked.any() and len(doubtful):
            self.sample(doubtful, FINE_LATTICE, failing, marked)
            doubtful = todo[:0]
        if self.cells.shape[1] == 3:
            cell, u = self.knots_inside(todo)
            failing[cell[self.distance(cell, u) > self.tolerance]] = True
            self.mark_worst(marked, np.flatnonzero(failing))
        self.verified[todo] = ~failing[todo]
        self.verified[doubtful] = False

    def sample(self, rows: IntArray, steps: int, failing: BoolArray, marked: BoolArray) -> BoolArray:
        """Sample cells on a lattice; note which fail, or mark their sides; (rows,) which are in doubt."""
        chosen = np.zeros(len(self.error), dtype=bool)
        for side in self.sides.T:
            chosen[side[rows]] = True
        if steps <= LATTICE:
            chosen &= np.isnan(self.roughness)
        sides = np.flatnonzero(chosen)
        if len(sides):
            distance = self.along(sides, max(steps, LATTICE))[1]
            # A parabola is three quarters as far from its chord at the quarters as in the middle.
            quarter, middle = distance.shape[1] // 4, distance.shape[1] // 2
            off = distance[:, [quarter, -1 - quarter]] - 0.75 * distance[:, [middle]]
            self.roughness[sides] = np.abs(off).max(axis=1)
            self.error[sides] = np.maximum(self.error[sides], distance.max(axis=1))
            marked[sides] = self.error[sides] > self.tolerance
        rough = np.maximum.reduce([self.roughness[side[rows]] for side in self.sides.T])
        seen = np.maximum.reduce([self.error[side[rows]] for side in self.sides.T])
        weights = _lattice(steps if steps > LATTICE else CENTROID)
        a, b, c = weights.T
        quadratic = 4 * np.stack([a * b, b * c, c * a], axis=1)
        length = max(1, 200_000 // len(weights))
        for begin in range(0, len(rows) if self.cells.shape[1] == 3 else 0, length):
            part = rows[begin : begin + length]
            u = np.einsum("wc,kcd->kwd", weights, self.corners[part]).reshape(-1, 2)
            distance = self.distance(np.repeat(part, len(weights)), u).reshape(len(part), -1)
            failing[part] = (distance > self.tolerance).any(axis=1)
            expected = np.abs(quadratic @ self.heights(part)).T
            block = slice(begin, begin + length)
            rough[block] = np.maximum(rough[block], np.abs(distance - expected).max(axis=1))
            seen[block] = np.maximum(seen[block], distance.max(axis=1))
        return np.asarray((rough > ROUGH * self.tolerance) & (seen + HIDDEN * rough > self.tolerance))

    def distance(self, cell: IntArray, u: FloatArray) -> FloatArray:
        """(m,) distances of the surface at (m, 2) parameters from the cells they lie in."""
        sample = self.sampler.points(self.cell_patch[cell], u, np.zeros(len(cell), dtype=np.int64))
        distance = to_triangles(sample, *(self.points[corner] for corner in self.cells[cell].T))
        self.worst = max(self.worst, float(distance.max(initial=0.0)))
        return distance

    def knots_inside(self, todo: IntArray) -> tuple[IntArray, FloatArray]:
        """Knots inside given cells: with extreme weights the linear parametrisation has its peaks there."""
        found_cells, found = [np.empty(0, dtype=np.int64)], [np.empty((0, 2))]
        for index, patch in enumerate(self.sampler.patches):
            knots = patch.knots[~patch.domain.incidence.any(axis=1)]
            cells = todo[self.cell_patch[todo] == index]
            a, b, c = np.moveaxis(self.corners[cells], 1, 0)
            for knot in knots:
                signs = np.stack([_cross(b - a, knot - a), _cross(c - b, knot - b), _cross(a - c, knot - c)])
                inside = cells[(signs > 0).all(axis=0) | (signs < 0).all(axis=0)]
                found_cells.append(inside)
                found.append(np.repeat(knot[None], len(inside), axis=0))
        return np.concatenate(found_cells), np.concatenate(found)

    def split(self, marked: BoolArray) -> int:
        """Split marked edges in the middle, and the cells beside them by pattern; the number of cells that stay."""
        chosen = np.flatnonzero(marked)
        count = len(self.cells) + int(marked[self.sides].sum())
        reached = float(self.error[self.sides].max())
        if count > self.max_cells:
            raise ToleranceError(
                f"tolerance: {self.asked:g} needs more than {self.max_cells} faces; with {len(self.cells)} "
                f"the distance is still {reached:.3g}"
            )
        old = self.edges[chosen]
        width = np.abs(old.parameters[:, 1] - old.parameters[:, 0]).max(axis=1)
        if (width < SHORTEST * self.sizes[old.patch]).any():
            raise ToleranceError(
                f"tolerance: {self.asked:g} is not reached where parameters are too close to tell apart; "
                f"the distance is still {reached:.3g}"
            )
        vertex = np.full(len(marked), -1)
        vertex[chosen] = len(self.points) + np.arange(len(chosen))
        middles = old.middles
        self.patch = np.concatenate([self.patch, old.patch])
        self.parameters = np.concatenate([self.parameters, middles])
        self.face = np.concatenate([self.face, old.face])
        self.points = np.concatenate([self.points, self.middle[chosen]])
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
        self.edges = self.edges.followed_by(*halves)
        divide = divide_segments if self.cells.shape[1] == 2 else divide_triangles
        whole = Cells(self.cells, self.sides, self.corners, self.cell_patch)
        pieces, made = divide(whole, self.edges, self.points, vertex, child)
        keep = ~self.has_mark(marked, slice(None))
        self.edges = self.edges.followed_by(made)
        self.cells = np.concatenate([self.cells[keep], *(piece.cells for piece in pieces)])
        self.sides = np.concatenate([self.sides[keep], *(piece.sides for piece in pieces)])
        self.corners = np.concatenate([self.corners[keep], *(piece.corners for piece in pieces)])
        self.cell_patch = np.concatenate([self.cell_patch[keep], *(piece.patch for piece in pieces)])
        added = sum(len(piece.cells) for piece in pieces)
        self.verified = np.concatenate([self.verified[keep], np.zeros(added, dtype=bool)])
        self.bulging = self.bulging[keep]
        return len(self.bulging)

    def result(self) -> tuple[Complex, FloatArray]:
        """The refined complex; cells ordered by patch, else in the order in which they were made."""
        order = np.argsort(self.cell_patch, kind="stable")
        refined = Complex(
            self.patch,
            self.parameters,
            self.face,
            self.cells[order],
            self.cell_patch[order],
            self.corners[order],
            self.collapsed,
        )
        return refined, self.points


def _lattice(steps: int) -> FloatArray:
    """Barycentric coordinates of the inner points of a triangle's lattice."""
    i, j = np.mgrid[1:steps, 1:steps]
    inner = i + j < steps
    return np.stack([i[inner], j[inner], steps - i[inner] - j[inner]], axis=1) / steps


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _quadratic() -> FloatArray:
    """(3, 7) heights at seven places of a triangle of the quadratic with given heights at the sides' middles."""
    places = np.array(
        [[2, 2, 0], [0, 2, 2], [2, 0, 2], [4 / 3, 4 / 3, 4 / 3], [2, 1, 1], [1, 2, 1], [1, 1, 2]], dtype=np.float64
    )
    a, b, c = (places / 4).T
    return 4 * np.stack([a * b, b * c, c * a])


_QUADRATIC = _quadratic()
