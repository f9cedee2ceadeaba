"""Descriptions of patches: kind, domain, and the distance of the parametrisation from a linear one."""

import math
from functools import lru_cache
from typing import Any

import numpy as np

from gtb_cli.arrays import bounds_of
from gtb_cli.checks.bounding_boxes import bounds
from gtb_cli.knots.domain import has_integer_corners
from gtb_cli.knots.even_triangulation import cell_count, triangulation
from gtb_cli.knots.lattice import lattice_of, repeated
from gtb_cli.theory.patch import Patch
from gtb_cli.theory.rational_basis import RationalBasis


def description(patch: Patch) -> dict[str, Any]:
    """Describe a patch as plain data (Sections 2 and 4 of the paper; Ex. 4.1).

    A kind with a degree has a whole lattice of knots, at any place and scale. Edge normals are as given, or as "auto"
    has chosen; a curve has none, and as edges the knots at its ends. max |Σ_i T_i(u) a_i − u| is measured in the toric
    parametrisation, in units of the knots.
    """
    shape, normals = patch.domain, patch.edge_normals if patch.dimension == 2 else None
    kind = "toric" if (patch.knots == np.rint(patch.knots)).all() else "GT"
    if lattice := lattice_of(shape):
        whole = {2: "rational Bézier curve", 3: "rational Bézier triangle", 4: "rational Bézier tensor product"}
        kind = whole[len(shape.vertices)]
    if normals == "auto":
        normals = "primitive" if has_integer_corners(shape.vertices) else "unit"
    return {
        "name": patch.name,
        "kind": kind,
        "degree": [direction.degree for direction in lattice or ()] or None,
        "dimension": patch.dimension,
        "knots": len(patch.knots),
        "hull_vertices": shape.vertices.tolist(),
        "edges": [shape.edge_knots(edge).tolist() for edge in range(len(shape.vertices))],
        "edge_normals": normals,
        "repeated_knots": [list(group) for group in repeated(patch.knots)],
        "bounding_box": bounds([patch]).tolist(),
        "control_box": bounds_of(patch.control_points).tolist(),
        "linear_precision_error": _linear_precision_error(patch.rational_basis),
    }


@lru_cache(maxsize=64)  # the patches of a model often have one basis
def _linear_precision_error(basis: RationalBasis) -> float:
    most_segments, most_points = 64, 20_000  # roughly: domains with many edges are sampled at fewer segments of each
    shape = basis.domain
    resolution = max(2, min(most_segments, math.isqrt(2 * most_points // cell_count(shape, 1))))
    u = triangulation(shape, resolution).parameters
    offsets = basis.blend(shape.knots - shape.center, basis.locations(u), len(u)) - (u - shape.center)
    return float(np.sqrt((offsets**2).sum(axis=1)).max())
