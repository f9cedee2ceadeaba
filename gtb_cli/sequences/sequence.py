"""Families of patches as meshes with one list of faces: degenerations, knot limits; files: `sequence_folder`.

Vertices are placed by the linear parametrisation, in which a family converges point by point; toric parameters would
run together. The triangulation is that of the limit: for a degeneration it follows the regular decomposition.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.knots.convergence import convergence_rate
from gtb_cli.knots.decomposition import RegularDecomposition, regular_decomposition
from gtb_cli.knots.even_triangulation import cell_count
from gtb_cli.language.spec_paths import of_patch
from gtb_cli.limits.degeneration import lifting_of
from gtb_cli.limits.knot_limit import knot_limit
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.meshes.shading import Normals, filled_normals
from gtb_cli.sequences.family import Family, approaching, degenerating
from gtb_cli.sequences.measurement import ACCURACY, Accuracy, Measurement
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.tessellation.tessellate import refuse_faces
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen
from gtb_cli.vocabulary import MAX_FACES


@frozen
class Member:
    """One mesh of a sequence; distances are two-sided, in model units, and None where they are not measured."""

    value: float  # its x or step
    mesh: Mesh
    distance: float | None  # of the surface from the limit
    # From the limit with its film, where it has one. That of the last mesh, which is the limit without it, tells how
    # far the film reaches from it; the distances of the others from the limit tend to that, not to 0.
    film_distance: float | None
    distance_error: float | None  # of both distances, as far as samples tell; None where they are doubtful, too
    doubt: str  # why the distances could not be measured as finely as they should be, or nothing


@frozen
class MeshSequence:
    """Meshes of a family of patches and, last, of its limit, made one by one on request.

    Iterating keeps none of them, and the last digits may differ the next time; `members` makes and keeps all.
    """

    name: str
    key: str  # the parameter that differs between meshes: "x" or "step"
    values: tuple[float, ...]  # of the parameter; the last is inf or 0 for a degeneration, and 1 for a knot limit
    _family: Family
    _mosaic: Complex
    _accuracy: Accuracy | None
    _normals: bool
    _decomposition: RegularDecomposition | None = None  # of a degeneration

    def __len__(self) -> int:
        return len(self.values)

    @cached_property
    def film(self) -> Mesh | None:
        """The part of the limit as a set that the last mesh lacks."""
        return self._family.film

    def __iter__(self) -> Iterator[Member]:
        together = 32  # members that are made, and measured, before the first of them is handed out
        measurement = None if self._accuracy is None else Measurement(self._family, self._accuracy)
        for first in range(0, len(self), together):
            members = range(first, min(first + together, len(self)))
            meshes = [self._mesh(self._family.samplers[k]) for k in members]
            found = [(None, None, None, "")] * len(members) if measurement is None else measurement.distances(members)
            for k, mesh, (plain, filmed, error, doubt) in zip(members, meshes, found, strict=True):
                yield Member(self.values[k], mesh, plain, filmed if self._family.filmed else None, error, doubt)

    def _mesh(self, sampler: Sampler) -> Mesh:
        cells, where = self._mosaic.cells, (self._mosaic.patch, self._mosaic.parameters, self._mosaic.face)
        vertices = sampler.points(*where)

        def normals() -> Normals:
            found = sampler.normals(*where)
            return Normals(filled_normals(found, vertices, cells), None, not np.isnan(found).any())

        has_normals = self._normals and cells.shape[1] == 3
        return Mesh(vertices, cells, parameters=where[1], normals=normals if has_normals else None, name=self.name)

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """All meshes with their distances; all have the same cells."""
        return tuple(self)

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """Meshes of the members."""
        return tuple(member.mesh for member in self.members)

    @property
    def distances(self) -> tuple[float, ...]:
        """Distances of the members from the limit; empty if they are not measured."""
        return tuple(member.distance for member in self.members if member.distance is not None)

    @property
    def film_distances(self) -> tuple[float, ...] | None:
        """Distances from the limit with its film; None if there is no film, or they are not measured."""
        return tuple(member.film_distance for member in self.members if member.film_distance is not None) or None

    @cached_property
    def predicted_rate(self) -> float | None:
        """The exponent ρ with which distances fall at least, by the theory; None if there is none, or it is not known.

        For x → ∞ and x → 0 it is the `convergence_rate` of the lifting. Knots that merge without a film change every
        point by O(1 − step).
        """
        if self._decomposition is None:
            return None if self._family.filmed else 1.0
        found = math.nan
        with suppress(ToleranceError):
            found = convergence_rate(self._decomposition)
        return found if 0 < found < math.inf else None

    def entry(self, member: Member, name: str) -> dict[str, Any]:
        """Return the entry of a mesh in `sequence.json`, by the name of its file."""
        entry: dict[str, Any] = {
            "file": name,
            # A whole number below 2⁵³ as an int, which JSON writes without a point
            self.key: "inf" if (x := member.value) == math.inf else int(x) if x.is_integer() and abs(x) < 2**53 else x,
            "vertices": len(member.mesh.vertices),
            "faces": len(member.mesh.cells),
            "distance_to_limit": member.distance,
            "distance_error": member.distance_error,
        }
        if self._family.filmed:
            entry["distance_to_limit_with_film"] = member.film_distance
        return entry

    def record(self, entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Return the content of `sequence.json`, with the entries of all meshes."""
        predicted = self.predicted_rate if self._accuracy and len(entries) > 1 else None
        return {"name": self.name, "meshes": list(entries), "rate": {"predicted": predicted}}


