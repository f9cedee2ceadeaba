"""Scalars for the vertices of a mesh: parameters and curvatures."""

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gtb_cli.arrays import FloatArray, groups
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.tessellation.sampler import Sampler, torically_inside
from gtb_cli.theory.curvature import Curvature, curvatures_at
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import ATTRIBUTES, BASIS, Parametrization

QUALITY_NAME = "quality"  # the scalar that MeshLab colours by; it repeats the first attribute that was asked for


def with_attributes(
    shape: Patch | Model, mesh: Mesh, names: Sequence[str], parametrization: Parametrization = "linear"
) -> tuple[Mesh, int]:
    """Return a mesh with a scalar at each vertex for each name, and the number of vertices that have no curvature.

    Names are some of `ATTRIBUTES` (a curve has u only), or ``basis:I`` for the basis function T_I of a single patch,
    which the mesh has as ``basis_I``. The first one is there again as `QUALITY_NAME`. The mesh was made of the shape by
    `tessellate` in the given parametrisation; vertices that patches share get the scalars of the first patch. A vertex
    without a finite curvature gets the mean of its neighbours' values, and 0 if no vertex has one. `DomainError`
    refuses unknown names, a curvature of a curve, a basis function of a model, and a mesh without parameters.
    """
    functions = {name: _basis_index(shape, name) for name in names if name.startswith(BASIS)}
    for name in names:
        if name not in ATTRIBUTES and name not in functions:
            raise DomainError(f"attribute: expected one of {', '.join(ATTRIBUTES)} or {BASIS}I, got {name!r}")
        if mesh.is_curve and name != "u" and name not in functions:
            raise DomainError(f"attribute: a curve has u, its parameter, and no {name}")
    if mesh.parameters is None:
        raise DomainError("attribute: the vertices of this mesh have no parameters")
    values: dict[str, FloatArray] = dict(zip("uv", mesh.parameters.T, strict=False))
    replaced = 0
    if any(name.endswith("curvature") for name in names):
        found = _curvature_of(shape, mesh, mesh.parameters, parametrization)
        values |= {f"{kind}_curvature": filled_scalars(mesh, scalars) for kind, scalars in found._asdict().items()}
        replaced = int(np.count_nonzero(np.isnan(found.gaussian)))
    if functions and isinstance(shape, Patch):
        basis = shape.basis(mesh.parameters, parametrization)
        values |= {name: basis[:, index] for name, index in functions.items()}
    chosen = {name.replace(":", "_"): np.ascontiguousarray(values[name]) for name in dict.fromkeys(names)}
    if chosen:
        chosen[QUALITY_NAME] = next(iter(chosen.values()))
    return replace(mesh, attributes=MappingProxyType({**mesh.attributes, **chosen})), replaced


def _basis_index(shape: Patch | Model, name: str) -> int:
    """Return the index of the basis function that ``basis:I`` names."""
    text = name.removeprefix(BASIS)
    if not isinstance(shape, Patch):
        raise DomainError(f"attribute: {name} is of a single patch, and this is a model of {len(shape.patches)}")
    if not (text.isascii() and text.isdecimal()) or len(text) > 9 or int(text) >= len(shape.knots):
        raise DomainError(f"attribute: expected {BASIS}I with I from 0 to {len(shape.knots) - 1}, got {name!r}")
    return int(text)


def _curvature_of(shape: Patch | Model, mesh: Mesh, u: FloatArray, parametrization: Parametrization) -> Curvature:
    """Return the curvatures at the vertices of a mesh, with respect to its orientation."""
    if isinstance(shape, Patch):
        return shape.curvature(u, parametrization)
    assert mesh.origin is not None
    found = Curvature(np.empty(len(u)), np.empty(len(u)))
    sampler = Sampler(shape.patches, torically_inside) if parametrization == "toric" else Sampler(shape.patches)
    face = sampler.faces_at(mesh.origin.patch, u)
    for index, rows in groups(mesh.origin.patch):
        where = sampler.locations(index, u[rows], face[rows])
        (gaussian,), (mean,) = curvatures_at([shape.patches[index]], where, len(rows))
        found.gaussian[rows], found.mean[rows] = gaussian, -mean if mesh.origin.turned[index] else mean
    return found


def filled_scalars(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Replace (m,) values at vertices that are not finite by the mean of the neighbours' values, ring by ring."""
    finite = np.isfinite(values)
    if finite.all():
        return values
    result = np.where(finite, values, 0.0)
    ends = np.concatenate([mesh.edges, mesh.edges[:, ::-1]])
    while not finite.all():
        ends = ends[~finite[ends[:, 0]]]
        known = ends[finite[ends[:, 1]]]
        if not len(known):
            break
        count = np.bincount(known[:, 0], minlength=len(values))
        # Divided first: the sum may be beyond the range of floats.
        share = result[known[:, 1]] / count[known[:, 0]]
        found = count > 0
        result[found] = np.bincount(known[:, 0], share, len(values))[found]
        finite |= found
    return result
