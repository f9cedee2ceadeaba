"""Limit properties: weights that grow along a lifting, and a single weight that grows."""

import math

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, choice
from gtb_cli.checks.report import Finding, not_applicable, within_rounding
from gtb_cli.knots.decomposition import lifting_of_knot, regular_decomposition
from gtb_cli.knots.even_triangulation import cell_count, triangulation
from gtb_cli.limits.degeneration import cells_of, degenerate
from gtb_cli.moment.torus import exponents
from gtb_cli.theory.basis import torus_coordinates


def weights(probe: Probe) -> Finding:
    """Compare the patch of weights x^λ ω with the basis times x^λ, also for weights beyond the range of floats."""
    common_factor_log = 1000.0  # of a factor that changes no point, and makes all weights logarithms
    patch, tiny = probe.patch, np.finfo(float).tiny
    lifting = np.arange(len(patch.knots)) % 2.0 if patch.lifting is None else patch.lifting
    lifting = lifting / max(float(np.abs(lifting).max()), tiny)
    growth = (lifting - lifting.max()) / max(float(np.ptp(lifting)), tiny)
    shares = probe.basis * np.exp(growth)
    expected = (shares / shares.sum(axis=1, keepdims=True)) @ patch.control_points
    grown = [degenerate(patch, math.e, growth + common) for common in (0, common_factor_log)]
    value = max(probe.distance(each.evaluate(probe.u), expected) for each in grown)
    bound = 2 * probe.distance_rounding + common_factor_log * EPS * VALUE_ROUNDINGS
    of = "of weights e^λ ω, λ = 0 … −1, as the lifting has them" if patch.lifting is not None else "of other weights"
    return within_rounding(value, bound, f"largest distance from the basis times the factors {of}, of the extent")


def toric_degeneration(probe: Probe) -> Finding:
    """Compare the patch, with weights far along the lifting, with the cells of the regular control curve or surface."""
    faded_log = 30 * math.log(10)  # logarithm of the factor by which the nearest knot under a cell's plane has faded
    sufficient_log = 14 * math.log(10)  # if the range of the lifting is thousands of times its smallest gap
    max_log_range = 1000.0  # of weights: exponents of this size have rounding errors far below the tolerance
    cell_scale = 0.98  # so that samples of a cell stay in Δ, and away from other cells, where convergence is slow
    limit_tolerance = 1e-6  # of the extent; the usual measured distance is 1e-12
    cell_samples, max_cells = 100, 50  # roughly: an evenly spread choice of more cells is compared
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
        exponent = min((faded_log + weights) / smallest, max_log_range * exponent)
        if exponent * smallest < sufficient_log + weights:
            return not_applicable("a knot is so near to its cell's plane that it does not fade within floats")
    far = degenerate(patch, math.e, exponent * (patch.lifting - patch.lifting.max()))
    p, expected = [], []
    for index in choice(len(limit), max_cells):
        cell = limit[index]
        finest = math.isqrt(2 * cell_samples // cell_count(cell.domain, 1)) if cell.dimension == 2 else cell_samples
        places = triangulation(cell.domain, max(2, finest)).parameters
        p.append(cell.domain.center + cell_scale * (places - cell.domain.center))
        expected.append(cell.evaluate(p[-1], "linear"))
    value = probe.distance(far.evaluate(np.concatenate(p), "linear"), np.concatenate(expected))
    what = f"{'curve' if patch.dimension == 1 else 'surface'} at x^λ, log x = {exponent:.3g}"
    bound = limit_tolerance + probe.distance_rounding
    return within_rounding(value, bound, f"largest distance from the regular control {what}, of the extent")


def one_weight(probe: Probe) -> Finding:
    """Check that every point inside Δ goes to a knot's control point if its weight outgrows all others."""
    infinite_weight_log = 120.0  # logarithm of the ratio between one knot's share and all others
    patch, worst, n = probe.patch, 0.0, len(probe.patch.knots)
    u = np.asarray(patch.domain.center + patch.domain.size * np.array([[-0.25], [0.0], [0.25]]))
    s = torus_coordinates(patch.domain, patch.domain.heights_of_columns(u))
    logs = exponents(patch.knots - patch.domain.center, patch.log_products, s)
    for k in choice(n, 16):
        growth = infinite_weight_log + float((logs.max(axis=0) - logs[k]).max())
        heavy = degenerate(patch, math.e, growth * lifting_of_knot(n, k))
        worst = max(worst, probe.distance(heavy.evaluate(u), patch.control_points[k]))
    return within_rounding(worst, probe.distance_rounding, "largest distance from the control point, of the extent")
