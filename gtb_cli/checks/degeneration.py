"""Limit properties: repeated knots, and weights that grow along a lifting."""

from __future__ import annotations

import math

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, choice
from gtb_cli.checks.report import Outcome, not_applicable, within_rounding
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.degeneration import cells_of, degenerate

FADED_LOG = 30 * math.log(10)
"""Natural logarithm of the factor, 1e30, by which the nearest knot under a cell's plane has faded."""

SUFFICIENT_LOG = 14 * math.log(10)
"""The same for 1e14, which suffices if the range of the lifting is thousands of times its smallest gap."""

MAX_LOG_RANGE = 1000.0
"""Largest range of the natural logarithms of weights: exponents of this size have rounding errors far below
`LIMIT_TOLERANCE`."""

CELL_SCALE = 0.98
"""Factor by which samples of a cell are drawn towards its middle: rounding cannot move them out of Δ, and they stay
away from other cells, near which convergence is slowest."""

LIMIT_TOLERANCE = 1e-6
"""Largest distance from the limit, as a fraction of the extent; the usual measured value is 1e-12."""

COMMON_FACTOR_LOG = 1000.0
"""Natural logarithm of a common factor of all weights that is beyond the range of floats."""

CELL_SAMPLES = 100
"""Largest number, roughly, of samples of each cell."""

MAX_CELLS = 50
"""Largest number of cells to compare; if there are more, an evenly spread choice is compared."""


def multiple_knots(probe: Probe) -> Outcome:
    """Compare a patch with repeated knots with the patch in which these are merged."""
    if not probe.repetitions:
        return not_applicable("no knot is repeated")
    value = probe.distance(probe.merged.evaluate(probe.u), probe.points)
    return within_rounding(
        value, probe.distance_rounding, "largest distance from the patch of merged knots, of the extent"
    )


def weights(probe: Probe) -> Outcome:
    """Compare the patch of weights x^λ ω with the basis times x^λ, also for weights beyond the range of floats.

    A common factor of the weights changes no point; `COMMON_FACTOR_LOG` makes it so large that they must be logarithms.
    """
    patch = probe.patch
    lifting = np.arange(len(patch.knots)) % 2.0 if patch.lifting is None else patch.lifting
    lifting = lifting / max(float(np.abs(lifting).max()), np.finfo(float).tiny)
    growth = (lifting - lifting.max()) / max(float(np.ptp(lifting)), np.finfo(float).tiny)
    shares = probe.basis * np.exp(growth)
    expected = (shares / shares.sum(axis=1, keepdims=True)) @ patch.control_points
    value = max(
        probe.distance(degenerate(patch, math.e, growth + common).evaluate(probe.u), expected)
        for common in (0, COMMON_FACTOR_LOG)
    )
    bound = 2 * probe.distance_rounding + COMMON_FACTOR_LOG * EPS * VALUE_ROUNDINGS
    of = "of weights e^λ ω, λ = 0 … −1, as the lifting has them" if patch.lifting is not None else "of other weights"
    return within_rounding(value, bound, f"largest distance from the basis times the factors {of}, of the extent")


def toric_degeneration(probe: Probe) -> Outcome:
    """Compare the patch, with weights far along the lifting, with the cells of the regular control curve or surface."""
    patch = probe.patch
    if patch.lifting is None:
        return not_applicable("the patch has no lifting")
    decomposition = regular_decomposition(patch.knots, patch.lifting)
    limit = cells_of(patch, decomposition).patches
    gaps = np.stack([decomposition.gaps(cell) for cell in range(len(limit))])
    smallest = float(gaps.min(where=gaps > 0, initial=np.inf))
    # Without a gap the lifting is affine, and any power only moves points along the patch.
    exponent = 1.0 / max(float(np.ptp(patch.lifting)), np.finfo(float).tiny)
    if np.isfinite(smallest):
        # A knot has to fade, however large its weight is.
        weights = float(np.ptp(patch.log_products))
        exponent = min((FADED_LOG + weights) / smallest, MAX_LOG_RANGE * exponent)
        if exponent * smallest < SUFFICIENT_LOG + weights:
            return not_applicable("a knot is so near to its cell's plane that it does not fade within floats")
    far = degenerate(patch, math.e, exponent * (patch.lifting - patch.lifting.max()))
    p, expected = [], []
    for index in choice(len(limit), MAX_CELLS):
        cell = limit[index]
        finest = math.isqrt(2 * CELL_SAMPLES // cell_count(cell.domain, 1)) if cell.dimension == 2 else CELL_SAMPLES
        places = triangulation(cell.domain, max(2, finest)).parameters
        p.append(cell.domain.center + CELL_SCALE * (places - cell.domain.center))
        expected.append(cell.evaluate(p[-1], "linear"))
    places = np.concatenate(p)
    value = probe.distance(far.evaluate(places, "linear"), np.concatenate(expected))
    what = "curve" if patch.dimension == 1 else "surface"
    power = f"x^λ, log x = {exponent:.3g}"
    bound = LIMIT_TOLERANCE + probe.distance_rounding
    return within_rounding(value, bound, f"largest distance from the regular control {what} at {power}, of the extent")
