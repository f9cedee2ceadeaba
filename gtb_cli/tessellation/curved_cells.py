"""Cells for ParaView: exact Bézier cells where a shape has them, else quadratic cells, also with attributes."""

import numpy as np

from gtb_cli.cad.kinds_of_surfaces import shortened
from gtb_cli.cad.vtu import QuadraticCells, encode_quadratic, encode_vtu
from gtb_cli.errors import DomainError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model, joints_of
from gtb_cli.tessellation.attributes import QUALITY_NAME, with_attributes
from gtb_cli.tessellation.complexes import joined_complex
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.refinement import refine
from gtb_cli.tessellation.sampler import Sampler
from gtb_cli.theory.patch import Patch


def encode_cells(spec: Patch | Model, recipe: Recipe) -> tuple[bytes, str, list[str]]:
    """Return a VTU file of exact cells, or of quadratic cells for attributes or without exact cells; size, warnings."""
    warnings: list[str] = []
    if not recipe.attributes:
        try:
            data, count, warnings = encode_vtu(spec)
            return data, f"{count} exact {'cell' if count == 1 else 'cells'}", [*warnings, *unused(recipe)]
        except DomainError as fault:
            warnings = [f"quadratic cells through points of the surface, not exact: {shortened(str(fault))}"]
    parts = quadratic_cells(spec, recipe)
    return encode_quadratic(parts), f"{sum(len(part.cells) for part in parts)} quadratic cells", warnings


def unused(recipe: Recipe, *names: str) -> list[str]:
    """Say which numbers, of all or the named, are for meshes and change nothing in a file of exact surfaces."""
    given = [name for name in names or ("resolution", "tolerance") if getattr(recipe, name) != getattr(Recipe(), name)]
    return [f"`{name}` is for meshes, and changes nothing here" for name in given]


def quadratic_cells(spec: Patch | Model, recipe: Recipe) -> list[QuadraticCells]:
    """Return the cells of each patch's mesh, each with a point of the surface at the middle parameter of each side.

    With a tolerance, triangles with straight sides are within it, and curved cells much nearer. The recipe's attributes
    are fields on all points. A `ToleranceError` refuses too many cells.
    """
    recipe.check_size(spec)
    tolerance = recipe.tolerance_for(spec)
    mosaic = joined_complex(spec.patches, joints_of(spec), recipe.resolution if tolerance is None else 2)
    if tolerance is not None:
        mosaic, _ = refine(mosaic, Sampler(spec.patches), tolerance, recipe.max_faces)
    parts = []
    for index, patch in enumerate(spec.patches):
        corners = mosaic.corners[mosaic.cell_patch == index]
        middles = (corners + np.roll(corners, -1, axis=1)) / 2
        nodes = np.concatenate([corners, middles if patch.dimension == 2 else middles[:, :1]], axis=1)
        parameters, cells = np.unique(nodes.reshape(-1, patch.dimension), axis=0, return_inverse=True)
        cells = cells.reshape(nodes.shape[:2])
        points = patch.evaluate(parameters, "linear")
        order = [[0, 2], [2, 1]] if patch.dimension == 1 else [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]
        mesh = Mesh(points, np.concatenate([cells[:, part] for part in order]), parameters=parameters)
        fields = dict(with_attributes(patch, mesh, recipe.attributes, "linear")[0].attributes)
        fields.pop(QUALITY_NAME, None)
        parts.append(QuadraticCells(points, cells, fields))
    return parts
