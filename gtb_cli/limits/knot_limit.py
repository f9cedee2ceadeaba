"""Knots that move to other knots: the merged patch, their limit inside Δ, and films where they reach its edge."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gtb_cli.arrays import FloatArray, IntArray, read_only
from gtb_cli.errors import DomainError
from gtb_cli.knots.face import Face
from gtb_cli.language.spec_paths import of_patch
from gtb_cli.theory.corner_powers import summed
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

MIN_NORMAL_WEIGHT = float(np.finfo(np.float64).tiny)  # smallest weight that is a float with full precision


@of_patch
def merge_knots(patch: Patch, moves: Mapping[int, int]) -> Patch:
    """Merge knots into others: the limit of the patch, inside Δ, as knot k moves to the place of knot q.

    ``c̃_q = c_q``, ``ω̃_q = Σ c_i ω_i / c_q`` and ``b̃_q = Σ c_i ω_i b_i / Σ c_i ω_i``, summed over q and all k that
    merge into it (Thm 3.1, Cor. 3.1, Thm 4.1, there with all c_i = 1). On the boundary of Δ the convergence may fail:
    see `knot_limit`.

    Moves are {k: q} by index. Chains are followed: {1: 2, 2: 3} merges knots 1 and 2 into knot 3. The patch loses the
    knots k. The other knots keep their order; q keeps its place, coefficient and lifting value. `DomainError` is raised
    for an index out of range, moves that form a cycle, and a move that would change the hull.
    """
    stays, number, counts = np.unique(ends_of_moves(patch, moves), return_inverse=True, return_counts=True)
    kept = patch.part(stays, edge_normals=patch.edge_normals, edge_scale=patch.edge_scale)
    with np.errstate(over="ignore", under="ignore"):
        products = patch.coefficients * patch.weights
        ordinary = bool(np.isfinite(np.bincount(number, products)).all() and products.min() >= MIN_NORMAL_WEIGHT)
    logs, factors = patch.log_products, np.column_stack([np.ones(len(products)), patch.control_points])
    if ordinary:  # so that whole numbers stay whole
        logs, factors = np.zeros(len(products)), products[:, None] * factors
    tops, sums = summed(number, logs, factors)
    alone, totals = counts == 1, sums[:, 0]
    points = np.where(alone[:, None], kept.control_points, sums[:, 1:] / totals[:, None])
    if ordinary:
        return kept.replace(control_points=points, weights=np.where(alone, kept.weights, totals / kept.coefficients))
    logarithms = tops + np.log(totals) - np.log(kept.coefficients)
    return kept.replace(control_points=points, log_weights=np.where(alone, kept.log_weights, logarithms))


@of_patch
def move_knots(patch: Patch, moves: Mapping[int, int], step: float) -> Patch:
    """Move knots part of the way to others: ``a_k + step (a_q − a_k)``, all at once (Thm 4.1, Ex. 4.2).

    Moves are {k: q} by index: in a chain {1: 2, 2: 3} both knots move to the place of knot 3. Steps are from 0, the
    patch itself, to 1, where the knots coincide. `DomainError` is raised as by `merge_knots`, and for another step.
    """
    if not 0 <= step <= 1:
        raise DomainError(f"step: expected a number from 0 to 1, got {step!r}")
    ends = patch.knots[ends_of_moves(patch, moves)]
    return patch.replace(knots=ends if step == 1 else patch.knots + step * (ends - patch.knots))


def ends_of_moves(patch: Patch, moves: Mapping[int, int]) -> IntArray:
    """Return the knot at whose place each knot ends, (n,): itself, or its chain's end; raises like `merge_knots`."""
    n = len(patch.knots)
    if not moves:
        raise DomainError("merging: expected at least one knot to move")
    for index in (*moves, *moves.values()):
        if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index < n:
            raise DomainError(f"merging: expected knot indices from 0 to {n - 1}, got {index!r}")
    targets = np.arange(n)
    for k in moves:
        way = [k]
        while way[-1] in moves:
            way.append(moves[way[-1]])
            if way[-1] == k:
                raise DomainError(f"merging {' -> '.join(map(str, way))} is a cycle, nothing is left to merge into")
            if len(way) > n:
                break  # enters a cycle without k, which is reported for the knots of the cycle
        targets[k] = way[-1]
    # Moves that leave no corner without a knot keep the hull: all paths lie inside Δ.
    shape = patch.domain
    stays = (targets == np.arange(n)) | (patch.knots == patch.knots[targets]).all(axis=1)
    for corner, members in zip(shape.vertices, shape.faces.knots[shape.faces.corners], strict=True):
        if not (members & stays).any():
            k = int(np.flatnonzero(members)[0])
            place = f"{'end' if shape.dimension == 1 else 'corner'} ({', '.join(f'{x:g}' for x in corner)})"
            raise DomainError(f"merging knot {k} -> {targets[k]} changes the hull: no other knot stays at its {place}")
    return targets