@of_patch
def degeneration(
    patch: Patch,
    xs: Iterable[float],
    lifting: ArrayLike | None = None,
    resolution: int = 32,
    tolerance: float | None = None,
    *,
    normals: bool = True,
    max_faces: int = MAX_FACES,
    accuracy: Accuracy | None = None,
    distances: bool = True,
) -> MeshSequence:
    """Mesh the patches with weights x^λ ω, and their limit, the regular control curve or surface (Thm 3.2, Thm 4.2).

    Vertex i has the same parameter, a point of Δ, in all meshes: corners and edges of the regular decomposition are
    vertices and edges of the meshes. On the border of a cell, the limit depends only on the data of the border.

    Parameters
    ----------
    patch : Patch
    xs : iterable of float
        All from 1 to inf, or all from 0 to 1; inf or 0 is the limit itself. They are sorted, and repeated ones count
        once; without any, only the limit for x → ∞ is made.
    lifting : (n,) float, optional
        λ, by default the patch's own.
    resolution : int
        Cells along each edge of each cell of the regular decomposition.
    tolerance : float, optional
        One triangulation is refined instead until it is fine enough for all surfaces, the limit included.
    normals, distances : bool
        Whether meshes have normals, and distances from the limit are measured, which takes longer than the meshes.
    max_faces : int
        Of all meshes together.
    accuracy : Accuracy, optional
        Of the distances.

    Returns
    -------
    MeshSequence
        ``found.meshes`` and ``found.distances``, or the members one by one by iteration.

    Raises
    ------
    DomainError
        Some x are on both sides of 1, or not positive, or there is no lifting.
    ToleranceError
        There are too many faces.
    """
    values = sorted({float(value) for value in xs})
    if wrong := [value for value in values if not value >= 0]:
        raise DomainError(f"x: must be positive, got {wrong[0]!r}")
    if values and values[0] < 1 < values[-1]:
        both = f"{values[0]:g} goes towards 0 and {values[-1]:g} towards infinity, where the limits differ"
        raise DomainError(f"x: {both}: expected all at least 1, or all at most 1")
    upward = not values or values[0] >= 1
    values = [value for value in values[:: 1 if upward else -1] if value not in (0.0, math.inf)]
    exponents = lifting_of(patch, lifting)
    decomposition = regular_decomposition(patch.knots, exponents if upward else -exponents)
    # Checked before there is a patch for each value and cell: there may be thousands of both.
    n = resolution if tolerance is None else 1
    cells = sum(cell_count(len(polygon), n) for polygon in decomposition.polygons)
    refuse_faces(cells * (len(values) + 1), n, max_faces, len(values) + 1)
    family = degenerating(patch, [abs(math.log(value)) for value in values], decomposition)
    mosaic = family.uniform(resolution) if tolerance is None else family.refined(tolerance, max_faces)
    fineness = (accuracy or ACCURACY[patch.dimension]) if distances else None
    xs = (*values, math.inf if upward else 0.0)
    return MeshSequence(patch.name or "patch", "x", xs, family, mosaic, fineness, normals, decomposition)


@of_patch
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
    distances: bool = True,
) -> MeshSequence:
    """Mesh the patches whose knots are on the way to others, as `merge_knots` takes the moves, and the merged patch.

    Steps are from 0 to 1, which is the limit. They are sorted, and repeated ones count once. Other arguments are those
    of `degeneration`. Vertex i of all meshes has the same parameter, a point of Δ. There are films where the
    convergence is not uniform (Thm 3.1, Thm 4.1, Ex. 3.2, Ex. 3.3, Ex. 4.2).

    Raises `DomainError` for steps outside [0, 1], or moves that `merge_knots` refuses, and `ToleranceError` for too
    many faces.
    """
    limit = knot_limit(patch, moves)
    values = sorted({float(step) for step in steps} - {1.0})
    family = approaching(limit, values)
    if tolerance is None:
        meshes = len(values) + 1
        refuse_faces(cell_count(limit.merged.domain, resolution) * meshes, resolution, max_faces, meshes)
    mosaic = family.uniform(resolution) if tolerance is None else family.refined(tolerance, max_faces)
    fineness = (accuracy or ACCURACY[patch.dimension]) if distances else None
    return MeshSequence(patch.name or "patch", "step", (*values, 1.0), family, mosaic, fineness, normals)
