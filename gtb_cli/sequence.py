"""Families of patches as meshes with one list of faces: degenerations and knot limits, and how far each is from the end.

Vertices are placed by the linear parametrisation, in which a family converges point by point; with toric parameters they
would run together. The triangulation is that of the limit: for a degeneration it follows the regular decomposition.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.compare import surface_distance
from gtb_cli.complex import Complex, Sampler, joined_complex
from gtb_cli.domain import Domain, knot_tolerance
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.joints import EdgeRef, Joint, Joints
from gtb_cli.lifting import RegularDecomposition, regular_decomposition
from gtb_cli.limits import Film, KnotLimit, cells_of, degenerate, knot_limit, lifting_of, move_knots
from gtb_cli.mesh import Mesh
from gtb_cli.moment import LinearParametrization
from gtb_cli.patch import Patch
from gtb_cli.refinement import refine
from gtb_cli.tessellation import COARSEST, MAX_FACES, vertex_normals
from gtb_cli.triangulation import cell_count

INF = math.inf

MEASURED = {1: 1e-5, 2: 1e-3}
"""Chord error, as a fraction of the diagonal of the limit, of the meshes between which distances are measured."""

MEASURED_CELLS = {1: 64, 2: 4096}
"""Roughly the cells that those start from."""

MEASURED_FACES = 200_000
"""More are not made for measuring; then distances are between coarser meshes."""

FILM_CELLS = 64
"""Cells of a film along each of its sides."""


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """Meshes of a family of patches, and of its limit, which is the last.

    Attributes
    ----------
    name : str
    key : str
        What tells the meshes apart: "x" or "step".
    values : tuple of float
        Its values; for a degeneration the last is inf or 0, for a knot limit 1.
    meshes : tuple of Mesh
        All with the same cells.
    distances : tuple of float
        Two-sided distance of each surface from the limit, in model units; see `measured_distance`.
    film : Mesh or None
        What the limit as a set has beside its last mesh.
    film_distances : tuple of float or None
        Distances from the limit with its film, where it has one.
    """

    name: str
    key: str
    values: tuple[float, ...]
    meshes: tuple[Mesh, ...]
    distances: tuple[float, ...]
    film: Mesh | None = None
    film_distances: tuple[float, ...] | None = None

    def record(self, files: Sequence[str]) -> dict[str, Any]:
        """What `sequence.json` says of the meshes, written to these files."""
        entries = []
        for index, (file, value, mesh) in enumerate(zip(files, self.values, self.meshes, strict=True)):
            entry: dict[str, Any] = {
                "file": file,
                self.key: "inf" if value == INF else number(value),
                "vertices": len(mesh.vertices),
                "faces": len(mesh.cells),
                "distance_to_limit": self.distances[index],
            }
            if self.film_distances is not None:
                entry["distance_to_limit_with_film"] = self.film_distances[index]
            entries.append(entry)
        return {"name": self.name, "meshes": entries}


def number(value: float) -> float | int:
    """Return a float that is a whole number below 2⁵³ as an int, which JSON writes without a point."""
    return int(value) if value.is_integer() and abs(value) < 2**53 else value


def degeneration_sequence(
    patch: Patch,
    x: Iterable[float],
    lifting: ArrayLike | None = None,
    resolution: int = 32,
    tolerance: float | None = None,
    *,
    max_faces: int = MAX_FACES,
) -> MeshSequence:
    """Mesh the patches with weights x^λ ω, and the regular control curve or surface they tend to.

    Parameters
    ----------
    patch : Patch
    x : iterable of float
        All from 1 to inf, or all from 0 to 1: the limit is that way, and inf and 0 mean the limit itself. Put in order;
        repeated ones count once. None at all give the limit for x → ∞ only.
    lifting : (n,) float, optional
        λ; default the patch's own.
    resolution : int
        Cells along each edge of each cell of the regular decomposition; not used with a tolerance.
    tolerance : float, optional
        Largest distance from each surface, the limit included, to its mesh: one triangulation is refined until it is
        fine enough for all.
    max_faces : int
        Of all meshes together.

    Returns
    -------
    MeshSequence
        Vertex i of all meshes has the same parameter, a point of Δ: corners and edges of the regular decomposition are
        vertices and edges of the meshes.

    Raises
    ------
    DomainError
        x on both sides of 1, or not positive; no lifting.
    ToleranceError
        Too many faces.

    Notes
    -----
    On the borders of cells the limit has the data of the border alone.

    References
    ----------
    Thm 3.2, Thm 4.2, Ex. 3.4, Ex. 4.4.
    """
    values = sorted({float(value) for value in x})
    upward = _is_upward(values)
    exponents = lifting_of(patch, lifting)
    decomposition = regular_decomposition(patch.knots, exponents if upward else -exponents)
    limit = cells_of(patch, decomposition)
    order = _left_to_right(decomposition)
    cells = [limit.patches[k] for k in order]
    joints = _joints(decomposition, order, cells)
    faces = _outer_faces(patch.domain, decomposition, order)
    family: list[Sampler] = [
        _Whole(cells, "linear", True, whole=Sampler((degenerate(patch, value, exponents),), "linear", False), faces=faces)
        for value in (values if upward else values[::-1])
        if value not in (0.0, INF)
    ]
    family.append(Sampler(cells, "linear", True))
    kept = [value for value in values if value not in (0.0, INF)]
    return _sequence(
        patch.name or "patch",
        "x",
        (*(kept if upward else kept[::-1]), INF if upward else 0.0),
        family,
        joints,
        resolution,
        tolerance,
        max_faces,
    )


def knot_sequence(
    patch: Patch,
    moves: Mapping[int, int],
    steps: Iterable[float] = (),
    resolution: int = 32,
    tolerance: float | None = None,
    *,
    max_faces: int = MAX_FACES,
) -> MeshSequence:
    """Mesh the patches whose knots are on the way to others, and the merged patch.

    Parameters
    ----------
    patch : Patch
    moves : mapping of int to int
        As for `merge_knots`.
    steps : iterable of float
        From 0 to 1, which means the limit. Put in order; repeated ones count once.
    resolution, tolerance, max_faces
        As for `degeneration_sequence`.

    Returns
    -------
    MeshSequence
        Vertex i of all meshes has the same parameter, a point of Δ. With films where the convergence is not uniform.

    Raises
    ------
    DomainError
        Steps outside [0, 1], or moves that `merge_knots` refuses.
    ToleranceError
        Too many faces.

    References
    ----------
    Thm 3.1, Thm 4.1, Ex. 3.2, Ex. 3.3, Ex. 4.2.
    """
    limit = knot_limit(patch, moves)
    values = sorted({float(step) for step in steps} - {1.0})
    family = [Sampler((move_knots(patch, moves, step),), "linear", False) for step in values]
    family.append(Sampler((limit.merged,), "linear", False))
    return _sequence(
        patch.name or "patch",
        "step",
        (*values, 1.0),
        family,
        None,
        resolution,
        tolerance,
        max_faces,
        film=film_mesh(limit) if limit.films else None,
    )


def _sequence(
    name: str,
    key: str,
    values: tuple[float, ...],
    family: Sequence[Sampler],
    joints: Joints | None,
    resolution: int,
    tolerance: float | None,
    max_faces: int,
    film: Mesh | None = None,
) -> MeshSequence:
    patches = family[-1].patches
    most = max_faces // len(family)
    if tolerance is None:
        count = sum(cell_count(part.domain, resolution) for part in patches)
        if count > most:
            raise ToleranceError(
                f"{len(family)} meshes of {count} faces are more than {max_faces} faces: lower -n or raise --max-faces"
            )
        mosaic = joined_complex(patches, joints, resolution)
    else:
        mosaic = common_complex(coarsest_complex(patches, joints), family, tolerance, most)
    meshes = tuple(_mesh(mosaic, sampler, name) for sampler in family)
    start = joined_complex(patches, joints, _measuring_resolution(patches))
    distances = _Measurement(start, family[-1], film).distances(family)
    return MeshSequence(
        name,
        key,
        values,
        meshes,
        tuple(plain for plain, _ in distances),
        film,
        None if film is None else tuple(filmed for _, filmed in distances),
    )


def _is_upward(values: Sequence[float]) -> bool:
    for value in values:
        if not value >= 0:
            raise DomainError(f"x: must be positive, got {value!r}")
    if values and values[0] < 1 < values[-1]:
        raise DomainError(
            f"x: {values[0]:g} goes towards 0 and {values[-1]:g} towards infinity, where the limits differ: "
            "expected all at least 1, or all at most 1"
        )
    return not values or values[0] >= 1


def _left_to_right(decomposition: RegularDecomposition) -> list[int]:
    """Cells in the order of meshing: as they are, but those of a curve along it."""
    cells = range(len(decomposition.cells))
    if decomposition.dimension == 2:
        return list(cells)
    return sorted(cells, key=lambda k: float(decomposition.knots[decomposition.polygons[k][0], 0]))


def _joints(decomposition: RegularDecomposition, order: Sequence[int], cells: Sequence[Patch]) -> Joints:
    """How the cells are joined: by the knots they share, not by the shape of their edges."""
    shared, single = [], []
    seen: dict[tuple[int, ...], EdgeRef] = {}
    for index, k in enumerate(order):
        polygon = decomposition.polygons[k]
        corners = decomposition.knots[list(polygon)]
        found = cells[index].domain.vertices
        tolerance = 4 * knot_tolerance(decomposition.knots)
        if found.shape != corners.shape or np.abs(found - corners).max() > tolerance:
            raise DomainError(
                f"lifting: cell {k} has a corner that is straight to rounding; "
                "knots that are meant to be on a line, or their lifting values, are too inexact for a mesh"
            )
        for edge, knots in enumerate(_sides(polygon)):
            first = seen.setdefault(tuple(sorted(knots)), (index, edge))
            if first != (index, edge):
                shared.append(Joint(first, (index, edge), opposite=decomposition.dimension == 2))
    inner = {ref for joint in shared for ref in (joint.first, joint.second)}
    single = [ref for ref in seen.values() if ref not in inner]
    return Joints(tuple(shared), tuple(single), (), (), (), (False,) * len(cells), ())


def _sides(polygon: tuple[int, ...]) -> list[tuple[int, ...]]:
    """The knots at the ends of each edge of a polygon; of a segment, each end."""
    if len(polygon) == 2:
        return [(polygon[0],), (polygon[1],)]
    return list(zip(polygon, (*polygon[1:], polygon[0]), strict=True))


def _outer_faces(domain: Domain, decomposition: RegularDecomposition, order: Sequence[int]) -> IntArray:
    """(cells, faces) row of Δ's faces that holds each face of each cell; 0 where that is inside Δ."""
    sides = [_sides(decomposition.polygons[k]) for k in order]
    table = np.zeros((len(sides), 1 + 2 * max(map(len, sides))), dtype=np.int64)
    r = len(domain.vertices)
    for cell, edges in enumerate(sides):
        parts = edges if domain.dimension == 1 else [*edges, *((start,) for start, _ in edges)]
        for face, knots in enumerate(parts, start=1):
            on = np.flatnonzero(domain.incidence[list(knots)].all(axis=0))
            if len(on) == 1:
                table[cell, face] = 1 + on[0]
            elif len(on):
                table[cell, face] = 1 + r + int(np.flatnonzero(domain.faces[1 + r :, knots[0]])[0])
    return table


