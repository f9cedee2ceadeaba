"""Certificates of the cells of a mesh: segments of curves and triangles of surfaces, patch by patch."""

import math
import time
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.certificates.curve import CurveCertificate
from gtb_cli.certificates.planar import PlanarCertificate
from gtb_cli.certificates.surface import SurfaceCertificate
from gtb_cli.theory.knot_limit import merge_knots
from gtb_cli.theory.patch import Patch


class Certificates:
    """Proofs that cells are within a tolerance of their curves or surfaces.

    Parameters
    ----------
    patches : sequence of Patch
    seconds : float
        Of the processor, that surfaces may take.
    """

    def __init__(self, patches: Sequence[Patch], seconds: float = math.inf) -> None:
        self.patches, self.deadline = patches, time.process_time() + seconds
        self.curves: dict[int, CurveCertificate] = {}
        self.surfaces: dict[int, SurfaceCertificate] = {}
        self.planes: dict[int, PlanarCertificate] = {}

    def is_plane(self, index: int, tolerance: float) -> bool:
        """Tell whether a surface is certified by its boundary alone: all of its triangles together, see `failing`."""
        if index not in self.planes:
            self.planes[index] = PlanarCertificate(self.patches[index])
        return self.planes[index].serves(tolerance)

    def failing(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        """Tell which cells are not certain to be within the tolerance.

        Parameters
        ----------
        patch : (k,) int
        u : (k, d + 1, d) float
            Parameters of the cells' corners.
        corners : (k, d + 1, 3) float
            Their corners in the mesh, nearly the points of the patch there.
        tolerance : float

        Raises
        ------
        Uncertified
            Triangles take too long to certify.
        """
        if u.shape[1] == 3:
            return self._failing_triangles(patch, u, corners, tolerance)
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            if index not in self.curves:
                self.curves[index] = CurveCertificate(self.patches[index])
            curve = self.curves[index]
            fails[own] = curve.failing(curve.torus_coordinates(u[own]), corners[own], tolerance)
        return fails

    def _failing_triangles(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            if self.is_plane(index, tolerance):
                fails[own] = self.planes[index].failing(u[own], corners[own], tolerance)
                continue
            if index not in self.surfaces:
                self.surfaces[index] = SurfaceCertificate(without_copies(self.patches[index]), self.deadline)
            surface = self.surfaces[index]
            fails[own] = surface.failing(u[own], corners[own], tolerance)
        return fails


def without_copies(patch: Patch) -> Patch:
    """Return the same surface with one knot in place of several at one place, which act as one (Thm 4.1)."""
    _, first, number = np.unique(patch.knots, axis=0, return_index=True, return_inverse=True)
    moves = {k: q for k, q in enumerate(first[number.ravel()].tolist()) if k != q}
    return merge_knots(patch, moves) if moves else patch
