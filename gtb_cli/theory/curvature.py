"""Gaussian and mean curvature of a surface, with their limits on the boundary; those at corners: `corners`.

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

from gtb_cli.arrays import EPS, FloatArray, cross
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import PARALLEL_SINE, cleared, coordinate_rounding
from gtb_cli.theory.basis import Location
from gtb_cli.theory.corners import limits_at
from gtb_cli.theory.local_coordinates import FaceLayers, Local, Terms, face_layers, neighbourhoods
from gtb_cli.theory.rational_basis import Blend


class Curvature(NamedTuple):
    """Curvatures of a surface at points, (…); NaN without a finite limit. Found by `Patch.curvature`.

    K = κ₁ κ₂ is in units of 1 / length², H = (κ₁ + κ₂) / 2 in units of 1 / length. H is positive if the surface bends
    away from its normal: 1 / R for a sphere with outward normals.
    """

    gaussian: FloatArray
    mean: FloatArray


def curvatures_at(patches: Sequence[Blend], where: Iterable[Location], count: int) -> Curvature:
    """Return the curvatures, (q, count), of q patches that share one rational basis."""
    domain, log_weights = patches[0].rational_basis.domain, patches[0].rational_basis.log_weights
    if domain.dimension == 1:
        raise DomainError("curvature: Gaussian and mean curvature are a surface's, this is a curve")
    points = np.array([patch.control_points for patch in patches])
    points -= (points.min(axis=1, keepdims=True) + points.max(axis=1, keepdims=True)) / 2
    # If points have size 1, no product of derivatives leaves the range of floats.
    extent = np.abs(points).max(axis=(1, 2))[:, None]
    extent[extent == 0] = 1.0
    points /= extent[:, :, None]
    rounding = np.array([[coordinate_rounding(patch.control_points)] for patch in patches]) / extent
    gaussian, mean = np.empty((2, len(patches), count))
    for location in where:
        rows = np.arange(count)[location.rows]
        if location.face.is_corner and face_layers(domain, location.face).slow.any():
            # More knots count than the corner's neighbours on the edges.
            for k, net in enumerate(points):
                limits = limits_at(domain, log_weights, net, location.face.index)
                gaussian[k, rows], mean[k, rows] = limits.gaussian, limits.mean
            continue
        for here, local, e, layers in neighbourhoods(domain, log_weights, location, 12):
            found = _about(points, rounding, local, local.terms(e, layers), layers)
            gaussian[:, rows[here]], mean[:, rows[here]] = found
    with np.errstate(over="ignore"):  # of a surface smaller than the smallest square
        return Curvature(gaussian / extent / extent, mean / extent)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # from points without a normal or a finite limit
def _about(points: FloatArray, rounding: FloatArray, local: Local, terms: Terms, layers: FaceLayers) -> Curvature:
    """Return the curvatures of surfaces with (q, n, 3) points, known up to (q, 1) lengths, at places one knot leads."""
    deltas = cleared(points - points[:, [local.k]], rounding[:, :, None])
    columns = deltas.swapaxes(1, 2)
    total = terms.point.sum(axis=0)
    p = columns @ terms.point / total
    first, second = (columns @ x - p * x.sum(axis=0) for x in terms.first)
    across = cross(first, second, 1)
    lengths = [np.sqrt((v**2).sum(axis=1)) for v in (first, second, across)]
    regular = lengths[2] > PARALLEL_SINE * lengths[0] * lengths[1]
    normal = np.where(regular[:, None], across / lengths[2][:, None] * local.turn, np.nan)
    # Distances of control points from the tangent planes, with 0 in place of possible rounding: a point that
    # equals the leading knot's is as near as p is.
    d = deltas @ normal - (normal * p).sum(axis=1, keepdims=True)
    near = 8 * EPS * np.sqrt((p**2).sum(axis=1, keepdims=True))
    d[np.abs(d) <= np.where((deltas != 0).any(axis=2, keepdims=True), rounding[:, :, None] + near, near)] = 0.0
    xi_xi, xi_eta, eta_eta = (total * (x * d).sum(axis=1) for x in terms.second)
    square, product = lengths[2] ** 2, (first * second).sum(axis=1)
    gaussian = (xi_xi * eta_eta - xi_eta**2) / square
    mean = (2 * product * xi_eta - lengths[1] ** 2 * xi_xi - lengths[0] ** 2 * eta_eta) / (2 * square)
    hindering = np.any([layers.slow, *(knots for _, knots in layers.against)], axis=0)
    unlimited = (d[:, hindering] != 0).any(axis=1) | ~np.isfinite(gaussian) | ~np.isfinite(mean)
    return Curvature(np.where(unlimited, np.nan, gaussian), np.where(unlimited, np.nan, mean))
