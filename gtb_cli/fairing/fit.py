"""Curves through points, by progressive iterative approximation at the lengths of their polygon."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, finite, one_for_each
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

RESIDUAL_TOLERANCE = 1e-12  # of the largest coordinate: the iteration ends as near to the points
MAX_POINTS = 100  # with more, weights that are ordinary floats concentrate too little to converge in time
PLAIN_ROUNDS = 1000  # then the equations are solved directly: neighbours whose basis is nearly the same need ten times
MAX_ROUNDS = PLAIN_ROUNDS + 10


@frozen
class Fit:
    """A curve through points. Made by `gtb_cli.fit`.

    Attributes
    ----------
    curve : Patch
    parameters : (n,) float
        Parameters of the points, in their order.
    rounds : int
        Number of rounds of the iteration.
    distance : float
        Largest remaining distance from a point, in model units.
    """

    curve: Patch
    parameters: FloatArray
    rounds: int
    distance: float


def fit(points: ArrayLike, knots: ArrayLike | None = None) -> Fit:
    """Find a curve through points, by progressive iterative approximation (Section 3, property (c); Thm 2.1 (c)).

    Parameters
    ----------
    points : (n, 3) or (n, 2) float
        2 to 100 points in the order in which the curve passes them, from the first to the last.
    knots : (n,) float, optional
        Knots of the curve, ascending. Default: lengths along the polygon, with steps of at least 1e-3 of the longest.

    Raises
    ------
    DomainError
        Points or knots of other shapes or numbers, neighbours that coincide (without `knots`), or knots that do not
        ascend.
    ToleranceError
        1e-12 of the largest coordinate cannot be reached: basis functions are the same, as for coincident knots.

    Notes
    -----
    Control points start as the points, and in each round move by the distances that are missed:
    ``b_i ← b_i + p_i − P(t_i)``. This converges because the basis of curves is normalised and totally positive. After
    1000 rounds the limit is found as the solution of linear equations. Weights are free, and are chosen so that the
    basis is local: about 100 rounds suffice for 10 points and for 70. Parameters are those at which each knot's T is
    largest, and the scale of the edge functions makes them evenly spread.
    """
    places = finite("points", points)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise DomainError(f"points: expected shape (n, 3) or (n, 2), got {places.shape}")
    if not 2 <= (n := len(places)) <= MAX_POINTS:
        raise DomainError(f"points: expected 2 to {MAX_POINTS}, got {n}")
    a = _chord_lengths(places) if knots is None else finite("knots", knots)
    one_for_each("knots", a, n, "point")
    steps = np.diff(a)
    if not (steps > EPS * np.abs(a).max()).all():
        raise DomainError(f"knots: must ascend, got {a[int(steps.argmin())]:g} before {a[int(steps.argmin()) + 1]:g}")
    s, logs, is_ordinary = _local_weights(steps)
    scale = max(float(s[-1]) / 2, 1 / float(a[-1] - a[0]))
    weights = {"weights": np.exp(logs)} if is_ordinary else {"log_weights": logs}
    curve = Patch(a, places, edge_scale=scale, **weights)
    # s = k log((t − a_0)/(a_n − t)); the ends are the points' own.
    parameters = a[0] + (a[-1] - a[0]) / (1 + np.exp(-s / scale))
    parameters[[0, -1]] = a[[0, -1]]
    control, matrix = curve.control_points, curve.basis(parameters)
    size = float(np.abs(places).max()) or 1.0
    for rounds in range(MAX_ROUNDS + 1):
        missing = curve.control_points - matrix @ control
        distance = float(np.sqrt((missing**2).sum(axis=1)).max())
        if distance <= RESIDUAL_TOLERANCE * size:
            return Fit(curve.replace(control_points=control), parameters, rounds, distance)
        try:
            control = control + (missing if rounds < PLAIN_ROUNDS else np.linalg.solve(matrix, missing))
        except np.linalg.LinAlgError:
            break
    raise ToleranceError(f"the curve still misses a point by {distance:.3g} after {rounds} rounds: take other knots")


def _chord_lengths(points: FloatArray) -> FloatArray:
    """Return (n,) lengths along the polygon."""
    # Logarithms of weights grow with the ratio of steps; beyond 1e5 their rounding is too large for meshes.
    min_step = 1e-3
    chords = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    if not (chords > EPS * np.abs(points).max()).all():
        raise DomainError(f"points: {int(chords.argmin())} and {int(chords.argmin()) + 1} coincide and have no chord")
    return np.concatenate([[0.0], np.cumsum(np.maximum(chords, min_step * chords.max()))])


def _local_weights(steps: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
    """Return the points' torus coordinates, symmetric about 0, log weights, and whether the weights are floats.

    If ``s_{i+1} − s_i = κ/(a_{i+1} − a_i)`` and ``log ω_{i+1} − log ω_i = −(a_{i+1} − a_i)(s_i + s_{i+1})/2``, then for
    equally spaced knots, knot j has exp(−κ (i − j)²/2) times the weight of knot i at s_i.
    """
    # At a point, its own knot has e times the weight of each neighbour if κ = 2: errors shrink to 5/6.
    for kappa in (2.0, 1.0, 0.5):
        s = np.concatenate([[0.0], np.cumsum(kappa / steps)])
        s -= s[-1] / 2
        logs = np.concatenate([[0.0], -np.cumsum(steps * (s[1:] + s[:-1]) / 2)])
        if is_ordinary := bool(np.ptp(logs) <= 1300.0):  # the range of floats
            break
    return s, logs - (logs.min() + logs.max()) / 2, is_ordinary
