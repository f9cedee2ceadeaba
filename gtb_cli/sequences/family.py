"""Families of patches that tend to a limit, meshed on one complex: the triangulation follows the limit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray
from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import RegularDecomposition
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import INTERIOR
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.knots.triangulation import cell_count, central_triangulation, triangulation
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.moment.solve import ACCEPTED_RESIDUAL
from gtb_cli.moment.torus import BLOCK_NUMBERS
from gtb_cli.sequences.continuation import Continuation, Places
from gtb_cli.sequences.film import film_mesh
from gtb_cli.tessellation.complex import Complex, alone, joined_complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.tessellate import FIRST_RESOLUTIONS
from gtb_cli.theory.degeneration import cells_of
from gtb_cli.theory.edges import EdgeRef
from gtb_cli.theory.joints import Joint, Joints
from gtb_cli.theory.knot_limit import KnotLimit, move_knots
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

LAYER_CELLS = 4.0
"""Cells across the layer along the boundary in which a member differs from what it is inside."""

CORNER_TOLERANCES = 4.0
"""Multiple of `knot_tolerance` by which corners of a cell and of its domain's hull may differ and be the same knots."""

MAX_FOLLOWED_VERTICES = 20_000
"""Vertices up to which members are solved together; the points of more would fill arrays of their own anyway."""

MAX_TOGETHER = 32
"""Largest number of members that are solved together."""


@frozen
class Degeneration:
    """The data from which the members of a degeneration are made.

    Attributes
    ----------
    patch : Patch
    gaps : (n, c) float
        How far the lifting of each knot is below the plane of each cell, in the order of meshing.
    logarithms : (k,) float
        |log x| of all members but the limit.
    faces : (c, f) int
        Numbers of the faces of Δ that hold each face of each cell.
    borders : (c, f) bool
        Whether a face of a cell has a lower dimension than that face of Δ.
    knots : Places
        Those of knots inside Δ that are not corners of cells: near each other, such knots may make peaks of members.
    """

    patch: Patch
    gaps: FloatArray
    logarithms: FloatArray
    faces: IntArray
    borders: BoolArray
    knots: Places

    def places(self, mosaic: Complex) -> Places:
        """Return the places in Δ of the vertices of a complex over the cells."""
        return Places(mosaic.patch, mosaic.parameters, self.faces[mosaic.patch, mosaic.face])


@frozen
class Family:
    """Patches with the same Δ in their linear parametrisations, and their limit.

    Attributes
    ----------
    samplers : tuple of Sampler
        One for each patch, the limit last. All take parameters with the patch of the limit in which they lie, and the
        face of that patch's domain.
    joints : Joints or None
        How the patches of the limit are joined; None for a single one.
    thickness : tuple of float
        For each member the thickness, as a fraction of Δ's size, of the layer along the boundary in which it differs
        from what it is inside; empty if there is none.
    degeneration : Degeneration or None
        None for other families.
    knot_limit : KnotLimit or None
        Likewise.
    steps : tuple of float
        Those of a knot limit's members.
    """

    samplers: tuple[Sampler, ...]
    joints: Joints | None
    thickness: tuple[float, ...] = ()
    degeneration: Degeneration | None = None
    knot_limit: KnotLimit | None = None
    steps: tuple[float, ...] = ()

    @property
    def limit(self) -> Sampler:
        """The last sampler."""
        return self.samplers[-1]

    @property
    def dimension(self) -> int:
        """1 for curves, 2 for surfaces."""
        return self.limit.patches[0].dimension

    @property
    def has_film(self) -> bool:
        """Whether the limit as a set is more than the last patches."""
        return self.knot_limit is not None and bool(self.knot_limit.films)

    @cached_property
    def film(self) -> Mesh | None:
        """A mesh of what it is more."""
        return film_mesh(self.knot_limit) if self.knot_limit is not None and self.has_film else None

    def cell_count(self, resolution: int) -> int:
        """Number of cells of `uniform`, without making it."""
        return sum(cell_count(patch.domain, resolution) for patch in self.limit.patches)

    def uniform(self, resolution: int) -> Complex:
        """Return the complex with `resolution` cells along each edge of each patch of the limit."""
        return joined_complex(self.limit.patches, self.joints, resolution)

    def graded(self, resolution: int, member: int) -> Complex:
        """Return a complex like `uniform`, but with cells near the boundary as small as a member needs."""
        if not self.thickness or not 0 < self.thickness[member] < 1 / resolution:
            return self.uniform(resolution)
        return graded_complex(self.limit.patches[0].domain, resolution, self.thickness[member] / LAYER_CELLS)

    def refined(self, tolerance: float, max_cells: int) -> Complex:
        """Refine the coarsest complex until it is within a tolerance of every member.

        Raises
        ------
        ToleranceError
            More than `max_cells` cells would be needed.
        """
        for resolution in FIRST_RESOLUTIONS:
            mosaic = self.uniform(resolution)
            if mosaic.is_simplicial:
                break
        count = 0
        while len(mosaic.cells) > count:
            count = len(mosaic.cells)
            for sampler in reversed(self.samplers):
                mosaic, _ = refine(mosaic, sampler, tolerance, max_cells)
        return _in_order(mosaic)


