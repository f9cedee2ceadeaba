"""Torus coordinates of many points inside Δ, solved together by damped Newton steps."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.knots.domain import domain
from gtb_cli.theory.basis import exponents
from gtb_cli.theory.moment import MomentMap

NEWTON_STEPS = 60
"""Steps after which points are left to the slower moment map, which always converges."""

MAX_HALVINGS = 30
"""Largest number of halvings of a step."""

DESCENT_FRACTION = 1e-4
"""Fraction of the descent predicted by the slope that a step must reach."""

REGULARISATION = 1e-3
"""Regularisation of the Hessian, as a multiple of the residual."""


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
    target = p.T
    features = np.vstack([knots.T, knots[:, 0] ** 2, knots[:, 0] * knots[:, 1], knots[:, 1] ** 2])
    for _ in range(NEWTON_STEPS):
        value, t = _objective(knots, logs, target, s)
        moments = features @ t
        gradient = moments[:2] - target
        residual = np.abs(gradient).max(axis=0)
        if residual.max() <= within:
            return s
        xx = moments[2] - moments[0] ** 2 + REGULARISATION * residual
        yy = moments[4] - moments[1] ** 2 + REGULARISATION * residual
        xy = moments[3] - moments[0] * moments[1]
        step = -np.array([yy * gradient[0] - xy * gradient[1], xx * gradient[1] - xy * gradient[0]]) / (xx * yy - xy**2)
        slope = (gradient * step).sum(axis=0)
        length = np.ones(len(p))
        for _ in range(MAX_HALVINGS):
            new, _ = _objective(knots, logs, target, s + length * step)
            high = ~(new <= value + DESCENT_FRACTION * length * slope + 1e-13 * (1 + np.abs(value)))
            if not high.any():
                break
            length[high] /= 2
        s = s + length * step
    return MomentMap(knots, logs).inverse(p)


def _objective(knots: FloatArray, logs: FloatArray, p: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    e = exponents(knots, logs, s)
    top = e.max(axis=0)
    t = np.exp(e - top)
    total = t.sum(axis=0)
    return np.log(total) + top - (p * s).sum(axis=0), t / total
