"""A patch with the same knots, weights and boundary, and with inner control points that make it fair."""

import math
from typing import Literal, TypeAlias

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray
from gtb_cli.errors import DomainError
from gtb_cli.fairing.energy import Energy, energy_matrix
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.layers import layers
from gtb_cli.knots.triangulation import central_triangulation
from gtb_cli.meshes.solidity import folded_pairs
from gtb_cli.spec_paths import of_patch
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

Keep: TypeAlias = Literal["boundary", "tangents"]

RIDGE_FRACTION = 1e-12  # of the mean energy is added: a control point without influence on it stays where it is

FOLD_RINGS = 16  # of the mesh of Δ that is searched for folds


@frozen
class Fairing:
    """A fair patch. Made by `fair`.

    Attributes
    ----------
    patch : Patch
    before, after : float
        Energy of the given patch and of this one, in units of length²; see `gtb_cli.fairing.energy.energy`.
    error : float
        Relative error of both, by a coarser quadrature.
    free : int
        Number of control points that were free.
    folds : int
        Sides of some thousand triangles at which the surface turns back.
    """

    patch: Patch
    before: float
    after: float
    error: float
    free: int
    folds: int


@of_patch
def fair(patch: Patch, energy: Energy = "thin-plate", keep: Keep = "boundary") -> Fairing:
    """Choose the inner control points of a surface for the least energy.

    Parameters
    ----------
    patch : Patch
        A surface.
    energy : {"thin-plate", "dirichlet"}
        See `gtb_cli.fairing.energy.energy`.
    keep : {"boundary", "tangents"}
        What stays: the boundary curves, or also the tangent planes along them, which the layer of knots next to each
        edge determines.

    Raises
    ------
    DomainError
        The patch is a curve, or an option has an unknown value.

    Notes
    -----
    This is one linear least-squares problem, since the patch is linear in its control points. Knots and weights stay.
    The quadrature is refined until both energies agree to 1e-6, or to resolution 128. Not in the paper.
    """
    if keep not in ("boundary", "tangents"):
        raise DomainError(f"keep: expected boundary or tangents, got {keep!r}")
    kept = kept_knots(patch.domain, keep)
    free = np.flatnonzero(~kept)
    middle = patch.control_points.mean(axis=0)
    given = patch.control_points - middle
    energies: list[FloatArray] = []
    error = math.inf
    for resolution in (32, 64, 96, 128):
        matrix = energy_matrix(patch.domain, patch.log_products, energy, resolution)
        points = given.copy()
        if len(free):
            ridge = RIDGE_FRACTION * np.trace(matrix) / len(matrix)
            form = matrix[np.ix_(free, free)] + ridge * np.eye(len(free))
            points[free] -= np.linalg.solve(form, matrix[free] @ points)
        energies.append(np.einsum("pik,ij,pjk->p", np.array([given, points]), matrix, np.array([given, points])))
        if len(energies) > 1:
            error = float((np.abs(energies[-1] - energies[-2]) / np.maximum(energies[-1], np.finfo(float).tiny)).max())
        if error <= 1e-6:
            break
    points += middle
    points[kept] = patch.control_points[kept]
    patch = patch.replace(control_points=points)
    before, after = energies[-1].tolist()
    part = central_triangulation(patch.domain, FOLD_RINGS)
    vertices = patch.evaluate(part.parameters, "linear")
    return Fairing(patch, before, after, error, len(free), len(folded_pairs(vertices, part.cells)))


def kept_knots(domain: Domain, keep: Keep) -> BoolArray:
    """Return (n,) whether a knot is on an edge or, for tangents, in the layer nearest to an edge."""
    kept = np.asarray(domain.incidence.any(axis=1))
    if keep == "tangents":
        for heights in domain.heights.T:
            kept[next(layers(heights))] = True
    return kept
