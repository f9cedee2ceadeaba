"""Properties of surfaces: their boundary and their isoparametric curves."""

from gtb_cli.checks.probe import Probe, points_at_torus
from gtb_cli.checks.report import Finding, not_applicable, within_rounding


def boundaries(probe: Probe) -> Finding:
    """Check that T of knots off an edge is 0 on it, and that the surface there is the curve of the knots on it."""
    patch, edges = probe.patch, probe.edges
    worst = edges.leak
    points = patch.points_at(edges.locations, len(edges.numbers) * edges.each).reshape(-1, edges.each, 3)
    for edge, sigma, found in zip(edges.numbers, edges.torus, points, strict=True):
        curve = patch.boundary(edge)
        ends = curve.evaluate(curve.domain.vertices)
        worst = max(worst, probe.distance(found[1:-1], points_at_torus(curve, sigma)))
        worst = max(worst, probe.distance(found[[0, -1]], ends))
    reason = "largest distance of an edge from the curve of its knots, or value of another knot's T there"
    return within_rounding(worst, 2 * probe.distance_rounding, reason)


def isoparametric_curves(probe: Probe) -> Finding:
    """Compare P(u*, v) on a rectangle with the curve of the knots' other coordinates, weights c ω exp(u_i θ(u*))."""
    domain = probe.patch.domain
    if len(domain.vertices) != 4 or ((domain.normals != 0).sum(axis=1) != 1).any():
        return not_applicable("the domain is not a rectangle along the axes: isolines on it are not GT-Bézier curves")
    locations, values = probe.isolines
    points = probe.patch.points_at(locations, len(values))
    reason = "largest distance of isolines from the GT-Bézier curves of their weights, of the extent"
    value = probe.distance(points, values @ probe.patch.control_points)
    return within_rounding(value, 4 * probe.distance_rounding, reason)
