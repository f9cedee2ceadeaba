"""How far the members of a family of patches are from its limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gtb_cli.errors import ToleranceError
from gtb_cli.meshes.compare import surface_distance
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.sequences.family import Family
from gtb_cli.tessellation.complex import Complex, Sampler
from gtb_cli.tessellation.lattice import POINTS_IN_ALL
from gtb_cli.tessellation.refinement import refine

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
        See `refine`.
    """

    chord_error: float
    cells: int
    points_in_all: int = POINTS_IN_ALL


ACCURACY = {1: Accuracy(1e-5, 64), 2: Accuracy(1e-3, 4096)}
"""What is used for curves and for surfaces."""


class Measurement:
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
        """The mesh of a surface."""
        return Mesh(sampler.points(mosaic.patch, mosaic.parameters, mosaic.face), mosaic.cells)


def _union(a: Mesh, b: Mesh) -> Mesh:
    return Mesh(np.concatenate([a.vertices, b.vertices]), np.concatenate([a.cells, b.cells + len(a.vertices)]))
