"""The largest curvature near corners of surfaces, at all scales: layers that limits at the corner itself do not show.

With exponents x of knots as in `gtb_cli.theory.corners`, the ways v and w dual to the two knots that lead at a place
have derivatives P_v and P_w of different orders, and sums of terms ``ξ (ξ − 1)``, ``ξ η`` and ``η (η − 1)`` give the
second form without what is tangential: digits stay, however near the corner is.
"""

import math

import numpy as np

from gtb_cli.arrays import FloatArray, cross, dot
from gtb_cli.knots.domain import Domain
from gtb_cli.theory.corner_powers import exponents_at, newton_polygon

DISTANCES = np.logspace(-1, -6, 6)
"""Of the shorter edge, from the corner."""


def corner_layer(domain: Domain, log_weights: FloatArray, points: FloatArray, corner: int) -> tuple[float, float]:
    """Return the largest principal curvature near a corner of Δ, sampled, and the length of its shorter edge.

    NaN where the (n, 3) control points have fewer than two directions.
    """
    ways, reach = 21, 3.0  # fan of rates (1 / (1 + e^-q), 1 / (1 + e^q)): the last ones run along the edges
    x, gaps, own = exponents_at(domain, corner)
    b = points - points[own]
    ends = [np.where(x[:, 1 - k] <= gaps[1 - k], x[:, k], 0).argmax() for k in (0, 1)]
    edge = float(np.linalg.norm(b[ends], axis=1).min())
    others = np.delete(np.arange(len(x)), own)
    chain = others[newton_polygon(x[others], gaps)]
    sizes = np.linalg.norm(b[chain], axis=1)
    chain, sizes = chain[sizes > 0], sizes[sizes > 0]
    if len(chain) < 2 or edge == 0:
        return math.nan, edge
    q = np.linspace(-reach, reach, ways)
    rates = 1 / (1 + np.exp(np.stack([-q, q], axis=1)))
    leads = log_weights[chain] - log_weights[own] + np.log(sizes)
    far = np.log(DISTANCES * edge)[:, None, None]
    s = (-((leads - far) / (rates @ x[chain].T)).max(axis=2)[:, :, None] * rates).reshape(-1, 2)
    order = np.argsort(-(s @ x[chain].T + leads), axis=1)[:, :2]
    terms = np.exp(s @ x.T + log_weights - log_weights[own])
    b_and_1, largest = np.column_stack([b, np.ones(len(b))]), 0.0
    for first, second in np.unique(order, axis=0).tolist():
        t = terms[(order == (first, second)).all(axis=1)]
        dual = x @ np.linalg.inv(x[chain[[first, second]]])
        whole = np.clip(np.rint(dual), 0, 1)
        xi, eta = np.where(np.abs(dual - whole) <= 1e-10, whole, dual).T
        total = t.sum(axis=1, keepdims=True)
        place = t @ b / total
        factors = np.stack([xi, eta, xi * (xi - 1), xi * eta, eta * (eta - 1)])
        sums = (t * factors[:, None]) @ b_and_1
        v, w, *seconds = sums[..., :3] - place * sums[..., 3:]
        normal = cross(v, w)
        area = np.linalg.norm(normal, axis=1)
        vv, vw, ww = (dot(normal, second) / area for second in seconds)
        mean = (dot(v, v) * ww - 2 * dot(v, w) * vw + dot(w, w) * vv) / (2 * area**2)
        gaussian = (vv * ww - vw**2) / area**2
        found = (np.abs(mean) + np.sqrt(np.maximum(mean**2 - gaussian, 0))) * total[:, 0]
        largest = max(largest, float(found.max()))
    return largest, edge
