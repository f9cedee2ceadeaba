"""The GT-Bernstein basis β with its weights and coefficients, and torus coordinates; T_i: `rational_basis`.

With the torus coordinate ``s(u) = Σ_j s_j ξ_j log h_j(u)``, every exponent is linear:
``Σ_j h_j(a_i) log h_j(u) = <a_i, s> + (a term common to all i)``, so that the rational basis is
``T_i = softmax_i(<a_i, s> + log(c_i ω_i))``. On the relative interior of a face of Δ the same holds for the knots on
that face, with the edge functions that vanish left out.
"""

from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import EPS, FloatArray, IntArray, finite, positive, read_only
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.face import Face
from gtb_cli.knots.lattice import binomial_coefficients

CoefficientRule: TypeAlias = Literal["binomial", "partition-of-unity"]


class Location(NamedTuple):
    """The place of parameters: a face of Δ, of dimension e, and torus coordinates on it."""

    rows: slice | IntArray  # (B,) indices of the parameters; later locations replace earlier ones of the same rows
    face: Face
    knots: FloatArray  # (k, e) coordinates of the knots on the face
    s: FloatArray  # (e, B) torus coordinates, dual to them


def torus_coordinates(domain: Domain, heights: FloatArray) -> FloatArray:
    """Return torus coordinates s from positive edge functions: (r, m) → (d, m)."""
    return np.asarray(domain.normals.T @ np.log(heights))


def gt_bernstein(domain: Domain, coefficients: ArrayLike, u: ArrayLike) -> FloatArray:
    """Evaluate ``β_i(u) = c_i ∏_j h_j(u)^{h_j(a_i)}`` with 0⁰ = 1, (m, n), as `Patch.beta` does (eq. 201, eq. 204)."""
    heights = domain.edge_functions(u)
    zero = heights == 0
    logs = np.log(np.where(zero, 1.0, heights))
    vanishes = zero.astype(np.float64) @ (~domain.incidence).T.astype(np.float64) > 0
    with np.errstate(over="ignore", under="ignore"):
        beta = np.exp(logs @ domain.heights.T + np.log(np.asarray(coefficients, dtype=np.float64)))
    return np.where(vanishes, 0.0, beta)


def unity_coefficients(domain: Domain, u: ArrayLike | None = None) -> FloatArray:
    """Solve ``Σ_j β_j(u_i) = 1`` at n distinct parameters for the (n,) coefficients c (eq. 8, Thm 2.2).

    The paper does not guarantee a positive solution: knots {0, 1, 3} with u = (1.5, 2, 2.25) do not have one.

    Parameters
    ----------
    domain : Domain
        Δ with its knots and edge functions: ``patch.domain``.
    u : (n, d) float, optional
        Default: the inner Chebyshev points of Δ for curves, the knots moved by 10 % towards its middle for surfaces.

    Raises
    ------
    DomainError
        Knots are repeated, so that the system is singular, or the solution is not positive, hence not a basis.
    """
    n = len(domain.knots)
    if u is None and domain.dimension == 1:
        u = domain.center + domain.size / 2 * np.cos(np.pi * (2 * np.arange(n, 0, -1) - 1) / (2 * n))[:, None]
    elif u is None:
        u = domain.knots + 0.1 * (domain.center - domain.knots)
    parameters, _ = domain.grid(u)
    if len(parameters) != n:
        raise DomainError(f"parameters: expected {n}, one per knot, got {len(parameters)}")
    matrix = gt_bernstein(domain, np.ones(n), parameters)
    rows = matrix.max(axis=1, keepdims=True)
    if not np.isfinite(matrix).all() or not (rows > 0).all() or not (matrix > 0).any(axis=0).all():
        raise DomainError("coefficients: the exponents are so large that β is beyond the range of floats")
    # Rows and columns are scaled to a largest entry of 1, so that the rank decision does not depend on units.
    columns = (matrix / rows).max(axis=0)
    scaled = matrix / rows / columns
    if np.linalg.matrix_rank(scaled) < n:
        why = "no unique solution to rounding (repeated or too many knots?)"
        raise DomainError(f"coefficients: partition of unity has {why}")
    solution = np.linalg.solve(scaled, 1.0 / rows[:, 0])
    c = solution / columns
    # Entries are powers, and the error is that of their logarithms; Skeel's bound limits the error of the solution.
    logs = np.abs(np.log(matrix[matrix > 0])).max()
    doubt = EPS * (n + logs) * (np.abs(np.linalg.inv(scaled)) @ (np.abs(scaled) @ np.abs(solution)))
    if not (solution > doubt).all():
        values = ", ".join(f"{x:.6g}" if abs(y) > d else "0" for x, y, d in zip(c, solution, doubt, strict=True))
        raise DomainError(f"coefficients: partition of unity would need ({values}), which are not all positive")
    return np.asarray(c)


COEFFICIENTS = {"binomial": binomial_coefficients, "partition-of-unity": unity_coefficients}  # as specs name them


def coefficients_of(shape: Domain, values: ArrayLike | str | None) -> FloatArray:
    """Return the positive coefficients c, (n,), as given, by a rule, or by default 1."""
    if isinstance(values, str):
        if values not in COEFFICIENTS:
            raise DomainError(f"coefficients: expected numbers, {' or '.join(COEFFICIENTS)}, got {values!r}")
        values = COEFFICIENTS[values](shape)
    return positive("coefficients", np.ones(len(shape.knots)) if values is None else values)


def both_weights(weights: ArrayLike | None, logarithms: ArrayLike | None, n: int) -> tuple[FloatArray, FloatArray]:
    """Return weights and their logarithms, (n,) each, from either or both; by default 1 and 0."""
    if logarithms is None:
        weights = positive("weights", np.ones(n) if weights is None else weights)
        return weights, read_only(np.log(weights))
    logarithms = finite("log_weights", logarithms)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        powers = read_only(np.exp(logarithms))
        weights = powers if weights is None else read_only(weights)
        if weights.shape == powers.shape:  # others are refused later
            rounding = 1e-9 * np.minimum(weights, powers) + np.finfo(float).tiny
            if not ((weights == powers) | (np.abs(weights - powers) <= rounding)).all():
                raise DomainError("weights: disagree with log_weights; `Patch.replace` changes both")
    return weights, logarithms
