"""Curves of edges beside each other: proofs that two are equal, and distances; `same_edges` decides."""

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, ascending, column_dot, distinct
from gtb_cli.models.rational_equality import Rational, corners_of, difference, least_difference
from gtb_cli.theory.corner_powers import alike, summed
from gtb_cli.theory.edges import CURVE_TOLERANCE, Curve
from gtb_cli.values import by_value


@by_value
class Match:
    """Which points of one curve correspond to which of another."""

    distance: float  # between corresponding points, at most: a bound if `proved`, otherwise measured
    proved: bool  # the curves are equal
    even: bool  # equal fractions correspond
    places: FloatArray | None = None  # (2, k) ascending fractions of both curves from 0 to 1, which correspond
    torus: FloatArray | None = None  # (α, β) if torus coordinates s and α s + β correspond
    turned: bool = False  # the second curve was reversed first

    def carried(self, one: Curve, other: Curve, fractions: FloatArray, *, back: bool = False) -> FloatArray:
        """Return fractions of the second curve at (m,) fractions of the first; with `back`, the other way round."""
        if self.even:
            return fractions
        if back:
            one, other = other, one
        result, inside = np.clip(fractions, 0.0, 1.0), (fractions > 0) & (fractions < 1)
        t = fractions[inside]
        if self.torus is not None:
            scale, shift = self.torus
            s = one.moments.inverse(t[:, None])
            result[inside] = other.moments((s - shift) / scale if back else s * scale + shift)[:, 0]
        else:
            assert self.places is not None, "curves correspond evenly, by torus coordinates, or by places"
            ours, theirs = self.places[::-1] if back else self.places
            after = np.searchsorted(ours, t, side="right")
            low, high = theirs[np.maximum(after - 2, 0)], theirs[np.minimum(after + 1, len(ours) - 1)]
            result[inside] = other.nearest(one.points_at(t), np.interp(t, ours, theirs), low, high)[0]
        return np.asarray(result)


def equal(one: Curve, other: Curve, tolerance: float) -> Match | None:
    """Prove that two curves have the same points in the same order, within a distance; None if there is no proof.

    Curves P and Q with Q(α s + β) = P(s), as after a change of degree, of weights by κ e^{σ a} or of knots by an affine
    map, are recognised by their `difference`, so that no place is missed, however narrow; parts of a line by control
    points on it. The first control points that differ from an end give α and β.
    Curves related by another change of parameters, which only curves run through at a speed of higher degree have,
    are not recognised unless they are straight.
    """
    if np.linalg.norm(one.ends - other.ends, axis=1).max() > tolerance:
        return None
    first, second = (
        Rational(each.knots[:, None], each.log_weights, each.points, np.stack([each.knots, 1 - each.knots], axis=1))
        for each in (one, other)
    )
    rounding = 64 * EPS * float(max(np.abs(one.points).max(), np.abs(other.points).max()))
    for least in (tolerance, rounding):
        for end, other_end in zip(corners_of(first, least), corners_of(second, least), strict=False):
            turn, start = end.carried(other_end, [0])
            distance, shift = least_difference(first, second, turn, start, tolerance)
            if distance <= tolerance:
                fractions, others = (each._replace(points=each.knots) for each in (first, second))
                apart, _ = difference(fractions, others, turn, shift)
                is_even = bool(apart <= CURVE_TOLERANCE * np.diff(one.knots).min())
                return Match(distance, True, is_even, torus=np.array([turn[0, 0], shift[0]]))
    uneven = [_unevenness(curve, one.ends, tolerance / 2) for curve in (one, other)]
    if sum(uneven) <= tolerance:
        return Match(tolerance, True, True)
    found = matched(one, other, tolerance) if sum(uneven) < np.inf else None
    return found and Match(tolerance, True, False, found.places)


