"""Thin-plate and Dirichlet energy of a patch in its linear parametrisation: quadratic forms of the control points.

With p = μ(s), ``∂T/∂s = T (a − μ)``, ``∂p/∂s = C`` (the covariance of the knots under T) and ``∂²p/∂s² = K`` (their
third central moments). So ``∂T/∂p = C⁻¹ ∂T/∂s`` and ``∂²T/∂p² = C⁻¹ (∂²T/∂s² − K ∂T/∂p) C⁻¹``: no differences.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, planar_cross
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.triangulation import central_triangulation
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents, shares
from gtb_cli.theory.patch import Patch

Energy: TypeAlias = Literal["thin-plate", "dirichlet"]


def energy(patch: Patch, kind: Energy = "thin-plate") -> float:
    """Return the energy of a surface over Δ, scaled to area 1, in the linear parametrisation.

    Parameters
    ----------
    patch : Patch
        A surface.
    kind : {"thin-plate", "dirichlet"}
        ``∫ |P_xx|² + 2 |P_xy|² + |P_yy|²`` or ``∫ |P_x|² + |P_y|²``, in units of length².
    """
    points = patch.control_points - patch.control_points.mean(axis=0)
    return float(np.einsum("ik,ij,jk->", points, energy_matrix(patch.domain, patch.log_products, kind), points))


def energy_matrix(domain: Domain, log_weights: FloatArray, kind: Energy) -> FloatArray:
    """Return the (n, n) matrix of the quadratic form `energy`, the same for each coordinate of the control points.

    Raises
    ------
    DomainError
        The domain is that of a curve, or the energy has another name.
    """
    if domain.dimension == 1:
        raise DomainError("energy: expected a surface, this is a curve")
    p, areas = energy_samples(domain, len(domain.knots))
    unit = np.sqrt(areas.sum())
    knots, middles = (domain.knots - domain.center) / unit, (p - domain.center) / unit
    s = MomentMap(knots, log_weights).inverse(middles, 1e-10)
    return moments_energy(knots, log_weights, s, areas / unit**2, kind)


def energy_samples(domain: Domain, knots: int) -> tuple[FloatArray, FloatArray]:
    """Return (m, 2) middles and (m,) areas of triangles that cover Δ and are narrower near its boundary."""
    grading = 2.0  # draws rings to the boundary, where derivatives change within the next layer of knots
    samples_per_knot = 4  # with three equations each of the thin-plate energy: no control point is left free
    r = len(domain.vertices)
    rings = max(14, int(np.ceil(np.sqrt(samples_per_knot * knots / r))))
    part = central_triangulation(domain, rings)
    centre = domain.vertices.mean(axis=0)
    depth = domain.heights_of_columns(part.parameters)
    share = (depth / domain.heights_of_columns(centre[None])).min(axis=0)
    # `share` is 1 in the middle, 0 on the boundary.
    stretch = (1 - share**grading) / np.where(share < 1, 1 - share, 1.0)
    corners = (centre + (part.parameters - centre) * stretch[:, None])[part.cells]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return corners.mean(axis=1), np.abs(planar_cross(first, second)) / 2


def moments_energy(
    knots: FloatArray, log_weights: FloatArray, s: FloatArray, areas: FloatArray, kind: Energy
) -> FloatArray:
    """Return the (n, n) energy matrix of samples at (2, m) torus coordinates that stand for (m,) areas."""
    t = shares(exponents(knots, log_weights, s))
    x, y = (axis[:, None] - axis @ t for axis in knots.T)
    tx, ty = t * x, t * y
    cxx, cxy, cyy = (tx * x).sum(axis=0), (tx * y).sum(axis=0), (ty * y).sum(axis=0)
    det = cxx * cyy - cxy**2
    jxx, jxy, jyy = cyy / det, -cxy / det, cxx / det
    px, py = tx * jxx + ty * jxy, tx * jxy + ty * jyy
    root = np.sqrt(areas)
    if kind == "dirichlet":
        rows = np.concatenate([px * root, py * root], axis=1)
        return np.asarray(rows @ rows.T)
    if kind != "thin-plate":
        raise DomainError(f"energy: expected thin-plate or dirichlet, got {kind!r}")
    txx, txy, tyy = tx * x, tx * y, ty * y
    kxxx, kxxy, kxyy, kyyy = ((table * axis).sum(axis=0) for table, axis in ((txx, x), (txx, y), (tyy, x), (tyy, y)))
    axx = txx - t * cxx - (px * kxxx + py * kxxy)
    axy = txy - t * cxy - (px * kxxy + py * kxyy)
    ayy = tyy - t * cyy - (px * kxyy + py * kyyy)
    pxx = jxx**2 * axx + 2 * jxx * jxy * axy + jxy**2 * ayy
    pxy = jxx * jxy * axx + (jxx * jyy + jxy**2) * axy + jxy * jyy * ayy
    pyy = jxy**2 * axx + 2 * jxy * jyy * axy + jyy**2 * ayy
    rows = np.concatenate([pxx * root, pyy * root, pxy * (np.sqrt(2) * root)], axis=1)
    return np.asarray(rows @ rows.T)
