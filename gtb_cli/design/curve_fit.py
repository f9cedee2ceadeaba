"""Curves through given points, by progressive iterative approximation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, finite
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.theory.patch import Patch

REACHED = 1e-12
"""Largest distance of the curve from a point that ends the iteration, of the largest coordinate of the points."""

CONCENTRATION = 2.0
"""How far apart the torus coordinates of neighbouring points are, times their knots' distance: at a point its own knot
has e times the weight of each neighbour's, and errors shrink to 5/6 in a round."""

LARGEST_RANGE = 1300.0
"""Range of logarithms of weights that stay ordinary floats, which is kept to where the basis is local all the same."""

PATIENCE = 1000
"""Rounds after which the equations are solved that the iteration tends to solve: knots are so uneven that neighbours
have nearly the same basis, and it would take tens of thousands."""

MAX_POINTS = 100
"""With more, weights within that range concentrate too little for the iteration to converge in time."""

MAX_ROUNDS = PATIENCE + 10

SHORTEST_STEP = 1e-3
"""Shortest step between knots that are not given, of the longest. Ranges of logarithms of weights grow with the
ratio of the steps, and beyond some 1e5 their rounding is more than the parametrisation of meshes bears."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A curve or surface through points, or near them. Made by `gtb_cli.design.fit.fit`.

    Attributes
    ----------
    patch : Patch
    parameters : (n,) or (n, 2) float
        Where it passes the points, in the order of these: a curve's own parameters, those of the linear
        parametrisation of a surface.
    rounds : int
        Of the iteration, or of corrections of the parameters.
    distance : float
        Largest distance that is left, in model units.
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
        """The patch, where it is a curve."""
        return self.patch


def curve_through(points: ArrayLike, knots: ArrayLike | None = None) -> Fit:
    """Find a curve through points by progressive iterative approximation.

    Control points begin as the points, and in each round move by what the curve misses these by:
    ``b_i ← b_i + p_i − P(t_i)``. The basis is normalised and totally positive, so that this converges.

    Parameters
    ----------
    points : (n, 3) or (n, 2) float
        In the order in which the curve passes them; it begins in the first and ends in the last.
    knots : (n,) float, optional
        Ascending. Default: the lengths of the polygon of points up to each, from 0, steps being `SHORTEST_STEP` of
        the longest at least.

    Returns
    -------
    Fit

    Raises
    ------
    DomainError
        Fewer than two points or more than `MAX_POINTS`, neighbours that coincide (without `knots`), or knots that do
        not ascend.
    ToleranceError
        `REACHED` is not: knots so near each other that rounding makes their basis functions the same.

    Notes
    -----
    Weights are free, and are chosen so that the basis is local: about 100 rounds do for 10 points and for 70, more for
    more and for uneven ones. After `PATIENCE` rounds what they tend to is found at once, as the solution of linear
    equations. The parameters are those at which each knot's T is the largest, and the scale of the edge functions is
    such that they are spread evenly.

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
    if a.shape != (n,):
        raise DomainError(f"knots: expected {n}, one for each point, got shape {a.shape}")
    steps = np.diff(a)
    if not (steps > EPS * np.abs(a).max()).all():
        raise DomainError(f"knots: must ascend, got {a[int(steps.argmin())]:g} before {a[int(steps.argmin()) + 1]:g}")
    s, logs = _local_weights(steps)
    scale = max(float(s[-1]) / 2, 1 / float(a[-1] - a[0]))
    curve = Patch(a, places, log_weights=logs, edge_scale=scale)
    if np.ptp(logs) <= LARGEST_RANGE:
        curve = curve.replace(weights=np.exp(logs))
    # s = k log((t − a_0)/(a_n − t)); the ends are the points' own.
    parameters = a[0] + (a[-1] - a[0]) / (1 + np.exp(-s / scale))
    parameters[[0, -1]] = a[[0, -1]]
    return passed(curve, parameters, curve.basis(parameters), curve.control_points)


def passed(patch: Patch, parameters: FloatArray, matrix: FloatArray, points: FloatArray) -> Fit:
    """Give a patch the control points with which it passes points, by progressive iterative approximation.

    Parameters
    ----------
    patch : Patch
    parameters : (n,) or (n, 2) float
    matrix : (n, n) float
        Its basis there.
    points : (n, 3) float

    Raises
    ------
    ToleranceError
        `REACHED` is not.
    """
    control = points.copy()
    size = float(np.abs(points).max()) or 1.0
    for rounds in range(MAX_ROUNDS + 1):
        missing = points - matrix @ control
        distances = np.sqrt((missing**2).sum(axis=1))
        distance = float(distances.max())
        if distance <= REACHED * size:
            fitted = patch.replace(control_points=control)
            return Fit(fitted, parameters, rounds, distance, float(np.sqrt((distances**2).mean())))
        try:
            control += missing if rounds < PATIENCE else np.linalg.solve(matrix, missing)
        except np.linalg.LinAlgError:
            break
    kind, ways = ("curve", "knots") if patch.dimension == 1 else ("surface", "points or parameters")
    raise ToleranceError(f"the {kind} still misses a point by {distance:.3g} after {rounds} rounds: take other {ways}")


def _chord_lengths(points: FloatArray) -> FloatArray:
    """(n,) lengths along the polygon."""
    chords = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    if not (chords > EPS * np.abs(points).max()).all():
        raise DomainError(f"points: {int(chords.argmin())} and {int(chords.argmin()) + 1} coincide, and have no chord")
    return np.concatenate([[0.0], np.cumsum(np.maximum(chords, SHORTEST_STEP * chords.max()))])


def _local_weights(steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Torus coordinates of the points, symmetric about 0, and log weights, for knots with given distances.

    With ``s_{i+1} − s_i = κ/(a_{i+1} − a_i)`` and ``log ω_{i+1} − log ω_i = −(a_{i+1} − a_i)(s_i + s_{i+1})/2`` knot j
    has exp(−κ (i − j)²/2) of knot i's weight at s_i, if knots are equally spaced.
    """
    for kappa in (CONCENTRATION, CONCENTRATION / 2, CONCENTRATION / 4):
        s = np.concatenate([[0.0], np.cumsum(kappa / steps)])
        s -= s[-1] / 2
        logs = np.concatenate([[0.0], -np.cumsum(steps * (s[1:] + s[:-1]) / 2)])
        if np.ptp(logs) <= LARGEST_RANGE:
            break
    return s, logs - (logs.min() + logs.max()) / 2
