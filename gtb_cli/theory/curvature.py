"""Gaussian and mean curvature of a surface, with their limits on the boundary.

Derivatives with respect to the torus coordinates are moments under T: ``∂P = Σ_i T_i b_i (a_i − μ)`` and ``∂²P = Σ_i
T_i (b_i − P)(a_i − μ)(a_i − μ)ᵀ``. Curvatures do not depend on the coordinates. In the product of ∂²P with the normal,
any quadratic function of a_i with the same Hessian may replace (a_i − μ)(a_i − μ)ᵀ, since moments with affine functions
are tangents. We take coordinates ξ, η that are 0 and 1 at the three knots with most of T, and the quadratic functions
ξ(ξ − 1), ξη and η(η − 1). These vanish at all three knots, so that no digits are lost near an edge or a corner. The
limit there keeps only the knots whose T vanishes last.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, cross_of_columns
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import PARALLEL_SINE, cleared, coordinate_rounding
from gtb_cli.theory.basis import Location
from gtb_cli.theory.corners import limits_at
from gtb_cli.theory.local_coordinates import FaceLayers, Local, Terms, face_layers, neighbourhoods
from gtb_cli.theory.parametrization import Blend, Parametrization


class Curvature(NamedTuple):
    """(…) curvatures of a surface at points; NaN without a finite limit. Found by `Patch.curvature`.

    K = κ₁ κ₂ is in units of 1 / length², H = (κ₁ + κ₂) / 2 in units of 1 / length. H is positive if the surface bends
    away from its normal: 1 / R for a sphere with outward normals.
    """

    gaussian: FloatArray
    mean: FloatArray


def curvature(patch: Blend, u: ArrayLike, parametrization: Parametrization = "toric") -> Curvature:
    """Gaussian and mean curvature of a surface at (…, 2) parameters; see `Patch.curvature`."""
    columns, grid = patch.rational_basis.domain.grid(u)
    found = curvatures_at([patch], patch.rational_basis.locations(columns, parametrization), len(columns))
    return Curvature(found.gaussian[0].reshape(grid), found.mean[0].reshape(grid))


def curvatures_at(patches: Sequence[Blend], where: Iterable[Location], count: int) -> Curvature:
    """(q, count) curvatures of q patches that share one rational basis: what does not depend on points is made once."""
    field = _CurvatureField(patches)
    gaussian, mean = np.empty((2, len(patches), count))
    for location in where:
        gaussian[:, location.rows], mean[:, location.rows] = field.at(location)
    return Curvature(gaussian, mean)


class _CurvatureField:
    """Curvatures of q patches with one basis; data that do not depend on the place are computed once."""

    def __init__(self, patches: Sequence[Blend]) -> None:
        self.domain, self.log_weights = patches[0].rational_basis.domain, patches[0].rational_basis.log_weights
        if self.domain.dimension == 1:
            raise DomainError("curvature: Gaussian and mean curvature are a surface's, this is a curve")
        points = np.array([patch.control_points for patch in patches])
        points -= (points.min(axis=1, keepdims=True) + points.max(axis=1, keepdims=True)) / 2
        # If points have size 1, no product of derivatives leaves the range of floats.
        extent = np.abs(points).max(axis=(1, 2))
        self.extent = np.where(extent > 0, extent, 1.0)[:, None]
        self.points = points / self.extent[:, :, None]
        self.rounding = np.array([[coordinate_rounding(patch.control_points)] for patch in patches]) / self.extent

    def at(self, location: Location) -> Curvature:
        """(q, m) curvatures at the m parameters of a location."""
        gaussian, mean = np.empty((2, len(self.points), location.s.shape[1]))
        if location.face.is_corner and face_layers(self.domain, location.face).slow.any():
            # Other knots than the next ones on the edges count.
            for row, points in enumerate(self.points):
                limits = limits_at(self.domain, self.log_weights, points, location.face.index)
                gaussian[row], mean[row] = limits.gaussian, limits.mean
        else:
            for here, local, e, layers in neighbourhoods(self.domain, self.log_weights, location, 12):
                gaussian[:, here], mean[:, here] = self._about(local, local.terms(e, layers), layers)
        with np.errstate(over="ignore"):  # of a surface smaller than the smallest square
            return Curvature(gaussian / self.extent / self.extent, mean / self.extent)

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")  # from points without a normal or a finite limit
    def _about(self, local: Local, terms: Terms, layers: FaceLayers) -> Curvature:
        """Curvatures at places that one knot leads."""
        deltas = cleared(self.points - self.points[:, [local.k]], self.rounding[:, :, None])
        columns = deltas.swapaxes(1, 2)
        total = terms.point.sum(axis=0)
        p = columns @ terms.point / total
        first, second = (columns @ x - p * x.sum(axis=0) for x in terms.first)
        cross = np.empty_like(first)
        cross_of_columns(first.swapaxes(0, 1), second.swapaxes(0, 1), cross.swapaxes(0, 1))
        lengths = [np.sqrt((v**2).sum(axis=1)) for v in (first, second, cross)]
        regular = lengths[2] > PARALLEL_SINE * lengths[0] * lengths[1]
        d = self._depths(deltas, p, np.where(regular[:, None], cross / lengths[2][:, None] * local.turn, np.nan))
        xi_xi, xi_eta, eta_eta = (total * (x * d).sum(axis=1) for x in terms.second)
        square, product = lengths[2] ** 2, (first * second).sum(axis=1)
        gaussian = (xi_xi * eta_eta - xi_eta**2) / square
        mean = (2 * product * xi_eta - lengths[1] ** 2 * xi_xi - lengths[0] ** 2 * eta_eta) / (2 * square)
        unlimited = (d[:, layers.hindering] != 0).any(axis=1) | ~np.isfinite(gaussian) | ~np.isfinite(mean)
        return Curvature(np.where(unlimited, np.nan, gaussian), np.where(unlimited, np.nan, mean))

    def _depths(self, deltas: FloatArray, p: FloatArray, normal: FloatArray) -> FloatArray:
        """(q, n, m) distances of control points from the tangent planes, with 0 in place of possible rounding."""
        d = deltas @ normal - (normal * p).sum(axis=1, keepdims=True)
        # The control points of the leading knot, and those equal to it, are as near as p is.
        near = 8 * EPS * np.sqrt((p**2).sum(axis=1, keepdims=True))
        moved = (deltas != 0).any(axis=2, keepdims=True)
        d[np.abs(d) <= np.where(moved, self.rounding[:, :, None] + near, near)] = 0.0
        return np.asarray(d)
