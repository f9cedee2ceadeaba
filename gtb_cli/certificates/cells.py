"""Certificates of the cells of a mesh: segments of curves and triangles of surfaces, patch by patch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, IntArray, groups
from gtb_cli.certificates.curve import CurveCertificate
from gtb_cli.certificates.surface import WAY_OUT, SurfaceCertificate
from gtb_cli.errors import ToleranceError
from gtb_cli.theory.patch import Patch

# Knots times parts of surfaces that are bounded: about a minute, as 1.2 to 3.6 µs were measured for each
MAX_WORK = 30_000_000


class Certificates:
    """Proofs that cells are within a tolerance of their curves or surfaces.

    Parameters
    ----------
    patches : sequence of Patch
    """

    def __init__(self, patches: Sequence[Patch]) -> None:
        self.patches = patches
        self.curves: dict[int, CurveCertificate] = {}
        self.surfaces: dict[int, SurfaceCertificate] = {}

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
        ToleranceError
            Triangles take too long to certify.
        """
        if u.shape[1] == 3:
            self._refuse_too_many(patch, u, corners, tolerance)
            return self._failing_triangles(patch, u, corners, tolerance)
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            if index not in self.curves:
                self.curves[index] = CurveCertificate(self.patches[index])
            curve = self.curves[index]
            fails[own] = curve.failing(curve.torus_coordinates(u[own]), corners[own], tolerance)
        return fails

    def _refuse_too_many(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> None:
        """Raise `ToleranceError` if some of many triangles foretell that all take too long."""
        few, worth, ratio = 64, 32, 1.5  # triangles that are tried; times as many that are worth it; beyond doubt
        if len(patch) < worth * few:
            return
        some, before = slice(None, None, len(patch) // few), self._work
        self._failing_triangles(patch[some], u[some], corners[some], tolerance)
        needed = (self._work - before) / len(patch[some]) * len(patch)
        if needed > ratio * MAX_WORK:
            raise ToleranceError(
                f"tolerance: {tolerance:g} takes too long to certify, {len(patch)} faces about "
                f"{needed / MAX_WORK:.2g} times as long as is allowed: {WAY_OUT}"
            )

    def _failing_triangles(self, patch: IntArray, u: FloatArray, corners: FloatArray, tolerance: float) -> BoolArray:
        fails = np.zeros(len(patch), dtype=bool)
        for index, own in groups(patch):
            if index not in self.surfaces:
                self.surfaces[index] = SurfaceCertificate(self.patches[index])
            surface = self.surfaces[index]
            fails[own] = surface.failing(u[own], corners[own], tolerance, MAX_WORK - self._work + surface.work)
        return fails

    @property
    def _work(self) -> int:
        return sum(surface.work for surface in self.surfaces.values())
