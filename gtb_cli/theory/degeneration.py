"""Toric degeneration: weights x^λ ω, and the regular control curve or surface that patches tend to as x grows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, finite
from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import RegularDecomposition, regular_decomposition
from gtb_cli.theory.model import Model
from gtb_cli.theory.patch import Patch

MAX_WEIGHT_LOG = 700.0
"""Largest natural logarithm of a weight, in size: exp(±700), and products with knots and points, are ordinary
floats."""


def degenerate(patch: Patch, x: float, lifting: ArrayLike | None = None) -> Patch:
    """Give a patch the weights ``ω_i(x) = x^{λ_i} ω_i`` of its toric degeneration.

    Parameters
    ----------
    patch : Patch
    x : float
        Finite and positive. As x → ∞ the patch tends to `regular_control_surface` of the same lifting, as x → 0 to
        that of −λ; x = 1 gives the patch back.
    lifting : (n,) float, optional
        λ_i; default the patch's own.

    Returns
    -------
    Patch
        The same but for its weights, given as logarithms where some are beyond the range of floats.

    Raises
    ------
    DomainError
        x is not finite and positive, or there is no lifting.

    References
    ----------
    Eq. (304), eq. (403).
    """
    if not (math.isfinite(x) and x > 0):
        raise DomainError(f"x: must be finite and positive, got {x!r}")
    with np.errstate(over="ignore"):
        exponents = lifting_of(patch, lifting) * math.log(x)
    if not np.isfinite(exponents).all():
        raise DomainError("lifting: λ log x is beyond the largest float")
    logs = exponents + patch.log_weights
    if max(np.abs(array).max() for array in (exponents, patch.log_weights, logs)) <= MAX_WEIGHT_LOG:
        # Powers, as 5³ is 125, and exp(3 log 5) nearly.
        return patch.replace(weights=patch.weights * np.power(float(x), lifting_of(patch, lifting)))
    return patch.replace(log_weights=logs)


def regular_control_surface(patch: Patch, lifting: ArrayLike | None = None) -> Model:
    """Find the limit of a patch under toric degeneration: each cell of the regular decomposition, a patch of its own.

    Parameters
    ----------
    patch : Patch
        A curve's is its regular control curve.
    lifting : (n,) float, optional
        λ_i; default the patch's own. The limit for x → 0 is that of −λ.

    Returns
    -------
    Model
        As `cells_of`, which takes a decomposition that is known already.

    Raises
    ------
    DomainError
        There is no lifting, or it does not fit.

    References
    ----------
    Thm 3.2, Thm 4.2.
    """
    return cells_of(patch, regular_decomposition(patch.knots, lifting_of(patch, lifting)))


def cells_of(patch: Patch, decomposition: RegularDecomposition) -> Model:
    """Give each cell its own patch: the knots, weights, coefficients and control points of that cell, in its order."""
    name = patch.name or "patch"
    cells = [patch.part(np.array(cell), name=f"{name}-cell{i}") for i, cell in enumerate(decomposition.cells)]
    return Model(tuple(cells), name=patch.name)


def lifting_of(patch: Patch, lifting: ArrayLike | None) -> FloatArray:
    """(n,) the lifting given, or else the patch's own; refuses none, and one that does not fit the knots."""
    values = patch.lifting if lifting is None else finite("lifting", lifting)
    if values is None:
        raise DomainError("lifting: the patch has none, and none is given")
    if values.shape != (len(patch.knots),):
        raise DomainError(f"lifting: expected {len(patch.knots)} values, one per knot, got shape {values.shape}")
    return values
