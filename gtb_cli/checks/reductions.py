"""Special cases: a patch on an edge, on an isoparametric line, on a lattice of knots, and with repeated knots."""

from itertools import product

import numpy as np

from gtb_cli.arrays import EPS
from gtb_cli.bezier.isocurve import isocurve
from gtb_cli.checks.probe import Probe, choice, largest, points_at_torus
from gtb_cli.checks.report import Finding, not_applicable, within_rounding
from gtb_cli.errors import DomainError
from gtb_cli.knots.lattice import binomial_coefficients, lattice_fault, lattice_of
from gtb_cli.moment.torus import shares
from gtb_cli.theory.basis import torus_coordinates


def boundary_curves(probe: Probe) -> Finding:
    """Check that T of knots off an edge is 0 on it, and that the surface there is the curve of the knots on it."""
    patch, domain, worst = probe.patch, probe.patch.domain, 0.0
    zero = probe.heights == 0
    for edge in choice(len(domain.vertices), 64):
        rows = np.flatnonzero(zero[edge] & (zero.sum(axis=0) == 1))
        leak = largest(np.abs(probe.basis[rows][:, ~domain.incidence[:, edge]]))
        sigma = domain.direction(edge) @ torus_coordinates(domain, np.where(zero[:, rows], 1.0, probe.heights[:, rows]))
        worst = max(worst, leak, probe.distance(probe.points[rows], points_at_torus(patch.boundary(edge), sigma[None])))
    reason = "largest distance of an edge from the curve of its knots, or value of another knot's T there"
    return within_rounding(worst, 2 * probe.distance_rounding, reason)


def isoparametric_curves(probe: Probe) -> Finding:
    """Compare P(u*, v) on a rectangle with the curve of the knots' other coordinates, weights c ω exp(u_i θ(u*))."""
    patch, domain, worst = probe.patch, probe.patch.domain, 0.0
    if len(domain.vertices) != 4 or ((domain.normals != 0).sum(axis=1) != 1).any():
        return not_applicable("the domain is not a rectangle along the axes: isolines on it are not GT-Bézier curves")
    low, high = domain.vertices[[0, 2]]
    for axis, fraction in product((0, 1), (0.125, 0.6)):
        u = np.linspace(low, high, 17)
        u[:, axis] = low[axis] + fraction * (high[axis] - low[axis])
        curve = isocurve(patch, axis, float(u[0, axis]))
        worst = max(worst, probe.distance(patch.evaluate(u), curve.evaluate(u[:, 1 - axis])))
    reason = "largest distance of isolines from the GT-Bézier curves of their weights, of the extent"
    return within_rounding(worst, 4 * probe.distance_rounding, reason)


def classical_bezier(probe: Probe) -> Finding:
    """Compare the patch with the rational Bézier patch on the same lattice, by powers of barycentric coordinates."""
    patch, domain = probe.patch, probe.patch.domain
    lattice = lattice_of(domain)
    if lattice is None:
        return not_applicable(f"it needs {lattice_fault(domain)}")
    try:
        binomials = binomial_coefficients(domain)
    except DomainError as error:
        return not_applicable(str(error).removeprefix("coefficients: "))
    some = slice(None, None, -(-len(probe.inside) // 200))
    s = torus_coordinates(domain, probe.heights[:, probe.inside])[:, some]
    bernstein = np.tile(binomials, (s.shape[1], 1))
    for direction in lattice:
        barycentric = shares(np.pad(direction.steps @ s, [(1, 0), (0, 0)])).T
        bernstein *= (barycentric[:, None, :] ** direction.places).prod(axis=2)
    with np.errstate(divide="ignore"):
        logs = np.log(bernstein) + patch.log_products - np.log(binomials)
    values = np.exp(logs - logs.max(axis=1, keepdims=True))
    points = values @ patch.control_points / values.sum(axis=1, keepdims=True)
    value = probe.distance(points, probe.points[probe.inside[some]])
    # Powers multiply the rounding of barycentric coordinates, and the weights round in the exponents; a knot that is
    # off the lattice by a fraction of a step changes exponents by that fraction.
    degrees = sum(direction.degree for direction in lattice)
    off = max(float(direction.offsets.max()) for direction in lattice)
    farthest = max(float(np.abs(direction.steps @ s).max()) for direction in lattice)
    bound = probe.distance_rounding + 4 * EPS * degrees**2 + 2 * off * farthest
    kind = {2: "curve", 3: "triangle", 4: "tensor product patch"}[len(domain.vertices)]
    numbers = " × ".join(str(direction.degree) for direction in lattice)
    return within_rounding(value, bound, f"largest distance from the Bézier {kind} of degree {numbers}, of the extent")


def multiple_knots(probe: Probe) -> Finding:
    """Compare a patch that has repeated knots with the patch in which they are merged."""
    if probe.merged is probe.patch:
        return not_applicable("no knot is repeated")
    value, bound = probe.distance(probe.merged.evaluate(probe.u), probe.points), probe.distance_rounding
    return within_rounding(value, bound, "largest distance from the patch of merged knots, of the extent")
