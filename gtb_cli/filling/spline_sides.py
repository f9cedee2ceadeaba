"""Sides that are B-splines: one Bézier curve each, where one is near enough to all polynomial pieces.

With a corner at each inner knot, a patch would have no finite curvature in the middle of a smooth side. A Bézier curve
is nearest to a spline at other parameters than its own: those of the nearest points, which are found by turns with the
curve (tangent distance minimisation; W. Wang, H. Pottmann and Y. Liu, Fitting B-spline curves to point clouds, 2006).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.filling.sides import MAX_DEGREE, HoleSide, bernstein

MOST_TURN = 0.01  # of the unit tangent between pieces: what turns more is meant as a corner
MAX_DISTANCE = 1e-5  # between a spline and its Bézier curve, of the loop's size, as between ends that meet


def single_curves(sides: Sequence[HoleSide]) -> tuple[list[HoleSide], list[str]]:
    """Replace the pieces of each B-spline by one Bézier curve with the same ends, if three sides or more remain.

    Where none of degree 20 is within `MAX_DISTANCE`, there are several with corners between them. Also return remarks
    that say so, and how far curves are from their splines.
    """
    groups = [(name, list(group)) for name, group in groupby(sides, lambda side: side.spline)]
    points = np.concatenate([side.points for side in sides]) if sides else np.zeros((1, 3))
    size = float(np.ptp(points, axis=0).max())
    if not size > 0 or sum(1 if name else len(group) for name, group in groups) < 3:
        return list(sides), []
    found, remarks = [], []
    for name, group in groups:
        if name is None or len(group) == 1:
            found += group
            continue
        start = group[0].curve[0, :3]
        curves = nearest_curves([(piece.curve[:, :3] - start) / size for piece in group])
        ends = [start, *(group[count - 1].curve[-1, :3] for count in np.cumsum([count for _, _, count in curves]))]
        for k, (points, _, _) in enumerate(curves):
            curve = np.vstack([ends[k], points[1:-1] * size + start, ends[k + 1]])
            label = name if len(curves) == 1 else f"{name} part {k}"
            whole = np.column_stack([curve, np.ones(len(curve))])
            found.append(replace(group[0], name=label, curve=whole, spline=None))
        distance = f"up to {max(distance for _, distance, _ in curves) * size:.3g} from its B-spline"
        several = f"{len(curves)} curves with corners between them, {distance}; one would be too far"
        remarks.append(f"{name}: " + (several if curves[1:] else f"one curve of degree {len(curve) - 1}, {distance}"))
    return found, remarks


def nearest_curves(pieces: Sequence[FloatArray]) -> list[tuple[FloatArray, float, int]]:
    """Return Bézier points of curves of the least degrees that suffice, with distances and numbers of pieces."""
    if (found := nearest_curve(pieces, MAX_DISTANCE, range(len(pieces[0]), MAX_DEGREE + 1))) is not None:
        return [(*found, len(pieces))]
    _, turns = _at_joints(pieces)
    cut = 1 + int(turns.argmax()) if turns.max() > MOST_TURN else len(pieces) // 2
    return [*nearest_curves(pieces[:cut]), *nearest_curves(pieces[cut:])]


def nearest_curve(pieces: Sequence[FloatArray], most: float, degrees: Iterable[int]) -> tuple[FloatArray, float] | None:
    """Return the Bézier points of one curve of the first degree within a distance of pieces, and this, if there is any.

    Coordinates are relative to a point near them, and of size 1.
    """
    if len(pieces) == 1:
        return pieces[0], 0.0
    hopeless = 10  # times too far with all distances weighed alike
    least_evenness = 0.2  # of speeds along a curve, on which the knots of an edge are evenly spaced
    ratios, turns = _at_joints(pieces)
    if turns.max() > MOST_TURN:
        return None
    places, t = _sampled(pieces, ratios)
    ways = np.array([pieces[0][1] - pieces[0][0], pieces[-1][-1] - pieces[-1][-2]])
    if _fitted(places, t, ways, MAX_DEGREE, 1.0)[1] > hopeless * most:
        return None
    for degree in degrees:
        for along in (0.1, 0.01, 0.001):  # the less, the nearer it comes, and the more its speed varies
            points, distance, evenness = _fitted(places, t, ways, degree, along)
            if distance <= most and evenness >= least_evenness:
                return points, distance
    return None


def _at_joints(pieces: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the ratios of derivatives after and before each joint, and changes of unit tangents, 2 without one."""
    legs = np.array([[before[-1] - before[-2], after[1] - after[0]] for before, after in pairwise(pieces)])
    lengths = np.linalg.norm(legs, axis=2, keepdims=True)
    safe = np.where(lengths > 0, lengths, 1.0)
    turns = np.linalg.norm(np.diff(legs / safe, axis=1), axis=(1, 2))
    return safe[:, 1, 0] / safe[:, 0, 0], np.where(lengths.all(axis=(1, 2)), turns, 2.0)


