"""Distances of the members of a family from its limit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtb_cli.arrays import joined, shifted
from gtb_cli.errors import ToleranceError
from gtb_cli.knots.face import INTERIOR
from gtb_cli.meshes.compare import surface_distance
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.sequences.continuation import Places
from gtb_cli.sequences.family import Family
from gtb_cli.sequences.motion import Motion, has_wide_layers
from gtb_cli.sequences.separation import Separation
from gtb_cli.tessellation.barycentric import MIN_SAMPLES
from gtb_cli.tessellation.complex import Complex
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler

FILM_ACCURACY = 0.25
"""Error of the distance from a film, as a fraction of the meshes' chord error, in addition to it."""

MIN_RESOLUTION = 4
"""Least number of segments along each edge of the meshes that are measured."""

SEARCH_CELLS = 512
"""Rough number of cells whose vertices and middles start the search for distances between surfaces."""

MAX_PLACES = 2500
"""Vertices and middles up to which memory holds all distances between them; beyond that, meshes are measured."""

MOVING_TOGETHER = 8
"""Steps of a knot limit that are measured together: more would be reported late, fewer take longer each."""

MAX_TOGETHER_NUMBERS = 2_000_000
"""Knots times places times steps up to which they are; if one step has more, meshes are measured."""

MAX_MEASURED_FACES = 200_000
"""Faces of a mesh that is measured; if more would be needed, distances are between coarser meshes."""


@dataclass(frozen=True)
class Accuracy:
    """How finely distances from a limit are measured.

    Attributes
    ----------
    chord_error : float
        That of the meshes between which distances are measured, as a fraction of the diagonal of the limit.
    cells : int
        Rough number of cells from which those meshes are refined.
    points_in_all : int
        See `refine`.
    relative : float
        Relative error of a distance between the surfaces themselves: three digits are right.
    """

    chord_error: float
    cells: int
    points_in_all: int = MIN_SAMPLES
    relative: float = 5e-4


ACCURACY = {1: Accuracy(1e-5, 64), 2: Accuracy(1e-3, 4096)}
"""The accuracy for curves and for surfaces."""


