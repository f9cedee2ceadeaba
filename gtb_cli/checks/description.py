"""Descriptions of patches: kind, domain, and the distance of the parametrisation from a linear one."""

import math
from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import numpy as np

from gtb_cli.arrays import FloatArray, bounds_of
from gtb_cli.checks.bounding_boxes import bounds
from gtb_cli.knots.domain import EdgeNormals, has_integer_corners
from gtb_cli.knots.lattice import lattice_of, repeated
from gtb_cli.knots.triangulation import cell_count, triangulation
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import RationalBasis
from gtb_cli.values import frozen

Kind: TypeAlias = Literal[
    "GT", "toric", "rational Bézier curve", "rational Bézier triangle", "rational Bézier tensor product"
]


@frozen
class Description:
    """Description of a patch. Made by `description`."""

    kind: Kind  # the knots are a whole lattice, at any place and scale, or integers ("toric"), or neither ("GT")
    degree: tuple[int, ...]  # of a lattice in its directions, else empty
    edges: tuple[tuple[int, ...], ...]  # the knots on each edge, in order along it, or at each end of a curve
    edge_normals: EdgeNormals | None  # as given, or as "auto" has chosen; None for a curve
    bounding_box: FloatArray  # (2, 3) lowest and highest coordinates of the patch
    control_box: FloatArray  # and of its control points
    linear_precision_error: float  # max |Σ_i T_i(u) a_i − u| in the toric parametrisation, in units of the knots
    repeated_knots: tuple[tuple[int, ...], ...]


def description(patch: Patch) -> Description:
    """Describe a patch (Sections 2 and 4 of the paper; Ex. 4.1)."""
    shape, normals = patch.domain, patch.edge_normals if patch.dimension == 2 else None
    kind: Kind = "toric" if (patch.knots == np.rint(patch.knots)).all() else "GT"
    lattice = lattice_of(shape) or ()
    if lattice:
        kind = get_args(Kind)[len(shape.vertices)]  # curves have two, triangles three and tensor products four
    if normals == "auto":
        normals = "primitive" if has_integer_corners(shape.vertices) else "unit"
    edges = tuple(tuple(shape.edge_knots(edge).tolist()) for edge in range(len(shape.vertices)))
    boxes, error = (bounds([patch]), bounds_of(patch.control_points)), _linear_precision_error(patch.rational_basis)
    degree = tuple(direction.degree for direction in lattice)
    return Description(kind, degree, edges, normals, *boxes, error, repeated(patch.knots))


@lru_cache(maxsize=64)  # the patches of a model often have one basis
def _linear_precision_error(basis: RationalBasis) -> float:
    most_segments, most_points = 64, 20_000  # roughly: domains with many edges are sampled at fewer segments of each
    shape = basis.domain
    resolution = max(2, min(most_segments, math.isqrt(2 * most_points // cell_count(shape, 1))))
    u = triangulation(shape, resolution).parameters
    offsets = basis.blend(shape.knots - shape.center, basis.locations(u), len(u)) - (u - shape.center)
    return float(np.sqrt((offsets**2).sum(axis=1)).max())