@dataclass(frozen=True, eq=False)
class _Whole(Sampler):
    """One patch, at parameters that are known by the cell of its limit they lie in, and the face of that cell."""

    whole: Sampler = field(kw_only=True)
    faces: IntArray = field(kw_only=True)

    def points(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        return self.whole.points(np.zeros_like(patch), parameters, self.faces[patch, face])

    def normals(self, patch: IntArray, parameters: FloatArray, face: IntArray) -> FloatArray:
        return self.whole.normals(np.zeros_like(patch), parameters, self.faces[patch, face])


def coarsest_complex(patches: Sequence[Patch], joints: Joints | None) -> Complex:
    """The complex with the fewest cells that can be refined."""
    for resolution in COARSEST:
        mosaic = joined_complex(patches, joints, resolution)
        if mosaic.is_simplicial:
            break
    return mosaic


def common_complex(start: Complex, family: Sequence[Sampler], tolerance: float, max_faces: int) -> Complex:
    """Refine a complex until it is fine enough for every member of a family."""
    mosaic, count = start, 0
    while len(mosaic.cells) > count:
        count = len(mosaic.cells)
        for sampler in reversed(family):
            mosaic, _ = refine(mosaic, sampler, tolerance, max_faces)
    return in_order(mosaic)


def in_order(mosaic: Complex) -> Complex:
    """A curve's cells and vertices in their order along it, which refinement does not keep."""
    if mosaic.cells.shape[1] == 3:
        return mosaic
    cells = np.argsort(mosaic.corners[:, 0, 0], kind="stable")
    vertices = np.append(mosaic.cells[cells, 0], mosaic.cells[cells[-1], 1])
    steps = np.arange(len(cells))
    return Complex(
        mosaic.patch[vertices],
        mosaic.parameters[vertices],
        mosaic.face[vertices],
        np.stack([steps, steps + 1], axis=1),
        mosaic.cell_patch[cells],
        mosaic.corners[cells],
        mosaic.collapsed,
    )


def _mesh(mosaic: Complex, sampler: Sampler, name: str) -> Mesh:
    where = mosaic.patch, mosaic.parameters, mosaic.face
    vertices = sampler.points(*where)
    normals = None
    if mosaic.cells.shape[1] == 3:
        normals = vertex_normals(sampler.normals(*where), vertices, mosaic.cells)
    return Mesh(vertices, mosaic.cells, parameters=mosaic.parameters, normals=normals, name=name)


def _measuring_resolution(patches: Sequence[Patch]) -> int:
    dimension = patches[0].dimension
    unit = sum(cell_count(patch.domain, 1) for patch in patches)
    return max(4, round((MEASURED_CELLS[dimension] / unit) ** (1 / dimension)))


class _Measurement:
    """Distances of surfaces from a limit.

    Both are meshed with the same triangulation, refined until either mesh is within `MEASURED` of its surface, and
    the Hausdorff distance between the meshes is taken (`surface_distance`: between cells, not vertices). So it is
    off by twice that chord error at most, and by far less where surface and limit are nearly the same, as then the
    meshes' errors are. It does not depend on the resolution of the meshes that are written.
    """

    def __init__(self, start: Complex, limit: Sampler, film: Mesh | None) -> None:
        self.limit, self.film = limit, film
        points = limit.points(start.patch, start.parameters, start.face)
        if film is not None:
            points = np.concatenate([points, film.vertices])
        self.tolerance = MEASURED[limit.patches[0].dimension] * float(np.linalg.norm(np.ptp(points, axis=0)))
        self.start = self.refined(start, limit)

    def refined(self, mosaic: Complex, sampler: Sampler) -> Complex:
        try:
            return refine(mosaic, sampler, self.tolerance, MEASURED_FACES)[0]
        except ToleranceError:
            return mosaic

    def distances(self, family: Sequence[Sampler]) -> list[tuple[float, float]]:
        """Each member's distance from the limit, and from the limit with its film; the last is the limit."""
        found = [self.distance(sampler) for sampler in family[:-1]]
        last = 0.0
        if self.film is not None:
            mesh = self.sampled(self.start, self.limit)
            last = surface_distance(mesh, _union(mesh, self.film)).value
        return [*found, (0.0, last)]

    def distance(self, sampler: Sampler) -> tuple[float, float]:
        mosaic = self.refined(self.start, sampler)
        surface, limit = self.sampled(mosaic, sampler), self.sampled(mosaic, self.limit)
        plain = surface_distance(surface, limit).value
        if self.film is None:
            return plain, plain
        return plain, surface_distance(surface, _union(limit, self.film)).value

    @staticmethod
    def sampled(mosaic: Complex, sampler: Sampler) -> Mesh:
        return Mesh(sampler.points(mosaic.patch, mosaic.parameters, mosaic.face), mosaic.cells)


def _union(a: Mesh, b: Mesh) -> Mesh:
    return Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.cells, b.cells + len(a.vertices)]))


