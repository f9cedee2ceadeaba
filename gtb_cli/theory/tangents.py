"""Unit tangents of a curve, with their limits at its ends."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.differences import PARALLEL_SINE, cleared, coordinate_rounding
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.knots.layers import layers
from gtb_cli.moment.torus import covariance, exponents, shares
from gtb_cli.theory.basis import Location
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch


def tangents(patch: Patch, t: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
    """(…, 3) unit tangents of a curve at (…) or (…, 1) parameters, in the direction of increasing ones.

    They are NaN where the derivative vanishes. At an end they are limits: the direction from its control point to the
    nearest knot's different control point, where repeated knots count with their mean (property (c) of GT-Bézier
    curves, eq. 302). `DomainError` is raised for a surface, and for a parameter outside Δ.
    """
    if patch.dimension != 1:
        raise DomainError("tangents: a surface has many at a point, expected a curve")
    columns, grid = patch.domain.grid(t)
    result = np.empty((len(columns), 3))
    for location in patch.rational_basis.locations(columns, parametrization):
        if location.face.is_corner:
            result[location.rows] = _at_end(patch, location.face.index)
        else:
            result[location.rows] = _inside(patch, location)
    return result.reshape(*grid, 3)


def _inside(patch: Patch, location: Location) -> FloatArray:
    """``Σ_i T_i (a_i − μ)(b_i − P)``, normalised; about the knot with the largest T, to keep digits at the ends."""
    e = exponents(location.knots, patch.log_products, location.s)
    leader = e.argmax(axis=0)
    result = np.empty((e.shape[1], 3))
    for k, rows in groups(leader):
        deltas, _ = _deltas(patch, k)
        step = patch.knots[:, 0] - patch.knots[k, 0]
        step[np.abs(step) <= knot_tolerance(patch.knots)] = 0.0
        part = e[:, rows]
        derivative = covariance(part, step[:, None], deltas, deltas.T @ shares(part)).T
        result[rows] = _unit(derivative, PARALLEL_SINE * float(np.abs(step).max() * np.abs(deltas).max()))
    return result


def _at_end(patch: Patch, end: int) -> FloatArray:
    heights = patch.domain.heights[:, end]
    at_end = np.flatnonzero(heights == 0)
    deltas, rounding = _deltas(patch, int(at_end[0]))

    def mean(knots: IntArray) -> FloatArray:
        return np.asarray(deltas[knots].T @ shares(patch.log_products[knots, None])[:, 0])

    for layer in layers(heights):
        step = mean(layer) - mean(at_end)
        if np.abs(step).max() > rounding:
            return np.asarray(_unit(step[None], 0.0)[0] * (1.0 if end == 0 else -1.0))
    return np.full(3, np.nan)


def _deltas(patch: Patch, k: int) -> tuple[FloatArray, float]:
    """(n, 3) control points less that of knot k, exactly 0 if they are equal within rounding; and this rounding."""
    rounding = coordinate_rounding(patch.control_points)
    return cleared(patch.control_points - patch.control_points[k], rounding), rounding


def _unit(vectors: FloatArray, smallest: float) -> FloatArray:
    """(m, 3) unit vectors; NaN if no entry is larger than `smallest`."""
    size = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = np.where(size > smallest, vectors, np.nan) / np.where(size > 0, size, 1.0)
    return np.asarray(scaled / np.sqrt((scaled**2).sum(axis=1, keepdims=True)))
