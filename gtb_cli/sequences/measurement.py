"""Distances of the members of a family from its limit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtb_cli.arrays import shifted
from gtb_cli.distances.between_shapes import cells_along_edges, layered
from gtb_cli.distances.search import FarthestSearch
from gtb_cli.distances.strata import Surface, surface_of
from gtb_cli.errors import ToleranceError
from gtb_cli.meshes.hausdorff import mesh_distance
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.sequences.family import Family
from gtb_cli.tessellation.complexes import Complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.refinement_samples import MIN_SAMPLES
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.patch import Patch

LEAST_RESOLUTION = 4  # segments along each edge of what is measured


@dataclass(frozen=True)
class Accuracy:
    """The accuracy with which distances from a limit are measured."""

    chord_error: float  # of meshes between which distances from films are measured, as a fraction of the diagonal
    cells: int  # rough number from which the meshes are refined
    points_in_all: int = MIN_SAMPLES  # see `refine`


ACCURACY = {1: Accuracy(1e-5, 64), 2: Accuracy(1e-3, 4096)}  # the accuracy for curves and for surfaces


class Measurement:
    """Distances of surfaces from a limit, whatever the resolution of the meshes that are written.

    They are found on the surfaces themselves or, from films, which have no torus coordinates, between meshes. Surface
    and limit then have the same triangulation, refined until each mesh is within the chord error of its surface. Their
    distance is off by at most twice the chord error.
    """

    def __init__(self, family: Family, accuracy: Accuracy) -> None:
        self.family, self.accuracy = family, accuracy

    def distances(self, members: range) -> Iterator[tuple[float, float, float | None, str]]:
        """Yield each member's distances from the limit and from the limit with its film, their error, and a doubt."""
        if self.family.filmed:
            yield from map(self.between_meshes, members)
            return
        near = {k: patch for k, patch in enumerate(self.family.members) if patch is not None and k in members}
        surfaces = [self.limit, *self.surfaces([*near.values()])]
        ways = [(row, 0) for row in range(1, len(surfaces))] + [(0, row) for row in range(1, len(surfaces))]
        known: dict[int, tuple[float, float]] = {}
        if near:
            found, _, errors = FarthestSearch(surfaces, ways, len(near)).farthest()
            known = dict(zip(near, zip(found.tolist(), errors.tolist(), strict=True), strict=True))
        for member in members:
            distance, error = known.get(member, (0.0, 0.0))
            yield distance, distance, error, ""

    @cached_property
    def rough(self) -> Complex:
        """The complex from whose vertices and middles the search for distances between surfaces starts."""
        cells, many = 512, 64  # in all, and patches of the limit that have enough points anyway
        patches = self.family.limit.patches
        return self.family.uniform(cells_along_edges(patches, cells, LEAST_RESOLUTION if len(patches) < many else 1))

    @cached_property
    def limit(self) -> Surface:
        """The limit, with points all over it."""
        patches = self.family.limit.patches
        return surface_of(patches, self.rough if self.family.faces is not None else layered(self.rough, patches))

    def surfaces(self, members: Sequence[Patch]) -> list[Surface]:
        """Return members with points all over them, and more in the thin layers along edges while knots move."""
        rough, faces = self.rough, self.family.faces
        if faces is None:
            return [surface_of([member], layered(rough, [member])) for member in members]
        patch, cell_patch, face = 0 * rough.patch, 0 * rough.cell_patch, faces[rough.patch, rough.face]
        whole = replace(rough, patch=patch, face=face, cell_patch=cell_patch, own_corners=rough.corners)  # over Δ
        return [surface_of([member], whole) for member in members]

    def between_meshes(self, member: int) -> tuple[float, float, float | None, str]:
        """Measure a member as `distances` does, from a limit with a film, between meshes within the chord error."""
        film_error = 0.25  # as a fraction of the chord error: cells of surface and film do not match
        limit, sampler, film = self.family.limit, self.family.samplers[member], self.family.film
        assert film is not None
        start, doubt = self.start
        mosaic, other_doubt = self.refined(start, sampler)
        where = mosaic.patch, mosaic.parameters, mosaic.face
        ends = Mesh(limit.points(*where), mosaic.cells)
        surface = ends if sampler is limit else Mesh(sampler.points(*where), mosaic.cells)
        cells = np.concatenate([ends.cells, shifted(film.cells, len(ends.vertices))])
        both = Mesh(np.concatenate([ends.vertices, film.vertices]), cells)
        found = mesh_distance(surface, both, film_error * self.tolerance)
        plain = found if sampler is limit else mesh_distance(surface, ends)
        error = 2 * self.tolerance + max(found.error, plain.error)
        doubt = doubt or other_doubt
        return 0.0 if sampler is limit else plain.distance, found.distance, None if doubt else error, doubt

    @cached_property
    def start(self) -> tuple[Complex, str]:
        """The complex on which the limit is within the chord error; a coarse one, and why, if it has too many faces."""
        return self.refined(self.coarse, self.family.limit)

    @cached_property
    def tolerance(self) -> float:
        """The chord error in model units."""
        points = self.family.limit.points(self.coarse.patch, self.coarse.parameters, self.coarse.face)
        if self.family.film is not None:
            points = np.concatenate([points, self.family.film.vertices])
        return self.accuracy.chord_error * float(np.linalg.norm(np.ptp(points, axis=0)))

    @cached_property
    def coarse(self) -> Complex:
        """The complex from which meshes are refined."""
        return self.family.uniform(cells_along_edges(self.family.limit.patches, self.accuracy.cells, LEAST_RESOLUTION))

    def refined(self, mosaic: Complex, sampler: Sampler) -> tuple[Complex, str]:
        """Refine a complex for a surface; if that takes too many faces, return it as it is, and why."""
        most_faces = 200_000
        try:
            return refine(mosaic, sampler, self.tolerance, most_faces, self.accuracy.points_in_all)[0], ""
        except ToleranceError as error:
            return mosaic, str(error)
