"""Properties of curves that follow from their totally positive bases, and one weight that tends to infinity."""

import math
from itertools import permutations

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, choice, evenly, principal_axes
from gtb_cli.checks.report import Finding, at_most, not_applicable, number, within_rounding
from gtb_cli.knots.decomposition import lifting_of_knot
from gtb_cli.moment.torus import exponents
from gtb_cli.theory.basis import torus_coordinates
from gtb_cli.theory.degeneration import degenerate

MAX_MINOR_ORDER = 4  # rows of a sampled minor, which is then a sum of at most 24 products

UNDERFLOW_NOTE = "in each sampled minor there are values of the basis below the range of floats"


MIN_CHORD = 1e-3  # of the extent: a shorter chord is joined with the next, as its direction would be rounding

PLANE_WIDTH = 1e-12  # of the extent: control points in a slab as thin lie in a plane


def total_positivity(probe: Probe) -> Finding:
    """Measure minors of the collocation matrix of the rational basis, relative to the sum of their products' sizes."""
    minors, bound = _minors(probe)
    if not len(minors):
        return not_applicable(UNDERFLOW_NOTE)
    value = max(0.0, -float(minors.min()))
    return within_rounding(
        value, bound, f"largest negative minor of up to {MAX_MINOR_ORDER} rows, of its products' sum"
    )


def strict_total_positivity(probe: Probe) -> Finding:
    """Measure the same minors, which are positive at parameters inside Δ for distinct knots."""
    if probe.repetitions:
        return not_applicable("repeated knots make equal columns: the basis is merely totally positive")
    minors, bound = _minors(probe)
    if not len(minors):
        return not_applicable(UNDERFLOW_NOTE)
    smallest = float(minors.min())
    undecided = float((np.abs(minors) <= bound).mean())
    reason = "negative of the smallest sampled minor, at parameters inside the domain"
    if undecided and smallest >= -bound:
        return number(-smallest, f"{reason}: {undecided:.0%} of them are within rounding of 0")
    return at_most(-smallest, -bound, reason)


def _minors(probe: Probe) -> tuple[FloatArray, float]:
    """Return sampled minors, relative to the sums of their products' sizes, and what rounding may do to one."""
    count = 400  # of each order
    n = len(probe.patch.knots)
    u = np.sort(probe.u[probe.inside, 0])
    basis = probe.patch.basis(u)[:, np.argsort(probe.patch.knots[:, 0], kind="stable")]
    ratios = [np.zeros(0)]
    orders = min(MAX_MINOR_ORDER, n, len(u))
    for order in range(1, orders + 1):
        spread = evenly(count, 2 * order)
        rows, columns = (_subsets(part, total) for part, total in ((spread[:, :order], len(u)), (spread[:, order:], n)))
        entries = basis[rows[:, :, None], columns[:, None, :]]
        for axis in (2, 1):  # rows, then columns, are scaled: the minor is scaled by the product of the factors
            entries = entries / np.maximum(np.abs(entries).max(axis=axis, keepdims=True), np.finfo(float).tiny)
        minor, size = np.zeros(count), np.zeros(count)
        for permutation in permutations(range(order)):
            product = np.prod(entries[:, np.arange(order), permutation], axis=1)
            minor += _sign(permutation) * product
            size += np.abs(product)
        # Inside Δ a zero can only be a value below the range of floats.
        decidable = (size != 0) & (entries != 0).all(axis=(1, 2))
        ratios.append(minor[decidable] / size[decidable])
    bound = 2 * orders * probe.rounding + EPS * math.factorial(orders)
    return np.nan_to_num(np.concatenate(ratios), nan=-np.inf), bound


def _subsets(spread: FloatArray, count: int) -> IntArray:
    """Return (m, k) ascending, distinct indices below `count` from (m, k) numbers in [0, 1)."""
    k = spread.shape[1]
    return np.asarray(np.sort(spread * (count - k + 1), axis=1).astype(np.int64) + np.arange(k))


