"""Limit properties: repeated knots, and weights that grow as a lifting says."""

from __future__ import annotations

import math

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.checks.probe import ROUNDINGS, Probe
from gtb_cli.checks.report import Outcome, not_applicable, within_rounding
from gtb_cli.knots.decomposition import regular_decomposition
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.degeneration import cells_of, degenerate

FADED = 30 * math.log(10)
"""Logarithm of what is left of the nearest knot under a cell's plane: a factor 1e-30."""

ENOUGH = 14 * math.log(10)
"""A factor 1e-14 will do where the range of the lifting is thousands of times the smallest gap."""

LARGEST_LOG = 1000.0
"""Range of the logarithms of weights: what rounding does to exponents of this size is far below `CONVERGED`."""

SHRUNK = 0.98
"""Samples of a cell are drawn this much towards its middle: inside Δ whatever rounding does, and not where two cells
meet, where the limit is approached most slowly."""

CONVERGED = 1e-6
"""Largest distance from the limit, of the extent; measured, 1e-12 is usual."""

COMMON = 1000.0
"""Logarithm of a factor of all weights that no float holds."""

CELL_SAMPLES = 100
"""Roughly the most samples of each cell."""

MAX_CELLS = 50
"""Most cells that are compared; of more, some that are spread evenly."""


def multiple_knots(probe: Probe) -> Outcome:
    """A patch with repeated knots against the patch with these merged."""
    if not probe.repetitions:
        return not_applicable("no knot is repeated")
    value = probe.distance(probe.merged.evaluate(probe.u), probe.points)
    return within_rounding(
        value, probe.distance_rounding, "largest distance from the patch of merged knots, of the extent"
    )


def weights(probe: Probe) -> Outcome:
    """The patch with the weights x^λ ω against its own basis times x^λ; also for weights beyond the range of floats.

    A common factor of the weights changes no point: with `COMMON` in it they are kept as logarithms.
    """
    patch = probe.patch
    lifting = np.arange(len(patch.knots)) % 2.0 if patch.lifting is None else patch.lifting
    lifting = lifting / max(float(np.abs(lifting).max()), np.finfo(float).tiny)
    growth = (lifting - lifting.max()) / max(float(np.ptp(lifting)), np.finfo(float).tiny)
    shares = probe.basis * np.exp(growth)
    expected = (shares / shares.sum(axis=1, keepdims=True)) @ patch.control_points
    value = max(
        probe.distance(degenerate(patch, math.e, growth + common).evaluate(probe.u), expected) for common in (0, COMMON)
    )
    bound = 2 * probe.distance_rounding + COMMON * EPS * ROUNDINGS
    of = "of weights e^λ ω, λ = 0 … −1, as the lifting has them" if patch.lifting is not None else "of other weights"
    return within_rounding(value, bound, f"largest distance from the basis times the factors {of}, of the extent")


def toric_degeneration(probe: Probe) -> Outcome:
    """The patch with its weights far along the lifting against the cells of the regular control curve or surface."""
    patch = probe.patch
    if patch.lifting is None:
        return not_applicable("the patch has no lifting")
    decomposition = regular_decomposition(patch.knots, patch.lifting)
    limit = cells_of(patch, decomposition).patches
    gaps = np.stack([decomposition.gaps(cell) for cell in range(len(limit))])
    smallest = float(gaps.min(where=gaps > 0, initial=np.inf))
    # With no gap the lifting is affine, and any power moves points along the patch.
    exponent = 1.0 / max(float(np.ptp(patch.lifting)), np.finfo(float).tiny)
    if np.isfinite(smallest):
        # A knot has to fade however large its weight is.
        weights = float(np.ptp(patch.log_products))
        exponent = min((FADED + weights) / smallest, LARGEST_LOG * exponent)
        if exponent * smallest < ENOUGH + weights:
            return not_applicable("a knot is so near to its cell's plane that it does not fade within floats")
    far = degenerate(patch, math.e, exponent * (patch.lifting - patch.lifting.max()))
    p, expected = [], []
    for index in np.unique(np.linspace(0, len(limit) - 1, min(len(limit), MAX_CELLS)).astype(np.int64)).tolist():
        cell = limit[index]
        finest = math.isqrt(2 * CELL_SAMPLES // cell_count(cell.domain, 1)) if cell.dimension == 2 else CELL_SAMPLES
        places = triangulation(cell.domain, max(2, finest)).parameters
        p.append(cell.domain.center + SHRUNK * (places - cell.domain.center))
        expected.append(cell.evaluate(p[-1], "linear"))
    places = np.concatenate(p)
    value = probe.distance(far.evaluate(places, "linear"), np.concatenate(expected))
    what = "curve" if patch.dimension == 1 else "surface"
    power = f"x^λ, log x = {exponent:.3g}"
    bound = CONVERGED + probe.distance_rounding
    return within_rounding(value, bound, f"largest distance from the regular control {what} at {power}, of the extent")
