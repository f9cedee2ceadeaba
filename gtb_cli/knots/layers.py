"""Layers of knots at equal distance from an edge, whose shares vanish together towards it."""

from collections.abc import Iterator

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray

LAYER_TOLERANCE = 1e-9  # fraction of the hull's size: knots whose distances from an edge differ by less form one layer


def layers(heights: FloatArray) -> Iterator[IntArray]:
    """Yield the indices of the knots of equal positive height over an edge, lowest first."""
    order = np.argsort(heights, kind="stable")
    order = order[heights[order] > 0]
    yield from np.split(order, np.flatnonzero(np.diff(heights[order]) > LAYER_TOLERANCE * heights.max()) + 1)
