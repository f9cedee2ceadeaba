"""Properties of surfaces: their boundary and their isoparametric curves."""

from __future__ import annotations

import numpy as np

from gtb_cli.arrays import FloatArray
from gtb_cli.checks.probe import Probe, choice, largest, points_at_torus
from gtb_cli.checks.report import Outcome, not_applicable, within_rounding
from gtb_cli.design.isocurve import isocurve
from gtb_cli.theory.basis import torus_coordinates


def boundaries(probe: Probe) -> Outcome:
    """Check that T of knots off an edge is 0 on it, and that the surface there is the curve of the knots on it."""
    max_edges = 64  # of more, an evenly spread choice is examined
    patch, domain = probe.patch, probe.patch.domain
    r = len(domain.vertices)
    worst = 0.0
    fractions = np.arange(1, 16)[:, None] / 16
    for edge in choice(r, max_edges):
        start, end = domain.vertices[edge], domain.vertices[(edge + 1) % r]
        u = start + fractions * (end - start)
        worst = max(worst, largest(np.abs(patch.basis(u)[:, ~domain.incidence[:, edge]])))
        heights = domain.heights_of_columns(u, 0, np.full(len(u), domain.faces.edge(edge).number))
        heights[edge] = 1.0
        sigma = (domain.direction(edge) @ torus_coordinates(domain, heights))[None]
        curve = patch.boundary(edge)
        worst = max(worst, probe.distance(patch.evaluate(u), points_at_torus(curve, sigma)))
        ends = curve.evaluate(curve.domain.vertices)
        worst = max(worst, probe.distance(patch.evaluate(np.stack([start, end])), ends))
    reason = "largest distance of an edge from the curve of its knots, or value of another knot's T there"
    return within_rounding(worst, 2 * probe.distance_rounding, reason)


def isoparametric_curves(probe: Probe) -> Outcome:
    """Compare P(u*, v) on a rectangle with the curve of the knots' other coordinates, weights c ω exp(u_i θ(u*))."""
    domain = probe.patch.domain
    if len(domain.vertices) != 4 or ((domain.normals != 0).sum(axis=1) != 1).any():
        return not_applicable("the domain is not a rectangle along the axes: isolines on it are not GT-Bézier curves")
    worst = max(_isoline_distance(probe, axis, fraction) for axis in (0, 1) for fraction in (0.125, 0.5, 0.8))
    reason = "largest distance of isolines from the GT-Bézier curves of their weights, of the extent"
    return within_rounding(worst, 4 * probe.distance_rounding, reason)


def _isoline_distance(probe: Probe, axis: int, fraction: float) -> float:
    """Return the distance between the isoline of one coordinate and its curve."""
    patch, domain = probe.patch, probe.patch.domain
    low, high = domain.vertices.min(axis=0), domain.vertices.max(axis=0)
    place = low + fraction * (high - low)
    other = 1 - axis
    curve = isocurve(patch, axis, float(place[axis]))
    v = np.linspace(low[other], high[other], 17)
    v[-1] = high[other]
    u: FloatArray = np.empty((len(v), 2))
    u[:, axis], u[:, other] = place[axis], v
    return probe.distance(patch.evaluate(u), curve.evaluate(v))
