"""Torus coordinates of many points inside Δ, solved together by damped Newton steps."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import EPS, FloatArray
from gtb_cli.knots.domain import domain
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.moment.torus import exponents


def starts(knots: FloatArray, p: FloatArray) -> FloatArray:
    """Return (2, m) torus coordinates to start from for points inside: as if only their nearest layers counted."""
    shape = domain(knots, "unit")
    heights = shape.heights_of_columns(p)
    layers = np.where(shape.heights > 1e-9 * shape.size, shape.heights, np.inf).min(axis=0)
    return np.asarray(shape.normals.T @ (np.log(heights) / layers[:, None]))


def torus_of(knots: FloatArray, logs: FloatArray, p: FloatArray, s: FloatArray, within: float) -> FloatArray:
    """Return (2, m) torus coordinates s with |μ(s) − p| ≤ `within`, from starts that are near or as good as `starts`.

    They minimise log Σ c ω e^<a, s> − <p, s>, by damped Newton steps for many points of one net together.
    """
    newton_steps = 60  # steps after which points are left to the slower moment map, which always converges
    max_halvings = 30  # largest number of halvings of a step
    descent_fraction = 1e-4  # fraction of the descent predicted by the slope that a step must reach
    # Residual, as a multiple of the one that is asked for, from which on a point is left where it is
    finished_share = 1e-6
    regularisation = 1e-3  # regularisation of the Hessian, as a multiple of the residual
    s, left = np.array(s), np.arange(len(p))
    features = np.vstack([knots.T, knots[:, 0] ** 2, knots[:, 0] * knots[:, 1], knots[:, 1] ** 2])
    value, t = _objective(knots, logs, p.T, s)
    for _ in range(newton_steps):
        moments = features @ t
        gradient = moments[:2] - p.T[:, left]
        residual = np.abs(gradient).max(axis=0)
        if residual.max() <= within:
            return s
        xx = moments[2] - moments[0] ** 2 + regularisation * residual
        yy = moments[4] - moments[1] ** 2 + regularisation * residual
        xy = moments[3] - moments[0] * moments[1]
        step = -np.array([yy * gradient[0] - xy * gradient[1], xx * gradient[1] - xy * gradient[0]]) / (xx * yy - xy**2)
        slope = (gradient * step).sum(axis=0)
        coarse = residual > max(finished_share * within, 16 * EPS)
        left, value, step, slope = left[coarse], value[coarse], step[:, coarse], slope[coarse]
        limit, length = value + 1e-13 * (1 + np.abs(value)), np.ones(len(left))
        high, t = np.arange(len(left)), t[:, coarse]
        for _ in range(max_halvings):
            new = s[:, left[high]] + length[high] * step[:, high]
            value[high], t[:, high] = _objective(knots, logs, p.T[:, left[high]], new)
            high = high[~(value[high] <= limit[high] + descent_fraction * length[high] * slope[high])]
            if not len(high):
                break
            length[high] /= 2
        s[:, left] += length * step
    return MomentMap(knots, logs).inverse(p)


def _objective(knots: FloatArray, logs: FloatArray, p: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    e = exponents(knots, logs, s)
    top = e.max(axis=0)
    t = np.exp(e - top)
    total = t.sum(axis=0)
    return np.log(total) + top - (p * s).sum(axis=0), t / total