def film_mesh(limit: KnotLimit, resolution: int = FILM_CELLS) -> Mesh:
    """Mesh the films of a knot limit: segments for a curve, triangles for a surface.

    Parameters
    ----------
    limit : KnotLimit
        With films.
    resolution : int
        Cells along each side of each film.
    """
    meshes = [_film_piece(film, limit.patch.dimension, resolution) for film in limit.films]
    offsets = np.cumsum([0] + [len(points) for points, _ in meshes])
    cells = np.concatenate([part + offset for (_, part), offset in zip(meshes, offsets[:-1], strict=True)])
    return Mesh(np.concatenate([points for points, _ in meshes]), cells, name="film")


def _film_piece(film: Film, dimension: int, n: int) -> tuple[FloatArray, IntArray]:
    levels = np.arange(n + 1) / n
    steps = np.arange(n)
    if dimension == 1:
        return film.points(levels[:, None]), np.stack([steps, steps + 1], axis=1)
    if film.along is None:
        first, second = np.meshgrid(levels, levels, indexing="ij")
        points = film.points(np.column_stack([first.ravel(), second.ravel()]))
    else:
        points = np.concatenate([_section_points(film.section(z), n) for z in levels.tolist()])
    row, column = (index.ravel() for index in np.mgrid[:n, :n])
    a = row * (n + 1) + column
    b, c, d = a + 1, a + n + 2, a + n + 1
    return points, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)


def _section_points(section: Patch, n: int) -> FloatArray:
    start, end = section.domain.vertices[:, 0]
    t = start + (end - start) * (np.arange(n + 1) / n)
    t[-1] = end
    where = LinearParametrization(section.domain, section.log_products).locations(t[:, None])
    return section.points_at(where, n + 1)
