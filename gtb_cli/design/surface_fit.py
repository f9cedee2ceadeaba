"""Surfaces with the knots and weights of a patch: through given points, one for each knot, or near any number."""

import math

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, finite
from gtb_cli.design.curve_fit import Fit, passed
from gtb_cli.errors import DomainError
from gtb_cli.fairing.energy import energy_matrix
from gtb_cli.knots.triangulation import central_triangulation
from gtb_cli.theory.patch import Patch


def surface_through(points: ArrayLike, patch: Patch, parameters: ArrayLike | None = None) -> Fit:
    """Find the surface through points, one for each knot, by progressive iterative approximation.

    Parameters
    ----------
    points : (n, 3) float
        Points in the order of the knots.
    patch : Patch
        A surface with n knots; its knots and weights stay.
    parameters : (n, 2) float, optional
        Parameters of the points, in the linear parametrisation. Default: the knots.

    Raises
    ------
    DomainError
        The patch is a curve, or shapes of arrays do not fit.
    ToleranceError
        The surface cannot pass through the points: some basis functions are the same, as for coincident knots, or
        vanish at all parameters.

    Notes
    -----
    The basis of a surface need not be totally positive, so no theorem guarantees convergence. At the knots, all patches
    that were tried converged; if convergence is slow or fails, the equations are solved, as for curves.
    """
    places = _checked(points, patch)
    n = len(patch.knots)
    if len(places) != n:
        raise DomainError(f"points: expected {n}, one for each knot, got {len(places)}")
    p = patch.knots if parameters is None else _parameters(parameters, n)
    return passed(patch, p, patch.basis(p, "linear"), places)


def surface_near(points: ArrayLike, patch: Patch, parameters: ArrayLike | None = None, smoothing: float = 1e-6) -> Fit:
    """Find control points with which a patch is near points.

    Parameters
    ----------
    points : (m, 3) float
    patch : Patch
        A surface, whose knots and weights stay. Without parameters, points are first projected onto it.
    parameters : (m, 2) float, optional
        Fixed parameters of the points, in the linear parametrisation. Default: by projection, corrected in rounds.
    smoothing : float
        Weight of the thin-plate energy relative to the points, each by its mean: it decides where there are no points.
        0 for none.

    Raises
    ------
    DomainError
        The patch is a curve, shapes of arrays do not fit, or parameters lie outside Δ.
    """
    places = _checked(points, patch)
    if not (math.isfinite(smoothing) and smoothing >= 0):
        raise DomainError(f"smoothing: must not be negative, got {smoothing!r}")
    plate = energy_matrix(patch.domain, patch.log_products, "thin-plate")
    if parameters is not None:
        p = _parameters(parameters, len(places))
        fitted = _solved(patch, places, p, plate, smoothing)
        return _measured(fitted, places, p, 0)
    p = _nearest(patch, places)
    best = _measured(_solved(patch, places, p, plate, smoothing), places, p, 0)
    for rounds in range(1, 9):
        p = _corrected(best.patch, places, best.parameters)
        found = _measured(_solved(patch, places, p, plate, smoothing), places, p, rounds)
        if not found.mean < best.mean:
            break
        best = found
    return best


def _checked(points: ArrayLike, patch: Patch) -> FloatArray:
    most = 100_000  # the table of T has a number for each point and knot
    if patch.dimension == 1:
        raise DomainError("patch: expected a surface, this is a curve (which `fit` finds without `patch`)")
    places = finite("points", points)
    if places.ndim != 2 or places.shape[1] != 3 or not 1 <= len(places) <= most:
        raise DomainError(f"points: expected shape (m, 3) with m up to {most}, got {places.shape}")
    return places


def _parameters(parameters: ArrayLike, count: int) -> FloatArray:
    p = finite("parameters", parameters)
    if p.shape != (count, 2):
        raise DomainError(f"parameters: expected shape ({count}, 2), got {p.shape}")
    return p


def _solved(patch: Patch, points: FloatArray, p: FloatArray, plate: FloatArray, smoothing: float) -> Patch:
    """Return the patch with the least-squares control points, computed relative to the middle of the points."""
    t = patch.basis(p, "linear")
    normal = t.T @ t
    form = normal + smoothing * np.trace(normal) / np.trace(plate) * plate
    middle = points.mean(axis=0)
    control = np.linalg.lstsq(form, t.T @ (points - middle), rcond=1e-13)[0] + middle
    return patch.replace(control_points=control)


def _measured(patch: Patch, points: FloatArray, p: FloatArray, rounds: int) -> Fit:
    distances = np.linalg.norm(patch.evaluate(p, "linear") - points, axis=1)
    return Fit(patch, p, rounds, float(distances.max()), float(np.sqrt((distances**2).mean())))


def _nearest(patch: Patch, points: FloatArray) -> FloatArray:
    """Return (m, 2) parameters of the nearest vertices of a mesh, moved slightly inside."""
    from scipy.spatial import cKDTree

    part = central_triangulation(patch.domain, 24)
    _, index = cKDTree(patch.evaluate(part.parameters, "linear")).query(points)
    return _corrected(patch, points, _inside(patch, part.parameters[index]))


def _corrected(patch: Patch, points: FloatArray, p: FloatArray) -> FloatArray:
    """Take one Gauss-Newton step to the projections of the points, within Δ."""
    difference_step, longest = 1e-4, 0.1  # of Δ's size: tangents to two digits, and a bound for corrections
    size = patch.domain.size
    h = difference_step * size
    base = _inside(patch, p, difference_step * 4)
    at = patch.evaluate(base, "linear")
    tangents = [
        (patch.evaluate(base + step, "linear") - patch.evaluate(base - step, "linear")) / (2 * h)
        for step in np.array([[h, 0], [0, h]])
    ]
    gap = points - at
    a, b, c = ((tangents[i] * tangents[j]).sum(axis=1) for i, j in ((0, 0), (0, 1), (1, 1)))
    x, y = ((tangent * gap).sum(axis=1) for tangent in tangents)
    det = np.maximum(a * c - b * b, 1e-12 * np.maximum(a * c, np.finfo(float).tiny))
    step = np.column_stack([c * x - b * y, a * y - b * x]) / det[:, None]
    length = np.linalg.norm(step, axis=1, keepdims=True)
    step *= np.minimum(1, longest * size / np.maximum(length, np.finfo(float).tiny))
    return _inside(patch, base + step)


def _inside(patch: Patch, p: FloatArray, margin: float = 1e-9) -> FloatArray:
    """Move points towards the middle of Δ until they are inside by a fraction of its size."""
    shape = patch.domain
    centre = shape.vertices.mean(axis=0)
    slope = (p - centre) @ shape.normals.T
    room = ((centre - shape.vertices) * shape.normals).sum(axis=1) * (1 - margin)
    over = np.where(slope < 0, -slope / room, 0.0).max(axis=1)
    return np.asarray(centre + (p - centre) / np.maximum(over, 1.0)[:, None])
