"""Curves that begin or end near each other, found without comparing each with all others."""

from collections.abc import Iterator, Sequence

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.theory.edges import Curve

SORTING_DIRECTION = np.array([1.0, 1.618033988749895, 2.414213562373095])  # different places hardly ever tie along it


def touching(curves: Sequence[Curve], reach: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find pairs i < j of curves, (m, 2), whose ends are within the smaller of their (n,) reaches; and the gaps."""
    ends = np.array([curve.ends for curve in curves]).reshape(-1, 2, 3)
    pairs, gaps = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    heights = (ends - ends[:1, :1]).sum(axis=1) @ SORTING_DIRECTION  # equal for curves with the same ends
    for row, others in _within(heights, 2 * reach):
        straight, crossed = (np.abs(ends[others] - way).max(axis=(1, 2)) for way in (ends[row], ends[row][::-1]))
        gap = np.minimum(straight, crossed)
        if len(near := np.flatnonzero(gap <= np.minimum(reach[others], reach[row]))):
            pairs.append(np.column_stack([others[near], np.full(len(near), row)]))
            gaps.append(gap[near])
    found = np.sort(np.concatenate(pairs), axis=1)
    order = np.lexsort(found.T[::-1])
    return found[order], np.concatenate(gaps)[order]


def meeting(curves: Sequence[Curve], reach: float) -> list[list[int]]:
    """Find, for each curve, the others, ascending, with an end within a distance of one of its ends along each axis."""
    places = np.array([curve.ends for curve in curves]).reshape(-1, 3)
    pairs: list[set[int]] = [set() for _ in curves]
    for row, others in _within((places - places[:1]) @ SORTING_DIRECTION, np.full(len(places), reach)):
        for other in (others[np.abs(places[others] - places[row]).max(axis=1) <= reach] // 2).tolist():
            pairs[row // 2].add(other)
            pairs[other].add(row // 2)
    return [sorted(others - {row}) for row, others in enumerate(pairs)]


def _within(heights: FloatArray, reach: FloatArray) -> Iterator[tuple[int, IntArray]]:
    """Yield each row with the rows after it, by (n,) heights of places, that may be within its reach on each axis."""
    order = np.argsort(heights, kind="stable")
    beyond = np.searchsorted(heights[order], (heights + SORTING_DIRECTION.sum() * reach)[order], side="right")
    for k in np.flatnonzero(beyond > np.arange(len(order)) + 1).tolist():
        yield int(order[k]), order[k + 1 : beyond[k]]
