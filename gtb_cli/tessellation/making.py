"""From a spec to the finished mesh of a recipe: its surface, with attributes, as a solid, and what it must be."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtb_cli.errors import ToleranceError
from gtb_cli.knots.triangulation import cell_count
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model, with_weld
from gtb_cli.tessellation.doubtful_corners import doubtful_corners
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.tessellate import tessellate
from gtb_cli.theory.patch import Patch
from gtb_cli.vocabulary import RESOLUTION

if TYPE_CHECKING:
    from gtb_cli.tessellation.recipe import Held


def mesh_of(recipe: Recipe, spec: Patch | Model, rounding: float, held: Held | None) -> tuple[Mesh, list[str]]:
    """Make the mesh of a patch or model, and say what is unusual about its shape; see `Recipe.mesh`."""
    recipe.check_size(spec)
    spec = with_weld(spec, recipe.weld)
    surface, tolerance = _surface(recipe, spec, rounding)
    remarks = [*doubtful_corners(spec), *_remarks_on_spread(recipe, spec, surface)]
    mesh, is_solid = surface, recipe.radius is not None or recipe.thickness is not None
    faults: list[str] = []
    folds: list[str] = []
    thin: list[str] = []
    if recipe.attributes:
        from gtb_cli.tessellation.attributes import with_attributes

        mesh, replaced = with_attributes(spec, mesh, recipe.attributes, recipe.parametrization)
        if replaced:
            remarks.append(
                f"the curvature has no finite limit at {replaced} of {len(mesh.vertices)} vertices, "
                "which get the mean of their neighbours'"
            )
    if is_solid:
        from gtb_cli.tessellation.solid_making import solid_of

        mesh, faults, folds, thin = solid_of(recipe, spec, mesh, tolerance)
    must_close = not mesh.is_curve and (recipe.thickness is not None or {"watertight", "solid"} & {*recipe.require})
    stored, coarse = held(mesh) if held and must_close else (mesh, "")
    if not mesh.is_curve and (recipe.thickness is not None or "solid" in recipe.require):
        from gtb_cli.tessellation.solid_making import crossings_of

        crossings = crossings_of(mesh, stored, coarse)
        folds += crossings
    if is_solid and folds and not faults:
        from gtb_cli.tessellation.solid_making import smaller_solid

        folds[-1] += f"; {smaller_solid(recipe, spec, surface, tolerance, held, bool(crossings))}"
    if recipe.require:
        from gtb_cli.tessellation.requirements import require

        finer = _fine(recipe, spec, surface) if "unfolded" in recipe.require else surface
        require(recipe.require, spec, mesh, finer, faults + folds, (stored, coarse))
    return mesh, remarks + faults + folds + thin


def _surface(recipe: Recipe, spec: Patch | Model, rounding: float) -> tuple[Mesh, float | None]:
    """Mesh the surface or curve, within the tolerance that a tube leaves to its middle line; return both."""
    tolerance, around = recipe.tolerance_for(spec), 1
    if tolerance is not None and recipe.radius is not None:
        from gtb_cli.solids.tube import ring_size

        # Of the middle line, and of the polygon of its rings: on the outside of a bend as sharp as the tube allows, the
        # middle line's error counts twice.
        tolerance *= 1 / 3
        around = 2 * ring_size(recipe.radius, tolerance)
    try:
        mesh = tessellate(
            spec,
            None if tolerance else recipe.resolution,
            tolerance,
            recipe.parametrization,
            normals=recipe.normals or recipe.thickness is not None,
            max_faces=recipe.max_faces // around,
            rounding=rounding,
        )
    except ToleranceError as error:
        if around == 1:
            raise
        raise ToleranceError(f"{error}: the tube has {around} faces around each segment") from None
    return mesh, tolerance


def _fine(recipe: Recipe, spec: Patch | Model, surface: Mesh) -> Mesh:
    """The mesh of a surface if it folds or is fine, else one of at most half a million faces that may fold."""
    from gtb_cli.solids.solidity import folded_places

    most_faces, segments = 500_000, RESOLUTION
    while sum(cell_count(patch.domain, segments) for patch in spec.patches) > most_faces and segments > 1:
        segments //= 2
    is_fine = surface.is_curve or len(surface.cells) >= most_faces
    if is_fine or (recipe.tolerance is None and recipe.resolution >= segments) or folded_places(surface):
        return surface
    return tessellate(spec, segments, normals=False)


def _remarks_on_spread(recipe: Recipe, spec: Patch | Model, surface: Mesh) -> list[str]:
    """Remarks on the seams of a model, and on how its mesh is spread."""
    model, remarks = spec if isinstance(spec, Model) else None, []
    if model is not None:
        from gtb_cli.models.openings import seam_remarks

        remarks += seam_remarks(model)
    if recipe.tolerance is None and (recipe.parametrization == "toric" or recipe.resolution <= 2):
        from gtb_cli.tessellation.remarks import coarse_sides, crowding

        remarks += coarse_sides(model, surface, recipe.resolution) if model is not None else []
        remarks += crowding(spec, recipe.resolution) if recipe.parametrization == "toric" else []
    return remarks
