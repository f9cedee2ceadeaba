"""Properties of a curve's ends: directions and lengths of tangents."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from gtb_cli.arrays import EPS, FloatArray
from gtb_cli.checks.probe import VALUE_ROUNDINGS, Probe, largest, points_at_torus
from gtb_cli.checks.report import Finding, not_applicable, within_rounding
from gtb_cli.theory.normals import tangents
from gtb_cli.theory.patch import Patch

DEPTH_LOG = 600.0  # logarithm of the largest trusted ratio between values of the basis: floats reach 708
MAX_NEGLECTED = 0.1  # with a larger neglected share, the limit is not reached within the range of floats


class _End(NamedTuple):
    """An end of the merged curve; arrays have a row for each knot, the nearest to the end first."""

    patch: Patch  # moved so that its control point there is 0
    sign: float  # 1 at the start and −1 at the end
    at: float
    places: FloatArray
    logs: FloatArray
    vectors: FloatArray
    lengths: FloatArray


def _ends(probe: Probe) -> list[_End]:
    patch, found = probe.merged, []
    for sign, vertex in zip((1.0, -1.0), patch.domain.vertices[:, 0].tolist(), strict=True):
        distances = sign * (patch.knots[:, 0] - vertex)
        order = np.argsort(distances, kind="stable")
        vectors = patch.control_points - patch.control_points[order[0]]
        vectors[np.abs(vectors).max(axis=1) <= 8 * EPS * probe.reach * probe.extent] = 0.0
        moved, rows = patch.replace(control_points=vectors), vectors[order]
        lengths = np.sqrt((rows**2).sum(axis=1))
        found.append(_End(moved, sign, vertex, distances[order], patch.log_products[order], rows, lengths))
    return found


def _worst(findings: Iterable[Finding]) -> Finding:
    """Return a finding that fails, else one that does not hold, else the one with the largest violation."""
    return max(findings, key=lambda one: (one.status == "fails", one.status != "holds", one.value or 0.0))


def end_tangents(probe: Probe) -> Finding:
    """Compare directions near the ends, and unit tangents there, with the way to the next distinct control point."""
    return _worst(_end_tangent(probe, end) for end in _ends(probe))


def _end_tangent(probe: Probe, end: _End) -> Finding:
    if not end.lengths.any():
        return not_applicable("all control points coincide")
    lead = int(np.flatnonzero(end.lengths)[0])
    # So near to the end that the next different control point has the smallest share which is trusted beside the end's,
    # and each knot beyond it has faded exponentially with its distance from it.
    sigma = (DEPTH_LOG + end.logs[lead] - end.logs[0]) / end.places[lead]
    fading = end.logs[lead + 1 :] - end.logs[lead] - sigma * (end.places[lead + 1 :] - end.places[lead])
    neglected = float((np.exp(np.minimum(fading, DEPTH_LOG)) * end.lengths[lead + 1 :]).sum() / end.lengths[lead])
    if neglected > MAX_NEGLECTED:
        return not_applicable("the knots after the next one are so near to it that the limit is beyond floats")
    vector = points_at_torus(end.patch, np.array([[-end.sign * sigma]]))[0]
    directions = np.stack([vector, end.sign * tangents(end.patch, [end.at])[0], end.vectors[lead]])
    with np.errstate(invalid="ignore"):  # a curve that does not leave its end
        directions /= np.abs(directions).max(axis=1, keepdims=True)
        directions /= np.sqrt((directions**2).sum(axis=1, keepdims=True))
    bound = 2 * neglected + VALUE_ROUNDINGS * EPS * probe.reach * probe.extent / float(np.abs(end.vectors[lead]).max())
    reason = "largest difference of unit vectors from that to the next control point, at both ends"
    return within_rounding(largest(np.abs(directions[:2] - directions[2])), bound, reason)


def end_tangent_lengths(probe: Probe) -> Finding:
    """Compare difference quotients at the ends with the paper's formula, with its k_0 and k_1."""
    ends = _ends(probe)
    if not ends[0].lengths.any():
        return not_applicable("all control points coincide")
    k_0, k_1 = (float(1 / end.places[1]) for end in ends)
    return _worst(
        _end_tangent_length(end._replace(patch=end.patch.replace(edge_scale=[k_0, k_1])), near, far)
        for end, near, far in zip(ends, (k_0, k_1), (k_1, k_0), strict=True)
    )


def _end_tangent_length(end: _End, near: float, far: float) -> Finding:
    length, order = end.places[-1], np.argsort(end.sign * end.patch.knots[:, 0], kind="stable")
    u = end.at + end.sign * length * 2.0 ** -np.arange(8.0, 50.0, 3.0)
    steps = np.abs(u - end.at)
    u, steps = (array[steps >= VALUE_ROUNDINGS * end.patch.domain.tolerance] for array in (u, steps))
    log_length = end.logs[1] - end.logs[0] + np.log(near) - far / near * np.log(far * length)
    # The knots beyond the next one, the end's share beside 1, the slope of the other edge function, and rounding
    shares = end.patch.basis(u)[:, order]
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = (shares[:, 2:] @ end.lengths[2:]) / (shares[:, 1] * end.lengths.max()) + shares[:, 1:].sum(axis=1)
    errors += 2 * far / near * steps / length + Probe(end.patch).rounding
    best = int(np.nan_to_num(errors, nan=np.inf).argmin())
    if not errors[best] <= MAX_NEGLECTED / 2 or abs(log_length) > DEPTH_LOG:
        return not_applicable("the limit is not reached within the range of floats")
    quotient = end.patch.evaluate(u[best : best + 1])[0] / steps[best]
    scale = np.exp(log_length) * float(np.abs(end.vectors).max())
    value = largest(np.abs(quotient - np.exp(log_length) * end.vectors[1]) / scale)
    reason = "difference from the formula, of its length; k_0 and k_1 as it demands"
    return within_rounding(value, 2 * float(errors[best]), reason)
