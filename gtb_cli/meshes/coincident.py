"""`numbered_places` numbers points at exactly the same place alike; `merged` joins what pairs connect."""

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray, index_type

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)  # odd, mixed bits


def numbered_places(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Number (m, 3) finite points so that those with equal coordinates have the same number; −0 and 0 are equal.

    Returns the first point (k,) of each number, ascending, and (m,) numbers.
    """
    rows = np.ascontiguousarray(points, dtype=np.float64) + 0.0
    bits = rows.view(np.uint64)
    key = np.zeros(len(rows), dtype=np.uint64)
    for axis in range(3):
        key = (key ^ bits[:, axis]) * _FACTORS[axis]
        key ^= key >> np.uint64(29)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    if not np.array_equal(rows[first[number]], rows):  # two keys coincide by chance
        order = np.lexsort(rows.T)
        key[order] = np.cumsum(np.append(False, (rows[order][1:] != rows[order][:-1]).any(axis=1)))
        _, first, number = np.unique(key, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=index_type(len(rows)))
    rank[np.argsort(first)] = np.arange(len(first))
    return np.sort(first), rank[number]


def merged(count: int, pairs: IntArray) -> IntArray:
    """Return the smallest index, (count,), to which each index is connected by (c, 2) pairs."""
    label = np.arange(count, dtype=index_type(count))
    one, other = pairs.T
    while len(one):
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(label, above := label[label]):
            label = above
        one, other = label[one], label[other]
        apart = one != other
        one, other = one[apart], other[apart]
    return label
