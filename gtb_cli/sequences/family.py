"""Families of patches that tend to a limit, meshed on one complex that follows the limit; and films as meshes."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, shifted
from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import RegularDecomposition
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.knots.even_triangulation import triangulation
from gtb_cli.knots.hull import border_of, knot_tolerance
from gtb_cli.limits.degeneration import cells_of
from gtb_cli.limits.knot_limit import KnotLimit, move_knots
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.joints import Joint, Joints, unjoined
from gtb_cli.moment.solve import TARGET_RESIDUAL, LogSum, solve
from gtb_cli.moment.torus import shares
from gtb_cli.tessellation.complexes import Complex, coarse_complexes, joined_complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.edges import EdgeRef
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen


@frozen
class Family:
    """Patches with the same Δ in their linear parametrisations, and their limit."""

    # One for each patch, the limit last. All take parameters with the patch of the limit in which they lie, and the
    # face of that patch's domain.
    samplers: tuple[Sampler, ...]
    members: tuple[Patch | None, ...]  # without the limit; None for a member that is the limit to rounding
    joints: Joints  # of the patches of the limit
    faces: IntArray | None = None  # (c, f) faces of Δ that hold each face of each patch of the limit; None for one
    filmed: KnotLimit | None = None  # the limit, if as a set it has films beside the merged patch

    @property
    def limit(self) -> Sampler:
        """The sampler of the limit."""
        return self.samplers[-1]

    @cached_property
    def film(self) -> Mesh | None:
        """A mesh of the films, if there are any."""
        return None if self.filmed is None else film_mesh(self.filmed)

    def uniform(self, resolution: int) -> Complex:
        """Return the complex with `resolution` cells along each edge of each patch of the limit."""
        return joined_complex(self.limit.patches, self.joints, resolution)

    def refined(self, tolerance: float, max_faces: int) -> Complex:
        """Refine the coarsest complex until it is within a tolerance of every member; at most `max_faces` in all."""
        max_cells = max_faces // len(self.samplers)
        mosaic, count = next(coarse_complexes(self.limit.patches, self.joints)), 0
        while len(mosaic.cells) > count:
            count = len(mosaic.cells)
            for sampler in reversed(self.samplers):
                mosaic, _ = refine(mosaic, sampler, tolerance, max_cells)
        if mosaic.cells.shape[1] == 3:
            return mosaic
        # Refinement does not keep the order along a curve.
        order = np.argsort(mosaic.corners[:, 0, 0], kind="stable")
        vertices = np.append(mosaic.cells[order, 0], mosaic.cells[order[-1], 1])
        patch, parameters, face = mosaic.patch[vertices], mosaic.parameters[vertices], mosaic.face[vertices]
        cells = np.arange(len(order))[:, None] + np.arange(2)
        cell_patch, corners = mosaic.cell_patch[order], mosaic.corners[order]
        return Complex(patch, parameters, face, cells, cell_patch, corners, mosaic.collapsed)


def approaching(limit: KnotLimit, steps: Sequence[float]) -> Family:
    """Patches at some steps of a knot limit, and the merged one."""
    members = tuple(move_knots(limit.patch, limit.moves, step) for step in steps)
    samplers = tuple(Sampler((patch,)) for patch in (*members, limit.merged))
    return Family(samplers, members, unjoined(limit.merged), filmed=limit if limit.films else None)


def degenerating(patch: Patch, logarithms: Sequence[float], decomposition: RegularDecomposition) -> Family:
    """Patches with the weights e^{l λ} ω for some l ≥ 0, and the regular control surface of the decomposition by λ."""
    least_exponent = 40.0  # by which knots outside a cell are below it on a member that is the limit to rounding
    order = list(range(len(decomposition.cells)))
    if decomposition.dimension == 1:  # along the curve
        order.sort(key=lambda k: float(decomposition.knots[decomposition.polygons[k][0], 0]))
    limit = cells_of(patch, decomposition).patches
    cells = [limit[k] for k in order]
    joints = _joints(decomposition, order, cells)
    faces = _outer_faces(patch.domain, decomposition, order)
    gaps = [decomposition.gaps(k) for k in order]
    least_gap = min((float(gap.min(where=gap > 0, initial=np.inf)) for gap in gaps), default=np.inf)
    samplers, members = list[Sampler](), list[Patch | None]()
    for logarithm in logarithms:
        # An affine lifting changes no point; the gaps, 0 on the cell itself, keep all digits there.
        wholes = [patch.replace(log_weights=patch.log_weights - logarithm * gap) for gap in gaps]
        samplers.append(Sampler(wholes, parts=[cell.domain for cell in cells], faces=faces))
        members.append(wholes[0] if logarithm * least_gap < least_exponent else None)
    return Family((*samplers, Sampler(cells)), tuple(members), joints, faces)


def _sides(polygon: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the knots at the ends of each edge of a polygon, or the two ends of a segment one by one."""
    return [(polygon[0],), (polygon[1],)] if len(polygon) == 2 else [*border_of(polygon)]


