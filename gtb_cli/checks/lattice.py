"""Reduction to classical rational Bézier patches, which are evaluated here by recurrence, without exponentials."""

import math

import numpy as np

from gtb_cli.arrays import EPS, FloatArray
from gtb_cli.checks.probe import Probe
from gtb_cli.checks.report import Finding, not_applicable, within_rounding
from gtb_cli.errors import DomainError
from gtb_cli.knots.lattice import binomial_coefficients, lattice_of


def classical_bezier(probe: Probe) -> Finding:
    """Compare the patch with the rational Bézier curve, triangle or tensor product patch on the same lattice."""
    most, max_numbers = 200, 2_000_000  # parameters, and floats in a table of the recurrence, for high degrees
    domain = probe.patch.domain
    try:
        binomials = binomial_coefficients(domain)
    except DomainError as error:
        return not_applicable(str(error).removeprefix("coefficients: binomial ").replace("needs", "it needs", 1))
    lattice = lattice_of(domain) or ()
    size = math.prod((direction.degree + 1) ** len(direction.steps) for direction in lattice)
    stride = -(-len(probe.inside) // max(4, min(most, max_numbers // size)))
    s = probe.torus[:, ::stride]
    values = np.ones((s.shape[1], len(domain.knots)))
    for direction in lattice:
        values *= de_casteljau(direction.degree, _barycentric(direction.steps @ s))[
            (slice(None), *direction.places.T[1:])
        ]
    with np.errstate(divide="ignore"):
        logs = np.log(values) + probe.patch.log_products - np.log(binomials)
    values = np.exp(logs - logs.max(axis=1, keepdims=True))
    points = values @ probe.patch.control_points / values.sum(axis=1, keepdims=True)
    value = probe.distance(points, probe.points[probe.inside[::stride]])
    # The recurrence rounds once for each degree, and the weights round in the exponents; a knot that is off the
    # lattice by a fraction of a step changes exponents by that fraction.
    degrees = sum(direction.degree for direction in lattice)
    off = max(float(direction.offsets.max()) for direction in lattice)
    largest = max(float(np.abs(direction.steps @ s).max()) for direction in lattice)
    bound = probe.distance_rounding + 4 * EPS * degrees**2 + 2 * off * largest
    kind = {2: "curve", 3: "triangle", 4: "tensor product patch"}[len(domain.vertices)]
    numbers = " × ".join(str(direction.degree) for direction in lattice)
    return within_rounding(value, bound, f"largest distance from the Bézier {kind} of degree {numbers}, of the extent")


def de_casteljau(degree: int, barycentric: FloatArray) -> FloatArray:
    """Evaluate the Bernstein polynomials of a segment (e = 2) or triangle (e = 3).

    Parameters
    ----------
    degree : int
    barycentric : (e, m) float
        Nonnegative with sum 1.

    Returns
    -------
    (m, degree + 1) or (m, degree + 1, degree + 1) float
        Indexed by the exponents of the second barycentric coordinate, or of the second and third.

    Notes
    -----
    ``B^k_α = Σ_j λ_j B^{k−1}_{α − e_j}``, de Casteljau's recurrence: only products and sums of nonnegative numbers.
    """
    first, *others = barycentric
    column = (len(first), *(1 for _ in others))
    values = np.zeros((len(first), *(degree + 1 for _ in others)))
    values.reshape(len(first), -1)[:, 0] = 1.0
    for _ in range(degree):
        raised = first.reshape(column) * values
        for axis, share in enumerate(others, 1):
            raised += share.reshape(column) * np.roll(values, 1, axis=axis)
        values = raised
    return values


def _barycentric(logs: FloatArray) -> FloatArray:
    """Return (e, m) shares in proportion 1 : exp(logs[0]) : … for (e − 1, m) logarithms."""
    whole = np.concatenate([np.zeros((1, logs.shape[1])), logs])
    shares = np.exp(whole - whole.max(axis=0))
    return np.asarray(shares / shares.sum(axis=0))