def approaching(limit: KnotLimit, steps: Sequence[float]) -> Family:
    """Patches at some steps of a knot limit, and the merged one."""
    samplers = [_linear(move_knots(limit.patch, limit.moves, step)) for step in steps]
    thickness = (*map(limit.nearness, steps), 0.0) if limit.films else ()
    return Family((*samplers, _linear(limit.merged)), None, thickness, knot_limit=limit, steps=tuple(steps))


def degenerating(patch: Patch, logarithms: Sequence[float], decomposition: RegularDecomposition) -> Family:
    """Patches with the weights e^{l λ} ω for some l ≥ 0, and the regular control surface of the decomposition by λ.

    Raises
    ------
    DomainError
        The decomposition has a corner that is straight to rounding.
    """
    order = _left_to_right(decomposition)
    limit = cells_of(patch, decomposition).patches
    cells = [limit[k] for k in order]
    joints = _joints(decomposition, order, cells)
    faces = _outer_faces(patch.domain, decomposition, order)
    gaps = [decomposition.gaps(k) for k in order]
    members = []
    for logarithm in logarithms:
        # An affine lifting changes no point; the gaps, 0 on the cell itself, keep all digits there.
        whole = [patch.replace(log_weights=patch.log_weights - logarithm * gap) for gap in gaps]
        members.append(Sampler(cells, "linear", True, wholes=whole, faces=faces))
    degeneration = Degeneration(
        patch,
        np.stack(gaps, axis=1),
        np.array(logarithms, dtype=np.float64),
        faces,
        _borders(patch.domain, cells, faces),
        _other_knots(patch.domain, decomposition, order),
    )
    return Family((*members, Sampler(cells, "linear", True)), joints, degeneration=degeneration)


def _linear(patch: Patch) -> Sampler:
    return Sampler((patch,), "linear", False)


def _left_to_right(decomposition: RegularDecomposition) -> list[int]:
    """Return the cells in the order of meshing: unchanged for a surface, along the curve for a curve."""
    cells = range(len(decomposition.cells))
    if decomposition.dimension == 2:
        return list(cells)
    return sorted(cells, key=lambda k: float(decomposition.knots[decomposition.polygons[k][0], 0]))


