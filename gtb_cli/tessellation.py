"""Patches and models to meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, TypeAlias, get_args

import numpy as np

from gtb_cli.arrays import FloatArray, IntArray
from gtb_cli.basis import Location, toric_locations
from gtb_cli.errors import DomainError
from gtb_cli.mesh import Mesh
from gtb_cli.moment import linear_locations
from gtb_cli.patch import Patch
from gtb_cli.triangulation import triangulation

Parametrization: TypeAlias = Literal["toric", "linear"]


def locations(patch: Patch, u: FloatArray, parametrization: Parametrization) -> Iterator[Location]:
    """Locate (m, d) parameters of a patch in one of the two parametrisations."""
    if parametrization not in get_args(Parametrization):
        raise DomainError(f"parametrization: expected toric or linear, got {parametrization!r}")
    if parametrization == "linear":
        return linear_locations(patch.domain, patch.log_products, u)
    return toric_locations(patch.domain, u)


def tessellate(patch: Patch, resolution: int = 32, parametrization: Parametrization = "toric") -> Mesh:
    """Uniform mesh of one patch."""
    parts = triangulation(patch.domain, resolution)
    u = parts.parameters
    where = list(locations(patch, u, parametrization))
    vertices = patch.points_at(where, len(u))
    normals = None
    if patch.dimension == 2:
        normals = vertex_normals(patch.normals_at(where, len(u)), vertices, parts.cells)
    return Mesh(vertices, parts.cells, parameters=u, normals=normals, name=patch.name or "patch")


def vertex_normals(normals: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Replace normals that the surface does not have (NaN) by the mean of the adjacent faces, weighted by area."""
    missing = np.isnan(normals[:, 0])
    if not missing.any():
        return normals
    touching = missing[faces].any(axis=1)
    corners = vertices[faces[touching]]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(sums, faces[touching, k], area)
    scale = np.abs(sums).max(axis=1, keepdims=True)
    sums = np.where(scale > 0, sums / np.where(scale > 0, scale, 1), [0.0, 0.0, 1.0])
    sums /= np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(np.where(missing[:, None], sums, normals))
