"""Curves through given points, by progressive iterative approximation."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, finite, one_for_each
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

RESIDUAL_TOLERANCE = 1e-12  # of the largest coordinate: the iteration ends as near to the points


MAX_LOG_RANGE = 1300.0  # of weights that are ordinary floats; it is kept if the basis is local nevertheless

# Rounds after which the equations behind the iteration are solved directly: if knots are so uneven that neighbours have
# nearly the same basis, the iteration would take tens of thousands of rounds
PLAIN_ROUNDS = 1000

# Largest number of points: with more, weights in `MAX_LOG_RANGE` concentrate too little for the iteration to converge
# in time
MAX_POINTS = 100

MAX_ROUNDS = PLAIN_ROUNDS + 10


@frozen
class Fit:
    """A curve or surface through points, or near them. Made by `gtb_cli.design.fit.fit`.

    Attributes
    ----------
    patch : Patch
    parameters : (n,) or (n, 2) float
        Parameters of the points, in their order: a curve's own parameters, or those of the linear parametrisation of a
        surface.
    rounds : int
        Number of rounds of the iteration, or of corrections of the parameters.
    distance : float
        Largest remaining distance from a point, in model units.
    mean : float
        Root of the mean square of the distances.
    """

    patch: Patch
    parameters: FloatArray
    rounds: int
    distance: float
    mean: float

    @property
    def curve(self) -> Patch:
        """The patch, if it is a curve."""
        return self.patch


def curve_through(points: ArrayLike, knots: ArrayLike | None = None) -> Fit:
    """Find a curve through points by progressive iterative approximation.

    Control points start as the points, and in each round move by the distances that the curve misses:
    ``b_i ← b_i + p_i − P(t_i)``. This converges because the basis is normalised and totally positive.

    Parameters
    ----------
    points : (n, 3) or (n, 2) float
        Points in the order in which the curve passes them; it begins at the first and ends at the last.
    knots : (n,) float, optional
        Ascending. Default: the lengths of the polygon up to each point, from 0, with steps of at least a
        thousandth of the longest.

    Raises
    ------
    DomainError
        Fewer than two points or more than `MAX_POINTS`, neighbours that coincide (without `knots`), or knots that do
        not ascend.
    ToleranceError
        `RESIDUAL_TOLERANCE` cannot be reached: knots are so close that rounding makes their basis functions the same.

    Notes
    -----
    Weights are free, and are chosen so that the basis is local: about 100 rounds suffice for 10 points and for 70, and
    more are needed for more or uneven points. After `PLAIN_ROUNDS` their limit is found as the solution of linear
    equations. The parameters are those at which each knot's T is largest, and the scale of the edge functions makes
    them evenly spread.

    References
    ----------
    Section 3, property (c); Thm 2.1 (c).
    """
    places = finite("points", points)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise DomainError(f"points: expected shape (n, 3) or (n, 2), got {places.shape}")
    n = len(places)
    if not 2 <= n <= MAX_POINTS:
        raise DomainError(f"points: expected 2 to {MAX_POINTS}, got {n}")
    a = _chord_lengths(places) if knots is None else finite("knots", knots)
    one_for_each("knots", a, n, "point")
    steps = np.diff(a)
    if not (steps > EPS * np.abs(a).max()).all():
        raise DomainError(f"knots: must ascend, got {a[int(steps.argmin())]:g} before {a[int(steps.argmin()) + 1]:g}")
    s, logs = _local_weights(steps)
    scale = max(float(s[-1]) / 2, 1 / float(a[-1] - a[0]))
    curve = Patch(a, places, log_weights=logs, edge_scale=scale)
    if np.ptp(logs) <= MAX_LOG_RANGE:
        curve = curve.replace(weights=np.exp(logs))
    # s = k log((t − a_0)/(a_n − t)); the ends are the points' own.
    parameters = a[0] + (a[-1] - a[0]) / (1 + np.exp(-s / scale))
    parameters[[0, -1]] = a[[0, -1]]
    return passed(curve, parameters, curve.basis(parameters), curve.control_points)


def passed(patch: Patch, parameters: FloatArray, matrix: FloatArray, points: FloatArray) -> Fit:
    """Find control points with which a patch passes through points, by progressive iterative approximation.

    Parameters
    ----------
    patch : Patch
    parameters : (n,) or (n, 2) float
    matrix : (n, n) float
        Values of the basis at the parameters.
    points : (n, 3) float

    Raises
    ------
    ToleranceError
        `RESIDUAL_TOLERANCE` cannot be reached.
    """
    control = points.copy()
    size = float(np.abs(points).max()) or 1.0
    for rounds in range(MAX_ROUNDS + 1):
        missing = points - matrix @ control
        distances = np.sqrt((missing**2).sum(axis=1))
        distance = float(distances.max())
        if distance <= RESIDUAL_TOLERANCE * size:
            fitted = patch.replace(control_points=control)
            return Fit(fitted, parameters, rounds, distance, float(np.sqrt((distances**2).mean())))
        try:
            control += missing if rounds < PLAIN_ROUNDS else np.linalg.solve(matrix, missing)
        except np.linalg.LinAlgError:
            break
    kind, ways = ("curve", "knots") if patch.dimension == 1 else ("surface", "points or parameters")
    raise ToleranceError(f"the {kind} still misses a point by {distance:.3g} after {rounds} rounds: take other {ways}")


def _chord_lengths(points: FloatArray) -> FloatArray:
    """Return (n,) lengths along the polygon."""
    # Logarithms of weights grow with the ratio of steps; beyond 1e5 their rounding is too large for meshes.
    min_step = 1e-3
    chords = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    if not (chords > EPS * np.abs(points).max()).all():
        raise DomainError(f"points: {int(chords.argmin())} and {int(chords.argmin()) + 1} coincide and have no chord")
    return np.concatenate([[0.0], np.cumsum(np.maximum(chords, min_step * chords.max()))])


def _local_weights(steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return torus coordinates of the points, symmetric about 0, and log weights, for knots with given distances.

    If ``s_{i+1} − s_i = κ/(a_{i+1} − a_i)`` and ``log ω_{i+1} − log ω_i = −(a_{i+1} − a_i)(s_i + s_{i+1})/2``, then for
    equally spaced knots, knot j has exp(−κ (i − j)²/2) times the weight of knot i at s_i.
    """
    concentration = 2.0  # at a point, its own knot has e times the weight of each neighbour: errors shrink to 5/6
    for kappa in (concentration, concentration / 2, concentration / 4):
        s = np.concatenate([[0.0], np.cumsum(kappa / steps)])
        s -= s[-1] / 2
        logs = np.concatenate([[0.0], -np.cumsum(steps * (s[1:] + s[:-1]) / 2)])
        if np.ptp(logs) <= MAX_LOG_RANGE:
            break
    return s, logs - (logs.min() + logs.max()) / 2