def _sides(polygon: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the knots at the ends of each edge of a polygon, or the two ends of a segment one by one."""
    if len(polygon) == 2:
        return [(polygon[0],), (polygon[1],)]
    return list(zip(polygon, (*polygon[1:], polygon[0]), strict=True))


def _joints(decomposition: RegularDecomposition, order: Sequence[int], cells: Sequence[Patch]) -> Joints:
    """Return the joints of the cells, found from the knots they share and not from the shape of their edges."""
    shared: list[Joint] = []
    seen: dict[tuple[int, ...], EdgeRef] = {}
    for index, k in enumerate(order):
        polygon = decomposition.polygons[k]
        corners, found = decomposition.knots[list(polygon)], cells[index].domain.vertices
        tolerance = CORNER_TOLERANCES * knot_tolerance(decomposition.knots)
        if found.shape != corners.shape or np.abs(found - corners).max() > tolerance:
            raise DomainError(
                f"lifting: cell {k} has a corner that is straight to rounding: knots that are meant to lie on a line, "
                "or their lifting values, are too inexact for a mesh that follows the cells"
            )
        for edge, knots in enumerate(_sides(polygon)):
            first = seen.setdefault(tuple(sorted(knots)), (index, edge))
            if first != (index, edge):
                shared.append(Joint(first, (index, edge), opposite=decomposition.dimension == 2))
    inner = {joint.first for joint in shared}
    return Joints(
        shared=tuple(shared),
        open=tuple(ref for ref in seen.values() if ref not in inner),
        collapsed=(),
        crowded=(),
        almost=(),
        flipped=(False,) * len(cells),
        one_sided=(),
    )


def _outer_faces(shape: Domain, decomposition: RegularDecomposition, order: Sequence[int]) -> IntArray:
    """Return (cells, faces) numbers of the smallest faces of Δ that contain each face of each cell."""
    sides = [_sides(decomposition.polygons[k]) for k in order]
    table = np.zeros((len(sides), 1 + 2 * max(map(len, sides))), dtype=np.int64)
    for cell, edges in enumerate(sides):
        parts = edges if shape.dimension == 1 else [*edges, *((start,) for start, _ in edges)]
        for face, knots in enumerate(parts, start=1):
            table[cell, face] = shape.faces.smallest(knots).number
    return table


def _other_knots(shape: Domain, decomposition: RegularDecomposition, order: Sequence[int]) -> Places:
    """Return the places of knots inside Δ that are not corners of cells."""
    corners = np.concatenate([np.array(polygon) for polygon in decomposition.polygons])
    others = np.setdiff1d(np.flatnonzero(~shape.incidence.any(axis=1)), corners)
    cell = np.argsort(order)[decomposition.locate(shape.knots[others])] if len(others) else others
    return Places(cell, shape.knots[others], np.full(len(others), INTERIOR))


def _borders(shape: Domain, cells: Sequence[Patch], faces: IntArray) -> BoolArray:
    """Return (cells, faces) whether each face of each cell is smaller than the face of Δ that contains it."""
    whole = np.array([face.dimension for face in shape.faces])[faces]
    own = np.full(faces.shape, shape.dimension)
    for row, cell in zip(own, cells, strict=True):
        row[: len(cell.domain.faces)] = [face.dimension for face in cell.domain.faces]
    return np.asarray(own < whole)


@frozen
class Vertices:
    """The vertices of a complex on the members of a family.

    Parameters
    ----------
    family : Family
    mosaic : Complex
    """

    family: Family
    mosaic: Complex

    def __iter__(self) -> Iterator[list[FloatArray]]:
        """(v, 3) points of some members at a time, in order, without the limit."""
        members = self.family.samplers[:-1]
        solved = self._continuation
        count = MAX_TOGETHER
        if solved is not None and self.family.degeneration is not None:
            knots = len(self.family.degeneration.gaps)
            count = min(max(BLOCK_NUMBERS // (knots * solved.count), 1), MAX_TOGETHER)
        for first in range(0, len(members), count):
            samplers = members[first : first + count]
            if solved is None or self.family.degeneration is None:
                yield from ([self.sampled(sampler)] for sampler in samplers)
                continue
            points, known = solved.at(self.family.degeneration.logarithms[first : first + count], ACCEPTED_RESIDUAL)
            for place, found, sampler in zip(points, known, samplers, strict=True):
                rows = np.flatnonzero(~found)
                if len(rows):
                    place[rows] = self.sampled(sampler, rows)
            yield list(points)

    def sampled(self, sampler: Sampler, rows: IntArray | slice = slice(None)) -> FloatArray:
        """(m, 3) points of one member at some vertices, or all."""
        return sampler.points(self.mosaic.patch[rows], self.mosaic.parameters[rows], self.mosaic.face[rows])

    @cached_property
    def _continuation(self) -> Continuation | None:
        one = self.family.degeneration
        if one is None or not len(one.logarithms) or len(self.mosaic.patch) > MAX_FOLLOWED_VERTICES:
            return None
        return Continuation(one.patch, one.gaps, one.places(self.mosaic), float(one.logarithms.max()))


def graded_complex(shape: Domain, resolution: int, finest: float) -> Complex:
    """Cut Δ around its centre into cells that become smaller towards its edges and corners.

    Parameters
    ----------
    shape : Domain
    resolution : int
        Cells along each edge.
    finest : float
        Width of the outermost cells, as a fraction of Δ's size; less than 1 / `resolution`.
    """
    part = triangulation(shape, resolution) if shape.dimension == 1 else central_triangulation(shape, resolution)
    v = shape.vertices
    steepness = 1.0
    for _ in range(50):
        steepness = math.log1p(steepness / (resolution * finest))
    if shape.dimension == 1:
        share = (part.parameters - v[0]) / (v[1] - v[0])
        u = v[0] + _both_ways(share, steepness) * (v[1] - v[0])
        u[part.boundary] = v[:, None]
    else:
        u = _towards_edges(v, part.parameters, steepness)
        sides = np.roll(v, -1, axis=0) - v
        share = _both_ways(np.arange(resolution) / resolution, steepness)
        u[part.boundary] = v[:, None] + share[None, :, None] * sides[:, None]
    return alone(shape, replace(part, parameters=u))


def _towards_edges(v: FloatArray, u: FloatArray, steepness: float) -> FloatArray:
    """Move (m, 2) points of a polygon along the rays from its centre, and these towards its corners."""
    center = v.mean(axis=0)
    sides = np.roll(v, -1, axis=0) - v
    normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
    # Shares of the way out to each edge's line; the largest says which edge the ray meets.
    shares = (u - center) @ (normals / ((v - center) * normals).sum(axis=1)[:, None]).T
    edge = shares.argmax(axis=1)
    ring = np.clip(shares.max(axis=1), 0.0, 1.0)
    side = sides[edge]
    outer = center + (u - center) / np.where(ring > 0, ring, 1.0)[:, None] - v[edge]
    place = np.clip((outer * side).sum(axis=1) / (side**2).sum(axis=1), 0.0, 1.0)
    target = v[edge] + _both_ways(place, steepness)[:, None] * side
    return np.asarray(center + (1 - _from_end(1 - ring, steepness))[:, None] * (target - center))


def _from_end(share: FloatArray, steepness: float) -> FloatArray:
    """Map [0, 1] to itself, with small steps near 0."""
    return np.asarray(np.expm1(steepness * share) / math.expm1(steepness))


def _both_ways(share: FloatArray, steepness: float) -> FloatArray:
    """Map [0, 1] to itself, with small steps near both ends."""
    half = _from_end(1 - np.abs(2 * share - 1), steepness) / 2
    return np.where(share < 0.5, half, 1 - half)


def _in_order(mosaic: Complex) -> Complex:
    """Return a curve's cells and vertices in their order along it, which refinement does not keep."""
    if mosaic.cells.shape[1] == 3:
        return mosaic
    cells = np.argsort(mosaic.corners[:, 0, 0], kind="stable")
    vertices = np.append(mosaic.cells[cells, 0], mosaic.cells[cells[-1], 1])
    steps = np.arange(len(cells))
    return Complex(
        patch=mosaic.patch[vertices],
        parameters=mosaic.parameters[vertices],
        face=mosaic.face[vertices],
        cells=np.stack([steps, steps + 1], axis=1),
        cell_patch=mosaic.cell_patch[cells],
        own_corners=mosaic.corners[cells],
        collapsed=mosaic.collapsed,
    )
