"""Descriptions of patches: kind, domain, and the distance of the parametrisation from a linear one."""

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.checks.bounds import bounds
from gtb_cli.errors import DomainError
from gtb_cli.knots.domain import EdgeNormals, domain
from gtb_cli.knots.lattice import lattice_of
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.parametrization import RationalBasis
from gtb_cli.theory.patch import Patch
from gtb_cli.values import frozen

Kind: TypeAlias = Literal[
    "GT", "toric", "rational Bézier curve", "rational Bézier triangle", "rational Bézier tensor product"
]


@frozen
class Description:
    """Description of a patch. Made by `description`.

    Attributes
    ----------
    kind : str
        "rational Bézier curve", "rational Bézier triangle" or "rational Bézier tensor product" if the knots are a
        whole lattice of that shape, at any place and scale; otherwise "toric" if they are integers, or "GT".
    degree : tuple of int
        Degree of a rational Bézier curve or triangle, or the two degrees of a tensor product; empty for others.
    edges : tuple of tuple of int
        Indices of the knots on each edge of Δ, in order along it; for a curve, those at its two ends.
    edge_normals : {"unit", "primitive"} or None
        The normals that "auto" has chosen; None for a curve.
    bounding_box : (2, 3) float
        Lowest and highest coordinates of the patch, see `gtb_cli.checks.bounds.bounds`.
    control_box : (2, 3) float
        Lowest and highest coordinates of the control points, between which the patch lies.
    linear_precision_error : float
        ``max |Σ_i T_i(u) a_i − u|`` over a sampling of Δ in the toric parametrisation, in units of the knots.
    repeated_knots : tuple of tuple of int
        Groups of indices of equal knots.
    """

    kind: Kind
    degree: tuple[int, ...]
    edges: tuple[tuple[int, ...], ...]
    edge_normals: EdgeNormals | None
    bounding_box: FloatArray
    control_box: FloatArray
    linear_precision_error: float
    repeated_knots: tuple[tuple[int, ...], ...]


def description(patch: Patch) -> Description:
    """Describe a patch.

    Notes
    -----
    Every patch has linear precision in the linear parametrisation; the error is that of
    the toric one, and is 0 up to rounding for Bézier patches whose products c_i ω_i are binomial.

    References
    ----------
    Sections 2 and 4 of the paper; Ex. 4.1.
    """
    kind, degree = _kind(patch)
    shape = patch.domain
    return Description(
        kind=kind,
        degree=degree,
        edges=tuple(tuple(shape.edge_knots(edge).tolist()) for edge in range(len(shape.vertices))),
        edge_normals=_edge_normals(patch),
        bounding_box=bounds([patch]),
        control_box=bounds_of(patch.control_points),
        linear_precision_error=_linear_precision_error(patch),
        repeated_knots=_repeated_knots(patch.knots),
    )


def descriptions(patches: Iterable[Patch]) -> list[Description]:
    """Describe patches; those with one basis differ only in their boxes."""
    known: dict[tuple[RationalBasis, EdgeNormals], Description] = {}
    found = []
    for patch in patches:
        key = (patch.rational_basis, patch.edge_normals)
        if key in known:
            control_box = bounds_of(patch.control_points)
            found.append(replace(known[key], bounding_box=bounds([patch]), control_box=control_box))
        else:
            found.append(known.setdefault(key, description(patch)))
    return found


def _kind(patch: Patch) -> tuple[Kind, tuple[int, ...]]:
    bezier_kinds: dict[int, Kind] = {
        2: "rational Bézier curve",
        3: "rational Bézier triangle",
        4: "rational Bézier tensor product",
    }
    lattice = lattice_of(patch.domain)
    if lattice is None:
        return ("toric" if (patch.knots == np.rint(patch.knots)).all() else "GT"), ()
    return bezier_kinds[len(patch.domain.vertices)], tuple(direction.degree for direction in lattice)


def _edge_normals(patch: Patch) -> EdgeNormals | None:
    if patch.dimension == 1:
        return None
    if patch.edge_normals != "auto":
        return patch.edge_normals
    try:
        domain(patch.domain.vertices, "primitive")
    except DomainError:
        return "unit"
    return "primitive"


def _linear_precision_error(patch: Patch) -> float:
    most_segments, most_points = 64, 20_000  # roughly: domains with many edges are sampled at fewer segments of each
    shape = patch.domain
    resolution = max(2, min(most_segments, math.isqrt(2 * most_points // cell_count(shape, 1))))
    u = triangulation(shape, resolution).parameters
    centred = patch.knots - shape.center
    images = patch.rational_basis.blend(centred, patch.rational_basis.locations(u), len(u))
    offsets = images - (u - shape.center)
    return float(np.sqrt((offsets**2).sum(axis=1)).max())


def _repeated_knots(knots: FloatArray) -> tuple[tuple[int, ...], ...]:
    _, group, count = np.unique(knots, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    repeated = sorted(np.flatnonzero(count > 1).tolist(), key=lambda k: int(np.argmax(group == k)))
    return tuple(tuple(np.flatnonzero(group == k).tolist()) for k in repeated)
