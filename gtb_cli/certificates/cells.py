"""Certificates of the cells of a mesh: segments of curves and triangles of surfaces, patch by patch."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtb_cli.arrays import EPS, BoolArray, FloatArray, IntArray, groups
from gtb_cli.certificates.curve import CurveCertificate
from gtb_cli.certificates.deadline import Deadline
from gtb_cli.certificates.planar import PlanarCertificate
from gtb_cli.certificates.surface import SurfaceCertificate
from gtb_cli.limits.knot_limit import merge_knots
from gtb_cli.theory.patch import Patch


class Certificates:
    """Proofs that cells are within a tolerance of their curves or surfaces, up to a deadline."""

    def __init__(self, patches: Sequence[Patch], deadline: Deadline) -> None:
        self.patches, self.deadline = patches, deadline

    @cached_property
    def _curves(self) -> list[CurveCertificate]:
        return [CurveCertificate(patch, self.deadline) for patch in self.patches]

    @cached_property
    def _planes(self) -> list[PlanarCertificate]:
        return [PlanarCertificate(patch, self.deadline) for patch in self.patches]

    @cached_property
    def _surfaces(self) -> list[SurfaceCertificate]:
        return [SurfaceCertificate(without_copies(patch), self.deadline) for patch in self.patches]

    def is_plane(self, index: int, tolerance: float) -> bool:
        """Tell whether a surface is certified by its boundary alone: all of its triangles together, see `failing`."""
        return self._planes[index].serves(tolerance)

    def failing(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        """Mark the cells, (k,), that are not certain to be within the tolerance.

        They have (k, d + 1, d) corners in Δ, and (k, d + 1, 3) in the mesh, nearly the points of the patch there.
        Raises `Uncertified` once the deadline has passed.
        """
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            # A surface and its mesh are in the convex hull of the control points, but for rounding of the corners.
            hull = np.concatenate([self.patches[index].control_points, *corners[own].swapaxes(0, 1)])
            if np.linalg.norm(np.ptp(hull, axis=0)) * (1 + 8 * EPS) <= tolerance:
                continue
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
