"""What patches tend to: toric degeneration of their weights, and knots that move to the place of others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, finite
from gtb_cli.errors import DomainError
from gtb_cli.theory.decomposition import RegularDecomposition, regular_decomposition
from gtb_cli.theory.patch import Model, Patch

SMALLEST = float(np.finfo(np.float64).tiny)

LARGEST_LOG = 700.0
"""Weights between exp(-700) and exp(700) are ordinary floats, and so are their products with knots and points."""


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
    logs = np.log(patch.weights) if patch.log_weights is None else patch.log_weights
    if patch.log_weights is None and max(np.abs(exponents).max(), np.abs(exponents + logs).max()) <= LARGEST_LOG:
        return replace(patch, weights=patch.weights * np.exp(exponents))
    return replace(patch, log_weights=exponents + logs)


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
        A patch for each cell, in the order of `RegularDecomposition.cells`, with the knots, weights, coefficients and
        control points of that cell.

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
    """Give each cell of a decomposition of a patch's knots its own patch."""
    name = patch.name or "patch"
    parts = []
    for index, cell in enumerate(decomposition.cells):
        members = np.array(cell)
        parts.append(
            Patch(
                patch.knots[members],
                patch.control_points[members],
                patch.weights[members] if patch.log_weights is None else None,  # type: ignore[arg-type]
                patch.coefficients[members],
                # A cell of a lattice polygon need not be one, and has edges of its own.
                edge_normals="unit" if patch.edge_normals == "unit" else "auto",
                lifting=None if patch.lifting is None else patch.lifting[members],
                name=f"{name}-cell{index}",
                log_weights=None if patch.log_weights is None else patch.log_weights[members],
            )
        )
    return Model(tuple(parts), name=patch.name)


def lifting_of(patch: Patch, lifting: ArrayLike | None) -> FloatArray:
    """(n,) the lifting given, or else the patch's own.

    Raises
    ------
    DomainError
        There is none, or it does not fit the knots.
    """
    values = patch.lifting if lifting is None else finite("lifting", lifting)
    if values is None:
        raise DomainError("lifting: the patch has none, and none is given")
    if values.shape != (len(patch.knots),):
        raise DomainError(f"lifting: expected {len(patch.knots)} values, one per knot, got shape {values.shape}")
    return values


def merge_knots(patch: Patch, moves: Mapping[int, int]) -> Patch:
    """Merge knots into others: what the patch tends to, inside Δ, as knot k moves to the place of knot q.

    ``c̃_q = c_q``, ``ω̃_q = Σ c_i ω_i / c_q`` and ``b̃_q = Σ c_i ω_i b_i / Σ c_i ω_i``, the sums over q and all k that
    merge into it.

    Parameters
    ----------
    patch : Patch
    moves : mapping of int to int
        {k: q} by index. Chains are followed: {1: 2, 2: 3} merges knots 1 and 2 into knot 3.

    Returns
    -------
    Patch
        Without the knots k; the others keep their order, and q its place, coefficient and lifting value.

    Raises
    ------
    DomainError
        Indices that are none, cycles, or a move that would change the hull.

    Notes
    -----
    On the boundary of Δ the convergence may fail: see `gtb_cli.theory.knot_limit.knot_limit`.

    References
    ----------
    Thm 3.1, Cor. 3.1, Thm 4.1 (there with all c_i = 1).
    """
    targets = ends_of_moves(patch, moves)
    stays = targets == np.arange(len(targets))
    logarithmic = patch.log_weights is not None
    points = patch.control_points.copy()
    weights = patch.weights.copy() if patch.log_weights is None else patch.log_weights.copy()
    with np.errstate(over="ignore", under="ignore"):
        products = patch.coefficients * patch.weights
    for q in np.unique(targets[~stays]).tolist():
        members = np.flatnonzero(targets == q)
        terms = products[members]
        with np.errstate(over="ignore"):
            ordinary = not logarithmic and bool(np.isfinite(terms.sum()) and terms.min() >= SMALLEST)
        largest = patch.log_products[members].max()
        if not ordinary:
            terms = np.exp(patch.log_products[members] - largest)
        total = terms.sum()
        points[q] = terms @ points[members] / total
        if ordinary:
            weights[q] = total / patch.coefficients[q]
        else:
            logarithm = largest + math.log(total) - math.log(patch.coefficients[q])
            weights[q] = logarithm if logarithmic else math.exp(logarithm)
    kept = np.flatnonzero(stays)
    return replace(
        patch,
        knots=patch.knots[kept],
        control_points=points[kept],
        weights=weights[kept],
        coefficients=patch.coefficients[kept],
        lifting=None if patch.lifting is None else patch.lifting[kept],
        log_weights=weights[kept] if logarithmic else None,
    )


def move_knots(patch: Patch, moves: Mapping[int, int], step: float) -> Patch:
    """Move knots part of the way to others: ``a_k + step (a_q − a_k)``, all at once.

    Parameters
    ----------
    patch : Patch
    moves : mapping of int to int
        {k: q} by index. In a chain {1: 2, 2: 3} both knots move to the place of knot 3.
    step : float
        From 0, the patch itself, to 1, where the knots are repeated ones.

    Returns
    -------
    Patch

    Raises
    ------
    DomainError
        As `merge_knots`, or a step outside [0, 1].

    References
    ----------
    Thm 4.1, Ex. 4.2.
    """
    if not 0 <= step <= 1:
        raise DomainError(f"step: expected a number from 0 to 1, got {step!r}")
    targets = ends_of_moves(patch, moves)
    knots = patch.knots + step * (patch.knots[targets] - patch.knots)
    if step == 1:
        knots = patch.knots[targets]
    return replace(patch, knots=knots)


def ends_of_moves(patch: Patch, moves: Mapping[int, int]) -> IntArray:
    """(n,) the knot at whose place each knot ends: itself, or the end of its chain.

    Raises
    ------
    DomainError
        Indices that are none, cycles, or a move that would change the hull.
    """
    n = len(patch.knots)
    if not moves:
        raise DomainError("moves: expected at least one knot to move")
    for index in (*moves, *moves.values()):
        if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index < n:
            raise DomainError(f"moves: expected knot indices from 0 to {n - 1}, got {index!r}")
    targets = np.arange(n)
    for k in moves:
        way = [k]
        while way[-1] in moves:
            way.append(moves[way[-1]])
            if way[-1] == k:
                raise DomainError(f"moves: {' -> '.join(map(str, way))} is a cycle, nothing is left to merge into")
            if len(way) > n:
                break  # into a cycle that k is no part of; its own knots report it
        targets[k] = way[-1]
    _refuse_hull_change(patch, targets)
    return targets


def _refuse_hull_change(patch: Patch, targets: IntArray) -> None:
    """All ways are inside Δ, so that its hull stays the same if a knot stays at each of its corners."""
    shape = patch.domain
    stays = (targets == np.arange(len(targets))) | (patch.knots == patch.knots[targets]).all(axis=1)
    corners = shape.faces[-len(shape.vertices) :]
    for corner, members in zip(shape.vertices, corners, strict=True):
        if not (members & stays).any():
            k = int(np.flatnonzero(members)[0])
            place = ", ".join(f"{x:g}" for x in corner)
            what = "end" if shape.dimension == 1 else "corner"
            raise DomainError(
                f"moves: knot {k} -> {targets[k]} changes the hull: no other knot stays at its {what} ({place})"
            )
