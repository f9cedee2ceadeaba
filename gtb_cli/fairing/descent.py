"""The fairest control points: descent to the least product of powers of bending and of its variation."""

import math
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.fairing.energy import Samples
from gtb_cli.fairing.variation import BENDING_POWER, Bending, bendings, linearisation

FLAT = 1e-9
"""∫ κ₁² + κ₂² or its variation below which no normal turns by more than some hundredths of a degree, or by rounding."""

LEAST_GAIN = 0.05
"""Part of the product of all figures that a step must win: what is fair to that is left as it is."""


def measured(regions: Sequence[Samples], surfaces: Sequence[FloatArray]) -> list[list[Bending]]:
    """Integrate each of the surfaces, (n, 3) control points, over all regions."""
    with np.errstate(all="ignore"):  # where a surface has no tangent plane, integrals are not finite
        return [list(found) for found in zip(*(bendings(*region, surfaces) for region in regions), strict=True)]


def figures(bent: Sequence[Bending]) -> FloatArray:
    """(2 k,) bending and variation of one surface in k regions; infinite where they are not finite."""
    found = np.array([value for one in bent for value in (one.energy, one.variation)])
    return np.where(np.isfinite(found), found, math.inf)


def descended(regions: Sequence[Samples], points: FloatArray, members: IntArray, most: FloatArray) -> FloatArray:
    """Return (n, 3) control points of which the (k,) members are moved until no step makes the surface fairer.

    What becomes smaller, by `LEAST_GAIN` at least, is the product of all `figures`, bending to the fourth power, and no
    figure becomes larger than its (2 r,) bound. Steps are those of the method of Levenberg and Marquardt, damped by
    forms of the second and third derivatives, so that control points move together.
    """
    most_steps, most_trials = 40, 4
    powers = np.tile([BENDING_POWER, 1], len(regions))
    now, damping = figures(measured(regions, [points])[0]), 1e-2
    for _ in range(most_steps):
        if not np.isfinite(now).all() or now.min() < FLAT:
            break
        forms = [linearisation(*region, points, members) for region in regions]
        slope, square, stiffness = (sum(part) for part in zip(*forms, strict=True))
        for _ in range(most_trials):
            form = square + damping * np.kron(stiffness, np.eye(3))
            form += EPS * np.trace(form) * np.eye(len(form))
            trial = points.copy()
            trial[members] -= np.linalg.solve(form, slope).reshape(-1, 3)
            found = figures(measured(regions, [trial])[0])
            gain = 1 - math.exp(min(0.0, float(powers @ np.log(found / now))))
            if gain > LEAST_GAIN and (found <= most).all():
                points, now, damping = trial, found, damping / 6
                break
            damping *= 10
        else:
            break
    return points
