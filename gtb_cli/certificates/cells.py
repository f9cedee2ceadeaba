"""Certificates of the cells of a mesh: segments of curves and triangles of surfaces, patch by patch."""

import math
import time
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.certificates.curve import CurveCertificate
from gtb_cli.certificates.planar import PlanarCertificate
from gtb_cli.certificates.surface import SurfaceCertificate
from gtb_cli.theory.knot_limit import merge_knots
from gtb_cli.theory.patch import Patch


class Certificates:
    """Proofs that cells are within a tolerance of their curves or surfaces, in some seconds of the processor."""

    def __init__(self, patches: Sequence[Patch], seconds: float = math.inf) -> None:
        self.patches, self.deadline = patches, time.process_time() + seconds

    @cached_property
    def _curves(self) -> list[CurveCertificate]:
        return [CurveCertificate(patch) for patch in self.patches]

    @cached_property
    def _planes(self) -> list[PlanarCertificate]:
        return [PlanarCertificate(patch) for patch in self.patches]

    @cached_property
    def _surfaces(self) -> list[SurfaceCertificate]:
        return [SurfaceCertificate(without_copies(patch), self.deadline) for patch in self.patches]

    def is_plane(self, index: int, tolerance: float) -> bool:
        """Tell whether a surface is certified by its boundary alone: all of its triangles together, see `failing`."""
        return self._planes[index].serves(tolerance)

    def failing(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        """Mark the cells, (k,), that are not certain to be within the tolerance.

        They have (k, d + 1, d) corners in Δ, and (k, d + 1, 3) in the mesh, nearly the points of the patch there.
        Raises `Uncertified` if triangles take too long to certify.
        """
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            if u.shape[1] == 2:
                curve = self._curves[index]
                fails[own] = curve.failing(curve.torus_coordinates(u[own])[:, :, 0], corners[own], tolerance)
            else:
                surface = self._planes[index] if self.is_plane(index, tolerance) else self._surfaces[index]
                fails[own] = surface.failing(u[own], corners[own], tolerance)
        return fails


def without_copies(patch: Patch) -> Patch:
    """Return the same surface with one knot in place of several at one place, which act as one (Thm 4.1)."""
    _, first, number = np.unique(patch.knots, axis=0, return_index=True, return_inverse=True)
    moves = {k: q for k, q in enumerate(first[number.ravel()].tolist()) if k != q}
    return merge_knots(patch, moves) if moves else patch
