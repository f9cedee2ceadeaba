"""`diff` and `distance` of any two things: meshes, patches, models, and files of meshes or specs."""

from collections.abc import Collection
from dataclasses import replace
from typing import get_args

import numpy as np

from gtb_cli.distances.between_shapes import shape_distance
from gtb_cli.distances.operands import Comparable, Operand, operand
from gtb_cli.distances.spec_difference import spec_difference
from gtb_cli.errors import DomainError
from gtb_cli.meshes.difference import Difference, difference
from gtb_cli.meshes.hausdorff import Distance, mesh_distance
from gtb_cli.meshes.mesh import LIBRARIES
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.vocabulary import Aspect, Comparison


def diff(
    a: Comparable,
    b: Comparable,
    tolerance: float | str | None = None,
    *,
    recipe: Recipe | None = None,
    kind: Comparison = "auto",
    ignore: Aspect | Collection[Aspect] = (),
) -> Difference:
    """Compare two meshes, as ``gtb diff`` does: ``found.same``, ``found.distance``, where, and how.

    A `GtbError` says that a file cannot be read, or something cannot be compared.

    Parameters
    ----------
    a, b : Mesh, Patch, Model, several patches, or path of a mesh file or of a spec
    tolerance : float or str, optional
        Largest distance that counts as none, in model units, or as ``"1%"`` of the size; 0 is what the numbers in files
        can hold. Default: 1e-9 of the size.
    recipe : Recipe, optional
        How to mesh what is not a mesh.
    kind : {"auto", "vertices", "surface"}
        Whether vertices are compared if the faces are the same, else surfaces; nothing but vertices; or surfaces. Two
        patches or models are compared themselves, and not as meshes, unless vertices are.
    ignore : {"orientation", "connectivity", "attributes"}, or a collection of them
        What is not a difference between meshes in the same place: faces that are turned over; other holes or parts,
        vertices shared in another way, and faces that are missing, there twice or without area; other normals, texture
        coordinates, attributes, groups, materials, named files and names of patches, of which ``limits`` do not tell.
    """
    recipe = recipe or Recipe()
    return compared(operand(a, recipe), operand(b, recipe), tolerance, kind, ignore)


def distance(a: Comparable, b: Comparable) -> Distance:
    """Measure the two-sided (Hausdorff) distance between two surfaces or curves, whatever their parameters.

    ``found.distance`` is also ``float(found)``; there are ``found.error``, and whether it is proved:
    ``found.is_proved``. A `GtbError` says that a file cannot be read, a mesh has no cells, or that something is neither
    a mesh nor a patch.

    Between meshes, the distance is proved up to its error. Between patches, models and curves it is found on themselves
    by a search to three digits, which is not proved: a nearest point may be missed. Beside a mesh, a patch is meshed
    with an error of at most a thousandth of its size, seen at samples only. `a` and `b` are what `diff` takes.
    """
    fine = 1e-3  # of the size: the mesh of a patch that is compared with a mesh
    one, other = (operand(each, Recipe(tolerance=f"{100 * fine}%")) for each in (a, b))
    if one.spec is not None and other.spec is not None:
        return shape_distance(one.spec, other.spec)
    found = mesh_distance(one.known.mesh, other.known.mesh)
    specs = [each for each in (one, other) if each.spec is not None]
    if not specs:
        return found
    size = float(np.linalg.norm(np.ptp(specs[0].known.mesh.bounds, axis=0)))
    return replace(found, bound=found.bound + fine * size, is_proved=False)


def compared(
    a: Operand, b: Operand, tolerance: float | str | None, kind: Comparison, ignore: Aspect | Collection[Aspect]
) -> Difference:
    """Compare two operands; see `diff`."""
    aspects = (ignore,) if isinstance(ignore, str) else tuple(ignore)
    for name, known, word in (("kind", Comparison, kind), *(("ignore", Aspect, each) for each in aspects)):
        if word not in get_args(known):
            raise DomainError(f"{name}: expected {' or '.join(get_args(known))}, got {word!r}")
    if kind == "vertices" or a.spec is None or b.spec is None:
        return _meshes_compared(a, b, tolerance, kind, aspects)
    return spec_difference(a.spec, b.spec, tolerance, aspects)


def _meshes_compared(
    a: Operand, b: Operand, tolerance: float | str | None, kind: Comparison, aspects: tuple[Aspect, ...]
) -> Difference:
    """Compare meshes, all else that they hold, and files that they name: by what these hold, and not by their names."""
    if kind == "surface" or "attributes" in aspects:
        return difference(a.known, b.known, tolerance, kind, aspects)
    found = difference(a.beside(b.known), b.beside(a.known), tolerance, kind, aspects)
    if not a.known.libraries or not b.known.libraries:
        return found
    values = [remark for remark in found.values if not remark.startswith(LIBRARIES)]
    are_other = [*a.libraries.values()] != [*b.libraries.values()]
    return replace(found, values=(*values, *[f"{LIBRARIES}: not the same"] * are_other))