def _sign(permutation: tuple[int, ...]) -> int:
    inversions = sum(a > b for i, a in enumerate(permutation) for b in permutation[i + 1 :])
    return -1 if inversions % 2 else 1


def progressive_iteration(probe: Probe) -> Finding:
    """Measure the spectral radius of I − C, where C is the collocation matrix at the knots: errors shrink by it."""
    most = 300  # for the time of dense eigenvalues
    patch = probe.patch
    if probe.repetitions:
        return not_applicable("repeated knots make the collocation matrix singular")
    if len(patch.knots) > most:
        return not_applicable(f"measured for at most {most} knots")
    order = np.argsort(patch.knots[:, 0], kind="stable")
    matrix = patch.basis(patch.knots[order])[:, order]
    if not np.isfinite(matrix).all():
        return at_most(np.inf, 1.0, "values of the basis are not finite")
    eigenvalues = np.linalg.eigvals(matrix)
    radius = float(np.abs(1 - eigenvalues).max())
    doubt = len(matrix) * VALUE_ROUNDINGS * EPS + 4 * probe.rounding
    reason = "factor by which errors shrink in a round, at the knots"
    if abs(radius - 1) <= doubt**0.5:
        return number(radius, f"{reason}: too near to 1 to tell")
    return at_most(radius, 1.0, reason)


def variation_diminishing(probe: Probe) -> Finding:
    """Compare how often lines (planes for a curve in space) cross the curve and its control polygon."""
    count = 100  # lines, or planes
    grazing_distance = 1e-6  # of the extent: lines as near to a control point are left out
    control = _polygon(probe) / probe.extent
    points = _linear_points(probe, 513) / probe.extent  # between these, crossings may be missed, but none are added
    axes, flat = _plane(control)
    spread = evenly(count, 3)
    angle, z = 2 * np.pi * spread[:, 0], np.zeros(count) if flat else 2 * spread[:, 1] - 1
    ring = np.sqrt(1 - z**2)
    normals = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1) @ axes
    sides, curve_sides = normals @ control.T, normals @ points.T
    low, high = sides.min(axis=1), sides.max(axis=1)
    offset = low + spread[:, 2] * (high - low)
    sides, curve_sides = sides - offset[:, None], curve_sides - offset[:, None]
    clear = np.abs(sides).min(axis=1) > grazing_distance + probe.distance_rounding
    if not clear.any():
        return not_applicable("the control points all coincide")
    excess = _changes(curve_sides[clear], probe.distance_rounding) - _changes(sides[clear], 0.0)
    what = "lines" if flat else "planes (the curve is not planar)"
    reason = f"crossings of the curve beyond those of its control polygon, largest of {int(clear.sum())} {what}"
    return at_most(float(max(0, excess.max())) if np.isfinite(points).all() else np.inf, 0.0, reason)


def _changes(values: FloatArray, tolerance: float) -> IntArray:
    """Return (m,) numbers of sign changes along the rows; values within the tolerance do not count."""
    signs = np.sign(values) * (np.abs(values) > tolerance)
    last = np.maximum.accumulate(np.where(signs != 0, np.arange(signs.shape[1]), -1), axis=1)
    filled = np.where(last >= 0, np.take_along_axis(signs, np.maximum(last, 0), axis=1), 0)
    return np.asarray((filled[:, 1:] * filled[:, :-1] < 0).sum(axis=1))


def convexity(probe: Probe) -> Finding:
    """Check that a curve with a convex control polygon turns one way, and once around with its chord."""
    turn_tolerance = 1e-6  # in radians, of the sum of a polygon's turns
    control = _polygon(probe)
    axes, flat = _plane(control / probe.extent)
    if not flat:
        return not_applicable("the control points are not in a plane")
    sine, turning = _turning(control @ axes[:2].T, probe.extent)
    if sine is None:
        return not_applicable("the control points are on a line")
    if sine > probe.distance_rounding or abs(abs(turning) - 2 * np.pi) > turn_tolerance:
        return not_applicable("the control polygon, closed by its chord, is not convex")
    points = _linear_points(probe, 129) @ axes[:2].T
    sine, turning = _turning(points, probe.extent)
    if sine is None:
        return not_applicable("the curve is a segment to rounding")
    if abs(abs(turning) - 2 * np.pi) > turn_tolerance:
        return at_most(abs(turning) / (2 * np.pi), 1.0, "turns of the curve, closed by its chord")
    bound = 2 * probe.distance_rounding / MIN_CHORD
    return within_rounding(sine, bound, "sine of the largest turn the wrong way; the control polygon is convex")