def _joints(decomposition: RegularDecomposition, order: Sequence[int], cells: Sequence[Patch]) -> Joints:
    """Return the joints of the cells, found from the knots they share and not from the shape of their edges."""
    shared: list[Joint] = []
    seen: dict[tuple[int, ...], EdgeRef] = {}
    for index, k in enumerate(order):
        polygon = decomposition.polygons[k]
        corners, found = decomposition.knots[list(polygon)], cells[index].domain.vertices
        tolerance = 4.0 * knot_tolerance(decomposition.knots)  # also of the corners of the domain's hull
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
    alone = tuple(ref for ref in seen.values() if ref not in inner)
    return Joints(tuple(shared), alone, (), (), (), flipped=(False,) * len(cells), one_sided=())


def _outer_faces(shape: Domain, decomposition: RegularDecomposition, order: Sequence[int]) -> IntArray:
    """Return (cells, faces) numbers of the smallest faces of Δ that contain each face of each cell."""
    sides = [_sides(decomposition.polygons[k]) for k in order]
    table = np.zeros((len(sides), 1 + 2 * max(map(len, sides))), dtype=np.int64)
    for cell, edges in enumerate(sides):
        parts = edges if shape.dimension == 1 else [*edges, *((start,) for start, _ in edges)]
        for face, knots in enumerate(parts, start=1):
            table[cell, face] = shape.faces.smallest(knots).number
    return table


def film_mesh(limit: KnotLimit) -> Mesh:
    """Mesh the films of a knot limit that has some: segments for a curve, triangles for a surface."""
    segment, square = [0, 1], [[0, 0], [1, 0], [1, 1], [0, 1]]
    levels, n = (segment, 1024) if limit.patch.dimension == 1 else (square, 64)  # and cells along each side of a film
    part = triangulation(domain(levels), n)
    points = []
    for film in limit.films:
        if film.along is None:
            points.append(film.points(part.parameters[:, ::-1]))
        else:
            log_weights = film.log_weights((np.arange(n + 1) / n)[:, None])
            points.append(_section_points(film.along, log_weights, film.control_points, n))
    cells = [shifted(part.cells, k * len(part.parameters)) for k in range(len(points))]
    vertices, triangles = np.concatenate(points), np.concatenate(cells)
    # Sections share the corners that no knot reaches, so there is no cell there.
    distinct = (vertices[triangles] != vertices[np.roll(triangles, 1, axis=1)]).any(axis=2)
    return Mesh(vertices, triangles[distinct.all(axis=1)], name="film")


def _section_points(along: FloatArray, log_weights: FloatArray, control_points: FloatArray, n: int) -> FloatArray:
    """Sample curves with (l, k) logarithms of weights at n + 1 evenly spaced linear parameters: (l (n + 1), 3)."""
    x = (along - along.min()) / np.ptp(along)
    t = np.tile(np.arange(1, n) / n, len(log_weights))
    weights = np.repeat(log_weights.T, n - 1, axis=1)
    # Points that are not found stay where the solver left them: on the film, too.
    s, _ = solve(LogSum(x[:, None] - 0.5, weights), t[None] - 0.5, np.log(t / (1 - t))[None], TARGET_RESIDUAL)
    inner = shares((x[:, None] - 0.5) * s + weights).T.reshape(len(log_weights), n - 1, -1)
    ends = [shares(np.where(x == end, log_weights, -np.inf).T).T[:, None] for end in (0, 1)]
    return np.concatenate([ends[0], inner, ends[1]], axis=1).reshape(-1, len(x)) @ control_points
