"""Unit tangents of a curve, with their limits at its ends."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.knots.about_a_knot import PARALLEL_SINE, coordinate_rounding, offsets_from, unit_columns
from gtb_cli.knots.domain import layers
from gtb_cli.knots.hull import knot_tolerance
from gtb_cli.moment.torus import covariance, exponents, shares
from gtb_cli.theory.basis import Location
from gtb_cli.theory.rational_basis import Blend, Parametrization


def tangents(patch: Blend, t: ArrayLike, parametrization: Parametrization = "toric") -> FloatArray:
    """Return unit tangents of a curve at parameters, (…) or (…, 1) → (…, 3); see `Patch.tangents`."""
    shape = patch.rational_basis.domain
    if shape.dimension != 1:
        raise DomainError("tangents: a surface has many at a point, expected a curve")
    columns, grid = shape.grid(t)
    result = np.empty((len(columns), 3))
    for location in patch.rational_basis.locations(columns, parametrization):
        if location.face.is_corner:
            result[location.rows] = _at_end(patch, location.face.index)
        else:
            result[location.rows] = _inside(patch, location)
    return result.reshape(*grid, 3)


def _inside(patch: Blend, location: Location) -> FloatArray:
    """Normalise ``Σ_i T_i (a_i − μ)(b_i − P)``, taken about the knot with the largest T to keep digits at the ends."""
    knots = patch.rational_basis.domain.knots
    e = exponents(location.knots, patch.rational_basis.log_weights, location.s)
    result = np.empty((e.shape[1], 3))
    for k, rows in groups(e.argmax(axis=0)):
        deltas = offsets_from(patch.control_points, k)
        step = knots[:, 0] - knots[k, 0]
        step[np.abs(step) <= knot_tolerance(knots)] = 0.0
        part = e[:, rows]
        derivative = covariance(part, step[:, None], deltas, deltas.T @ shares(part))
        known = np.abs(derivative).max(axis=0) > PARALLEL_SINE * np.abs(step).max() * np.abs(deltas).max()
        result[rows] = unit_columns(np.where(known, derivative, np.nan)).T
    return result


def _at_end(patch: Blend, end: int) -> FloatArray:
    basis = patch.rational_basis
    heights = basis.domain.heights[:, end]
    at_end = np.flatnonzero(heights == 0)
    deltas = offsets_from(patch.control_points, int(at_end[0]))

    def mean(knots: IntArray) -> FloatArray:
        return np.asarray(deltas[knots].T @ shares(basis.log_weights[knots, None])[:, 0])

    for layer in layers(heights):
        step = mean(layer) - mean(at_end)
        if np.abs(step).max() > coordinate_rounding(patch.control_points):
            return np.asarray(unit_columns(step[:, None])[:, 0] * (1.0 if end == 0 else -1.0))
    return np.full(3, np.nan)
