"""Curves of edges beside each other: proofs that two are equal, and distances; `joined_edges` decides."""

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, ascending, column_dot, distinct
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
    map, are recognised by the control points of their difference; parts of a line by control points on it.
    ``P(s) − Q(α s + β)`` is itself a rational curve: its knots are a_i + α b_j, its weights w_i v_j e^{β b_j}, its
    control points p_i − q_j, and those of equal knots act as one (Thm 4.1). Exponentials are linearly independent, so
    that the difference is 0 if, and only if, these control points all are; and it is nowhere longer than the longest
    of them. So no place is missed, however narrow. The first control points that differ from an end give α and β.
    Curves related by another change of parameters, which only curves run through at a speed of higher degree have,
    are not recognised unless they are straight.
    """
    if np.linalg.norm(one.ends - other.ends, axis=1).max() > tolerance:
        return None
    for scale, shift in _scales(one, other, tolerance):
        least = np.inf
        while True:  # Newton's method for the shift: rounding of the first points' differences is magnified
            distance, fractions, step = _difference(one, other, scale, shift)
            if distance <= tolerance:
                even = bool(fractions <= CURVE_TOLERANCE * np.diff(one.knots).min())
                return Match(distance, True, even, torus=np.array([scale, shift]))
            if not distance < least / 2:
                break
            least, shift = distance, shift - step
    uneven = [_unevenness(curve, one.ends, tolerance / 2) for curve in (one, other)]
    if sum(uneven) <= tolerance:
        return Match(tolerance, True, True)
    found = matched(one, other, tolerance) if sum(uneven) < np.inf else None
    return found and Match(tolerance, True, False, found.places)


def _scales(one: Curve, other: Curve, tolerance: float) -> Iterator[tuple[float, float]]:
    """Yield scales α and shifts β of the torus coordinate that the first terms at an end suggest."""
    rounding = 64 * EPS * float(max(np.abs(one.points).max(), np.abs(other.points).max()))
    tried: set[tuple[float, float]] = set()
    for least in (tolerance, rounding):
        for way, sides in ((1, (one, other)), (-1, (one.reversed(), other.reversed()))):
            terms = []
            for curve in sides:
                offsets = np.linalg.norm(curve.points - curve.points[0], axis=1)
                row = int((offsets > least).argmax())
                log_term = curve.log_weights[row] + np.log(max(offsets[row], least))
                terms.append((float(curve.knots[row]), float(log_term)))
            (a, first), (b, second) = terms
            if a and b and (pair := (a / b, way * (first - second) / b)) not in tried:
                tried.add(pair)
                yield pair


def _difference(one: Curve, other: Curve, scale: float, shift: float) -> tuple[float, float, float]:
    """Bound ``P(s) − Q(α s + β)`` and the difference of fractions; also return a step to subtract from β."""
    knots = (one.knots[:, None] + scale * other.knots).ravel()
    logs = (one.log_weights[:, None] + other.log_weights + shift * other.knots).ravel()
    values = (one.points[:, None] - other.points).reshape(-1, 3)
    rates = np.tile(other.knots, len(one.knots))
    values = np.column_stack([values, np.repeat(one.knots, len(other.knots)) - rates])
    order = np.argsort(knots, kind="stable")
    knots, logs, values, rates = knots[order], logs[order], values[order], rates[order]
    starts = np.flatnonzero(np.diff(knots, prepend=-1.0) > 16 * EPS * (1 + scale))
    group = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(knots)))
    shares = np.exp(logs - np.maximum.reduceat(logs, starts)[group])
    shares = (shares / np.add.reduceat(shares, starts)[group])[:, None]
    means = np.add.reduceat(shares * values, starts)
    means_of_rates = np.add.reduceat(shares[:, 0] * rates, starts)[group, None]
    slopes = np.add.reduceat(shares * (rates[:, None] - means_of_rates) * values[:, :3], starts)
    step = float((slopes * means[:, :3]).sum() / max((slopes**2).sum(), np.finfo(float).tiny))
    # The longest control points. Knots are merged over gaps: a share grows by e^{|s| gap} at most, which does not count
    # where all shares but an end's are below a rounding.
    gaps = knots - knots[starts][group]
    bounds = [float(np.linalg.norm(means[:, :3], axis=1).max()), float(np.abs(means[:, 3]).max())]
    if gaps.any():
        least, tiny = -np.log(EPS), np.finfo(float).tiny
        reaches = [
            np.maximum(logs[1:] - logs[0] + least, least) / np.maximum(knots[1:] - knots[0], tiny),
            np.maximum(logs[:-1] - logs[-1] + least, least) / np.maximum(knots[-1] - knots[:-1], tiny),
        ]
        reach = float(np.max(reaches))
        growth = np.expm1(min(float(gaps.max()) * reach, 1.0))
        if growth > 1:
            return np.inf, np.inf, step
        parts = np.linalg.norm(values[:, :3], axis=1), values[:, 3]
        bounds = [bound + growth * float(np.abs(part).max()) for bound, part in zip(bounds, parts, strict=True)]
    return bounds[0], bounds[1], step


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
