"""Torus coordinates from which the solver starts: of the nearest layers of knots alone, and of tamer weights."""

from functools import lru_cache

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.knots.domain import Domain, domain
from gtb_cli.moment.solve import LogSum, solve


class LayerStarts:
    """``Σ_j ξ_j/δ_j log(h_j(p)/δ_j)``: torus coordinates of p if only the nearest layers of knots counted.

    Parameters
    ----------
    shape : Domain
        The hull; δ_j is the distance from edge j to the nearest knots not on it.
    """

    def __init__(self, shape: Domain) -> None:
        self.layer = np.where(shape.heights > 0, shape.heights, np.inf).min(axis=0)
        self.normals = shape.normals
        self.offsets = np.einsum("jk,jk->j", shape.normals, shape.vertices)

    def __call__(self, p: FloatArray) -> FloatArray:
        """(d, m) starts of (d, m) points."""
        heights = self.normals @ p
        heights -= self.offsets[:, None]
        heights /= self.layer[:, None]
        np.maximum(heights, 1e-17, out=heights)  # nearer to an edge, points start there
        np.log(heights, out=heights)
        return np.asarray((self.normals / self.layer[:, None]).T @ heights)


def layer_starts(knots: FloatArray) -> LayerStarts:
    """Return the starts over the hull of (n, d) unit knots."""
    return _layer_starts(np.ascontiguousarray(knots).tobytes(), knots.shape[1])


@lru_cache(1024)  # the patches of a family, and of a model, share their knots
def _layer_starts(knots: bytes, dimension: int) -> LayerStarts:
    return LayerStarts(domain(np.frombuffer(knots).reshape(-1, dimension), "unit"))


def extents_of(knots: FloatArray) -> FloatArray:
    """(d,) extents of (n, d) knots."""
    return np.asarray(np.ptp(knots, axis=0))


def origin_of(knots: FloatArray) -> FloatArray:
    """(d,) 0 if zeros in the coordinates of (n, d) knots are exact, as over an edge; else the middle of the hull."""
    low, high = knots.min(axis=0), knots.max(axis=0)
    far = np.maximum(np.abs(low), np.abs(high)) > 4 * extents_of(knots)
    return np.where(far, (low + high) / 2, 0.0)


def tame_starts(total: LogSum, p: FloatArray, start: FloatArray) -> FloatArray:
    """Return starts that follow the solutions for powers of the weights, from tame ones on.

    As the power t of steep weights grows, s(t) tends to −t g + s_F, where g is the gradient of the cell of the regular
    decomposition that holds p, and s_F its own solution: it is extrapolated as a linear function of t.
    """
    tame = max(3.0, len(total.knots))  # the range of logarithms that the first start stands
    if np.ptp(total.log_weights, axis=0).max() <= tame:
        return start
    w = total.log_weights.reshape(len(total.knots), -1)
    affine = np.column_stack([total.knots, np.ones(len(w))])
    slopes = np.linalg.lstsq(affine, w)[0]
    bends = (w - affine @ slopes).reshape(total.log_weights.shape)
    t = tame / max(float(np.ptp(bends, axis=0).max()), tame)
    if t == 1:
        return start
    s = before = start
    power = 0.0
    while t < 1:
        found, _ = solve(LogSum(total.knots, t * bends), p, s, 1e-3)
        following = min(2 * t, 1.0)
        s = found + (found - before) * ((following - t) / (t - power)) if power else found
        before, power, t = found, t, following
    return np.asarray(s - slopes[:-1])
