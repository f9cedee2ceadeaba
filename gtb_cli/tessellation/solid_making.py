"""The tube or thickened surface of a recipe, what is wrong with it, and which smaller one is solid."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from gtb_cli.errors import DomainError, RequirementError, ToleranceError
from gtb_cli.meshes.mesh import Mesh
from gtb_cli.models.model import Model
from gtb_cli.solids.crossings import CROSSING_DEPTH, crossing_pairs
from gtb_cli.solids.rims import with_flat_rims
from gtb_cli.solids.solidity import crossing_remarks, folded_places, where
from gtb_cli.solids.thickening import thicken
from gtb_cli.solids.tube import folded_segments, tube
from gtb_cli.tessellation.attributes import curve_tangents
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.tessellation.remarks import offset_folds, thin_wall
from gtb_cli.tessellation.requirements import require
from gtb_cli.theory.patch import Patch

if TYPE_CHECKING:
    from gtb_cli.tessellation.recipe import Held


class Solid(NamedTuple):
    """A tube or a thickened surface, and what is wrong with it."""

    mesh: Mesh
    faults: list[str]  # of the surface, which no other thickness mends
    folds: list[str]
    thin: list[str]


def solid_of(recipe: Recipe, spec: Patch | Model, surface: Mesh, tolerance: float | None) -> Solid:
    """Make the tube around the mesh of a curve, or the wall of a thickness beside that of a surface."""
    if recipe.thickness is None:
        assert recipe.radius is not None
        mesh, folds = _tube(recipe, spec, surface, recipe.radius, tolerance)
        return Solid(mesh, [], folds, [])
    folds = offset_folds(spec, surface, recipe.thickness)
    wall = thicken(surface, recipe.thickness)
    thin = thin_wall(wall, recipe.thickness)
    return Solid(_rimmed(recipe, wall, recipe.thickness), folded_places(surface), folds, thin)


def crossings_of(mesh: Mesh, stored: Mesh, coarse: str) -> list[str]:
    """Say where a mesh, as it is stored, passes through itself, and with a remark, if it does not before."""
    crossings = crossing_remarks(stored)
    if crossings and stored is not mesh and not crossing_remarks(mesh):
        return [f"{line}: {coarse}" for line in crossings]
    return crossings


def smaller_solid(
    recipe: Recipe, spec: Patch | Model, surface: Mesh, tolerance: float | None, held: Held | None, crosses: bool
) -> str:
    """Name a smaller radius or thickness that makes a solid, or say that none was found.

    Each is judged as one that is asked for. A surface that passes through itself, which only a solid that `crosses`
    has, is a side of all walls: none is tried.
    """

    def is_tube(radius: float) -> bool:
        try:
            mesh, folds = _tube(recipe, spec, surface, radius, tolerance)
        except (DomainError, ToleranceError):
            return False
        return not folds and not crossings_of(mesh, *(held(mesh) if held else (mesh, "")))

    def is_wall(thickness: float) -> bool:
        if offset_folds(spec, surface, thickness):
            return False
        try:
            wall = _rimmed(recipe, thicken(surface, thickness), thickness)
            stored, coarse = held(wall) if held else (wall, "")
            require(("solid",), spec, wall, surface, crossings_of(wall, stored, coarse), (stored, coarse))
        except (DomainError, RequirementError):
            return False
        return True

    if recipe.thickness is None:
        assert recipe.radius is not None
        return _smaller("radius", recipe.radius, is_tube, len(surface.cells))
    if crosses and len(crossing_pairs(surface.vertices, surface.faces)[0]):
        return "no thickness is solid, as the surface passes through itself"
    if abs(recipe.thickness) <= CROSSING_DEPTH * max(surface.bounds[1] - surface.bounds[0]):
        return f"a wall thinner than {CROSSING_DEPTH:g} of the size cannot be told from one that does"
    return _smaller("thickness", recipe.thickness, is_wall, len(surface.cells))


def _smaller(name: str, value: float, is_solid: Callable[[float], bool], cells: int) -> str:
    """Name the largest of a few smaller values that make a solid, or say that none does.

    The first are 1/2, 1/8, 1/64 and 1/1024 of it; when one is solid, it is bisected upwards.
    """
    few, many = 5_000, 20_000  # cells up to which there is time for eight tries, and from which on only for one
    tries = 8 if cells < few else 4 if cells < many else 1
    low, high, tried = 0.0, value, 0
    while tried < (tries if low else min(tries, 4)):
        middle = float(f"{(low + high) / 2 if low else high / 2 ** (tried + 1):.3g}")
        low, high = (middle, high) if is_solid(middle) else (low, middle)
        tried += 1
    if low:
        return f"{'a radius of' if name == 'radius' else '`thickness`'} {low:g} was tried and is solid"
    if tried == 1:
        return f"a {name} of {high:g} was tried and is not solid"
    return f"{tried} {'radii' if name == 'radius' else 'thicknesses'} down to {high:g} were tried, and none is solid"


def _tube(
    recipe: Recipe, spec: Patch | Model, curve: Mesh, radius: float, tolerance: float | None
) -> tuple[Mesh, list[str]]:
    """The tube around the mesh of a curve, and where it folds."""
    tangents = None
    if curve.is_curve and isinstance(spec, Patch):
        tangents = curve_tangents(spec, curve, recipe.parametrization)
    folded = folded_segments(curve, radius, tolerance=tolerance, tangents=tangents)
    folds = []
    if len(folded):
        folds.append(f"a radius of {radius:g} is more than that of the curve's bends: {where(curve, folded)}")
    return tube(curve, radius, tolerance=tolerance, tangents=tangents, max_faces=recipe.max_faces), folds


def _rimmed(recipe: Recipe, wall: Mesh, thickness: float) -> Mesh:
    return wall if recipe.rim == "normal" else with_flat_rims(wall, thickness)
