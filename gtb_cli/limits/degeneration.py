"""Toric degeneration: weights x^λ ω, and the regular control curve or surface to which patches tend as x grows."""

import math

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, finite, one_for_each
from gtb_cli.errors import DomainError
from gtb_cli.knots.decomposition import RegularDecomposition, lifting_of_knot, regular_decomposition
from gtb_cli.language.spec_paths import of_patch
from gtb_cli.models.model import Model
from gtb_cli.theory.patch import Patch

MAX_WEIGHT_LOG = 700.0  # exp(±700), and its products with knots and points, are ordinary floats


@of_patch
def degenerate(patch: Patch, x: float, lifting: ArrayLike | None = None) -> Patch:
    """Give a patch the weights ``ω_i(x) = x^{λ_i} ω_i`` of its toric degeneration (eq. 304, eq. 403).

    The patch tends to the `regular_control_surface` of λ for x → ∞, and to that of −λ for x → 0; x = 1 returns the
    patch itself. The lifting λ, (n,), is the patch's own by default. New weights are given as logarithms if some are
    beyond the range of floats. `DomainError` is raised for an x that is not finite and positive, and without a lifting.
    """
    if not (math.isfinite(x) and x > 0):
        raise DomainError(f"x: must be finite and positive, got {x!r}")
    heights = lifting_of(patch, lifting)
    with np.errstate(over="ignore"):
        exponents = heights * math.log(x)
    if not np.isfinite(exponents).all():
        raise DomainError("lifting: λ log x is beyond the largest float")
    logs = exponents + patch.log_weights
    if max(np.abs(array).max() for array in (exponents, patch.log_weights, logs)) <= MAX_WEIGHT_LOG:
        # Powers, because 5³ is 125, but exp(3 log 5) is not exactly.
        return patch.replace(weights=patch.weights * np.power(float(x), heights))
    return patch.replace(log_weights=logs)


@of_patch
def regular_control_surface(patch: Patch, lifting: ArrayLike | None = None) -> Model:
    """Return the limit of a patch under toric degeneration: a patch for each cell of the regular decomposition.

    It is the limit for x → ∞ (Thm 3.2, Thm 4.2), of a curve its regular control curve; for x → 0 it is that of −λ. The
    lifting λ, (n,), is the patch's own by default. Patches are in the order of the cells; `cells_of` takes a known
    decomposition. `DomainError` is raised where there is no lifting, or it does not fit.
    """
    return cells_of(patch, regular_decomposition(patch.knots, lifting_of(patch, lifting)))


def cells_of(patch: Patch, decomposition: RegularDecomposition) -> Model:
    """Return a patch for each cell, with its knots, weights, coefficients and control points, in the cell's order."""
    name = patch.name or "patch"
    cells = [patch.part(np.array(cell), name=f"{name}-cell{i}") for i, cell in enumerate(decomposition.cells)]
    return Model(tuple(cells), name=patch.name)


def heights_of(patch: Patch, lifting: ArrayLike | None) -> FloatArray:
    """Return a lifting as `lifting_of` does, (n,), where an index stands for a knot whose weight alone grows."""
    if isinstance(lifting, int | np.integer):
        return lifting_of_knot(len(patch.knots), int(lifting))
    return lifting_of(patch, lifting)


def lifting_of(patch: Patch, lifting: ArrayLike | None) -> FloatArray:
    """Return the given lifting or, by default, the patch's own, (n,); refuse a missing one, and a wrong length."""
    values = patch.lifting if lifting is None else finite("lifting", lifting)
    if values is None:
        raise DomainError("has no lifting: write one into the spec, or give `lifting`")
    return one_for_each("lifting", values, len(patch.knots), "knot")
