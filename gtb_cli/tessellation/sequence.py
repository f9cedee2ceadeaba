"""Families of patches as meshes with one list of faces: degenerations, knot limits, and their distances from the end.

Vertices are placed by the linear parametrisation, in which a family converges point by point; toric parameters would
run together. The triangulation is that of the limit: for a degeneration it follows the regular decomposition.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.meshes.compare import surface_distance
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.complex import Complex, Sampler
from gtb_cli.tessellation.family import Family, approaching, degenerating
from gtb_cli.tessellation.film import film_mesh
from gtb_cli.tessellation.lattice import POINTS_IN_ALL
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.tessellate import vertex_normals
from gtb_cli.tessellation.triangulation import cell_count_of
from gtb_cli.theory.degeneration import lifting_of
from gtb_cli.theory.knot_limit import knot_limit, move_knots
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import MAX_FACES

INF = math.inf

FILM_ACCURACY = 0.25
"""Error of the distance from a film beside that of the meshes, as a fraction of it."""

COARSEST_MEASURED = 4
"""Least segments along each edge of the meshes that are measured."""

MEASURED_FACES = 200_000
"""More are not made for measuring; then distances are between coarser meshes."""


@dataclass(frozen=True)
class Accuracy:
    """How finely distances from a limit are measured.

    Attributes
    ----------
    chord_error : float
        That of the meshes between which distances are measured, as a fraction of the diagonal of the limit.
    cells : int
        Roughly what those meshes start from.
    points_in_all : int
        As of `refine`.
    """

    chord_error: float
    cells: int
    points_in_all: int = POINTS_IN_ALL


ACCURACY = {1: Accuracy(1e-5, 64), 2: Accuracy(1e-3, 4096)}
"""What is used for curves and for surfaces."""


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
        Distances from the limit with its film, where it has one. That of the last mesh, which is the limit without
        it, tells how far the film reaches from it; the distances of the others from the limit tend to that, not to 0.
    doubts : tuple of (float, str)
        Values whose distances could not be measured as finely as they should be, and why.
    """

    name: str
    key: str
    values: tuple[float, ...]
    meshes: tuple[Mesh, ...]
    distances: tuple[float, ...]
    film: Mesh | None = None
    film_distances: tuple[float, ...] | None = None
    doubts: tuple[tuple[float, str], ...] = ()

    def record(self, names: Sequence[str], kind: str = "file") -> dict[str, Any]:
        """What `sequence.json` says of the meshes; they have these names, of files or of what `kind` says."""
        entries = []
        for index, (name, value, mesh) in enumerate(zip(names, self.values, self.meshes, strict=True)):
            entry: dict[str, Any] = {
                kind: name,
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
    normals: bool = True,
    max_faces: int = MAX_FACES,
    accuracy: Accuracy | None = None,
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
    normals : bool
        Give surfaces their unit normals.
    max_faces : int
        Of all meshes together.
    accuracy : Accuracy, optional
        That of the distances; default `ACCURACY`.

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
    values = [value for value in values[:: 1 if upward else -1] if value not in (0.0, INF)]
    exponents = lifting_of(patch, lifting)
    decomposition = regular_decomposition(patch.knots, exponents if upward else -exponents)
    # Before there is a patch for each value and cell: both may be thousands.
    n = resolution if tolerance is None else 1
    cells = sum(cell_count_of(len(polygon), n) for polygon in decomposition.polygons)
    _refuse_too_many(cells, len(values) + 1, max_faces)
    family = degenerating(patch, [abs(math.log(value)) for value in values], decomposition)
    measurement = _Measurement(family, None, accuracy or ACCURACY[patch.dimension])
    values.append(INF if upward else 0.0)
    return _sequence(patch.name or "patch", "x", values, measurement, resolution, tolerance, normals, max_faces)


def knot_sequence(
    patch: Patch,
    moves: Mapping[int, int],
    steps: Iterable[float] = (),
    resolution: int = 32,
    tolerance: float | None = None,
    *,
    normals: bool = True,
    max_faces: int = MAX_FACES,
    accuracy: Accuracy | None = None,
) -> MeshSequence:
    """Mesh the patches whose knots are on the way to others, and the merged patch.

    Parameters
    ----------
    patch : Patch
    moves : mapping of int to int
        As for `merge_knots`.
    steps : iterable of float
        From 0 to 1, which means the limit. Put in order; repeated ones count once.
    resolution, tolerance, normals, max_faces, accuracy
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
    thickness = [limit.nearness(step) for step in values] if limit.films else []
    family = approaching([move_knots(patch, moves, step) for step in values], limit.merged, thickness)
    film = film_mesh(limit) if limit.films else None
    values.append(1.0)
    measurement = _Measurement(family, film, accuracy or ACCURACY[patch.dimension])
    return _sequence(patch.name or "patch", "step", values, measurement, resolution, tolerance, normals, max_faces)


def _sequence(
    name: str,
    key: str,
    values: Sequence[float],
    measurement: _Measurement,
    resolution: int,
    tolerance: float | None,
    normals: bool,
    max_faces: int,
) -> MeshSequence:
    family, film = measurement.family, measurement.film
    if tolerance is None:
        _refuse_too_many(family.cell_count(resolution), len(values), max_faces)
        mosaic = family.uniform(resolution)
    else:
        mosaic = family.refined(tolerance, max_faces // len(values))
    meshes = tuple(_mesh(mosaic, sampler, name, normals) for sampler in family.samplers)
    distances, film_distances, doubts = [], [], []
    for member, value in enumerate(values):
        plain, filmed, doubt = measurement.distances(member)
        distances.append(plain)
        film_distances.append(filmed)
        doubts += [(value, doubt)] if doubt else []
    return MeshSequence(
        name,
        key,
        tuple(values),
        meshes,
        tuple(distances),
        film,
        None if film is None else tuple(film_distances),
        tuple(doubts),
    )


def _refuse_too_many(cells: int, meshes: int, max_faces: int) -> None:
    if cells * meshes > max_faces:
        raise ToleranceError(
            f"{meshes} meshes of {cells} faces have more than {max_faces}: lower -n or raise --max-faces"
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


def _mesh(mosaic: Complex, sampler: Sampler, name: str, normals: bool) -> Mesh:
    where = mosaic.patch, mosaic.parameters, mosaic.face
    vertices = sampler.points(*where)
    directions = None
    if normals and mosaic.cells.shape[1] == 3:
        directions = vertex_normals(sampler.normals(*where), vertices, mosaic.cells)
    return Mesh(vertices, mosaic.cells, parameters=mosaic.parameters, normals=directions, name=name)


class _Measurement:
    """Distances of surfaces from a limit.

    Both are meshed with the same triangulation, refined until either mesh is within a chord error of its surface, and
    the Hausdorff distance between the meshes is taken (`surface_distance`: between cells, not vertices). So it is
    off by twice that chord error at most, and by far less where surface and limit are nearly the same, as then the
    meshes' errors are. It does not depend on the resolution of the meshes that are written.
    """

    def __init__(self, family: Family, film: Mesh | None, accuracy: Accuracy) -> None:
        self.family, self.film, self.accuracy = family, film, accuracy
        self.starts: dict[float, tuple[Complex, str]] = {}
        share = accuracy.cells / family.cell_count(1)
        self.resolution = max(COARSEST_MEASURED, math.floor(share ** (1 / family.dimension)))
        start = family.uniform(self.resolution)
        points = family.limit.points(start.patch, start.parameters, start.face)
        if film is not None:
            points = np.concatenate([points, film.vertices])
        self.tolerance = accuracy.chord_error * float(np.linalg.norm(np.ptp(points, axis=0)))

    def distances(self, member: int) -> tuple[float, float, str]:
        """A member's distance from the limit, from the limit with its film, and what is doubtful about them."""
        limit, sampler = self.family.limit, self.family.samplers[member]
        mosaic, doubt = self.fine_for_limit(member)
        mosaic, other_doubt = self.refined(mosaic, sampler)
        ends = self.sampled(mosaic, limit)
        surface = ends if sampler is limit else self.sampled(mosaic, sampler)
        plain = 0.0 if sampler is limit else surface_distance(surface, ends).value
        filmed = plain
        if self.film is not None:
            # Cells of the surface and of the film do not match, so that more would cost much.
            filmed = surface_distance(surface, _union(ends, self.film), FILM_ACCURACY * self.tolerance).value
        return plain, filmed, doubt or other_doubt

    def fine_for_limit(self, member: int) -> tuple[Complex, str]:
        """The complex that a member's measurement starts from."""
        thickness = self.family.thickness[member] if self.family.thickness else 0.0
        if thickness not in self.starts:
            start = self.family.graded(self.resolution, member)
            self.starts[thickness] = self.refined(start, self.family.limit)
        return self.starts[thickness]

    def refined(self, mosaic: Complex, sampler: Sampler) -> tuple[Complex, str]:
        """The complex fine enough for a surface, or else as it is, and why."""
        try:
            return refine(mosaic, sampler, self.tolerance, MEASURED_FACES, self.accuracy.points_in_all)[0], ""
        except ToleranceError as error:
            return mosaic, str(error)

    @staticmethod
    def sampled(mosaic: Complex, sampler: Sampler) -> Mesh:
        return Mesh(sampler.points(mosaic.patch, mosaic.parameters, mosaic.face), mosaic.cells)


def _union(a: Mesh, b: Mesh) -> Mesh:
    return Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.cells, b.cells + len(a.vertices)]))
