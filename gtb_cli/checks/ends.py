"""Properties of a curve's ends: directions and lengths of tangents."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, largest, points_at_torus
from gtb_cli.checks.report import Finding, at_most, not_applicable, within_rounding
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.tangents import tangents

DEPTH_LOG = 600.0  # logarithm of the largest trusted ratio between values of the basis: floats reach 708
MAX_NEGLECTED = 0.1  # with a larger neglected share, the limit is not reached within the range of floats


def end_tangents(probe: Probe) -> Finding:
    """Compare directions near the ends with those to the next distinct control point."""
    return _worst(_end_tangent(probe, _End(probe, end)) for end in (0, 1))


def _worst(findings: Iterable[Finding]) -> Finding:
    """Return the first finding that does not hold, otherwise the one with the largest violation."""
    worst = Finding("holds", 0.0, 0.0, "")
    for found in findings:
        if found.status != "holds":
            return found
        if (found.value or 0.0) >= (worst.value or 0.0):
            worst = found
    return worst


def _end_tangent(probe: Probe, end: _End) -> Finding:
    layer_log = 32.0  # logarithm of the factor by which knots beyond the next one have faded at the place
    lead = end.lead
    if lead is None:
        return not_applicable("all control points coincide")
    # Each knot beyond the next one fades exponentially with its distance from it.
    behind = slice(lead + 1, None)
    fading = end.logs[behind] - end.logs[lead] + end.log_lengths[behind] - end.log_lengths[lead]
    away = end.places[behind] - end.places[lead]
    sigma = max(0.0, float(((fading + layer_log) / away).max(initial=0.0)))
    sigma = min(sigma, (DEPTH_LOG + end.logs[lead] - end.logs[0]) / end.places[lead])
    neglected = float(np.exp(np.clip(fading - away * sigma, -DEPTH_LOG, DEPTH_LOG)).sum())
    if neglected > MAX_NEGLECTED:
        return not_applicable("the knots after the next one are so near to it that the limit is beyond floats")
    moved = probe.merged.replace(control_points=end.vectors)
    vector = points_at_torus(moved, np.array([[-end.sign * sigma]]))[0]
    if not np.isfinite(vector).all() or not vector.any():
        return at_most(math.inf, 0.0, "the curve does not leave its end")
    direction, expected = (v / np.abs(v).max() for v in (vector, end.step))
    length = np.sqrt((direction**2).sum() * (expected**2).sum())
    sine = float(np.sqrt((np.cross(direction, expected) ** 2).sum()) / length)
    if direction @ expected < 0:
        sine = 2.0 - sine
    bound = 2 * neglected + VALUE_ROUNDINGS * EPS * probe.reach * probe.extent / float(np.abs(end.step).max())
    reason = "sine of the angle to the next control point, the larger of both ends"
    found = within_rounding(sine, bound, reason)
    if found.status != "holds":
        return found
    tangent = end.sign * tangents(moved, [end.at])[0]
    expected = end.step / np.sqrt((end.step**2).sum())
    off = largest(np.abs(tangent - expected))
    return at_most(max(sine, off), bound, reason) if off <= bound else at_most(off, bound, f"{reason}: of the tangent")


def end_tangent_lengths(probe: Probe) -> Finding:
    """Compare difference quotients at the ends with the paper's formula, with its k_0 and k_1."""
    ends = [_End(probe, end) for end in (0, 1)]
    if ends[0].lead is None:
        return not_applicable("all control points coincide")
    k_0, k_1 = (1 / end.places[1] for end in ends)
    pairs = ((ends[0], k_0, k_1), (ends[1], k_1, k_0))
    return _worst(_end_tangent_length(probe, end, near, far) for end, near, far in pairs)


def _end_tangent_length(probe: Probe, end: _End, near: float, far: float) -> Finding:
    length = end.places[-1]
    scales = np.array([near, far] if end.sign > 0 else [far, near])
    moved = probe.merged.replace(control_points=end.vectors, edge_scale=scales)
    log_length = end.logs[1] - end.logs[0] + np.log(near) - far / near * np.log(far * length)
    best, step = _smallest_error(end, moved, near, far)
    if best > MAX_NEGLECTED or abs(log_length) > DEPTH_LOG:
        return not_applicable("the limit is not reached within the range of floats")
    u = end.at + end.sign * step * length
    quotient = moved.evaluate(np.array([u]))[0] / abs(u - end.at)
    scale = np.exp(log_length) * float(np.abs(end.vectors).max())
    expected = np.exp(log_length) * end.vectors[end.next_row]
    value = largest(np.abs(quotient - expected) / scale)
    return within_rounding(value, best, "difference from the formula, of its length; k_0 and k_1 as it demands")


def _smallest_error(end: _End, patch: Patch, near: float, far: float) -> tuple[float, float]:
    """Return the least bound for the error of a difference quotient over steps of 2^-8 to 2^-47 of Δ, and its step."""
    length = end.places[-1]
    best = step = np.inf
    vectors = np.exp(end.log_lengths - end.log_lengths.max())
    for fraction in (2.0**-k for k in range(8, 50, 3)):
        u = end.at + end.sign * fraction * length
        delta = abs(float(u) - end.at)
        if delta < VALUE_ROUNDINGS * patch.domain.tolerance:
            break
        # Log of the basis relative to the end knot's: a knot at distance d has d near log(near δ) − d far log(…).
        slope = near * np.log(near * delta) - far * np.log(far * (length - delta))
        shares = np.exp(np.clip(end.logs - end.logs[0] + slope * end.places, -DEPTH_LOG, DEPTH_LOG))
        others = float((shares[2:] * vectors[2:]).sum() / shares[1])
        error = others + float(shares[1:].sum()) + 2 * far / near * delta / length
        error += EPS * VALUE_ROUNDINGS * (1 + float(np.abs(end.logs).max()) + abs(slope) * length)
        if error < best:
            best, step = error, fraction
    return 2 * best, step


class _End:
    """One end of the merged curve: its knots by distance, with their weights and steps from the end point."""

    def __init__(self, probe: Probe, end: int) -> None:
        patch, tolerance = probe.merged, 8 * EPS * probe.reach * probe.extent
        knots = patch.knots[:, 0]
        self.sign = 1.0 if end == 0 else -1.0
        self.at = float(patch.domain.vertices[end, 0])
        distances = self.sign * (knots - self.at)
        order = np.argsort(distances, kind="stable")
        self.places = distances[order]
        self.logs = patch.log_products[order]
        self.vectors = patch.control_points - patch.control_points[order[0]]
        self.vectors[np.abs(self.vectors).max(axis=1) <= tolerance] = 0.0
        lengths = np.sqrt((self.vectors[order] ** 2).sum(axis=1))
        with np.errstate(divide="ignore"):
            self.log_lengths = np.log(lengths)
        different = np.flatnonzero(lengths > 0)
        self.lead = int(different[0]) if len(different) else None
        self.next_row = int(order[1])
        self.step = self.vectors[order[self.lead or 0]]
