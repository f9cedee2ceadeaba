"""Points at exactly the same place, numbered alike."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtb_cli.arrays import INDEX_ROWS, IntArray, index_type, row_blocks, taken

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)  # odd, mixed bits


def numbered_places(points: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Number (m, 3) finite points so that those with equal coordinates have the same number; −0 and 0 are equal.

    Returns the first point (k,) of each number, ascending, and (m,) numbers.
    """
    count, kind = len(points), index_type(len(points))
    bits = np.uint64(count.bit_length())  # of an index, which takes the lowest ones of a key: sorting is stable
    key, least = np.empty(count, dtype=np.uint64), np.empty(count, dtype=kind)  # the first of equal points
    blocks = [*row_blocks(count, INDEX_ROWS)]
    for rows in blocks:
        held = (points[rows].astype(np.float64) + 0.0).view(np.uint64)
        mixed = np.zeros(len(held), dtype=np.uint64)
        for axis in range(3):
            mixed = (mixed ^ held[:, axis]) * _FACTORS[axis]
            mixed ^= mixed >> np.uint64(29)
        key[rows] = mixed >> bits << bits | np.arange(rows.start, rows.stop, dtype=np.uint64)
    key.sort()
    order = (key & ((np.uint64(1) << bits) - np.uint64(1))).astype(kind)
    key >>= bits
    starts = np.flatnonzero(np.append(True, key[1:] != key[:-1])[:count])
    least[order] = np.repeat(order[starts], np.diff(starts, append=count))
    apart = [rows.start + np.flatnonzero((points[rows] != points[least[rows]]).any(axis=1)) for rows in blocks]
    if any(map(len, apart)):  # keys coincide by chance
        other = np.concatenate(apart)
        _, first, number = np.unique(points[other] + 0.0, axis=0, return_index=True, return_inverse=True)
        least[other] = other[first[number.ravel()]]
    is_first = least == np.arange(count, dtype=kind)
    return np.flatnonzero(is_first), taken(np.cumsum(is_first, dtype=kind) - 1, least)
