"""Curves through points, and surfaces with the knots and weights of a patch, through points or near them."""

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, finite, one_for_each
from gtb_cli.errors import DomainError, ToleranceError
from gtb_cli.fairing.energy import energy_matrix
from gtb_cli.knots.triangulation import central_triangulation
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

RESIDUAL_TOLERANCE = 1e-12  # of the largest coordinate: the iteration ends as near to the points

# Largest number of points of a curve: with more, weights that are ordinary floats concentrate too little for the
# iteration to converge in time
MAX_POINTS = 100

# Rounds after which the equations behind the iteration are solved directly: if knots are so uneven that neighbours have
# nearly the same basis, the iteration would take tens of thousands of rounds
PLAIN_ROUNDS = 1000
MAX_ROUNDS = PLAIN_ROUNDS + 10


@frozen
class Fit:
    """A curve or surface through points, or near them. Made by `gtb_cli.fit`.

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


def fit(
    points: ArrayLike,
    knots: ArrayLike | None = None,
    *,
    patch: Patch | None = None,
    parameters: ArrayLike | None = None,
) -> Fit:
    """Find a curve through points, or a surface through them or near them.

    Parameters
    ----------
    points : (n, 3) or (n, 2) float
        Points in the order in which a curve passes them or, if there are as many, in the order of the knots of `patch`.
        A curve begins at the first and ends at the last of 2 to 100 points.
    knots : (n,) float, optional
        Knots of the curve, ascending. Default: the lengths of the polygon up to each point, from 0, with steps of at
        least a thousandth of the longest.
    patch : Patch, optional
        A surface, whose knots and weights the result has.
    parameters : (n, 2) float, optional
        Parameters of the points on the surface, in its linear parametrisation. Default: the knots, if there are as many
        points; otherwise by projection, corrected in rounds.

    Returns
    -------
    Fit
        A curve passes through all points, and so does a surface with as many knots, by progressive iterative
        approximation. Other surfaces are near the points: least squares with a little thin-plate energy.

    Raises
    ------
    DomainError
        Points or parameters of other shapes or numbers, neighbours that coincide (without `knots`), knots that do not
        ascend, or parameters outside Δ.
    ToleranceError
        1e-12 of the largest coordinate cannot be reached: basis functions are the same, as for coincident knots, or
        vanish at all parameters.

    Notes
    -----
    Control points start as the points, and in each round move by the distances that are missed:
    ``b_i ← b_i + p_i − P(t_i)``. This converges for curves because their basis is normalised and totally positive. That
    of a surface need not be, so no theorem guarantees convergence; at the knots, all patches that were tried converged.
    After 1000 rounds the limit is found as the solution of linear equations. Weights of a curve are free, and are
    chosen so that the basis is local: about 100 rounds suffice for 10 points and for 70. Its parameters are those at
    which each knot's T is largest, and the scale of the edge functions makes them evenly spread.

    References
    ----------
    Section 3, property (c); Thm 2.1 (c).
    """
    if patch is None:
        if parameters is not None:
            raise DomainError("parameters: are those of a surface, and no patch is given")
        return curve_through(points, knots)
    if knots is not None:
        raise DomainError("knots: are for curves, and a patch has its own")
    is_met = patch.dimension == 2 and np.ndim(points) == 2 and len(np.asarray(points)) == len(patch.knots)
    return (surface_through if is_met else surface_near)(points, patch, parameters)


def curve_through(points: ArrayLike, knots: ArrayLike | None = None) -> Fit:
    """Find a curve through points; see `fit`."""
    places = finite("points", points)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise DomainError(f"points: expected shape (n, 3) or (n, 2), got {places.shape}")
    n = len(places)
    if not 2 <= n <= MAX_POINTS:
        way_out = "; `patch` fits a surface to more" if n > MAX_POINTS else ""
        raise DomainError(f"points: expected 2 to {MAX_POINTS}, got {n}{way_out}")
    a = _chord_lengths(places) if knots is None else finite("knots", knots)
    one_for_each("knots", a, n, "point")
    steps = np.diff(a)
    if not (steps > EPS * np.abs(a).max()).all():
        raise DomainError(f"knots: must ascend, got {a[int(steps.argmin())]:g} before {a[int(steps.argmin()) + 1]:g}")
    s, logs, is_ordinary = _local_weights(steps)
    scale = max(float(s[-1]) / 2, 1 / float(a[-1] - a[0]))
    curve = Patch(a, places, log_weights=logs, edge_scale=scale)
    if is_ordinary:
        curve = curve.replace(weights=np.exp(logs))
    # s = k log((t − a_0)/(a_n − t)); the ends are the points' own.
    parameters = a[0] + (a[-1] - a[0]) / (1 + np.exp(-s / scale))
    parameters[[0, -1]] = a[[0, -1]]
    return _passed(curve, parameters, curve.basis(parameters), curve.control_points)


def _passed(patch: Patch, parameters: FloatArray, matrix: FloatArray, points: FloatArray) -> Fit:
    """Find control points with which a patch passes through points; `matrix` has the basis at the parameters."""
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
        is_ordinary = bool(np.ptp(logs) <= 1300.0)  # the range of floats
        if is_ordinary:
            break
    return s, logs - (logs.min() + logs.max()) / 2, is_ordinary


def surface_through(points: ArrayLike, patch: Patch, parameters: ArrayLike | None = None) -> Fit:
    """Find the surface through points, one for each knot; see `fit`."""
    places = _checked(points, patch)
    n = len(patch.knots)
    if len(places) != n:
        raise DomainError(f"points: expected {n}, one for each knot, got {len(places)}")
    p = patch.knots if parameters is None else _parameters(parameters, n)
    return _passed(patch, p, patch.basis(p, "linear"), places)


def surface_near(points: ArrayLike, patch: Patch, parameters: ArrayLike | None = None) -> Fit:
    """Find control points with which a surface is near (m, 3) points; without parameters, project them first.

    Raises `DomainError` as `fit` does.
    """
    smoothing = 1e-6  # weight of the thin-plate energy, which decides where there are no points
    places = _checked(points, patch)
    plate = energy_matrix(patch.domain, patch.log_products, "thin-plate")
    middle = places.mean(axis=0)

    def solved(p: FloatArray, rounds: int) -> Fit:
        """Return the fit with the least-squares control points, computed relative to the middle of the points."""
        t = patch.basis(p, "linear")
        normal = t.T @ t
        form = normal + smoothing * np.trace(normal) / np.trace(plate) * plate
        control = np.linalg.lstsq(form, t.T @ (places - middle), rcond=1e-13)[0] + middle
        fitted = patch.replace(control_points=control)
        distances = np.linalg.norm(fitted.evaluate(p, "linear") - places, axis=1)
        return Fit(fitted, p, rounds, float(distances.max()), float(np.sqrt((distances**2).mean())))

    if parameters is not None:
        return solved(_parameters(parameters, len(places)), 0)
    best = solved(_nearest(patch, places), 0)
    for rounds in range(1, 9):
        found = solved(_corrected(best.patch, places, best.parameters), rounds)
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


def _nearest(patch: Patch, points: FloatArray) -> FloatArray:
    """Return (m, 2) parameters of the nearest vertices of a mesh, moved slightly inside."""
    from scipy.spatial import cKDTree

    part = central_triangulation(patch.domain, 24)
    _, index = cKDTree(patch.evaluate(part.parameters, "linear")).query(points)
    return _corrected(patch, points, _inside(patch, part.parameters[index], 1e-9))


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
    return _inside(patch, base + step, 1e-9)


def _inside(patch: Patch, p: FloatArray, margin: float) -> FloatArray:
    """Move points towards the middle of Δ until they are inside by a fraction of its size."""
    shape = patch.domain
    centre = shape.vertices.mean(axis=0)
    slope = (p - centre) @ shape.normals.T
    room = ((centre - shape.vertices) * shape.normals).sum(axis=1) * (1 - margin)
    over = np.where(slope < 0, -slope / room, 0.0).max(axis=1)
    return np.asarray(centre + (p - centre) / np.maximum(over, 1.0)[:, None])
