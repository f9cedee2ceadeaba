"""Planar patches: whether they are injective, for all weights and for their own."""

import math

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray, planar_cross
from gtb_cli.checks.probe import Probe
from gtb_cli.checks.report import Finding, not_applicable, number
from gtb_cli.knots.hull import knot_tolerance

MAX_TRIPLES = 1_000_000  # a tenth of a second: all triples of up to 182 knots, some of more
SPATIAL_NOTE = "the control points are not in a plane"


def for_all_weights(probe: Probe) -> Finding:
    """Tell whether no choice of weights folds the patch: all triangles of knots and of control points turn alike.

    A patch is injective for all positive weights exactly if det(1, a_i; 1, a_j; 1, a_k) and
    det(1, b_i; 1, b_j; 1, b_k) agree in sign for all i, j, k for which neither is zero (or all differ in sign: then
    the patch is turned over).
    """
    points = planar(probe.patch.control_points)
    if points is None:
        return not_applicable(SPATIAL_NOTE)
    knots, n = probe.patch.knots, len(probe.patch.knots)
    total = math.comb(n, 3)
    if total > MAX_TRIPLES:  # some, chosen alike every time
        triples = np.sort(np.random.default_rng(0).integers(0, n, (MAX_TRIPLES, 3)), axis=1)
        triples = triples[(np.diff(triples, axis=1) > 0).all(axis=1)]
    else:
        below = np.arange(n)[:, None] < np.arange(n)
        triples = np.argwhere(below[:, :, None] & below)
    signs = _signs(knots, *triples.T) * _signs(points, *triples.T)
    found = [tuple(triples[np.argmax(signs == sign)].tolist()) for sign in (1.0, -1.0) if (signs == sign).any()]
    if len(found) == 2:
        one, other = sorted(found)
        return number(0.0, f"no: knots {one} and {other} turn their control points opposite ways")
    if total > MAX_TRIPLES:
        return number(None, f"not decided: {MAX_TRIPLES} of {total} triples of knots speak for it, none against")
    if not found:
        return number(0.0, "no: the control points are on a line")
    straight = int((signs == 0).sum())
    but = f"; {straight} on lines to rounding do not count" if straight else ""
    alike = f"all {total - straight} triples of knots turn their control points the same way"
    return number(1.0, f"yes, inside the domain: {alike}{but}")


def jacobian_sign(probe: Probe) -> Finding:
    """Measure at what share of the sample parameters, where the Jacobian has a sign, the patch is turned over."""
    points = planar(probe.patch.control_points)
    if points is None:
        return not_applicable(SPATIAL_NOTE)
    tangents = probe.patch.replace(control_points=points).derivatives(probe.u[probe.inside])
    lengths = np.sqrt((tangents**2).sum(axis=1)).prod(axis=1)
    areas = planar_cross(tangents[:, :2, 0], tangents[:, :2, 1])
    known = np.abs(areas) > 64 * EPS * lengths
    count = int(known.sum())
    if not count:
        return number(None, "the patch has no area at any sample parameter")
    positive = int((areas[known] > 0).sum())
    share = min(positive, count - positive) / count
    if share:
        return number(share, f"the patch folds: the Jacobian is positive at {positive} of {count} sample parameters")
    sign = "positive" if positive else "negative"
    return number(0.0, f"the Jacobian is {sign} at all {count} sample parameters, which proves nothing between them")


def planar(points: FloatArray) -> FloatArray | None:
    """Return (n, 2) coordinates of points in their common plane, seen from above, or None if they have none."""
    centred = points - (points.min(axis=0) + points.max(axis=0)) / 2
    if np.abs(centred[:, 2]).max() <= knot_tolerance(points):
        return np.asarray(centred[:, :2])
    centred -= centred.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    normal = np.cross(axes[0], axes[1])
    if np.abs(centred @ normal).max() > knot_tolerance(points):
        return None
    return np.asarray(centred @ np.stack([axes[0], axes[1] if normal[2] >= 0 else -axes[1]], axis=1))


def _signs(points: FloatArray, i: IntArray, j: IntArray, k: IntArray) -> FloatArray:
    """Return (m,) signs of the areas of triangles, 0 if a corner lies within rounding on the line of the others."""
    first, second = points[j] - points[i], points[k] - points[i]
    areas = planar_cross(first, second)
    longest = np.maximum(np.abs(first).max(axis=1), np.abs(second).max(axis=1))
    return np.where(np.abs(areas) <= 2 * knot_tolerance(points) * longest, 0.0, np.sign(areas))