def _unevenness(curve: Curve, ends: FloatArray, tolerance: float) -> float:
    """Return how far control points of a straight curve are from their knots' fractions of it; infinite if it is none.

    It is straight if they are within a distance of the segment between the ends, and it never turns back: the
    numerator of its derivative has no negative coefficient.
    """
    chord = ends[1] - ends[0]
    length = float(np.linalg.norm(chord))
    if length <= tolerance:
        return np.inf
    offsets = curve.points - ends[0]
    along = offsets @ chord / length
    across = np.linalg.norm(offsets - np.outer(along / length, chord), axis=1)
    if across.max() > tolerance or along.min() < -tolerance or along.max() > length + tolerance:
        return np.inf
    first, second = np.triu_indices(len(along), 1)
    knots, logs = (values[first] + values[second] for values in (curve.knots, curve.log_weights))
    rises = (along[second] - along[first]) * (curve.knots[second] - curve.knots[first])
    rises = summed(alike(knots[None], [16 * EPS]), logs, rises[:, None])[1]
    return float(np.abs(along - length * curve.knots).max()) if rises.min() >= -tolerance else np.inf


def _fractions(curve: Curve) -> FloatArray:
    """Return the fractions at which a curve is compared: evenly spaced, and at its knots, where shares peak."""
    return distinct(np.concatenate([np.linspace(0.0, 1.0, 33), curve.knots]))


def beside(one: Curve, other: Curve, reach: float, most: float) -> Match:
    """Measure curves at equal fractions and, if beyond `reach`, where they are nearest, at most `most` apart."""
    places = distinct(np.concatenate([_fractions(one), _fractions(other)]))
    gaps = one.points_between(places) - other.points_between(places)
    even = Match(float(np.linalg.norm(gaps, axis=1).max()), False, True)
    ends = float(np.linalg.norm(one.ends - other.ends, axis=1).max())  # no points can correspond at a lesser distance
    if even.distance <= max(reach, 1.001 * ends) or np.abs(one.ends - other.ends).max() > most:
        return even
    found = matched(one, other, most)
    return even if found is None or even.distance <= found.distance else found


def matched(one: Curve, other: Curve, reach: float) -> Match | None:
    """Match curves with about the same ends; None if farther apart than `reach`, or one runs to and fro."""
    even = _fractions(one)
    fine = distinct(np.concatenate([np.linspace(0.0, 1.0, 129), _fractions(other)]))
    points, way = one.points_between(even)[1:-1], other.points_between(fine)
    steps = np.diff(way, axis=0).T
    offsets = [np.subtract.outer(*pair) for pair in zip(points.T, way[:-1].T, strict=True)]
    ahead = sum(offset * step for offset, step in zip(offsets, steps, strict=True))
    share = np.clip(ahead / np.maximum(column_dot(steps, steps), np.finfo(float).tiny), 0.0, 1.0)
    square = sum((offset - share * step) ** 2 for offset, step in zip(offsets, steps, strict=True))
    rows, part = np.arange(len(points)), ascending(square)
    if np.sqrt(square[rows, part].max()) > reach:
        return None
    start = fine[part] + share[rows, part] * np.diff(fine)[part]
    low, high = fine[np.maximum(part - 1, 0)], fine[np.minimum(part + 2, len(fine) - 1)]
    found, there = other.nearest(points, start, low, high)
    places = np.concatenate([[0.0], found, [1.0]])
    rounding = 1e-12  # of fractions, by which points that are nearly one may change places
    if not (np.diff(places) > -rounding).all():
        return None
    places = np.maximum.accumulate(places)
    # Between the matched places and at its own knots, the other curve must not leave this one.
    between = np.setdiff1d(np.concatenate([_fractions(other), (places[1:] + places[:-1]) / 2]), places)
    after, beyond = np.searchsorted(places, between), other.points_at(between)
    t, back = one.nearest(beyond, np.interp(between, places, even), even[after - 1], even[after])
    gaps = np.concatenate([points - there, beyond - back, one.ends - other.ends])
    pairs = np.array([np.concatenate([even, t]), np.concatenate([places, between])])
    pairs = pairs[:, np.argsort(pairs[1], kind="stable")]
    pairs[0] = np.maximum.accumulate(pairs[0])
    return Match(float(np.linalg.norm(gaps, axis=1).max()), False, False, pairs)
