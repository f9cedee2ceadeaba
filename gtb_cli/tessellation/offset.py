"""Regularity of the offset of a surface, by the surface's own curvature."""

import math
from collections.abc import Sequence

import numpy as np

from gtb_cli.arrays import BoolArray, FloatArray, dot
from gtb_cli.knots.domain import Domain
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.curvature import curvatures_at
from gtb_cli.theory.patch import Patch


def sharpest_bend(
    patches: Sequence[Patch], turned: Sequence[bool], thickness: float, cells: int
) -> tuple[float, FloatArray]:
    """Find the smallest principal radius of curvature at which the offset of surfaces folds.

    Parameters
    ----------
    patches : sequence of Patch
    turned : sequence of bool
        Patches whose normals are reversed.
    thickness : float
        Distance of the offset, on the side of the normals if positive.
    cells : int
        Number of triangles of the mesh: samples are closer together, but no more than 48 lie along an edge.

    Returns
    -------
    radius : float
        Infinite if no fold is found.
    place : (3,) float

    Notes
    -----
    Each patch is sampled inside, evenly in the linear parametrisation. With a principal curvature κ towards the offset
    by D, this is regular if 1 − D κ > 0. Where it is not, a point of the offset is nearer than D to the surface; a fold
    counts if it is nearer by 2 %, so that curvatures that are infinite only at an edge or a corner do not. A fold
    narrower than the samples are apart may be missed.
    """
    sparsest, densest, per_patch = 16, 48, cells / len(patches)
    groups: dict[tuple[int, bool], list[int]] = {}
    for index, patch in enumerate(patches):
        groups.setdefault((id(patch.rational_basis), bool(turned[index])), []).append(index)
    radius, place = math.inf, np.full(3, np.nan)
    for (_, is_turned), members in groups.items():
        domain = patches[members[0]].domain
        count = min(max(sparsest, math.ceil(2 * math.sqrt(per_patch / cell_count(domain, 1)))), densest)
        part = triangulation(domain, count)
        u = part.parameters[part.cells].mean(axis=1)  # inside, also in triangles with corners on the boundary
        offset = -thickness if is_turned else thickness
        bends = _bends([patches[index] for index in members], u, offset)
        for index, bend in zip(members, bends, strict=True):
            folded = np.flatnonzero(bend * abs(thickness) >= 1)
            if not len(folded):
                continue
            folded = folded[bend[folded].argsort()[:: -max(1, len(folded) // 64)]]  # some with every curvature
            deep = folded[_is_nearer(patches[index], u[folded], offset, domain.size / count)]
            if len(deep) and 1 / bend[deep[0]] < radius:
                radius, place = float(1 / bend[deep[0]]), patches[index].evaluate(u[deep[:1]], "linear")[0]
    return radius, place


def _bends(patches: Sequence[Patch], u: FloatArray, offset: float) -> FloatArray:
    """(q, m) largest principal curvatures towards an offset; 0 where the surface is not regular."""
    gaussian, mean = curvatures_at(patches, patches[0].rational_basis.locations(u, "linear"), len(u))
    mean = -math.copysign(1.0, offset) * mean
    bends = mean + np.sqrt(np.maximum(mean**2 - gaussian, 0.0))
    return np.where(np.isfinite(bends), bends, 0.0)


def _is_nearer(patch: Patch, u: FloatArray, offset: float, step: float) -> BoolArray:
    """(k,) true where the offset of the point at each parameter is nearer by 2 % to another point of the surface."""
    rounds, share = 6, 0.98
    points = patch.evaluate(u, "linear") + offset * patch.normals(u, "linear")
    pattern = np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2]), axis=-1).reshape(-1, 2)
    best, rows = u, np.arange(len(u))
    nearest = np.full(len(u), np.inf)
    for _ in range(rounds):
        around = _inside(patch.domain, best[:, None] + step * pattern, best)
        found = patch.evaluate(around.reshape(-1, 2), "linear").reshape(len(u), -1, 3) - points[:, None]
        squares = dot(found.reshape(-1, 3), found.reshape(-1, 3)).reshape(len(u), -1)
        chosen = squares.argmin(axis=1)
        best, nearest = around[rows, chosen], squares[rows, chosen]
        step /= 2
    return np.asarray(np.sqrt(nearest) < share * abs(offset))


def _inside(domain: Domain, around: FloatArray, instead: FloatArray) -> FloatArray:
    """(k, p, 2) parameters, those not clearly inside Δ replaced by one of (k, 2) that are."""
    least = 1e-6 * domain.size * domain.normal_lengths
    heights = np.einsum("kprd,rd->kpr", around[:, :, None] - domain.vertices, domain.normals)
    return np.where((heights > least).all(axis=2)[:, :, None], around, instead[:, None])
