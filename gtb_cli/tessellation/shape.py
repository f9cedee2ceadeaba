"""What a Python user may hand over to be meshed, and `tessellate` as such a user calls it."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TypeAlias

from gtb_cli.errors import DomainError
from gtb_cli.language.loading import load
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.model import Model
from gtb_cli.theory.parametrization import Parametrization
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import MAX_FACES, RESOLUTION

Shape: TypeAlias = Patch | Model | Iterable[Patch] | str | os.PathLike[str]


def shape_of(shape: Shape) -> Patch | Model:
    """Return a patch or model as it is, load the file of a spec, and make a model of several patches.

    Raises
    ------
    DomainError
        It is something else.
    SpecError
        See `load`.
    """
    match shape:
        case Patch() | Model():
            return shape
        case str() | os.PathLike():
            return load(shape)
        case list() | tuple():
            return Model(tuple(shape))
    expected = "a Patch, a Model, several patches or the name of a spec file"
    raise DomainError(f"shape: expected {expected}, got {type(shape).__name__}")


def tessellate(
    shape: Shape,
    resolution: int | None = None,
    tolerance: float | str | None = None,
    parametrization: Parametrization = "linear",
    *,
    normals: bool = True,
    max_faces: int = MAX_FACES,
) -> Mesh:
    """Mesh a patch or a model, as ``gtb mesh`` does. `Recipe` has tubes, solids and attributes, too.

    Parameters
    ----------
    shape : Patch, Model, list or tuple of Patch, or path of a spec
    resolution : int, optional
        Segments along each edge of the domain, default 32; not together with a tolerance.
    tolerance : float or str, optional
        Largest distance from the surface to the mesh, in model units, or as ``"1%"`` of the bounding box's diagonal.
    parametrization : {"linear", "toric"}
        Where vertices are put: evenly (linear), or at the paper's parameters, which crowd where edge functions have
        large exponents. With a tolerance always linear.
    normals : bool
        Whether a surface's mesh gets its unit normals, which take longer than its points.
    max_faces : int
        More faces than this are refused before they are made.

    Returns
    -------
    Mesh
        With parameters, and unit normals if asked for. Edges that patches of a model share are sampled once, by the
        curve's own data, and their vertices are one.

    Raises
    ------
    DomainError
        Something else than a shape, a number that makes no sense, or a resolution together with a tolerance.
    ToleranceError
        Too many faces would be needed.
    SpecError
        The spec cannot be read.
    """
    if resolution is not None and tolerance is not None:
        raise DomainError("resolution: excludes a tolerance, give one of them")
    recipe = Recipe(
        RESOLUTION if resolution is None else resolution,
        tolerance,
        parametrization,
        normals=normals,
        max_faces=max_faces,
    )
    return recipe.mesh(shape_of(shape))[0]