def _sampled(pieces: Sequence[FloatArray], ratios: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points of a curve in pieces, from its start to its end, and its parameters in [0, 1].

    Derivatives are continuous with the ratios of the intervals of pieces k + 1 and k.
    """
    count = 320  # many to each wave of an error of degree 20
    lengths = np.cumprod([1.0, *ratios])
    ends = np.cumsum([0.0, *lengths]) / lengths.sum()
    t = (1 - np.cos(np.linspace(0, np.pi, count))) / 2
    owner = np.minimum(np.searchsorted(ends[1:], t), len(pieces) - 1)
    points = np.empty((count, 3))
    for k, piece in enumerate(pieces):
        mine = owner == k
        points[mine] = bernstein(len(piece) - 1, (t[mine] - ends[k]) / (ends[k + 1] - ends[k])) @ piece
    return points, t


def _fitted(
    places: FloatArray, t: FloatArray, ways: FloatArray, degree: int, along: float
) -> tuple[FloatArray, float, float]:
    """Fit a Bézier curve with the ends of a row of points, and (2, 3) tangents there, at parameters near the given.

    Distances along the curve weigh `along` times as much as those across. Return its points, the largest distance, and
    the ratio of the least to the largest speed.
    """
    rounds, steps = 12, 3
    ends = places[[0, -1]]
    across = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    free, known = np.eye(3 * (degree - 1)), np.zeros((degree - 1, 3))
    if degree > 2 and ways.any(axis=1).all():  # planes of neighbours agree at corners only with the right tangents
        free = np.delete(free, [1, 2, -2, -1], axis=1)
        free[:3, 0], free[-3:, -1] = ways
        known[[0, -1]] = ends
    for _ in range(rounds):
        values = bernstein(degree, t)
        rest = places - values @ np.vstack([ends[:1], known, ends[1:]])
        matrix = (across[:, :, None, :] * values[:, None, 1:-1, None]).reshape(3 * len(t), -1)
        wanted = (across @ rest[:, :, None]).ravel()
        inner = (free @ np.linalg.lstsq(matrix @ free, wanted, rcond=1e-13)[0]).reshape(-1, 3) + known
        points = np.vstack([ends[:1], inner, ends[1:]])
        for _ in range(steps):  # towards the nearest points
            rates = degree * bernstein(degree - 1, t) @ np.diff(points, axis=0)
            speeds = np.linalg.norm(rates, axis=1)
            away = places - bernstein(degree, t) @ points
            t = np.clip(t + (away * rates).sum(axis=1) / np.maximum(speeds, 1e-9) ** 2, 0, 1)
        tangents = rates / np.maximum(speeds, 1e-9)[:, None]
        across = np.eye(3) - (1 - along) * tangents[:, :, None] * tangents[:, None, :]
    distance = np.linalg.norm(places - bernstein(degree, t) @ points, axis=1).max()
    return points, float(distance), float(speeds.min() / speeds.max())
