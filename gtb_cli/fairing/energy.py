"""Thin-plate and Dirichlet energy, where `gtb fair` begins (matrices: `metric`); its own: `variation`, `descent`.

Near an edge second derivatives grow like h^(r − 2), h the distance from it and r the ratio of the second to the first
height of knots over it, and so do curvatures: over all of Δ the thin-plate integral is infinite for r ≤ 1.5, and at a
corner it may be for any power of h as a factor. So both energies are integrals over Δ without its outermost thousandth.
"""

import math
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, planar_cross
from gtb_cli.fairing.metric import blocks, forms
from gtb_cli.knots.domain import Domain
from gtb_cli.moment.moment_map import MomentMap
from gtb_cli.theory.patch import Patch

Energy: TypeAlias = Literal["thin-plate", "dirichlet"]


def energy_matrix(patch: Patch, kind: Energy, resolution: int = 64) -> FloatArray:
    """Return the (n, n) matrix of the energy of a surface as a quadratic form of each coordinate of control points.

    The energy is ``∫ |P_xx|² + 2 |P_xy|² + |P_yy|²`` or ``∫ |P_x|² + |P_y|²`` over Δ scaled to area 1, shrunk towards
    its middle by a thousandth, in units of length²; for `resolution` see `energy_samples`.
    """
    return energy_at(*samples(patch.domain, patch.log_products, resolution), kind)


class Samples(NamedTuple):
    """A quadrature in torus coordinates: (n, 2) knots of a domain of area 1, log weights, (2, m) places, (m,) areas."""

    knots: FloatArray
    log_weights: FloatArray
    s: FloatArray
    areas: FloatArray


def samples(
    domain: Domain, log_weights: FloatArray, resolution: int, left_out: float = 1e-3, until: float = 1.0
) -> Samples:
    """Return the places of `energy_samples` on the torus, of knots from their middle and in units of √area.

    The solver starts from places of half the resolution, by polynomials.
    """
    coarsest = 8  # with less, interpolation saves no steps
    p, areas, _ = energy_samples(domain, resolution, left_out, until)
    middle, unit = domain.vertices.mean(axis=0), np.sqrt(_sectors(domain.vertices).sum())
    knots, start = (domain.knots - middle) / unit, None
    if resolution > coarsest:
        count = (resolution + 1) // 2
        s = samples(domain, log_weights, count, left_out, until).s
        depth, along = _lagrange(_depths(count, until), _depths(resolution, until)), _lagrange(count, resolution)
        start = (depth @ s.reshape(2, len(domain.vertices), -1, count) @ along.T).reshape(2, -1)
    s = MomentMap(knots, log_weights).inverse((p - middle) / unit, 1e-8, start)
    return Samples(knots, log_weights, s, areas / unit**2)


@lru_cache
def gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of Gauss's rule on [−1, 1] (G. H. Golub, J. H. Welsch, Math. Comp. 23 (1969))."""
    k = np.arange(1, count)
    nodes, vectors = np.linalg.eigh(np.diag(k / np.sqrt(4 * k * k - 1), -1))
    weights = 2 * vectors[0] ** 2
    return (nodes - nodes[::-1]) / 2, weights / 2 + weights[::-1] / 2


def _lagrange(count: int, finer: int) -> FloatArray:
    """Return the values of the polynomials of Gauss's nodes at the nodes of a finer rule, (finer, count)."""
    values, basis = (np.cos(np.arange(count) * np.arccos(gauss(n)[0])[:, None]) for n in (finer, count))
    return np.asarray(values @ np.linalg.inv(basis))


def energy_at(knots: FloatArray, log_weights: FloatArray, s: FloatArray, areas: FloatArray, kind: Energy) -> FloatArray:
    """Return the (n, n) energy matrix of samples at (2, m) torus coordinates that stand for (m,) areas."""
    plane = np.column_stack([knots, np.zeros(len(knots))])
    return np.asarray(forms(blocks(knots, log_weights, s), areas, plane, [1 if kind == "dirichlet" else 2])[0])


def energy_samples(
    domain: Domain, resolution: int, left_out: float = 1e-3, until: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (m, 2) places, (m,) areas and depths of a quadrature over Δ without its outermost part, a thousandth.

    It has `resolution`² places in the triangle of each edge and the middle, by Gauss's rule in coordinates that are
    exponential functions of the distances from edges and corners: the error falls exponentially with the resolution.
    Of the specs' energies it is below 1e-2 with 32, and 2e-5 with 64. A strip up to `until` has a third of the places.
    """
    # Of the way to the middle, as is what is left out, and of an edge; within these, steps are nearly even
    layer, corner = min(1e-2, until / 10), max(1e-3, left_out)
    nodes, weights = gauss(_depths(resolution, until))
    span = np.log((until + layer) / (left_out + layer))
    depth = (left_out + layer) * np.exp(span * (nodes + 1) / 2) - layer
    depth_weights = weights * span / 2 * (depth + layer) * (1 - depth)
    nodes, weights = gauss(resolution)
    # Along the edge a logistic function of the nodes, from 0 to 1
    steepness = np.log((1 + corner) / corner) / 2
    along = (1 + np.tanh(steepness * nodes) / np.tanh(steepness)) / 2
    along_weights = weights * steepness / np.cosh(steepness * nodes) ** 2 / np.tanh(steepness) / 2
    middle, start = domain.vertices.mean(axis=0), domain.vertices[:, None]
    on_edges = start + along[:, None] * (np.roll(domain.vertices, -1, axis=0)[:, None] - start)
    places = middle + (1 - depth)[:, None, None] * (on_edges[:, None] - middle)
    areas = 2 * _sectors(domain.vertices)[:, None, None] * depth_weights[:, None] * along_weights
    return places.reshape(-1, 2), areas.ravel(), np.broadcast_to(depth[:, None], areas.shape).ravel()


def _depths(resolution: int, until: float) -> int:
    return resolution if until == 1 else math.ceil(resolution / 3)


def _sectors(vertices: FloatArray) -> FloatArray:
    """Return (r,) areas of the triangles between edges and the middle of the vertices."""
    out = vertices - vertices.mean(axis=0)
    return np.asarray(planar_cross(out, np.roll(out, -1, axis=0)) / 2)
