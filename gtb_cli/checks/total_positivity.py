"""Properties of curves that follow from their totally positive bases."""

import math
from itertools import permutations

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe
from gtb_cli.checks.report import Finding, at_most, not_applicable, number, within_rounding

MAX_MINOR_ORDER = 4  # rows of a sampled minor, which is then a sum of at most 24 products
UNDERFLOW_NOTE = "in each sampled minor there are values of the basis below the range of floats"
MIN_CHORD = 1e-3  # of the extent: a shorter chord is joined with the next, as its direction would be rounding
PLANE_WIDTH = 1e-12  # of the extent: control points in a slab as thin lie in a plane


def total_positivity(probe: Probe) -> Finding:
    """Measure minors of the collocation matrix of the rational basis, relative to the sum of their products' sizes."""
    minors, bound = _minors(probe)
    if not len(minors):
        return not_applicable(UNDERFLOW_NOTE)
    reason = f"largest negative minor of up to {MAX_MINOR_ORDER} rows, of its products' sum"
    return within_rounding(max(0.0, -float(minors.min())), bound, reason)


def strict_total_positivity(probe: Probe) -> Finding:
    """Measure the same minors, which are positive at parameters inside Δ for distinct knots."""
    if probe.merged is not probe.patch:
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
    random = np.random.default_rng(0)
    places = probe.inside[np.argsort(probe.u[probe.inside, 0])]
    basis = probe.basis[places][:, np.argsort(probe.patch.knots[:, 0], kind="stable")]
    ratios = [np.zeros(0)]
    orders = min(MAX_MINOR_ORDER, *basis.shape)
    for order in range(1, orders + 1):
        rows, columns = (
            np.sort(random.integers(0, total - order + 1, (count, order)), axis=1) + np.arange(order)
            for total in basis.shape
        )
        entries = basis[rows[:, :, None], columns[:, None, :]]
        for axis in (2, 1):  # rows, then columns, are scaled: the minor is scaled by the product of the factors
            entries = entries / np.maximum(np.abs(entries).max(axis=axis, keepdims=True), np.finfo(float).tiny)
        minor, size = np.zeros(count), np.zeros(count)
        for permutation in permutations(range(order)):
            product = np.prod(entries[:, np.arange(order), permutation], axis=1)
            minor += np.linalg.det(np.eye(order)[list(permutation)]) * product
            size += np.abs(product)
        # Inside Δ a zero can only be a value below the range of floats.
        decidable = (size != 0) & (entries != 0).all(axis=(1, 2))
        ratios.append(minor[decidable] / size[decidable])
    bound = 2 * orders * probe.rounding + EPS * math.factorial(orders)
    return np.nan_to_num(np.concatenate(ratios), nan=-np.inf), bound


def progressive_iteration(probe: Probe) -> Finding:
    """Measure the spectral radius of I − C, where C is the collocation matrix at the knots: errors shrink by it."""
    most = 300  # for the time of dense eigenvalues
    patch = probe.patch
    if probe.merged is not patch:
        return not_applicable("repeated knots make the collocation matrix singular")
    if len(patch.knots) > most:
        return not_applicable(f"measured for at most {most} knots")
    order = np.argsort(patch.knots[:, 0], kind="stable")
    matrix = patch.basis(patch.knots[order])[:, order]
    if not np.isfinite(matrix).all():
        return at_most(np.inf, 1.0, "values of the basis are not finite")
    radius = float(np.abs(1 - np.linalg.eigvals(matrix)).max())
    doubt = len(matrix) * VALUE_ROUNDINGS * EPS + 4 * probe.rounding
    reason = "factor by which errors shrink in a round, at the knots"
    if abs(radius - 1) <= doubt**0.5:
        return number(radius, f"{reason}: too near to 1 to tell")
    return at_most(radius, 1.0, reason)


def variation_diminishing(probe: Probe) -> Finding:
    """Compare how often lines (planes for a curve in space) cross the curve and its control polygon."""
    count = 100  # lines, or planes
    grazing_distance = 1e-6  # of the extent: lines as near to a control point are left out
    control, points, flat = _in_principal_axes(probe, 513)  # between samples, crossings may be missed, none are added
    random = np.random.default_rng(0)
    angle, place = 2 * np.pi * random.random(count), random.random((count, 1))
    z = np.zeros(count) if flat else random.uniform(-1, 1, count)
    ring = np.sqrt(1 - z**2)
    normals = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    sides, curve_sides = normals @ control.T, normals @ points.T
    offset = sides.min(axis=1, keepdims=True) + place * np.ptp(sides, axis=1, keepdims=True)
    sides, curve_sides = sides - offset, curve_sides - offset
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
    last = np.maximum.accumulate(np.where(signs != 0, np.arange(signs.shape[1]), 0), axis=1)
    filled = np.take_along_axis(signs, last, axis=1)
    return np.asarray((filled[:, 1:] * filled[:, :-1] < 0).sum(axis=1))


def convexity(probe: Probe) -> Finding:
    """Check that a curve with a convex control polygon turns one way, and once around with its chord."""
    turn_tolerance = 1e-6  # of a whole turn
    control, points, flat = _in_principal_axes(probe, 129)
    if not flat:
        return not_applicable("the control points are not in a plane")
    wrong, turns = _turning(control)
    if math.isnan(wrong):
        return not_applicable("the control points are on a line")
    if wrong > probe.distance_rounding or abs(turns - 1) > turn_tolerance:
        return not_applicable("the control polygon, closed by its chord, is not convex")
    wrong, turns = _turning(points)
    if math.isnan(wrong):
        return not_applicable("the curve is a segment to rounding")
    if abs(turns - 1) > turn_tolerance:
        return at_most(abs(turns - 1), turn_tolerance, "difference from one turn of the curve, closed by its chord")
    bound = 2 * probe.distance_rounding / MIN_CHORD
    return within_rounding(wrong, bound, "sine of the largest turn the wrong way; the control polygon is convex")


def _turning(points: FloatArray) -> tuple[float, float]:
    """Return the sine of a closed polygon's largest turn the wrong way (NaN if it is straight), and its turns."""
    places = (points[:, :2] @ [1, 1j]).tolist()
    kept = places[:1]
    for place in places[1:]:
        if abs(place - kept[-1]) > MIN_CHORD:
            kept.append(place)
    while len(kept) > 1 and abs(kept[-1] - kept[0]) <= MIN_CHORD:
        kept.pop()
    if len(kept) < 3:
        return math.nan, 0.0
    chords = np.roll(kept, -1) - kept
    angles = np.angle(np.roll(chords, -1) / chords)
    angles *= math.copysign(1.0, angles.sum())  # a zigzag may turn by 0 in all
    sines = np.sin(angles)
    return math.nan if np.abs(sines).max() <= PLANE_WIDTH else max(0.0, -float(sines.min())), angles.sum() / (2 * np.pi)


def _in_principal_axes(probe: Probe, count: int) -> tuple[FloatArray, FloatArray, bool]:
    """Return control points, (n, 3), and even points of the curve, (count, 3), and tell whether all are in a plane.

    Coordinates are those of `Probe.along_principal_axes`.
    """
    patch = probe.patch
    control = patch.control_points[np.argsort(patch.knots[:, 0], kind="stable")]
    start, end = patch.domain.vertices
    points = patch.evaluate(np.linspace(start, end, count), "linear")
    control, points = probe.along_principal_axes(control, points)
    return control, points, bool(np.ptp(control[:, 2]) <= PLANE_WIDTH + 8 * EPS * np.abs(control).max())
