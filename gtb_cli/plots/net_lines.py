"""Control nets, boundaries and parameter lines of patches: the lines drawn with a surface."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray
from gtb_cli.knots.decomposition import control_net, regular_decomposition
from gtb_cli.knots.domain import Domain
from gtb_cli.theory.patch import Patch


def net_of(patch: Patch, lifting: ArrayLike | None = None) -> list[tuple[int, int]]:
    """Return the pairs of knots whose control points are joined by a line: by an (n,) lifting, or the patch's own.

    Without either, by a `bowl`, so that the lattices of Bézier triangles and tensor products have their usual nets.
    """
    if lifting is None:
        lifting = patch.lifting if patch.lifting is not None else bowl(patch.domain)
    return _net(patch.knots.tobytes(), patch.dimension, np.asarray(lifting, dtype=float).tobytes())


@lru_cache(maxsize=256)  # the copies of a patch, and the next picture of a model that is being changed, have its knots
def _net(knots: bytes, dimension: int, lifting: bytes) -> list[tuple[int, int]]:
    return control_net(regular_decomposition(np.frombuffer(knots).reshape(-1, dimension), np.frombuffer(lifting)))


def bowl(domain: Domain) -> FloatArray:
    """Return the (n,) lifting that induces Delaunay's decomposition, with triangle and parallelogram made regular."""
    centred = (domain.knots - domain.center) / domain.size
    corners = domain.vertices - domain.vertices[0]
    regular = {3: np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]]), 4: np.eye(2)}.get(len(corners))
    if regular is not None:
        centred = centred @ np.linalg.solve(corners[[1, -1]], regular) * domain.size
    return np.asarray(-(centred**2).sum(axis=1))


def curve_path(curve: Patch) -> FloatArray:
    """Return (m, 3) points along a curve: evenly spread in its own parameter, and denser towards the ends."""
    low, high = curve.domain.vertices[:, 0].tolist()
    # A curve leaves its ends like t^h, where h, the distance of the next knot, may be small.
    segments, end_points, end_distance = 240, 48, 1e-15
    even = np.linspace(0, 1, segments + 1)[1:-1]
    near = np.geomspace(end_distance, 1 / segments, end_points)[:-1]
    share = np.concatenate([[0], near, even, 1 - near[::-1], [1]])
    return curve.evaluate((low * (1 - share) + high * share).clip(low, high))


def is_flat(clouds: Sequence[FloatArray]) -> bool:
    """Tell whether all points have the same height, so that they are drawn from above."""
    return bool(np.ptp(np.concatenate([cloud[:, 2] for cloud in clouds])) == 0)