class Measurement:
    """Distances of surfaces from a limit.

    Distances are found on the surfaces themselves, see `Separation` and `Motion`; those of curves whose knots move, and
    of surfaces with films, knots near to edges, too many places or some that cannot be followed, between meshes.

    For these, surface and limit are meshed with the same triangulation, refined until each mesh is within the chord
    error of its surface. The Hausdorff distance is taken between cells, not vertices (`surface_distance`). It is off by
    at most twice the chord error, and by far less if surface and limit, and so the errors of their meshes, are nearly
    the same. It does not depend on the resolution of the meshes that are written.
    """

    def __init__(self, family: Family, accuracy: Accuracy) -> None:
        self.family, self.accuracy = family, accuracy
        self.moving: dict[int, float | None] = {}
        self.starts: dict[float, tuple[Complex, str]] = {}

    def resolution_for(self, cells: int) -> int:
        """Segments along each edge of a complex with roughly the given number of cells."""
        share = cells / self.family.cell_count(1)
        return max(MIN_RESOLUTION, math.floor(math.sqrt(share) if self.family.dimension == 2 else share))

    @cached_property
    def tolerance(self) -> float:
        """The chord error in model units."""
        start = self.family.uniform(self.resolution_for(self.accuracy.cells))
        points = self.family.limit.points(start.patch, start.parameters, start.face)
        if self.family.film is not None:
            points = np.concatenate([points, self.family.film.vertices])
        return self.accuracy.chord_error * float(np.linalg.norm(np.ptp(points, axis=0)))

    def distances(self, members: range) -> Iterator[tuple[float, float, str]]:
        """Distances of members from the limit, and from the limit with its film, and what is doubtful about them."""
        one, last = self.family.degeneration, len(self.family.samplers) - 1
        if self.on_surfaces is not None and one is not None and members.stop <= last:
            found = self.on_surfaces.distances(one.logarithms[members.start : members.stop])
            yield from ((distance, distance, "") for distance in found.tolist())
            return
        for member in members:
            if member == last and not self.family.has_film:
                yield 0.0, 0.0, ""
            elif (distance := self.with_moving_knots(member)) is not None:
                yield distance, distance, ""
            else:
                yield self.between_meshes(member)

    def with_moving_knots(self, member: int) -> float | None:
        """Distance from a knot limit, found for some members together; None for other families, and where it fails."""
        limit = self.family.knot_limit
        if limit is None or self.family.dimension == 1 or not has_wide_layers(limit):
            return None
        if member not in self.moving:
            start = self.family.uniform(self.resolution_for(SEARCH_CELLS))
            last, places = len(self.family.steps), len(start.patch) + len(start.cells)
            together = min(MOVING_TOGETHER, MAX_TOGETHER_NUMBERS // (places * len(limit.patch.knots)))
            if places > MAX_PLACES or not together:
                return None
            chosen = range(member, min(member + together, last))
            patches = [self.family.samplers[k].patches[0] for k in chosen]
            try:
                found = Motion(limit, patches, start, self.accuracy.relative).distances()
                self.moving.update(zip(chosen, found.tolist(), strict=True))
            except ToleranceError:
                self.moving.update(dict.fromkeys(chosen))
        return self.moving[member]

    @cached_property
    def on_surfaces(self) -> Separation | None:
        """What measures the members of a degeneration; None for other families, and if there are too many places."""
        one = self.family.degeneration
        start = self.family.uniform(self.resolution_for(SEARCH_CELLS))
        vertices, cells = len(start.patch), len(start.cells)
        if one is None or vertices + cells > MAX_PLACES:
            return None
        middles = Places(start.cell_patch, start.corners.mean(axis=1), np.full(cells, INTERIOR))
        places = joined([one.places(start), middles, one.knots])
        borders = np.zeros(len(places.cell), dtype=bool)
        borders[:vertices] = one.borders[start.patch, start.face]
        together = np.column_stack([start.cells, vertices + np.arange(cells)])
        found = Separation(one.patch, one.gaps, places, together, borders, self.accuracy.relative)
        return found if found.is_whole else None

    def between_meshes(self, member: int) -> tuple[float, float, str]:
        """The same as `distances` for one member, between meshes."""
        limit, sampler = self.family.limit, self.family.samplers[member]
        mosaic, doubt = self.fine_for_limit(member)
        mosaic, other_doubt = self.refined(mosaic, sampler)
        ends = self.sampled(mosaic, limit)
        surface = ends if sampler is limit else self.sampled(mosaic, sampler)
        plain = 0.0 if sampler is limit else surface_distance(surface, ends).value
        filmed = plain
        if self.family.film is not None:
            # The cells of surface and film do not match, so a smaller error would take long.
            filmed = surface_distance(surface, _union(ends, self.family.film), FILM_ACCURACY * self.tolerance).value
        return plain, filmed, doubt or other_doubt

    def fine_for_limit(self, member: int) -> tuple[Complex, str]:
        """The complex, fine enough for the limit, from which a member is measured; and what is doubtful about it."""
        thickness = self.family.thickness[member] if self.family.thickness else 0.0
        if thickness not in self.starts:
            start = self.family.graded(self.resolution_for(self.accuracy.cells), member)
            self.starts[thickness] = self.refined(start, self.family.limit)
        return self.starts[thickness]

    def refined(self, mosaic: Complex, sampler: Sampler) -> tuple[Complex, str]:
        """The complex refined for a surface; if that takes too many faces, the complex as it is, and why."""
        try:
            return refine(mosaic, sampler, self.tolerance, MAX_MEASURED_FACES, self.accuracy.points_in_all)[0], ""
        except ToleranceError as error:
            return mosaic, str(error)

    @staticmethod
    def sampled(mosaic: Complex, sampler: Sampler) -> Mesh:
        """The mesh of a surface on a complex."""
        return Mesh(sampler.points(mosaic.patch, mosaic.parameters, mosaic.face), mosaic.cells)


def _union(a: Mesh, b: Mesh) -> Mesh:
    return Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.cells, shifted(b.cells, len(a.vertices))]))