@frozen
class Film:
    """The surface or curve that moving knots leave between the patch's fixed boundary and that of the merged patch.

    Let F be a facet or corner of Δ, and let η_ij be the speed at which knot i, which ends on F, approaches facet j
    through F (0 for a knot already there). At a distance ε from the end of the motion, the points of the patch at torus
    coordinates s + τ/ε outwards tend to those of the knots on F with the weights ``c_i ω_i ∏_j z_j^{η_ij}``. Here z_j =
    e^{−τ_j} runs from 1, the merged patch's boundary, to 0, the fixed boundary.

    F is `face`, and `members` are the (k,) knots that end on it. `speeds` are (k, g), η for the g facets that meet in
    F, in units of the smallest positive speed of each. `along` are (k,) coordinates along the edge of the ends of the
    paths, or None if F is a corner, or an end of a curve.
    """

    face: Face
    members: IntArray
    speeds: FloatArray
    along: FloatArray | None
    log_products: FloatArray
    control_points: FloatArray

    def section(self, z: float) -> Patch:
        """Return the curve at level z of the film of an edge."""
        assert self.along is not None, "the film of a corner has no sections"
        log_weights = self.log_weights(np.array([[z]]))[0]
        here = np.isfinite(log_weights)
        return Patch(self.along[here], self.control_points[here], log_weights=log_weights[here])

    def points(self, z: ArrayLike) -> FloatArray:
        """Return points of the film of a corner or end at levels z: (m, g) → (m, 3)."""
        logs = self.log_weights(np.asarray(z, dtype=np.float64))
        weights = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(weights @ self.control_points / weights.sum(axis=1, keepdims=True))

    def log_weights(self, z: FloatArray) -> FloatArray:
        """Return logarithms of the weights at levels z, −inf for weights 0: (m, g) → (m, k)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            powers = self.speeds[None] * np.log(z)[:, None, :]
        return np.asarray(self.log_products + np.where(self.speeds[None] > 0, powers, 0.0).sum(axis=2))


@frozen
class KnotLimit:
    """The limit of patches whose knots move to other knots; `targets`, (n,), says to which each one does."""

    patch: Patch
    moves: Mapping[int, int]
    targets: IntArray

    @cached_property
    def merged(self) -> Patch:
        """The merged patch: the limit at every point inside Δ."""
        return merge_knots(self.patch, self.moves)

    @cached_property
    def films(self) -> tuple[Film, ...]:
        """The parts of the limit set outside the merged patch; empty if the convergence is uniform."""
        parallel_ratio = 1e-9  # of the singular values of speeds: knots typed on one line
        patch, targets, shape = self.patch, self.targets, self.patch.domain
        moved = targets != np.arange(len(targets))
        films = []
        for face in shape.faces:
            members = np.flatnonzero(face.knots[targets])
            speeds = np.where(moved[members, None], shape.heights[members][:, face.facets], 0.0)
            if face.is_interior or not speeds.any():
                continue
            along = None
            if not face.is_corner:
                along = shape.along(face.index, patch.knots[targets[members]])
            elif shape.dimension == 2:
                # If all arrive along one line, the film of the corner is a border of its edges' films.
                shares = speeds / speeds.max(axis=0, initial=MIN_NORMAL_WEIGHT)
                if np.linalg.matrix_rank(shares, rtol=parallel_ratio) < 2:
                    continue
            speeds = read_only(speeds / np.array([column[column > 0].min(initial=np.inf) for column in speeds.T]))
            films.append(Film(face, members, speeds, along, patch.log_products[members], patch.control_points[members]))
        return tuple(films)

    @cached_property
    def arrivals(self) -> Mapping[int, int]:
        """Numbers of the corner or edge, or of the end of a curve, that knots reach from outside it, by knot."""
        faces, incidence = self.patch.domain.faces, self.patch.domain.incidence
        arriving = np.flatnonzero((incidence[self.targets] & ~incidence).any(axis=1)).tolist()
        return {k: faces.smallest(self.targets[k]).number for k in arriving}


@of_patch
def knot_limit(patch: Patch, moves: Mapping[int, int]) -> KnotLimit:
    """Find the limit of a patch as knots move to the places of others, along lines and all at once; see `merge_knots`.

    A knot that moves to the boundary from inside does not count there until it arrives: the boundary stays the same,
    while the patches tend, inside, to a patch with another boundary. The Hausdorff limit is the merged patch together
    with a film between the two boundaries: a segment at the end of a curve (a curve if several knots arrive there), a
    membrane at an edge. Thm 3.1 and Thm 4.1 state only the merged patch as the limit; Ex. 4.2.
    """
    return KnotLimit(patch, dict(moves), ends_of_moves(patch, moves))