def _turning(points: FloatArray, extent: float) -> tuple[float | None, float]:
    """Return the sine of a closed polygon's largest turn the wrong way (None if straight), and the sum of turns."""
    kept = [points[0]]
    for point in points[1:]:
        if np.hypot(*(point - kept[-1])) > MIN_CHORD * extent:
            kept.append(point)
    while len(kept) > 1 and np.hypot(*(kept[-1] - kept[0])) <= MIN_CHORD * extent:
        kept.pop()
    corners = np.array(kept)
    chords = np.roll(corners, -1, axis=0) - corners
    if len(corners) < 3 or not np.isfinite(corners).all():
        return None if np.isfinite(points).all() else np.inf, 0.0
    following = np.roll(chords, -1, axis=0)
    cross = chords[:, 0] * following[:, 1] - chords[:, 1] * following[:, 0]
    dot = (chords * following).sum(axis=1)
    sines = cross / np.hypot(*chords.T) / np.hypot(*following.T)
    turning = float(np.arctan2(cross, dot).sum())
    if np.abs(sines).max() <= PLANE_WIDTH:
        return None, 0.0
    wrong = -sines if turning > 0 else sines
    return max(0.0, float(wrong.max())), turning


def one_weight(probe: Probe) -> Finding:
    """Check that every point inside Δ goes to a knot's control point if its weight outgrows all others."""
    infinite_weight_log = 120.0  # logarithm of the ratio between one knot's share and all others
    patch = probe.patch
    u = np.asarray(patch.domain.center + patch.domain.size * np.array([[-0.25], [0.0], [0.25]]))
    s = torus_coordinates(patch.domain, patch.domain.heights_of_columns(u))
    logs = exponents(patch.knots - patch.domain.center, patch.log_products, s)
    worst = 0.0
    n = len(patch.knots)
    for k in choice(n, 16):
        growth = infinite_weight_log + float((logs.max(axis=0) - logs[k]).max())
        heavy = degenerate(patch, math.e, growth * lifting_of_knot(n, k))
        worst = max(worst, probe.distance(heavy.evaluate(u), patch.control_points[k]))
    return within_rounding(worst, probe.distance_rounding, "largest distance from the control point, of the extent")


def _polygon(probe: Probe) -> FloatArray:
    """Return (n, 3) control points in the order of their knots, relative to their middle."""
    points = probe.patch.control_points[np.argsort(probe.patch.knots[:, 0], kind="stable")]
    return np.asarray(points - _middle(probe))


def _middle(probe: Probe) -> FloatArray:
    control = probe.patch.control_points
    return np.asarray((control.min(axis=0) + control.max(axis=0)) / 2)


def _linear_points(probe: Probe, count: int) -> FloatArray:
    """Return (count, 3) points of the curve, evenly spaced in the linear parametrisation, about the same middle."""
    start, end = probe.patch.domain.vertices
    p = start + (end - start) * np.linspace(0.0, 1.0, count)[:, None]
    p[-1] = end
    return np.asarray(probe.patch.points_at(probe.linear.locations(p), count) - _middle(probe))


def _plane(control: FloatArray) -> tuple[FloatArray, bool]:
    """Return the principal axes (rows) of control points, and whether these lie in the plane of the first two."""
    axes = principal_axes(control - control.mean(axis=0))
    return axes, bool(np.ptp(control @ axes[2]) <= PLANE_WIDTH + 8 * EPS * np.abs(control).max())
