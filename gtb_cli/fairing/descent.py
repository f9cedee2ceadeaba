"""Descent to the fairest control points: the least product of powers of bending and of its variation."""

import math
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np

from gtb_cli.arrays import EPS, FloatArray, IntArray
from gtb_cli.fairing.metric import Block
from gtb_cli.fairing.variation import Bending, bendings, linearisation

Zone: TypeAlias = tuple[Iterable[Block], FloatArray]  # places in Δ, block by block, and the (m,) areas they stand for

BENDING_POWER = 4  # of ∫ κ₁² + κ₂² in the product that is made small: with less, some bend more than a thin plate does
FLAT = 1e-9  # of figures: below it normals turn by some hundredths of a degree at most, or by rounding
LEAST_GAIN = 0.1  # of the product of all figures, in a step: what is fair to that is left as it is


def measured(zones: Sequence[Zone], surfaces: Sequence[FloatArray]) -> list[list[Bending]]:
    """Integrate each of the surfaces, (n, 3) control points, over the first zone, the first two and so on."""
    with np.errstate(all="ignore"):  # where a surface has no tangent plane, integrals are not finite
        parts = [bendings(*zone, surfaces)[0] for zone in zones]
    return [[together(found[: k + 1]) for k in range(len(zones))] for found in zip(*parts, strict=True)]


def together(parts: Sequence[Bending]) -> Bending:
    """Return the integrals over all of several regions."""
    area, energy = (sum(getattr(part, name) for part in parts) for name in ("area", "energy"))
    varied = sum(part.variation / part.area if part.area else 0.0 for part in parts)
    return Bending(area, energy, area * varied, max(part.curvature for part in parts))


def figures(bent: Sequence[Bending]) -> FloatArray:
    """(2 k,) bending and variation of one surface in k regions; infinite where they are not finite."""
    found = np.array([value for one in bent for value in (one.energy, one.variation)])
    return np.where(np.isfinite(found), found, np.inf)


def is_fairer(found: FloatArray, than: FloatArray) -> bool:
    """Tell whether the product of (2 k,) figures, bending to a power, is smaller by `LEAST_GAIN`."""
    powers = np.tile([BENDING_POWER, 1], len(found) // 2)
    ours, others = (float(powers @ np.log(np.maximum(each, FLAT))) for each in (found, than))
    return ours < others + math.log(1 - LEAST_GAIN)


def descended(
    search: Sequence[Zone], judge: Sequence[Zone], points: FloatArray, members: IntArray, most: FloatArray
) -> FloatArray:
    """Return (n, 3) control points of which the (k,) members are moved until no step makes the surface fairer.

    What becomes smaller, by `LEAST_GAIN` at least, is the product of all `figures`, bending to a power, and no figure
    becomes larger than its (2 z,) bound. Steps are those of the method of Levenberg and Marquardt, damped by forms of
    the second and third derivatives, so that control points move together. They are found with one quadrature of z
    zones and judged by another, as a surface may ripple between the places of the first.
    """
    most_steps, most_trials = 40, 4
    now, damping = figures(measured(judge, [points])[0]), 1e-2
    for _ in range(most_steps):
        if not np.isfinite(now).all() or now.min() < FLAT:
            break
        slope, square, matrix = _logarithms([linearisation(*zone, points, members) for zone in search])
        for _ in range(most_trials):
            form = square + damping * np.kron(matrix, np.eye(3))
            form += EPS * np.trace(form) * np.eye(len(form))
            trial = points.copy()
            trial[members] -= np.linalg.solve(form, slope).reshape(-1, 3)
            found = figures(measured(judge, [trial])[0])
            if is_fairer(found, now) and (found <= most).all():
                points, now, damping = trial, found, damping / 6
                break
            damping *= 10
        else:
            break
    return points


def _logarithms(parts: Sequence[Sequence[FloatArray]]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return half the gradient, the square and the matrix of the logarithm of the product of all figures."""
    slope, square, matrix = np.zeros((3, 1))
    for k in range(len(parts)):
        (area, *integrals), slopes, squares, matrices = (sum(part) for part in zip(*parts[: k + 1], strict=True))
        factors = np.array([BENDING_POWER, 1]) / integrals
        slope = slope + factors @ slopes[1:] + slopes[0] / area
        square, matrix = square + np.tensordot(factors, squares, 1), matrix + np.tensordot(factors, matrices, 1)
    return np.asarray(slope), np.asarray(square), np.asarray(matrix)
