"""Control points that are probably in another order than their knots: two exchanged, or those of another grid."""

import numpy as np

from gtb_cli.arrays import FloatArray, grid_knots
from gtb_cli.theory.patch import Patch


def likely_order(patch: Patch, is_certain: bool) -> str:
    """Say how the control points b of a surface are out of order, if that is certain or probable; else nothing.

    Σ |b_i − b_j|² / |a_i − a_j|⁴, with the knots a, is less for the knots of another grid, or after an exchange. It is
    probable if it is a fifth less.
    """
    many = 500  # knots, from which on comparing all pairs takes long
    knots, points, count = patch.knots, patch.control_points, len(patch.knots)
    size, enough = float(np.ptp(points, axis=0).max()), 1 - 1e-9 if is_certain else 0.8
    other_order = "its control points were in another order than its knots" if is_certain else ""
    if count >= many or not size:
        return other_order
    weights, squares = _weights(knots), _squares(points / size)
    whole, rows = float((weights * squares).sum()), len(np.unique(knots[:, 0]))
    columns = count // rows
    if np.array_equal(weights, _weights(grid_knots(rows, columns))):  # which may be mirrored
        other = float((_weights(grid_knots(columns, rows)) * squares).sum())
        if other < enough * whole:
            return f"its knots were grid {columns}x{rows}"
    products = weights @ squares / whole
    own = np.diag(products)
    exchanged = 1 + 2 * (products + products.T - own - own[:, None]) + 4 * weights * squares / whole
    first, second = divmod(int(np.round(exchanged, 9).argmin()), count)  # the first of equal ones
    return f"control points {first} and {second} were exchanged" if exchanged[first, second] < enough else other_order


def _weights(knots: FloatArray) -> FloatArray:
    """Return the (n, n) weights of pairs of knots, 0 for one place."""
    squares = _squares(knots)
    return 1 / np.where(squares > 0, squares, np.inf) ** 2


def _squares(points: FloatArray) -> FloatArray:
    return np.asarray(((points[:, None] - points) ** 2).sum(axis=2))
